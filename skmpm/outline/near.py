"""Spatial search: points near segments, points inside bodies, depths of overlaps, parts that face each other."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.compiled import compiled
from skmpm.outline.cubics import place, seen, tangent
from skmpm.outline.curve import Cubics
from skmpm.outline.measures import normals
from skmpm.outline.overlaps import boxes
from skmpm.outline.topology import Outlines, chunks, ranges
from skmpm.parallel import over_bodies

CHUNK = 1_000_000  # pairs processed at a time, which take about 100 MB
JUST_INSIDE = 1e-6  # [segments] from a boundary point against its normal
# Largest cosine between outward normals that face each other, -1 ideally: an angle of 96 degrees, so that the two
# sides of a re-entrant right angle do not.
MAX_FACING_COSINE = -0.1


def closest(x: Array, segment_start: Array, segment_end: Array) -> tuple[Array, Array]:
    """Return the closest point of one segment to each point.

    Parameters
    ----------
    x, segment_start, segment_end : (2, k) [m]

    Returns
    -------
    s : (k,) in [0, 1]: the closest point is (1 - s) start + s end
    distance : (k,) [m]

    Examples
    --------
    >>> import numpy as np
    >>> import skmpm
    >>> x, start, end = np.array([[0.25], [1.0]]), np.array([[0.0], [0.0]]), np.array([[1.0], [0.0]])
    >>> s, distance = skmpm.outline.closest(x, start, end)
    >>> s.tolist(), distance.tolist()
    ([0.25], [1.0])
    """
    t, d = segment_end - segment_start, x - segment_start
    square = (t**2).sum(axis=0)
    s = np.clip((t * d).sum(axis=0) / np.where(square > 0, square, 1.0), 0.0, 1.0)
    distance: Array = np.linalg.norm(d - s * t, axis=0)
    return s, distance


@compiled
def distance_to_segment(x: Array, c: int, j: int, i: int) -> tuple[float, float]:
    """The place in [0, 1] on the segment from j to i that is closest to the boundary point c, and its distance [m].

    All are boundary points x (2, m) [m].
    """
    along_x, along_y = x[0, i] - x[0, j], x[1, i] - x[1, j]
    dx, dy = x[0, c] - x[0, j], x[1, c] - x[1, j]
    square = along_x**2 + along_y**2
    s = min(max((along_x * dx + along_y * dy) / square, 0.0), 1.0) if square > 0.0 else 0.0
    return s, np.sqrt((dx - s * along_x) ** 2 + (dy - s * along_y) ** 2)


def candidates(
    outlines: Outlines,
    x: Array,
    reach: float,
    pairs: Ints,
    bend: Array | None = None,
    least: Array | None = None,
) -> tuple[Ints, Ints]:
    """Boundary points closer than a distance to segments of another body, and these segments, sorted.

    Segments (k,) are named by the points where they begin. `pairs` (2, p), sorted, are bodies that give points and
    bodies that give segments. Of a pair only points whose `bend` (m,) is more than its `least` (p,) are looked at.
    """
    bodies = int(outlines.body.max(initial=-1)) + 1
    low, high = boxes(outlines, x, bodies)
    bend = np.zeros(outlines.size) if bend is None else bend
    least = np.full(pairs.shape[1], -1.0) if least is None else least
    ends = np.searchsorted(outlines.body, np.arange(bodies + 1))
    first_pair, parts = np.searchsorted(pairs[0], np.arange(bodies + 1)), {}

    def search(first: int, last: int) -> None:
        own = slice(first_pair[first], first_pair[last])
        chosen = np.ascontiguousarray(pairs[:, own])
        parts[first] = _pairs(x, outlines.next, ends, low, high, reach, chosen, bend, least[own])

    over_bodies(search, ends)
    found = np.concatenate([parts[first] for first in sorted(parts)], axis=1)
    return found[0], found[1]


def both_ways(pairs: Ints) -> Ints:
    """Ordered pairs (2, 2 p), sorted, from unordered ones (2, p)."""
    both = np.concatenate([pairs, pairs[::-1]], axis=1)
    return both[:, np.lexsort(both[::-1])]


@compiled
def _pairs(
    x: Array,
    following: Ints,
    ends: Ints,
    low: Array,
    high: Array,
    reach: float,
    pairs: Ints,
    bend: Array,
    least: Array,
) -> Ints:
    """The points and segments (2, k) of `candidates`; boxes of bodies are `low` to `high` (2, bodies)."""
    found, size = np.empty((2, 4 * x.shape[1] + 16), dtype=np.int64), 0
    near, first = np.empty(x.shape[1], dtype=np.int64), np.empty(pairs.shape[1] + 1, dtype=np.int64)
    begin = 0
    while begin < pairs.shape[1]:
        a, end, count = pairs[0, begin], begin, 0
        while end < pairs.shape[1] and pairs[0, end] == a:  # the segments of its neighbours that are near a
            first[end] = count
            for j in range(ends[pairs[1, end]], ends[pairs[1, end] + 1]):
                i, inside = following[j], True
                for axis in range(2):
                    inside &= min(x[axis, i], x[axis, j]) - reach <= high[axis, a]
                    inside &= max(x[axis, i], x[axis, j]) + reach >= low[axis, a]
                if inside:
                    if count == near.size:
                        near = np.append(near, near)
                    near[count] = j
                    count += 1
            end += 1
        first[end] = count
        for c in range(ends[a], ends[a + 1]):
            for k in range(begin, end):
                b = pairs[1, k]
                if bend[c] <= least[k] or x[0, c] < low[0, b] - reach or x[0, c] > high[0, b] + reach:
                    continue
                if x[1, c] < low[1, b] - reach or x[1, c] > high[1, b] + reach:
                    continue
                for e in range(first[k], first[k + 1]):
                    j = near[e]
                    if distance_to_segment(x, c, j, following[j])[1] < reach:
                        if size == found.shape[1]:
                            found = np.concatenate((found, found), axis=1)
                        found[0, size], found[1, size] = c, j
                        size += 1
        begin = end
    return found[:, :size]


def inside(outlines: Outlines, x: Array, body: Ints | int, y: Array) -> Bools:
    """Return whether points lie inside a body, that is, whether its outlines wind around them (Sunday's algorithm).

    Parameters
    ----------
    outlines, x : outlines, and positions (2, m) [m] of their boundary points
    body : () or (k,) the body tested for each point
    y : (2, k) [m]

    Returns
    -------
    (k,) false for a body without outline; undetermined for a point on the outline
    """
    tested = np.broadcast_to(np.asarray(body, dtype=np.int64), y.shape[1:])
    first = np.searchsorted(outlines.body, tested)
    count = np.searchsorted(outlines.body, tested, side="right") - first
    winding: Array = np.zeros(tested.size)
    for part in chunks(count, CHUNK):
        k = np.repeat(np.arange(tested.size)[part], count[part])
        j = ranges(first[part], count[part])
        a, b = x[:, j] - y[:, k], x[:, outlines.next[j]] - y[:, k]
        up, down = (a[1] <= 0) & (b[1] > 0), (a[1] > 0) & (b[1] <= 0)
        left = a[0] * b[1] - a[1] * b[0]
        winding += np.bincount(k, (up & (left > 0)) * 1.0 - (down & (left < 0)), tested.size)
    result: Bools = winding != 0
    return result


def penetration(shape: Cubics, pairs: Ints) -> Array:
    """Return how deep (p,) [m] boundary points of either body of a pair (2, p), and middles of segments, lie inside.

    A place lies inside the other body if the outlines of that wind around a place just inside its own body. Its
    depth is its distance from the curve where normals are opposite: bodies that coincide overlap by their width.
    """
    outlines, x = shape.curve.outlines, shape.x
    bodies = int(outlines.body.max(initial=-1)) + 1
    ends, depth = np.searchsorted(outlines.body, np.arange(bodies + 1)), np.zeros(pairs.shape[1])
    work = np.append(0, np.cumsum(np.diff(ends)[pairs].sum(axis=0)))
    pairs = np.ascontiguousarray(pairs)
    arguments = (pairs, *boxes(outlines, x, bodies), x, normals(outlines, x), shape.c, outlines.next, ends, depth)
    over_bodies(lambda first, last: _penetration(first, last, *arguments), work)
    return depth


@compiled
def _penetration(
    first: int,
    last: int,
    pairs: Ints,
    low: Array,
    high: Array,
    x: Array,
    outward: Array,
    c: Array,
    following: Ints,
    ends: Ints,
    depth: Array,
) -> None:
    """Write the depths of pairs first:last; bodies have boxes `low` to `high`, boundary points normals `outward`."""
    for p in range(first, last):
        for side in range(2):
            a, b = pairs[side, p], pairs[1 - side, p]
            for i in range(ends[a], ends[a + 1]):
                for middle in range(2):
                    y, normal = (x[0, i], x[1, i]), (outward[0, i], outward[1, i])
                    along_x, along_y, size = tangent(c, i, 0.5 * middle)
                    if middle == 1:
                        y, normal = place(c, i, 0.5), (along_y, -along_x)
                    if low[0, b] <= y[0] <= high[0, b] and low[1, b] <= y[1] <= high[1, b]:
                        here = _depth(y, normal, JUST_INSIDE * size, x, c, following, ends[b], ends[b + 1])
                        depth[p] = max(depth[p], here)


@compiled
def _depth(
    y: tuple[float, float],
    normal: tuple[float, float],
    step: float,
    x: Array,
    c: Array,
    following: Ints,
    first: int,
    last: int,
) -> float:
    """Depth of y, the surface of another body with this normal there, below the segments first:last of one body."""
    inner_x, inner_y = y[0] - step * normal[0], y[1] - step * normal[1]
    winding, nearest, segment, at = 0, 1e300, -1, 0.0
    for j in range(first, last):
        i = following[j]
        start_x, start_y = x[0, j] - inner_x, x[1, j] - inner_y
        along_x, along_y = x[0, i] - x[0, j], x[1, i] - x[1, j]
        left = start_x * along_y - start_y * along_x
        if start_y <= 0.0 < start_y + along_y:
            winding += left > 0.0
        elif start_y + along_y <= 0.0 < start_y:
            winding -= left < 0.0
        if normal[0] * along_y - normal[1] * along_x < 0.0:
            s = -(start_x * along_x + start_y * along_y) / max(along_x**2 + along_y**2, 1e-300)
            s = min(max(s, 0.0), 1.0)
            distance = (start_x + s * along_x) ** 2 + (start_y + s * along_y) ** 2
            if distance < nearest:
                nearest, segment, at = distance, j, s
    if winding == 0 or segment < 0:
        return 0.0
    return float(-seen(y, c, segment, at)[2])


def facing(outlines: Outlines, x: Array, bodies: Ints, reach: float, depth: float) -> tuple[Ints, Ints]:
    """Boundary points in front of segments of their own body that face them, and these segments, sorted.

    They are closer than `reach` [m] to the segment, and at most `depth` [m] behind it, having penetrated it. Only
    `bodies` are searched.
    """
    c, j = candidates(outlines, x, reach, np.stack([bodies, bodies]))
    along = x[:, outlines.next[j]] - x[:, j]
    outward = np.stack([along[1], -along[0]]) / np.maximum(np.hypot(*along), 1e-300)
    opposite = np.einsum("ik,ik->k", normals(outlines, x)[:, c], outward) < MAX_FACING_COSINE
    in_front = np.einsum("ik,ik->k", x[:, c] - x[:, j], outward) > -depth
    return c[opposite & in_front], j[opposite & in_front]
