"""The area shared by two bodies, by integration and independently of contact detection."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from skmpm.outline.topology import Floats, Integers, Outlines, chunks, ranges

CHUNK = 500_000  # pairs of edges processed at a time, which take about 100 MB


def overlap(outlines: Outlines, x: Floats, bodies: int) -> tuple[Integers, Floats]:
    """Return the area shared by each pair of bodies whose bounding boxes overlap.

    The indicator function of a polygon is the signed sum of those of the trapezoids under its edges. The shared area
    is therefore the sum, over pairs of edges e, f of the two outlines, of sign_e sign_f times the integral of
    min(y_e, y_f) over their common abscissae, which is known in closed form. Exact for simple polygons, convex or
    not, with or without holes.

    Returns
    -------
    pairs : (2, p) bodies, the first < the second, sorted
    area : (p,) [m2]
    """
    low, high = _boxes(outlines, x, bodies)
    pairs = _box_pairs(low, high)
    corner = np.maximum(low[:, pairs[0]], low[:, pairs[1]])
    size = np.minimum(high[:, pairs[0]], high[:, pairs[1]]) - corner
    first, second = (_edges_in(outlines, x, body, corner, size) for body in pairs)
    count = np.bincount(second.pair, minlength=pairs.shape[1])
    start = np.cumsum(count) - count
    area = np.zeros(pairs.shape[1])
    for part in chunks(count[first.pair], CHUNK):
        pair = first.pair[part]
        e = np.repeat(np.arange(first.pair.size)[part], count[pair])
        f = ranges(start[pair], count[pair])
        common = (first.left[e] < second.right[f]) & (second.left[f] < first.right[e])
        e, f = e[common], f[common]
        area += np.bincount(first.pair[e], _shared(first, e, second, f), area.size)
    return pairs, np.maximum(area, 0.0)


def lens_depth(shared: Floats, size: Floats) -> Floats:
    """Return the depth (p,) [m] of lenses of area `shared` (p,) between bodies of areas `size` (2, p) [m2].

    A lens of depth d between bodies of length L has an area of about d^1.5 L^0.5.
    """
    length = np.sqrt(np.maximum(size.min(axis=0), 1e-300))
    return np.asarray((shared / np.sqrt(length)) ** (2.0 / 3.0))


def _boxes(outlines: Outlines, x: Floats, bodies: int) -> tuple[Floats, Floats]:
    """Lower left and upper right corners (2, bodies) of the bounding boxes; inf and -inf without outline."""
    low, high = np.full((2, bodies), np.inf), np.full((2, bodies), -np.inf)
    if outlines.size:
        body, start = np.unique(outlines.body, return_index=True)
        low[:, body] = np.minimum.reduceat(x, start, axis=1)
        high[:, body] = np.maximum.reduceat(x, start, axis=1)
    return low, high


def _box_pairs(low: Floats, high: Floats) -> Integers:
    """Pairs (2, p) of boxes that share area, sorted."""
    real = np.flatnonzero(low[0] <= high[0])
    if real.size < 2:
        return np.zeros((2, 0), dtype=np.int64)
    low, high = low[:, real], high[:, real]
    reach = (high - low).max() * (1 + 1e-12)
    i, j = cKDTree((low + high).T / 2).query_pairs(reach, p=np.inf, output_type="ndarray").T
    share = (np.maximum(low[:, i], low[:, j]) < np.minimum(high[:, i], high[:, j])).all(axis=0)
    i, j = real[i[share]], real[j[share]]
    order = np.lexsort((j, i))
    return np.array((i[order], j[order]))


@dataclass(frozen=True, eq=False)
class _Edges:
    """Edges left < u < right of one body of each pair, in coordinates of the common window, sorted by pair."""

    pair: Integers  # (k,)
    left: Floats  # (k,)
    right: Floats
    at_left: Floats  # (k,) ordinate v at the left end
    at_right: Floats
    sign: Floats  # (k,) +1 if the material is below, -1 if above


def _edges_in(outlines: Outlines, x: Floats, body: Integers, corner: Floats, size: Floats) -> _Edges:
    """Edges of the body (p,) of each pair that intersect its window; u runs along the shorter side of the window."""
    first = np.searchsorted(outlines.body, body)
    count = np.searchsorted(outlines.body, body, side="right") - first
    pair, j = np.repeat(np.arange(body.size), count), ranges(first, count)
    axis, width = size.argmin(axis=0)[pair], size.min(axis=0)[pair]
    ends = np.array((j, outlines.next[j]))
    u, v = x[axis, ends] - corner[axis, pair], x[1 - axis, ends] - corner[1 - axis, pair]
    meets = (u[0] != u[1]) & (u.min(axis=0) < width) & (u.max(axis=0) > 0)
    u, v, pair = u[:, meets], v[:, meets], pair[meets]
    order = np.argsort(u, axis=0)
    left, right = np.take_along_axis(u, order, axis=0)
    at_left, at_right = np.take_along_axis(v, order, axis=0)
    return _Edges(pair, left, right, at_left, at_right, np.sign(u[0] - u[1]))


def _shared(first: _Edges, e: Integers, second: _Edges, f: Integers) -> Floats:
    """Signed integral of min(v_e, v_f) = (v_e + v_f)/2 - |v_e - v_f|/2 over the common abscissae."""
    left = np.maximum(first.left[e], second.left[f])
    right = np.minimum(first.right[e], second.right[f])
    (a, b), (c, d) = _ordinates(first, e, left, right), _ordinates(second, f, left, right)
    p, q = np.abs(a - c), np.abs(b - d)
    crossing = ((a < c) & (b > d)) | ((a > c) & (b < d))
    total = p + q
    apart = np.where(crossing, (p**2 + q**2) / np.where(crossing, total, 1.0), total)
    result: Floats = first.sign[e] * second.sign[f] * (right - left) * (a + b + c + d - apart) / 4
    return result


def _ordinates(edges: _Edges, e: Integers, left: Floats, right: Floats) -> tuple[Floats, Floats]:
    """Ordinates of edges e at two abscissae."""
    start, rise = edges.at_left[e], edges.at_right[e] - edges.at_left[e]
    run = edges.right[e] - edges.left[e]
    return start + (left - edges.left[e]) / run * rise, start + (right - edges.left[e]) / run * rise
