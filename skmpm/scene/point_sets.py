"""The material points that supports and loads act on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skmpm.outline import Outlines
from skmpm.scene.layout import Layout
from skmpm.scene.objects import Load, Pressure, SceneError

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class PointSet:
    """Points of bodies, and their shares of a force."""

    points: Ints  # (m,) into the arrays of a state
    share: Array  # (m,) their sum is 1


def loaded_points(scene: Layout, i: int, load: Load) -> PointSet:
    """The points of bodies that forces move which share load i, as `points_with_shares`."""
    return _with_shares(scene, matching(scene, f"load {i}: where", load.where, scene.movable))


def points_with_shares(scene: Layout, name: str, where: Callable[[Array], ArrayLike]) -> PointSet:
    """The points where a function is true: by boundary length if these are boundary points, otherwise by volume."""
    return _with_shares(scene, matching(scene, name, where))


def _with_shares(scene: Layout, points: Ints) -> PointSet:
    boundary = scene.outlines
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


def matching(
    scene: Layout, name: str, where: Callable[[Array], ArrayLike], bodies: NDArray[np.bool_] | None = None
) -> Ints:
    """The points of some bodies (bodies,), by default the deformable ones, where a function is true.

    SceneError where it is true at others that forces move: they would move as if it were not.
    """
    x = scene.initial_positions
    if not callable(where):
        raise SceneError(f"{name}: expected a function of positions (2, n) that returns (n,) booleans, got {where!r}")
    inside = np.asarray(where(x.copy()))  # the function may work in place
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
            " leave that body out, or give the body a `motion`"
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
