"""Springs: beds that hold points where they were, and bars between the means of two sets of points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skmpm.scene.layout import Layout
from skmpm.scene.objects import SceneError, Spring, motion, not_negative, numbers, positive, scalar, vector
from skmpm.scene.point_sets import PointSet, points_with_shares

Array = NDArray[np.float64]


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


def ends_of(scene: Layout, i: int, spring: Spring) -> Ends:
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


def rest_of(i: int, spring: Spring, ends: Ends, X: Array, t: float) -> Array:
    """What spring i has at time t without a force: displacement (2,) of a bed, length () of a bar [m].

    X (2, n) are positions at t = 0.
    """
    if ends.bed:
        return motion((0.0, 0.0) if spring.rest is None else spring.rest, t, f"spring {i}: rest")
    if spring.rest is None:
        return np.asarray(np.hypot(*ends.span(X)))
    length = scalar(spring.rest, t, f"spring {i}: rest")
    if length < 0.0:
        raise SceneError(f"spring {i}: rest = {length:g} m at t = {t:.6g} s; a length is zero or more")
    return np.asarray(length)
