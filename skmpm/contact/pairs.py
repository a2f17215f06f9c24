"""Which contact points touch which curve or wall, where, and how far from it they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm import outline
from skmpm.outline import Curve, Outlines
from skmpm.scene import Scene

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

DEPTH = 1.0  # a point deeper than this many cells belongs to the other side of the body
FACING = -0.3  # largest cosine between the normals of two surfaces in contact


@dataclass(frozen=True)
class Neighbours:
    """Points and segments that stay all there can be as long as no rim point moves by more than half the margin."""

    curve: Curve
    reach: float
    margin: float
    point: Ints
    segment: Ints


def neighbours(scene: Scene, curve: Curve, rank: Ints, x: Array, reach: float, margin: float) -> Neighbours:
    """Who may touch whom: of two bodies the one of lower rank gives the points."""
    rim = curve.outlines
    point, segment = outline.candidates(rim, x, reach + margin)
    free = scene.deformable
    first, second = rim.body[point], rim.body[segment]
    kept = (rank[first] < rank[second]) & (free[first] | free[second])
    return Neighbours(curve, reach, margin, point[kept], segment[kept])


def _nearest(near: Neighbours, x: Array, farthest: float) -> tuple[Ints, Ints, Array]:
    """Of every point and every body near it the nearest segment, and where on it, if not farther than `farthest`."""
    rim, c, i = near.curve.outlines, near.point, near.segment
    s, distance = outline.closest(x[:, c], x[:, i], x[:, rim.next[i]])
    along = x[:, rim.next[i]] - x[:, i]
    # Of two segments that meet in the nearest point, a corner, the one that faces the point's own surface more.
    facing = np.einsum("ik,ik->k", outline.normals(rim, x)[:, c], np.stack([along[1], -along[0]]))
    order = np.lexsort((distance + 1e-6 * facing, rim.body[i], c))
    order = order[distance[order] < farthest]
    pair = np.stack([c[order], rim.body[i][order]])
    first = np.ones(order.size, dtype=bool)
    first[1:] = (pair[:, 1:] != pair[:, :-1]).any(axis=0)
    kept = order[first]
    return c[kept], i[kept], s[kept]


@dataclass(frozen=True)
class _Projections:
    """Rim points projected on the curves of other bodies."""

    point: Ints  # (k,) rim vertex
    segment: Ints  # (k,)
    s: Array  # (k,)
    normal: Array  # (2, k) from the curve to the point
    gap: Array  # (k,) [m]

    def __getitem__(self, chosen: Ints) -> _Projections:
        return _Projections(*(a[..., chosen] for a in self.__dict__.values()))


def _project(curve: Curve, x: Array, c: Ints, segment: Ints, s: Array) -> _Projections:
    """Project points c (k,) on curves, from a start nearby; a point off a corner sees the corner itself."""
    segment, s = curve.project(x, x[:, c], segment, s)
    apart, normal = x[:, c] - curve.at(x, segment, s), curve.normals(x, segment, s)
    gap, distance = np.einsum("ik,ik->k", apart, normal), np.hypot(*apart)
    # By the length of the segment, not of the gap: a point right on the corner has no direction of its own.
    along = np.abs(apart[0] * normal[1] - apart[1] * normal[0])
    off_corner = curve.at_corner(segment, s) & (along > 1e-6 * np.hypot(*curve.at(x, segment, s, 1)))
    beside = off_corner & (gap > 0.0)
    normal = np.where(beside, apart / np.where(beside, distance, 1.0), normal)
    return _Projections(c, segment, s, normal, np.where(beside, distance, gap))


@dataclass(frozen=True)
class Pairs:
    """The contacts of a configuration."""

    bodies: Ints  # (2, k)
    point: Ints  # (k,) rim vertex
    stencil: Ints  # (4, k) rim vertices that carry the other side; unused for walls
    weights: Array  # (4, k) their shares; zero for walls
    turning: Array  # (4, k) shares in the curve's unit tangent [1/m]; zero for walls and at corners
    curvature: Array  # (k,) of the curve, negative where it bulges [1/m]; zero for walls and at corners
    normal: Array  # (2, k) at x + theta dt w
    gap: Array  # (k,) [m] at its end
    before: Array  # (k,) [m] at its start
    friction: Array  # (k,)

    @staticmethod
    def joined(parts: list[Pairs]) -> Pairs:
        """All of them."""
        return Pairs(*(np.concatenate(a, axis=-1) for a in zip(*(p.__dict__.values() for p in parts), strict=True)))


def touching_bodies(scene: Scene, near: Neighbours, start: Array, moved: Array, theta: float, cell: float) -> Pairs:
    """Contacts between bodies."""
    curve, rim, after = near.curve, near.curve.outlines, start + moved
    end = _project(curve, after, *_nearest(near, after, DEPTH * cell))
    facing = np.einsum("ik,ik->k", outline.normals(rim, after)[:, end.point], end.normal)
    end = end[np.flatnonzero((end.gap > -DEPTH * cell) & (end.gap < near.reach) & (facing < FACING))]
    at, place = start + theta * moved, (end.point, end.segment, end.s)
    driving = end if theta == 1.0 else _project(curve, at, *place)
    begin = _project(curve, start, *place)
    speed = np.hypot(*curve.at(at, driving.segment, driving.s, 1))
    bend, smooth = curve.at(at, driving.segment, driving.s, 2), ~curve.at_corner(driving.segment, driving.s)
    return Pairs(
        bodies=rim.body[np.stack([end.point, end.segment])],
        point=end.point,
        stencil=curve.stencil(driving.segment),
        weights=curve.weights(driving.segment, driving.s),
        turning=np.where(smooth, curve.weights(driving.segment, driving.s, 1) / speed, 0.0),
        curvature=np.where(smooth, np.einsum("ik,ik->k", driving.normal, bend) / speed**2, 0.0),
        normal=driving.normal,
        gap=end.gap,
        before=begin.gap,
        friction=np.full(end.point.size, float(scene.friction)),
    )


def touching_wall(
    scene: Scene, rim: Outlines, i: int, start: Array, moved: Array, point: Array, step: Array, reach: float
) -> Pairs:
    """Contacts with wall i, which moves from `point` by `step`."""
    wall = scene.walls[i]
    normal = np.asarray(wall.normal, dtype=float)
    before = normal @ (start - point[:, None])
    gap = before + normal @ (moved - step[:, None])
    c = np.flatnonzero((gap < reach) & scene.deformable[rim.body])
    return Pairs(
        bodies=np.stack([rim.body[c], np.full(c.size, -1 - i)]),
        point=c,
        stencil=np.repeat(c[None], 4, axis=0),
        weights=np.zeros((4, c.size)),
        turning=np.zeros((4, c.size)),
        curvature=np.zeros(c.size),
        normal=np.repeat(normal[:, None], c.size, axis=1),
        gap=gap[c],
        before=before[c],
        friction=np.full(c.size, float(wall.friction)),
    )
