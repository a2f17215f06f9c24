"""`contact_pressure`: the traction of the contacts along the boundary of a body, recovered from point forces."""

from __future__ import annotations

import reprlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm import outline
from skmpm.observe.contact_network import FORCED
from skmpm.observe.sides import Placed, Side, place, sides
from skmpm.representation import with_shapes
from skmpm.scene import Scene, SceneError, State, check_fits

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Default half-width of the averaging kernel [cells]. Hertz contacts 1.6 to 3.1 cells wide on either side, points h/3,
# h/2 and 0.74 h apart (docs/verification/contact_pressure.md): peaks are off by up to 21, 14 and 34 % at 1.0 and by
# up to 12, 7 and 19 % at 1.3; at 1.7 the narrowest contact is flattened by 6, 9 and 15 % on average.
AVERAGING = 1.3


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
    length : (m,) [m] of boundary that belongs to each point, half of its segments on this side
    normal : (2, m) unit, outwards: mean of the contact normals, weighted by the size of the normal forces; without
        force that of the boundary
    traction : (2, m) [Pa] force of the contacts on the body per length, in x and y
    pressure : (m,) [Pa] normal traction, positive in compression, negative where cohesion bears tension
    shear : (m,) [Pa] tangential traction, positive along increasing arc length
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

    @property
    def force(self) -> Array:
        """Resultant of the contact forces on the body, (2,) [N/m]."""
        return np.asarray(self.traction @ self.length)


def contact_pressure(scene: Scene, state: State, body: int, *, length: float | None = None) -> Traction:
    """Recover the contact traction along the boundary of one body from the contact forces of a state.

    Contact points may be denser than the grid resolves: force over tributary length then alternates, by 1.1 p0 (rms)
    in a Hertz contact of points h/3 apart. So each force is spread over the boundary by a tent of half-width `length`
    (a running mean over `length`, taken twice) and projected on the hat functions of the boundary points::

        t_i = sum_k F_k int phi(s - s_k) N_i ds / int N_i ds,     phi(s) = max(1 - |s| / length, 0) / length.

    The kernel is not negative and conserves the resultant, on a straight boundary also the moment. At corners it is
    reflected, which keeps a uniform traction uniform; a force closer to a corner than `length` may move away from it
    by up to length/3. A contact narrower than `length` appears wider, with a lower pressure
    (docs/how_to/measures.md).

    Parameters
    ----------
    body : index of the body in `scene.bodies`
    length : half-width of the kernel [m]; by default 1.3 cells, at most the length of a side; 0 for the point forces
        over the tributary lengths of the boundary points

    Raises
    ------
    SceneError
        If state, body or length do not fit the scene, the body has no outline, or contacts act at grid nodes.
    """
    check_fits(scene, state, "contact_pressure")
    width = AVERAGING * scene.cell if length is None else length
    _check(scene, state, body, width)
    boundary = scene.outlines
    x = state.x[:, boundary.point]
    corner = outline.curve(boundary, scene.initial_positions[:, boundary.point]).corner
    placed = place(state.contacts, boundary, corner, x, body, scene.cell)
    vectors, inward = state.contacts.vectors, np.abs(state.contacts.force[0]) * state.contacts.normal
    loads = (placed.sign * placed.share) * np.concatenate([vectors, inward])[:, placed.contact]
    own = sides(boundary, corner, x, body)
    spread = np.concatenate([_spread(side, placed, loads, width, boundary.size) for side in own], axis=1)
    c, weight = np.concatenate([side.point for side in own]), np.concatenate([side.weight for side in own])
    traction = spread[:2] / weight
    normal = _normals(spread[2:], np.concatenate([_side_normals(side, x) for side in own], axis=1))
    return Traction(
        body=body,
        point=boundary.point[c],
        side=np.repeat(np.arange(len(own)), [side.point.size for side in own]),
        arc_length=np.concatenate([side.begin + side.s for side in own]),
        x=x[:, c],
        length=weight,
        normal=normal,
        traction=traction,
        pressure=-(traction * normal).sum(axis=0),
        shear=normal[0] * traction[1] - normal[1] * traction[0],
    )


def _check(scene: Scene, state: State, body: int, length: float) -> None:
    n = len(scene.bodies)
    if not isinstance(body, int | np.integer) or not 0 <= body < n:
        raise SceneError(f"contact_pressure: body = {reprlib.repr(body)}; give the index of a body, 0 to {n - 1}")
    if not isinstance(length, int | float | np.number):
        raise SceneError(f"contact_pressure: length = {length!r}; give a length in metres, 0 or more")
    if not scene.outlined[body]:
        raise SceneError(f"contact_pressure: body {body} has no outline; give its Points an outline")
    if (state.contacts.point < 0).any():
        raise SceneError(
            f"contact_pressure: body {body}: contacts act at grid nodes, which do not lie on its boundary; run with"
            " Scheme(contact=contact.point_to_curve), the default, or use observe(...).bodies.stress"
        )
    if not (np.isfinite(length) and length >= 0.0):
        raise SceneError(f"contact_pressure: length = {length!r}; give a length in metres, 0 or more")


def _spread(side: Side, placed: Placed, loads: Array, width: float, boundary_points: int) -> Array:
    """Loads (components, k) on the boundary, spread over the points of a side: (components, n) [N/m]."""
    n, number = side.point.size, np.full(boundary_points, -1)
    number[side.segments] = np.arange(side.segments.size)
    here = np.flatnonzero(number[placed.segment] >= 0)
    segment, t, F = number[placed.segment[here]], placed.t[here], loads[:, here].T
    out = np.zeros((n, len(loads)))
    np.add.at(out, segment, (1.0 - t)[:, None] * F)
    np.add.at(out, (segment + 1) % n, t[:, None] * F)
    L = min(width, side.total)
    if L == 0.0:
        return out.T
    ends, index = np.append(side.s, side.total), np.arange(n)
    s = (1.0 - t) * ends[segment] + t * ends[segment + 1]
    # Two more copies of the side, mirrored at its corners or, of a closed one, continued.
    if side.closed:
        nodes, copy = np.concatenate([side.s - side.total, side.s, side.s + side.total]), np.tile(index, 3)
    else:
        nodes = np.concatenate([-side.s[:0:-1], side.s, 2.0 * side.total - side.s[-2::-1]])
        copy = np.concatenate([index[:0:-1], index, index[-2::-1]])
    # int phi N_i is the second divided difference of the second integral of phi, here less that of a point force.
    excess = (np.maximum(L - np.abs(s - nodes[:, None]), 0.0) ** 3 / (6.0 * L**2)) @ F
    slope = np.diff(excess, axis=0) / np.diff(nodes)[:, None]
    np.add.at(out, copy, np.diff(slope, axis=0, prepend=0.0, append=0.0))
    return out.T


def _normals(inward: Array, geometric: Array) -> Array:
    """Outward normals (2, m): against the weighted contact normals `inward` (2, m), or geometric ones without any."""
    size = np.hypot(*inward)
    loaded = size > FORCED * size.max(initial=0.0)
    return np.where(loaded, -inward / np.where(loaded, size, 1.0), geometric)


def _side_normals(side: Side, x: Array) -> Array:
    """Unit outward normals (2, n) at the points of a side: those of the chords between their neighbours on it."""
    y = x[:, side.point]
    before, after = (np.roll(y, 1, axis=1), np.roll(y, -1, axis=1))
    if not side.closed:
        before[:, 0], after[:, -1] = y[:, 0], y[:, -1]
    chord = after - before
    return np.asarray(np.stack([chord[1], -chord[0]]) / np.maximum(np.hypot(*chord), np.finfo(np.float64).tiny))
