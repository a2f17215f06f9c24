"""The material points that supports, loads and springs act on, and what these prescribe."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.outline import Outlines
from skmpm.scene.layout import Layout
from skmpm.scene.objects import Pressure, Spring, Support, Where
from skmpm.values import SceneError, components, not_negative, numbers, positive, scalar, vector

TURNING = "to turn points, give `rotation`"


@dataclass(frozen=True)
class PointSet:
    """Points of bodies, and their shares of a force."""

    points: Ints  # (m,) into the arrays of a state
    share: Array  # (m,) their sum is 1


def points_with_shares(scene: Layout, name: str, where: Where, bodies: Bools | None = None) -> PointSet:
    """The `matching` points: by boundary length if these are boundary points, otherwise by volume."""
    points, boundary = matching(scene, name, where, bodies), scene.outlines
    if np.isin(points, boundary.point).all():
        share = _lengths(boundary, scene.initial_positions, points)
    else:
        share = scene.initial_volumes[points]
    return PointSet(points, share / share.sum() if points.size else share)


def pressed_segments(scene: Layout, i: int, pressure: Pressure) -> Ints:
    """The boundary points at which the segments begin that load i, a pressure, acts on."""
    chosen, boundary = np.zeros(scene.offsets[-1], dtype=bool), scene.outlines
    chosen[matching(scene, f"load {i}: where", pressure.where)] = True
    return np.flatnonzero(chosen[boundary.point] & chosen[boundary.point[boundary.next]])


def matching(scene: Layout, name: str, where: Where, bodies: Bools | None = None) -> Ints:
    """The points of some bodies (bodies,), by default the deformable ones, where a function is true.

    SceneError where it is true at others that forces move: they would move as if it were not.
    """
    x = scene.initial_positions
    if not callable(where):
        raise SceneError(f"{name}: expected a function of positions (2, n) that returns (n,) booleans, got {where!r}")
    try:
        inside = np.asarray(where(x.copy()))  # the function may work in place
    except ValueError as error:
        if "truth value" not in str(error):
            raise
        raise SceneError(
            f"{name} failed ({error}); use &, | and ~ with parentheses instead of `and`, `or` and `not`, as in"
            " (x[0] < a) & (x[1] > b)"
        ) from error
    if inside.shape != x.shape[1:] or inside.dtype != np.bool_:
        raise SceneError(
            f"{name} returned {inside.dtype} of shape {inside.shape}; return {x.shape[1:]} booleans,"
            " one for each position"
        )
    own = scene.deformable if bodies is None else bodies
    untouched = scene.owner[inside & (scene.movable & ~own)[scene.owner]]
    if untouched.size:
        raise SceneError(
            f"{name} is true at points of body {untouched[0]}, a free rigid body, on which only a Load acts; let it"
            " leave that body out, or prescribe all of its `motion`"
        )
    return np.flatnonzero(inside & own[scene.owner])


def _lengths(boundary: Outlines, x: Array, points: Ints) -> Array:
    """Half the boundary from each point to its matching neighbours, or to both if neither matches, (points,) [m]."""
    start, end = boundary.point, boundary.point[boundary.next]
    half = 0.5 * np.hypot(*(x[:, end] - x[:, start]))
    chosen = np.isin(start, points) & np.isin(end, points)

    def tributary(half: Array) -> Array:
        return np.asarray(np.bincount(start, half, x.shape[1]) + np.bincount(end, half, x.shape[1]))[points]

    between = tributary(np.where(chosen, half, 0.0))
    return np.where(between > 0.0, between, tributary(half))


def supported_points(scene: Layout, i: int, support: Support) -> PointSet:
    """The points whose velocity support i prescribes, with equal shares."""
    points = matching(scene, f"support {i}: where", support.where)
    return PointSet(points, np.full(points.size, 1.0 / max(points.size, 1)))


def support_rotations(scene: Layout, t: float, dt: float | None = None) -> Array:
    """Rates of cosine and sine of the angles of supports that turn, (2, n) [1/s], as `Model.support_velocities`.

    Raises
    ------
    SceneError
        if an angle is no finite number
    """
    interval = scene.cell / scene.fastest_wave if dt is None else dt
    each = np.empty((2, scene.turning.size))
    for k, i in enumerate(scene.turning.tolist()):
        start, end = (support_angle(scene.supports[i], time, i) for time in (t, t + interval))
        each[:, k] = np.array([np.cos(end) - np.cos(start), np.sin(end) - np.sin(start)]) / interval
    return each


def support_angle(support: Support, t: float, i: int) -> float:
    """The angle of support i at time t [rad]; SceneError if it is no finite number."""
    return scalar(support.rotation, t, f"support {i}: rotation")


def support_arms(scene: Layout, i: int, points: Ints) -> Array:
    """Arms (2, k) [m] of the points of support i from its centre, at t = 0."""
    x, given = scene.initial_positions[:, points], scene.supports[i].centre
    return x - (x.mean(axis=1) if given is None else vector(f"support {i}: centre", given))[:, None]


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


def prescribed_components(support: Support, t: float, name: str) -> Array:
    """Prescribed displacement [m] or velocity [m/s] of a support at time t, (2,), nan for free components.

    Raises
    ------
    SceneError
        if it is not two components, each a finite number or None
    """
    value = support.prescribed(t) if callable(support.prescribed) else support.prescribed
    return components(name, value, 2, f"give two components (x, y), each a finite number or None; {TURNING}")
