"""The periodic box: its edges, and its motion, prescribed by a velocity gradient or found from a stress.

The edges of the box are the columns of H. With the mean velocity gradient L of a step of length dt, they become
exp(dt L) H at its end, so that a constant gradient is followed exactly. Components of L that a stress determines
follow from those at the end of the step: H_1 = D S exp(dt L) H, with the stretches D = I + dt diag(L_xx, L_yy) and
the shear S = I + dt L_xy e_x e_y^T, so that these rates times edges are speeds of edges. A change of one of them
moves H_1 by a multiple of the same component of a gradient, so that the stress is exact at the end of the step, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from skmpm.arrays import Array, Ints
from skmpm.values import Given, SceneError, numbers, positive

Tensor = ArrayLike | Callable[[float], ArrayLike]

COMPONENTS = np.array([[0, 1, 0], [0, 1, 1]])  # of L that a stress may determine: xx, yy, xy


@dataclass(frozen=True)
class Periodic(Given):
    """A periodic box of rectangular shape at t = 0: what leaves it on one side enters it on the other.

    With ``Periodic(width, None)`` or ``Periodic(None, height)`` it is periodic in one direction, and walls along that
    direction may close it in the other, as in a plane shear cell. Then it keeps its length, and the walls move.

    Parameters
    ----------
    width, height : edges at t = 0 [m]; one of them None where it is not periodic
    rate : velocity gradient (2, 2) of the box, [i, j] = dv_i / dx_j [1/s], or a function of time t -> (2, 2), taken
        at the middle of each step; zero by default
    stress : mean stress (2, 2) of the packing [Pa], tension positive, or a function of time, taken at t + theta dt
        of each step from t on; nan where the rate is given instead. The rates of these components are unknowns of
        the contact problem, in which the stress is exact at the end of every step. It is symmetric: a shear stress
        stands in both places, and determines the rate [0, 1], so that the lower edge keeps its direction
    mass : mass of an edge whose motion a stress determines [kg/m], in steps of backward Euler with any theta; by
        default that of all bodies that forces move. Without inertia it has none

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> box = skmpm.Periodic(width=3e-3, height=3e-3, rate=((0, 1), (0, 0)))
    >>> scene = skmpm.Scene([body], cell=4e-4, periodic=box)
    >>> state = skmpm.step(scene, skmpm.initial(scene), 1e-3)
    >>> state.box.round(6).tolist()
    [[0.003, 3e-06], [0.0, 0.003]]
    >>> plates = [skmpm.Wall((0, -1e-3), (0, 1)), skmpm.Wall((0, 1e-3), (0, -1), pressure=1e3, velocity=(0.1, 0))]
    >>> cell = skmpm.Scene([body], cell=4e-4, walls=plates, friction=0.5, periodic=skmpm.Periodic(3e-3, None))
    >>> skmpm.initial(cell).box.tolist()
    [[0.003], [0.0]]
    """

    width: float | None
    height: float | None
    rate: Tensor = field(default=((0.0, 0.0), (0.0, 0.0)), kw_only=True)
    stress: Tensor | None = field(default=None, kw_only=True)
    mass: float | None = field(default=None, kw_only=True)

    @property
    def box(self) -> Array:
        """The one or two edges at t = 0 as columns, (2, 1) or (2, 2) [m]."""
        given = [length is not None for length in (self.width, self.height)]
        return np.diag([0.0 if length is None else float(length) for length in (self.width, self.height)])[:, given]

    def rate_at(self, t: float) -> Array:
        """Prescribed velocity gradient of the box.

        Parameters
        ----------
        t : time [s]

        Returns
        -------
        (2, 2) [1/s]; zero where a stress determines it
        """
        rate, found = _tensor("rate", self.rate, t), np.zeros((2, 2), dtype=bool)
        found[tuple(self.components)] = True
        if (np.isfinite(rate[found]) & (rate[found] != 0.0)).any():
            raise SceneError(
                f"periodic: rate = {rate.tolist()} at t = {t:.6g} s has a component whose stress is given, too; give"
                " one of them"
            )
        if not np.isfinite(rate[~found]).all():
            where = ("xx", "xy", "yx", "yy")[int(np.argmax(~np.isfinite(rate) & ~found))]
            raise SceneError(
                f"periodic: rate = {rate.tolist()} at t = {t:.6g} s and no stress gives component {where}; give a"
                " finite rate, or the stress instead"
            )
        return np.where(found, 0.0, rate)

    def stress_at(self, t: float) -> Array:
        """Given stresses of the box.

        Parameters
        ----------
        t : time [s]

        Returns
        -------
        (q,) [Pa], in the order of `components`
        """
        if self.stress is None:
            return np.zeros(0)
        stress = _tensor("stress", self.stress, t)
        at = f" at t = {t:.6g} s" if callable(self.stress) else ""
        if not np.array_equal(stress[0, 1], stress[1, 0], equal_nan=True):
            raise SceneError(
                f"periodic: stress{at} = {stress.tolist()} is not symmetric; give the same shear stress twice, or nan"
            )
        pattern = ~np.isnan(_tensor("stress", self.stress, 0.0))
        if not (np.isfinite(stress) == pattern).all():
            raise SceneError(
                f"periodic: stress{at} = {stress.tolist()}; a component is given always or never, as a finite number"
            )
        return np.asarray(stress[tuple(self.components)])

    @property
    def components(self) -> Ints:
        """The components of the velocity gradient that a stress determines, (2, q)."""
        if self.stress is None:
            return COMPONENTS[:, :0]
        given = ~np.isnan(_tensor("stress", self.stress, 0.0))
        return COMPONENTS[:, given[tuple(COMPONENTS)]]

    def check(self) -> None:
        """Raise SceneError for the first error."""
        if self.width is None and self.height is None:
            raise SceneError("periodic: width and height are None; give one of them, or no periodic box")
        for name, length in (("width", self.width), ("height", self.height)):
            if length is not None:
                positive(f"periodic: {name}", length, "a length in metres, or None where it is not periodic")
        if self.box.shape[1] == 1:
            self._check_still()
        if self.mass is not None:
            positive("periodic: mass", self.mass, "a mass per metre of thickness in kg/m, or None")
        if self.stress is not None:
            self.stress_at(0.0)
            if self.components.size == 0:
                raise SceneError("periodic: stress has no component that is not nan; give one, or only a rate")
        elif self.mass is not None:
            raise SceneError(f"periodic: mass = {self.mass} without a stress; give one, or no mass")
        self.rate_at(0.0)

    def _check_still(self) -> None:
        """A box that is periodic in one direction keeps its length."""
        for name, given in (("rate", self.rate), ("stress", self.stress), ("mass", self.mass)):
            if callable(given) or (given is not None and np.any(np.asarray(given) != 0.0)):
                raise SceneError(
                    f"periodic: {name} = {given!r} in a box that is periodic in one direction, whose length stays;"
                    " move its walls instead, by Wall(velocity=...) or Wall(pressure=...)"
                )


def _tensor(name: str, value: Tensor, t: float) -> Array:
    """A tensor (2, 2), or the value at time t of a function of time; entries may be nan."""
    at = f" at t = {t:.6g} s" if callable(value) else ""
    given = value(t) if callable(value) else value
    remedy = f"give a tensor (2, 2) of numbers in {'1/s' if name == 'rate' else 'Pa'}, or a function of time"
    array = numbers(f"periodic: {name}{at}", given, remedy)
    if array.shape != (2, 2):
        raise SceneError(f"periodic: {name}{at} = {given!r}; {remedy}")
    return array


def deformed(box: Array, rate: Array, dt: float, components: Ints, found: Array) -> Array:
    """The edges [m] after a step, by the prescribed gradient and the unknown components (q,) [1/s]."""
    after = expm(dt * rate) @ box
    if components.size == 0:
        return np.asarray(after)
    L = np.zeros((2, 2))
    L[tuple(components)] = found
    shear = np.array([[1.0, dt * L[0, 1]], [0.0, 1.0]])
    return np.asarray((1.0 + dt * np.diag(L))[:, None] * (shear @ after))


def box_corners(box: Array, x: Array) -> Array:
    """Corners of a box, (2, 4) [m].

    They are those of the strip over which positions x (2, k) [m] extend if the box is periodic in one direction.
    """
    first, edges = np.zeros(2), box
    if box.shape[1] == 1:
        across = np.array([-box[1, 0], box[0, 0]]) / np.hypot(*box[:, 0])
        reach = across @ x
        first, edges = across * reach.min(), np.stack([box[:, 0], across * np.ptp(reach)], axis=1)
    a, b = edges.T
    return np.stack([first, first + a, first + a + b, first + b], axis=1)


def into_box(centres: Array, box: Array | None) -> Array:
    """Displacements (2, bodies) [m] that bring centres (2, bodies) [m] into the box; zero without one."""
    if box is None:
        return np.zeros_like(centres)
    return np.asarray(-box @ np.floor(np.linalg.pinv(box) @ centres))


def recut(box: Array) -> tuple[Array, Ints]:
    """The edges (2, 2) [m] of the same lattice with the least slanted second one, and T with that box = box T."""
    a, b = box.T
    change = np.array([[1, -int(np.rint((a @ b) / (a @ a)))], [0, 1]])
    return np.asarray(box @ change), change
