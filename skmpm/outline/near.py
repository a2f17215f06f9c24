"""Spatial search: boundary points near segments of other bodies, and points inside bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from skmpm.compiled import compiled
from skmpm.outline.topology import Floats, Integers, Outlines, chunks, ranges

CHUNK = 1_000_000  # pairs processed at a time, which take about 100 MB


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


@compiled
def distance_to_segment(x: Floats, c: int, j: int, i: int) -> tuple[float, float]:
    """The same for boundary point c of x (2, m) and the segment from boundary point j to i."""
    along_x, along_y = x[0, i] - x[0, j], x[1, i] - x[1, j]
    dx, dy = x[0, c] - x[0, j], x[1, c] - x[1, j]
    square = along_x**2 + along_y**2
    s = min(max((along_x * dx + along_y * dy) / square, 0.0), 1.0) if square > 0.0 else 0.0
    return s, np.hypot(dx - s * along_x, dy - s * along_y)


def candidates(outlines: Outlines, x: Floats, reach: float) -> tuple[Integers, Integers]:
    """Find the boundary points closer than `reach` to a segment of another body.

    Parameters
    ----------
    x : (2, m) [m]
    reach : [m]

    Returns
    -------
    c, j : (k,) boundary points and starts of segments (j, next[j]), sorted by c, then j
    """
    return closer_than(outlines, x, _near_other_boxes(outlines, x, reach), reach, same_body=False)


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


def closer_than(
    outlines: Outlines, x: Floats, chosen: Integers, reach: float, *, same_body: bool
) -> tuple[Integers, Integers]:
    """Pairs of the chosen boundary points and of the segments that begin at them, closer than `reach` [m].

    Either those of one body or those of two bodies, sorted by point, then by segment. The points are sorted into
    square bins of side `reach`, or larger so that bins are not more than points and segments do not cross many.
    """
    if chosen.size == 0:
        return chosen, chosen
    start, end = x[:, chosen], x[:, outlines.next[chosen]]
    low, size = start.min(axis=1), np.ptp(start, axis=1)
    mean_length = float(np.hypot(*(end - start)).mean())
    side = max(reach, mean_length, float(np.sqrt(size.prod() / chosen.size)), float(size.max()) / chosen.size)
    bins = (size / side).astype(np.int64) + 1
    bin_of_point = np.minimum(((start - low[:, None]) / side).astype(np.int64), bins[:, None] - 1)
    number = bins[1] * bin_of_point[0] + bin_of_point[1]
    ends = np.append(0, np.cumsum(np.bincount(number, minlength=int(bins.prod()))))
    sorted_points = chosen[np.argsort(number, kind="stable")]
    pairs = _pairs(x, outlines.next, outlines.body, chosen, sorted_points, ends, bins, low, side, reach, same_body)
    pairs.sort()
    return pairs // outlines.size, pairs % outlines.size


@compiled
def _pairs(
    x: Floats,
    following: Integers,
    body: Integers,
    segments: Integers,
    points: Integers,
    ends: Integers,
    bins: Integers,
    low: Floats,
    side: float,
    reach: float,
    same_body: bool,
) -> Integers:
    """The pairs of points in bins and segments, as m point + segment for m boundary points, in any order."""
    found, size = np.empty(4 * segments.size, dtype=np.int64), 0
    first, last = np.zeros(2, dtype=np.int64), np.zeros(2, dtype=np.int64)
    for j in segments:
        i = following[j]
        for axis in range(2):
            lower, upper = min(x[axis, i], x[axis, j]) - reach, max(x[axis, i], x[axis, j]) + reach
            first[axis] = min(max(int((lower - low[axis]) / side), 0), bins[axis])
            last[axis] = min(int((upper - low[axis]) / side), bins[axis] - 1) if upper >= low[axis] else -1
        for column in range(first[0], last[0] + 1):
            begin, end = bins[1] * column + first[1], bins[1] * column + last[1] + 1
            for k in range(ends[begin], ends[max(begin, end)]):
                c = points[k]
                if (body[c] == body[j]) == same_body and distance_to_segment(x, c, j, i)[1] < reach:
                    if size == found.size:
                        found = np.append(found, np.empty_like(found))
                    found[size] = x.shape[1] * c + j
                    size += 1
    return found[:size]


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
