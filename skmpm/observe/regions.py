"""Convex regions between walls, and periodic boxes: sides, area, and the parts of segments and outlines inside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skmpm.arrays import EXACT, Array, Bools, Ints
from skmpm.outline import Outlines
from skmpm.scene import State


@dataclass(frozen=True, eq=False)
class Region:
    """The intersection of the half-planes normal . (x - point) >= 0, where it is periodic one period of it."""

    normal: Array  # (2, w) unit, inwards
    point: Array  # (2, w) [m]
    length: Array  # (w,) of the part of each line that bounds the region [m]; 0 if redundant, inf if open
    area: float  # [m2]; nan if the region is not closed or empty


def region(normal: Array, point: Array, box: Array | None = None) -> Region:
    """The region of half-planes through `point` (2, w) [m] with inward unit `normal` (2, w).

    Of a periodic box with edges (2, 1) or (2, 2) [m], sides and area are those of one period.
    """
    sides, at = _sides(np.zeros((2, 0)) if box is None else box)
    every, through = np.concatenate([normal, sides], axis=1), np.concatenate([point, at], axis=1)
    length, w = _lengths(every, through), normal.shape[1]
    if length.size == 0 or not np.isfinite(length).all() or not length.any():
        return Region(normal, point, length[:w], float("nan"))
    # Green's theorem: twice the area is the sum of sides times distances of their lines from any point.
    distance = np.einsum("iw,iw->w", every, through.mean(axis=1)[:, None] - through)
    area = float(length @ distance) / 2.0
    return Region(normal, point, length[:w], area if area > 0.0 else float("nan"))


def _sides(box: Array) -> tuple[Array, Array]:
    """Inward unit normals of the opposite sides that the edges (2, n) of a periodic box join, and points on them."""
    across = np.linalg.pinv(box).T
    across /= np.hypot(*across)
    return np.concatenate([across, -across], axis=1), np.concatenate([0.0 * box, box], axis=1)


def between_walls(state: State, away: float = 0.0) -> Region:
    """The region between the walls of a state, at a distance `away` [m] from them, and one period of its box."""
    normal = state.wall_normals.T
    return region(normal, state.walls.T + away * normal, state.box)


def _lengths(normal: Array, point: Array) -> Array:
    """Length of each line between the other half-planes, (w,)."""
    tangent = np.stack([-normal[1], normal[0]])
    slope = normal.T @ tangent  # [j, i]: rate at which line i enters half-plane j
    height = np.einsum("aj,aji->ji", normal, point[:, None, :] - point[:, :, None])
    cuts = np.abs(slope) > EXACT
    t = -height / np.where(cuts, slope, 1.0)
    low = np.where(cuts & (slope > 0.0), t, -np.inf).max(axis=0, initial=-np.inf)
    high = np.where(cuts & (slope < 0.0), t, np.inf).min(axis=0, initial=np.inf)
    # Of two identical walls the first bounds the region.
    w = np.arange(normal.shape[1])
    same = np.einsum("aj,ai->ji", normal, normal) > 0.0
    behind = (height < 0.0) | ((height == 0.0) & same & (w[:, None] < w))
    outside = (~cuts & behind & (w[:, None] != w)).any(axis=0)
    return np.where(outside, 0.0, np.maximum(high - low, 0.0))


def contains(region: Region, x: Array) -> Bools:
    """Whether points x (2, n) [m] lie in the region, (n,)."""
    inside = np.ones(x.shape[1], dtype=bool)
    for n, p in zip(region.normal.T, region.point.T, strict=True):
        inside &= n @ x >= n @ p
    return inside


def share_inside(region: Region, start: Array, end: Array) -> Array:
    """Share of each segment, start to end (2, k) [m], that lies in the region, (k,)."""
    low, high = np.zeros(start.shape[1]), np.ones(start.shape[1])
    for n, p in zip(region.normal.T, region.point.T, strict=True):
        a, b = n @ start - n @ p, n @ end - n @ p
        cut = a * b < 0.0
        t = a / np.where(cut, a - b, 1.0)
        low = np.where(cut & (a < 0.0), np.maximum(low, t), low)
        high = np.where(cut & (a > 0.0), np.minimum(high, t), high)
        high = np.where(~cut & (a + b < 0.0), -1.0, high)
    return np.maximum(high - low, 0.0)


def area_inside(region: Region, outlines: Outlines, x: Array, bodies: int) -> Array:
    """Area of each body's outline in the region, (bodies,) [m2]; exact for any simple polygons.

    For each half-plane, edges are split where they cross its line, and the parts outside are projected onto the line.
    Winding numbers inside the half-plane do not change and those outside become zero, so the signed area of the
    result is that of the intersection, convex or not.

    Parameters
    ----------
    x : (2, m) positions of the boundary points [m]
    """
    origin = region.point.mean(axis=1)[:, None] if region.point.size else np.zeros((2, 1))
    a, b, body = x - origin, x[:, outlines.next] - origin, outlines.body
    for n, p in zip(region.normal.T, (region.point - origin).T, strict=True):
        a, b, body = _projected(a, b, body, n, float(n @ p))
    return np.asarray(np.bincount(body, (a[0] * b[1] - a[1] * b[0]) / 2.0, bodies), dtype=np.float64)


def _projected(a: Array, b: Array, body: Ints, n: Array, level: float) -> tuple[Array, Array, Ints]:
    """Edges a to b (2, k) projected into n . x >= level."""
    s, t = n @ a - level, n @ b - level
    k = np.flatnonzero(s * t < 0.0)
    crossing = a[:, k] + s[k] / (s[k] - t[k]) * (b - a)[:, k]
    start, end = a - n[:, None] * np.minimum(s, 0.0), b - n[:, None] * np.minimum(t, 0.0)
    start, end = np.concatenate([start, crossing], axis=1), np.concatenate([end, end[:, k]], axis=1)
    end[:, k] = crossing
    return start, end, np.concatenate([body, body[k]])
