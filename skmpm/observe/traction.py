"""`contact_pressure`: the traction of the contacts along the boundary of a body, recovered from point forces."""

from __future__ import annotations

import reprlib
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from skmpm import outline
from skmpm.arrays import ROUND_OFF, Array, Ints
from skmpm.observe.recovery import recover
from skmpm.observe.sides import Placed, Side, place, sides
from skmpm.representation import with_shapes
from skmpm.scene import Scene, SceneError, State, check_fits


@dataclass(frozen=True, eq=False, repr=False)
class Traction:
    """Contact traction along the boundary of a body, linear between its boundary points; `contact_pressure` makes it.

    A corner of the outline appears twice, as the end of one side and the start of the next, because the traction
    jumps there. The boundary is followed with the material on its left, from the first corner of each loop or,
    without corners, from its first boundary point.

    Attributes
    ----------
    body : index of the body
    point : (m,) indices of the boundary points in the arrays of the state
    side : (m,) number of the smooth side, in the order of the boundary
    arc_length : (m,) [m] along the loop, in the current configuration
    x : (2, m) [m]
    length : (m,) length of boundary that belongs to each point [m], half of its segments on this side
    normal : (2, m) unit, outwards: mean of the contact normals, weighted by the size of the normal forces; without
        force that of the boundary
    traction : (2, m) [Pa] force of the contacts on the body per length, in x and y
    pressure : (m,) [Pa] normal traction, positive in compression, negative where cohesion bears tension
    shear : (m,) [Pa] tangential traction, positive along increasing arc length
    error : (m,) [Pa] estimate of the error of the traction (`contact_pressure`); inf where the forces do not tell how
        narrow a contact is

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> floor = skmpm.Wall((0, -1e-3), (0, 1))
    >>> scene = skmpm.Scene([body], cell=4e-4, walls=[floor], gravity=(0, -9.81))
    >>> *_, state = skmpm.simulate(scene, dt=1e-3, until=2e-2)
    >>> result = skmpm.contact_pressure(scene, state, 0)
    >>> result.body, result.x.shape == result.traction.shape
    (0, True)
    >>> bool(result.pressure.max() > 0)
    True
    """

    __repr__ = with_shapes

    body: int
    point: Ints
    side: Ints
    arc_length: Array
    x: Array
    length: Array
    normal: Array
    traction: Array
    pressure: Array
    shear: Array
    error: Array

    @property
    def force(self) -> Array:
        """Resultant of the contact forces on the body, (2,) [N/m]."""
        return np.asarray(self.traction @ self.length)


def contact_pressure(scene: Scene, state: State, body: int, *, length: float | None = None) -> Traction:
    """Recover the contact traction along the boundary of one body from the contact forces of a state.

    Parameters
    ----------
    scene, state : a scene and its state
    body : index of the body in `scene.bodies`
    length : edge of the cells of the hat functions [m], by default that of the grid; longer for smoother curves; 0
        for the point forces over the tributary lengths of the boundary points

    Returns
    -------
    traction, pressure and their errors at the boundary points

    Raises
    ------
    SceneError
        if state, body or length do not fit the scene, the body has no outline, or contacts act at grid nodes

    Notes
    -----
    Forces F_k of boundary points that are denser than the grid resolves are not unique, and alternate. Bodies
    feel the nodal forces f_I = sum_k N_I(x_k) F_k, with the hat functions N_I of the body grid. A pressure q is
    improved by sharing each of them over its hat in proportion to q (Richardson, J. Opt. Soc. Am. 62 (1972) 55-59)::

        t(s) = q(s) sum_I N_I(s) f_I / int N_I q ds.

    With q = 1 the formula gives a first t, which is too flat. With this t, smoothed, as q it gives two estimates: a
    narrow one from the f_I, and a wide one from the nodal forces of the first t. The narrow one resolves small
    contacts, the wide one has no scatter. The result is the narrow one where the length under load is at most 2.7
    cells, and approaches the wide one with the square of that length. All are projected on the hat functions of the
    boundary points. The `error` is twice the difference of the two.

    A contact may be narrower than the result. Of all tractions with the force P and the standard deviation sigma of
    its point forces the uniform one has the lowest peak, P / (sqrt(12) sigma). The `error` is at least what the
    result lacks of it. Points L apart have added L^2 / 6 to sigma^2, the variance of their hat functions. Where no
    more is there, as under a single point, the `error` is infinite. Forces at most two cells apart count as one
    contact's. Peaks of smooth contacts, points up to a cell apart, are off by less than 5 %, or by less than `error`,
    in 95 % of cases (docs/how_to/measures.md).

    The resultant is that of the contacts, on straight sides their moment, too. No force passes round a corner, and
    pressures are negative only where cohesion bears tension.

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> floor = skmpm.Wall((0, -1e-3), (0, 1))
    >>> scene = skmpm.Scene([body], cell=4e-4, walls=[floor], gravity=(0, -9.81))
    >>> *_, state = skmpm.simulate(scene, dt=1e-3, until=2e-2)
    >>> result = skmpm.contact_pressure(scene, state, 0)
    >>> force = (result.traction * result.length).sum(axis=1)
    >>> weight = 9.81 * state.mass.sum()
    >>> round(float(force[1] / weight), 2)
    1.0
    """
    check_fits(scene, state, "contact_pressure")
    length = scene.cell if length is None else length
    _check(scene, state, body, length)
    return traction(scene, state, body, np.zeros(scene.outlines.size), length)


def traction(scene: Scene, state: State, body: int, pressure: Array, length: float) -> Traction:
    """Recover the traction of contacts and of pressures (m,) [Pa] on the boundary segments of a body."""
    boundary = scene.outlines
    x = state.x[:, boundary.point]
    corner = outline.curve(boundary, scene.initial_positions[:, boundary.point]).corner
    placed = place(state.contacts, boundary, corner, x, body, scene.cell)
    vectors, inward = state.contacts.vectors, np.abs(state.contacts.force[0]) * state.contacts.normal
    loads = (placed.sign * placed.share) * np.concatenate([vectors, inward])[:, placed.contact]
    lattice = _in_the_grid(scene, state, body, x, placed)
    segments = np.flatnonzero((pressure > 0.0) & (boundary.body == body))
    if segments.size:
        along = x[:, boundary.next[segments]] - x[:, segments]
        push = pressure[segments] * np.stack([-along[1], along[0]])
        loads = np.concatenate([loads, np.concatenate([push, push])], axis=1)
        placed = placed.with_middles(segments, np.hypot(*along))
    own = sides(boundary, corner, x, body)
    found = [recover(side, placed, loads, lattice, length, scene.cell) for side in own]
    spread, error = (np.concatenate(parts, axis=-1) for parts in zip(*found, strict=True))
    c, weight = np.concatenate([side.point for side in own]), np.concatenate([side.weight for side in own])
    force = spread[:2]
    normal = _normals(spread[2:], np.concatenate([_side_normals(side, x) for side in own], axis=1))
    return Traction(
        body=body,
        point=boundary.point[c],
        side=np.repeat(np.arange(len(own)), [side.point.size for side in own]),
        arc_length=np.concatenate([side.begin + side.s for side in own]),
        x=x[:, c],
        length=weight,
        normal=normal,
        traction=force,
        pressure=-(force * normal).sum(axis=0),
        shear=normal[0] * force[1] - normal[1] * force[0],
        error=error,
    )


def _check(scene: Scene, state: State, body: int, length: float) -> None:
    n = len(scene.bodies)
    if not isinstance(body, int | np.integer) or not 0 <= body < n:
        raise SceneError(f"contact_pressure: body = {reprlib.repr(body)}; give the index of a body, 0 to {n - 1}")
    if not (isinstance(length, int | float | np.number) and 0.0 <= length < np.inf):
        raise SceneError(f"contact_pressure: length = {length!r}; give a length in metres, 0 or more")
    if not scene.outlined[body]:
        raise SceneError(f"contact_pressure: body {body} has no outline; give its Points an outline")
    if (state.contacts.point < 0).any():
        raise SceneError(
            f"contact_pressure: body {body}: contacts act at grid nodes, which do not lie on its boundary; run with"
            " Scheme(contact=contact.point_to_curve), the default, or use observe(...).bodies.stress"
        )


def _in_the_grid(scene: Scene, state: State, body: int, x: Array, placed: Placed) -> Array:
    """Boundary points (2, m) [m] when the body grids were built; a rigid body follows the closest contact points."""
    if scene.deformable[body] or placed.contact.size == 0:
        return state.x_anchor[:, scene.outlines.point]
    closest = cKDTree(x[:, placed.segment].T).query(x.T)[1]
    point = state.contacts.point[placed.contact[closest]]
    return np.asarray(x + (state.x_anchor - state.x)[:, point])


def _normals(inward: Array, geometric: Array) -> Array:
    """Outward normals (2, m): against the weighted contact normals `inward` (2, m), or geometric ones without any."""
    size = np.hypot(*inward)
    loaded = size > ROUND_OFF * size.max(initial=0.0)
    return np.where(loaded, -inward / np.where(loaded, size, 1.0), geometric)


def _side_normals(side: Side, x: Array) -> Array:
    """Unit outward normals (2, n) at the points of a side: those of the chords between their neighbours on it."""
    y = x[:, side.point]
    before, after = (np.roll(y, 1, axis=1), np.roll(y, -1, axis=1))
    if not side.closed:
        before[:, 0], after[:, -1] = y[:, 0], y[:, -1]
    chord = after - before
    return np.asarray(np.stack([chord[1], -chord[0]]) / np.maximum(np.hypot(*chord), np.finfo(np.float64).tiny))
