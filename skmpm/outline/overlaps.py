"""The area shared by two bodies, by integration and independently of contact detection."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array, Ints
from skmpm.compiled import compiled, compiled_in_order
from skmpm.outline.topology import Outlines
from skmpm.parallel import over_bodies


def overlap(outlines: Outlines, x: Array, bodies: int) -> tuple[Ints, Array]:
    """Return the area shared by each pair of bodies whose bounding boxes overlap.

    Parameters
    ----------
    outlines, x : outlines, and positions (2, m) [m] of their boundary points
    bodies : number of bodies

    Returns
    -------
    pairs : (2, p) bodies, the first < the second, sorted
    area : (p,) [m2]

    Notes
    -----
    The indicator function of a polygon is the signed sum of those of the trapezoids under its edges. The shared area
    is therefore the sum, over pairs of edges e, f of the two outlines, of sign_e sign_f times the integral of
    min(y_e, y_f) over their common abscissae, which is known in closed form. Exact for simple polygons, convex or
    not, with or without holes.
    """
    low, high = boxes(outlines, x, bodies)
    pairs = box_pairs(low, high)
    area, ends = np.zeros(pairs.shape[1]), np.searchsorted(outlines.body, np.arange(bodies + 1))
    work = np.append(0, np.cumsum(np.diff(ends)[pairs].sum(axis=0)))
    arguments = (pairs, low, high, x, outlines.next, ends, area)
    over_bodies(lambda first, last: _shared_areas(first, last, *arguments), work)
    return pairs, np.maximum(area, 0.0)


def boxes(outlines: Outlines, x: Array, bodies: int) -> tuple[Array, Array]:
    """Lower left and upper right corners (2, bodies) [m] of bounding boxes; inf and -inf without outline."""
    outlines.check(x, bodies)
    low, high = np.full((2, bodies), np.inf), np.full((2, bodies), -np.inf)
    _bound(x, outlines.body, low, high)
    return low, high


@compiled_in_order
def _bound(x: Array, body: Ints, low: Array, high: Array) -> None:
    """Widen boxes until they hold the points x (2, m) of their bodies (m,)."""
    for i in range(body.size):
        for axis in range(2):
            low[axis, body[i]] = min(low[axis, body[i]], x[axis, i])
            high[axis, body[i]] = max(high[axis, body[i]], x[axis, i])


def box_pairs(low: Array, high: Array) -> Ints:
    """Pairs (2, p), sorted, of boxes that share area; `low` and `high` (2, boxes) [m] are their corners."""
    real = np.flatnonzero(low[0] < high[0])
    i, j = _sharing(real[np.argsort(low[0, real], kind="stable")], low, high)
    order = np.lexsort((j, i))
    return np.stack([i[order], j[order]])


@compiled
def _sharing(order: Ints, low: Array, high: Array) -> Ints:
    """Pairs (2, p) of the boxes in `order`, ascending to the right, that share area, the first < the second."""
    found, size = np.empty((2, 4 * order.size + 4), dtype=np.int64), 0
    for k in range(order.size):
        a = order[k]
        for b in order[k + 1 :]:
            if low[0, b] >= high[0, a]:
                break
            if low[1, b] < high[1, a] and low[1, a] < high[1, b]:
                if size == found.shape[1]:
                    found = np.concatenate((found, found), axis=1)
                found[0, size], found[1, size] = min(a, b), max(a, b)
                size += 1
    return found[:, :size]


@compiled
def _shared_areas(
    first: int,
    last: int,
    pairs: Ints,
    low: Array,
    high: Array,
    x: Array,
    following: Ints,
    ends: Ints,
    area: Array,
) -> None:
    """Add the shared areas of pairs first:last of bodies with boxes `low` to `high` to `area` (p,), zero before."""
    most = 0
    for b in range(ends.size - 1):
        most = max(most, ends[b + 1] - ends[b])
    edges = np.empty((2, most, 4))
    for p in range(first, last):
        a, b = pairs[0, p], pairs[1, p]
        corner_x, corner_y = max(low[0, a], low[0, b]), max(low[1, a], low[1, b])
        size_x, size_y = min(high[0, a], high[0, b]) - corner_x, min(high[1, a], high[1, b]) - corner_y
        axis, width = (0, size_x) if size_x <= size_y else (1, size_y)
        origin = (corner_x, corner_y) if axis == 0 else (corner_y, corner_x)
        m = _edges_in(x, following, ends[a], ends[a + 1], axis, origin, width, edges[0])
        n = _edges_in(x, following, ends[b], ends[b + 1], axis, origin, width, edges[1])
        for i in range(m):
            for j in range(n):
                area[p] += _below_both(edges[0, i], edges[1, j])


@compiled
def _edges_in(
    x: Array,
    following: Ints,
    first: int,
    last: int,
    axis: int,
    origin: tuple[float, float],
    width: float,
    edges: Array,
) -> int:
    """Write the edges (k, 4) of boundary points first:last that meet 0 < u < width, and return their number.

    Each as u and v of its start and of its end, with u along the axis, both relative to the origin.
    """
    count = 0
    for i in range(first, last):
        j = following[i]
        u, end = x[axis, i] - origin[0], x[axis, j] - origin[0]
        if u != end and min(u, end) < width and max(u, end) > 0.0:
            edges[count, 0], edges[count, 1] = u, x[1 - axis, i] - origin[1]
            edges[count, 2], edges[count, 3] = end, x[1 - axis, j] - origin[1]
            count += 1
    return count


@compiled_in_order
def _below_both(e: Array, f: Array) -> float:
    """Signed integral of min(v_e, v_f) = (v_e + v_f)/2 - |v_e - v_f|/2 over the common abscissae of two edges.

    The sign of an edge is that of its direction, positive with the material below it; only products of signs count,
    which do not depend on the orientation of the axes.
    """
    left, right = max(min(e[0], e[2]), min(f[0], f[2])), min(max(e[0], e[2]), max(f[0], f[2]))
    if left >= right:
        return 0.0
    rise_e, rise_f = (e[3] - e[1]) / (e[2] - e[0]), (f[3] - f[1]) / (f[2] - f[0])
    a, b = e[1] + (left - e[0]) * rise_e, e[1] + (right - e[0]) * rise_e
    c, d = f[1] + (left - f[0]) * rise_f, f[1] + (right - f[0]) * rise_f
    p, q = abs(a - c), abs(b - d)
    apart = p + q
    if (a < c and b > d) or (a > c and b < d):
        apart = (p**2 + q**2) / apart
    same = (e[2] > e[0]) == (f[2] > f[0])
    return float((1.0 if same else -1.0) * (right - left) * (a + b + c + d - apart) / 4.0)
