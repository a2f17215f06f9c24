"""Springs: beds that hold points where they were, and bars between the means of two sets of points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skmpm.scene.objects import SceneError, Where, motion, not_negative, numbers, positive, scalar, vector
from skmpm.scene.point_sets import PointSet, points_with_shares

if TYPE_CHECKING:
    from skmpm.scene.scene import Scene
    from skmpm.scene.state import State

Array = NDArray[np.float64]
SHORTEST = 1e-6  # [cells] bar at t = 0, which needs a direction

Rest = float | ArrayLike | Callable[[float], ArrayLike] | None


@dataclass(frozen=True)
class Spring:
    """A linear spring on the points of deformable bodies where `where(x)` is true at t = 0.

    Without `to` it is a bed to ground: every point is held at its position at t = 0 by a share of the stiffness, by
    boundary length if only boundary points match, else by volume. It resists rotation, too. With `to` it is a bar
    between the means of two sets of points, weighted alike, or from one to a fixed point: its force
    stiffness * (length - rest) acts along it, whatever it turns to. The force is exact at t + theta dt of each step.
    Neither `where` nor `to` may be true at points of free rigid bodies.

    Parameters
    ----------
    where : positions (2, n) [m] -> (n,) bool
    stiffness : in total, force per displacement and per metre of thickness [N/m2]; of a bed a number or (2,), one
        per direction, of which one may be zero
    to : the other end of a bar: positions (2, n) -> (n,) bool, or a point (2,) [m]
    rest : of a bed the displacement (2,) [m] without a force, by default zero; of a bar the length [m] without a
        force, by default that at t = 0. A number, or a function of time: its end then moves
    """

    where: Where
    stiffness: float | Sequence[float]
    to: Where | ArrayLike | None = field(default=None, kw_only=True)
    rest: Rest = field(default=None, kw_only=True)


class Ends(NamedTuple):
    """The points that a spring acts on."""

    first: PointSet
    second: PointSet | None  # of a bar between two sets
    point: Array | None  # (2,) of a bar to a fixed point [m]

    @property
    def bed(self) -> bool:
        """Whether it is a bed."""
        return self.second is None and self.point is None

    @property
    def sets(self) -> tuple[PointSet, ...]:
        """The sets of points, one or two."""
        return (self.first,) if self.second is None else (self.first, self.second)

    def span(self, x: Array) -> Array:
        """The vector from the other end of a bar to its first, (2,) [m], with points at x (2, n)."""
        first = x[:, self.first.points] @ self.first.share
        if self.second is not None:
            return np.asarray(first - x[:, self.second.points] @ self.second.share)
        return np.asarray(first - self.point)  # type: ignore[operator]


def ends_of(scene: Scene, i: int, spring: Spring) -> Ends:
    """The points that spring i acts on."""
    first = points_with_shares(scene, f"spring {i}: where", spring.where)
    if spring.to is None:
        return Ends(first, None, None)
    if callable(spring.to):
        return Ends(first, points_with_shares(scene, f"spring {i}: to", spring.to), None)
    return Ends(first, None, vector(f"spring {i}: to", spring.to))


def stiffness_of(i: int, spring: Spring) -> Array:
    """The stiffness of spring i in both directions, (2,) [N/m2]; SceneError if it is no stiffness."""
    name, what = f"spring {i}: stiffness", "a stiffness in N/m2 (per metre of thickness)"
    value = numbers(name, spring.stiffness, f"give {what}")
    if value.ndim == 0 or spring.to is not None:
        return np.full(2, positive(name, spring.stiffness, what))
    if value.shape != (2,):
        raise SceneError(f"{name} = {spring.stiffness}; give {what}: a number, or two, one per direction")
    each = np.array([not_negative(name, v, what) for v in value])
    if not each.any():
        raise SceneError(f"{name} = {spring.stiffness}; give at least one that is not zero")
    return each


def rest_of(scene: Scene, i: int, t: float) -> Array:
    """What spring i has at time t without a force: displacement (2,) of a bed, length () of a bar [m]."""
    spring, ends = scene.springs[i], scene.sprung[i]
    if ends.bed:
        return motion((0.0, 0.0) if spring.rest is None else spring.rest, t, f"spring {i}: rest")
    if spring.rest is None:
        return np.asarray(np.hypot(*ends.span(scene.initial_positions)))
    length = scalar(spring.rest, t, f"spring {i}: rest")
    if length < 0.0:
        raise SceneError(f"spring {i}: rest = {length:g} m at t = {t:.6g} s; a length is zero or more")
    return np.asarray(length)


def spring_forces(scene: Scene, state: State) -> Array:
    """Forces of the springs on the points of their `where`, (springs, 2) [N/m], at the time of a state."""
    forces = [-_pull(scene, i, state.x, state.t) for i in range(len(scene.springs))]
    return np.array([f if f.ndim == 1 else f.sum(axis=1) for f in forces]).reshape(-1, 2)


def _pull(scene: Scene, i: int, x: Array, t: float) -> Array:
    """Derivative of the energy of spring i by its displacement: of a bed by those of its points, (2, m) [N/m]."""
    ends, k, rest = scene.sprung[i], stiffness_of(i, scene.springs[i]), rest_of(scene, i, t)
    if ends.bed:
        return np.asarray(k[:, None] * ends.first.share * _stretch(scene, ends, x, rest))
    span = ends.span(x)
    length = float(np.hypot(*span))
    return np.asarray(k * (length - rest) * span / length) if length > 0.0 else np.zeros(2)


def _stretch(scene: Scene, ends: Ends, x: Array, rest: Array) -> Array:
    """Displacements of the points of a bed less that without a force, (2, m) [m]."""
    points = ends.first.points
    return np.asarray(x[:, points] - scene.initial_positions[:, points] - rest[:, None])


def check_springs(scene: Scene) -> None:
    """Raise SceneError for the first error in the springs."""
    for i, spring in enumerate(scene.springs):
        if not isinstance(spring, Spring):
            raise SceneError(f"spring {i} is a {type(spring).__name__}; use skmpm.Spring(where, stiffness)")
        stiffness_of(i, spring)
    for i, ends in enumerate(scene.sprung):
        for name, points in (("where", ends.first), ("to", ends.second)):
            if points is not None and points.points.size == 0:
                raise SceneError(
                    f"spring {i}: {name} is true at no point of a deformable body; allow for round-off in comparisons"
                )
        if ends.second is not None and np.isin(ends.first.points, ends.second.points).any():
            raise SceneError(f"spring {i}: where and to have points in common; give two separate sets")
        if not ends.bed and np.hypot(*ends.span(scene.initial_positions)) <= SHORTEST * scene.cell:
            raise SceneError(f"spring {i}: both its ends are at the same position at t = 0; move one of them")
        rest_of(scene, i, 0.0)
