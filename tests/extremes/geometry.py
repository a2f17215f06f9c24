"""Polygons of the boundary points, independent of the library: crossings, penetrations, overlap area."""

from __future__ import annotations

from itertools import combinations

import numpy as np

import skmpm

ROUNDING = 1e-12  # of the size of what is compared: products of lengths


def loops_of(scene: skmpm.Scene, state: skmpm.State, body: int) -> list[np.ndarray]:
    """The closed polygons through the boundary points of a body, each (2, m)."""
    return [state.x[:, scene.offsets[body] + loop] for loop in scene.bodies[body].points.outline]


def edges_of(loops: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Starts and ends (2, m) of all edges."""
    start = np.concatenate([np.zeros((2, 0)), *loops], axis=1)
    return start, np.concatenate([np.zeros((2, 0)), *(np.roll(loop, -1, axis=1) for loop in loops)], axis=1)


def inside(polygon: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Whether points x (2, n) lie inside a polygon (2, m): parity of the edges that a ray to the right crosses."""
    a, b = polygon[:, :, None], np.roll(polygon, -1, axis=1)[:, :, None]
    crosses = (a[1] > x[1]) != (b[1] > x[1])
    side = (x[0] - a[0]) * (b[1] - a[1]) - (x[1] - a[1]) * (b[0] - a[0])
    left = np.where(b[1] > a[1], side < 0.0, side > 0.0)
    return (crosses & left).sum(axis=0) % 2 == 1


def filled(loops: list[np.ndarray], x: np.ndarray) -> np.ndarray:
    """Whether points x (2, n) lie in the material between the loops, holes left out."""
    return np.logical_xor.reduce([np.zeros(x.shape[1], dtype=bool), *(inside(loop, x) for loop in loops)])


def crossings(loops: list[np.ndarray], within: float = np.inf) -> int:
    """Number of pairs of edges, of one loop or of two, that cross each other at inner points of both.

    With `within` [m] only pairs of one loop that are closer to each other along it: folds.
    """
    if not loops:
        return 0
    a, b = edges_of(loops)
    size = ROUNDING * float(np.square(np.ptp(a, axis=1)).sum())

    def side(p: np.ndarray, q: np.ndarray, x: np.ndarray) -> np.ndarray:
        area = (q[0] - p[0]) * (x[1] - p[1]) - (q[1] - p[1]) * (x[0] - p[0])
        return np.where(np.abs(area) <= size, 0.0, np.sign(area))

    first, second = (a[:, :, None], b[:, :, None]), (a[:, None], b[:, None])
    apart = side(*first, second[0]) * side(*first, second[1]) < 0.0
    crossed = apart & (side(*second, first[0]) * side(*second, first[1]) < 0.0)
    return int((crossed & (np.isinf(within) | (along(loops) < within))).sum()) // 2


def along(loops: list[np.ndarray]) -> np.ndarray:
    """The shorter way along a loop between the starts of its edges, (edges, edges) [m]; inf between two loops."""
    lengths = [np.hypot(*(np.roll(loop, -1, axis=1) - loop)) for loop in loops]
    way = np.full((sum(x.size for x in lengths),) * 2, np.inf)
    first = 0
    for length in lengths:
        start = np.cumsum(length) - length
        ahead = np.abs(start[:, None] - start)
        part = slice(first, first + length.size)
        way[part, part] = np.minimum(ahead, length.sum() - ahead)
        first += length.size
    return way


def deepest_in_itself(loops: list[np.ndarray]) -> float:
    """How far a vertex lies inside the polygon that it belongs to, from edges three away and more, at most [m].

    It does if the polygon winds around a place just outside its two edges.
    """
    if not loops:
        return 0.0
    depth, edges = 0.0, np.concatenate([[0], np.cumsum([loop.shape[1] for loop in loops])])
    for loop, first in zip(loops, edges, strict=False):
        edge = np.roll(loop, -1, axis=1) - loop
        unit = edge / np.hypot(*edge)
        both = unit + np.roll(unit, 1, axis=1)
        outside = loop + 1e-6 * np.hypot(*edge).min() * np.stack([both[1], -both[0]])
        for c in np.flatnonzero(filled(loops, outside)):
            a, b = edges_of(loops)
            near = first + (c + np.arange(-3, 3)) % loop.shape[1]
            kept = np.setdiff1d(np.arange(a.shape[1]), near)
            side = b[:, kept] - a[:, kept]
            share = (side * (loop[:, [c]] - a[:, kept])).sum(axis=0) / np.square(side).sum(axis=0)
            nearest = a[:, kept] + np.clip(share, 0.0, 1.0) * side
            depth = max(depth, float(np.hypot(*(loop[:, [c]] - nearest)).min()))
    return depth


def distance(loops: list[np.ndarray], x: np.ndarray) -> np.ndarray:
    """From points x (2, n) to the nearest edge, (n,)."""
    a, b = edges_of(loops)
    along = (b - a)[:, :, None]
    share = (along * (x[:, None] - a[:, :, None])).sum(axis=0) / np.square(along).sum(axis=0)
    nearest = a[:, :, None] + np.clip(share, 0.0, 1.0) * along
    return np.hypot(*(x[:, None] - nearest)).min(axis=0)


def deepest(scene: skmpm.Scene, state: skmpm.State) -> float:
    """How far a boundary point lies inside the polygon of another body, at most [m]."""
    loops, depth = [loops_of(scene, state, b) for b in range(len(scene.bodies))], 0.0
    for a, b in combinations(range(len(loops)), 2):
        for points, others in ((loops[a], loops[b]), (loops[b], loops[a])):
            x = np.concatenate([np.zeros((2, 0)), *points], axis=1)
            x = x[:, filled(others, x)]
            depth = max(depth, float(distance(others, x).max())) if x.size else depth
    return depth


def shared_points(scene: skmpm.Scene, state: skmpm.State) -> float:
    """Area of the points that lie inside another body, over that of all; boundaries touch by nature."""
    shared, inner = 0.0, np.ones(state.body.size, dtype=bool)
    inner[scene.outlines.point] = False
    for b in range(len(scene.bodies)):
        loops = loops_of(scene, state, b)
        if not loops:
            continue
        every = np.concatenate(loops, axis=1)
        near = (state.x > every.min(axis=1)[:, None]).all(axis=0) & (state.x < every.max(axis=1)[:, None]).all(axis=0)
        where = np.flatnonzero(near & inner & (state.body != b))
        if where.size:
            shared += float(state.weight[where[filled(loops, state.x[:, where])]].sum())
    return shared / float(state.weight.sum())


def shared_area(scene: skmpm.Scene, state: skmpm.State) -> float:
    """Area inside the polygons of two bodies, over that of all, counted on a lattice of h/20."""
    fine, shared = scene.cell / 20.0, 0.0
    for one, other in combinations([loops_of(scene, state, b) for b in range(len(scene.bodies))], 2):
        if not (one and other):
            continue
        low = np.maximum(*(np.concatenate(loops, axis=1).min(axis=1) for loops in (one, other)))
        high = np.minimum(*(np.concatenate(loops, axis=1).max(axis=1) for loops in (one, other)))
        if (low < high).all():
            axes = (np.arange(i + 0.5 * fine, j, fine) for i, j in zip(low, high, strict=True))
            x = np.stack(np.meshgrid(*axes)).reshape(2, -1)
            x = x[:, filled(one, x)]
            shared += float(filled(other, x).sum()) * fine**2
    return shared / float(state.weight.sum())
