"""Spatial search: boundary points near segments of other bodies, and points inside bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from skmpm.compiled import compiled
from skmpm.outline.topology import Floats, Integers, Outlines, chunks, ranges

CHUNK = 1_000_000  # pairs processed at a time, which take about 100 MB
LENGTH_RATIO = 4.0  # of the longest to the shortest segment in a search, whose radius depends on the longest


def closest(x: Floats, segment_start: Floats, segment_end: Floats) -> tuple[Floats, Floats]:
    """Return the closest point of one segment to each point.

    Parameters
    ----------
    x, segment_start, segment_end : (2, k) [m]

    Returns
    -------
    s : (k,) in [0, 1]: the closest point is (1 - s) start + s end
    distance : (k,) [m]
    """
    t, d = segment_end - segment_start, x - segment_start
    square = (t**2).sum(axis=0)
    s = np.clip((t * d).sum(axis=0) / np.where(square > 0, square, 1.0), 0.0, 1.0)
    distance: Floats = np.linalg.norm(d - s * t, axis=0)
    return s, distance


def candidates(outlines: Outlines, x: Floats, reach: float) -> tuple[Integers, Integers]:
    """Find the boundary points closer than `reach` to a segment of another body.

    Exact for segments of any length: for each group of segments of similar length a tree search finds the midpoints
    within `reach` plus half the longest segment; the candidates are then selected by their distance to the segment.

    Parameters
    ----------
    x : (2, m) [m]
    reach : [m]

    Returns
    -------
    c, j : (k,) boundary points and starts of segments (j, next[j]), sorted by c, then j
    """
    c, j = pairs_by_midpoints(outlines, x, _near_other_boxes(outlines, x, reach), reach)
    other = outlines.body[c] != outlines.body[j]
    return nearer(outlines, x, c[other], j[other], reach)


def _near_other_boxes(outlines: Outlines, x: Floats, reach: float) -> Integers:
    """Boundary points whose segments come closer than `reach` to the bounding box of another body, ascending."""
    if outlines.size == 0:
        return np.arange(0)
    first = np.flatnonzero(np.diff(outlines.body, prepend=-1))
    low, high = np.minimum.reduceat(x, first, axis=1) - reach, np.maximum.reduceat(x, first, axis=1) + reach
    order = np.argsort(low[0])
    last = np.searchsorted(low[0], high[0], side="right", sorter=order)
    one = np.repeat(order, last[order] - np.arange(order.size) - 1)
    two = order[ranges(np.arange(order.size) + 1, last[order] - np.arange(order.size) - 1)]
    overlap = (low[1, one] <= high[1, two]) & (low[1, two] <= high[1, one])
    own, box = np.concatenate([[one[overlap], two[overlap]], [two[overlap], one[overlap]]], axis=1)
    chosen = np.zeros(outlines.size, dtype=np.bool_)
    _reach_boxes(x, outlines.next, np.append(first, outlines.size), own, box, low, high, chosen)
    return np.flatnonzero(chosen)


@compiled
def _reach_boxes(
    x: Floats,
    following: Integers,
    first: Integers,
    own: Integers,
    box: Integers,
    low: Floats,
    high: Floats,
    chosen: Any,
) -> None:
    """Choose the segments of bodies own[k] that overlap with the box of body box[k], low to high (2, bodies)."""
    for k in range(own.size):
        b = box[k]
        for j in range(first[own[k]], first[own[k] + 1]):
            i, inside = following[j], True
            for axis in range(2):
                inside &= min(x[axis, i], x[axis, j]) <= high[axis, b] and max(x[axis, i], x[axis, j]) >= low[axis, b]
            chosen[j] |= inside


def pairs_by_midpoints(outlines: Outlines, x: Floats, chosen: Integers, reach: float) -> tuple[Integers, Integers]:
    """Pairs of boundary points and segments among those chosen, with all that are closer than `reach` [m]."""
    if chosen.size == 0:
        return chosen, chosen
    start, end = x[:, chosen], x[:, outlines.next[chosen]]
    length = np.maximum(np.linalg.norm(end - start, axis=0), np.finfo(np.float64).tiny)
    family = np.floor(np.log(length.max() / np.maximum(length, 1e-9 * length.max())) / np.log(LENGTH_RATIO))
    tree = _tree(start)
    found = []
    for k in np.unique(family):
        members = np.flatnonzero(family == k)
        middles = _tree((start[:, members] + end[:, members]) / 2)
        c, j = _pairs(tree, middles, reach + length[members].max() / 2)
        found.append((c, members[j]))
    c, j = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return chosen[c], chosen[j]


def nearer(outlines: Outlines, x: Floats, c: Integers, j: Integers, reach: float) -> tuple[Integers, Integers]:
    """Of pairs of boundary points c (k,) and segments j (k,) those closer than `reach` [m], sorted by c, then j."""
    near = closest(x[:, c], x[:, j], x[:, outlines.next[j]])[1] < reach
    c, j = c[near], j[near]
    order = np.argsort(c * outlines.size + j)
    return c[order], j[order]


def _tree(x: Floats) -> Any:
    return cKDTree(x.T, balanced_tree=False, compact_nodes=False)  # cheaper to build, and searched only once


def _pairs(tree: Any, other: Any, radius: float) -> tuple[Integers, Integers]:
    pairs: NDArray[Any] = tree.sparse_distance_matrix(other, radius * (1 + 1e-12), output_type="ndarray")
    return pairs["i"], pairs["j"]


def inside(outlines: Outlines, x: Floats, body: Integers | int, y: Floats) -> NDArray[np.bool_]:
    """Return whether points lie inside a body, that is, whether its outlines wind around them (Sunday's algorithm).

    Parameters
    ----------
    x : (2, m) [m]
    body : () or (k,) the body tested for each point
    y : (2, k) [m]

    Returns
    -------
    (k,) false for a body without outline; undetermined for a point on the outline
    """
    tested = np.broadcast_to(np.asarray(body, dtype=np.int64), y.shape[1:])
    first = np.searchsorted(outlines.body, tested)
    count = np.searchsorted(outlines.body, tested, side="right") - first
    winding: Floats = np.zeros(tested.size)
    for part in chunks(count, CHUNK):
        k = np.repeat(np.arange(tested.size)[part], count[part])
        j = ranges(first[part], count[part])
        a, b = x[:, j] - y[:, k], x[:, outlines.next[j]] - y[:, k]
        up, down = (a[1] <= 0) & (b[1] > 0), (a[1] > 0) & (b[1] <= 0)
        left = a[0] * b[1] - a[1] * b[0]
        winding += np.bincount(k, (up & (left > 0)) * 1.0 - (down & (left < 0)), tested.size)
    result: NDArray[np.bool_] = winding != 0
    return result
