"""Outlines that cross themselves: bodies that a deformation has folded, or driven through themselves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from skmpm.outline.topology import Floats, Integers, Outlines

# Where a simple loop first touches itself its tangents are opposite, and the arc between the two places that bounds
# the cavity turns back by pi. Half of that leaves room for the turns of a polygon and for one step beyond. A loop
# that folds at a point goes round once more than a simple one.
ROUNDING = 1e-12  # of the extent of all bodies
BACKWARD, FORWARD = 0.5 * np.pi, 3.0 * np.pi  # [rad]


def crossings(outlines: Outlines, x: Floats, chosen: Integers) -> Integers:
    """Find segments (2, k) of one body that cross, among some bodies `chosen`; the first < the second.

    Only bodies that turn back by more than `BACKWARD` in all, or forward by more than `FORWARD`, are searched, which
    leaves out convex ones.

    Parameters
    ----------
    x : (2, m) positions of the boundary points [m]
    """
    forward, backward = turns(outlines, x)
    folded = np.flatnonzero((backward > BACKWARD) | (forward > FORWARD))
    segment = np.flatnonzero(np.isin(outlines.body, np.intersect1d(folded, chosen)))
    if segment.size == 0:
        return np.zeros((2, 0), dtype=np.int64)
    start, end = x[:, segment], x[:, outlines.next[segment]]
    longest = float(np.hypot(*(end - start)).max())
    near = cKDTree(0.5 * (start + end).T).query_pairs(longest * (1.0 + 1e-9), output_type="ndarray").T
    i, j = segment[near]
    apart = (outlines.body[i] == outlines.body[j]) & (outlines.next[i] != j) & (outlines.next[j] != i)
    i, j = i[apart], j[apart]
    cross = _separates(outlines, x, i, j) & _separates(outlines, x, j, i)
    return np.sort(np.stack([i[cross], j[cross]]), axis=0)


def turns(outlines: Outlines, x: Floats) -> tuple[Floats, Floats]:
    """Sums of the turns to the left and to the right along the outline of each body, (bodies,) [rad]."""
    ahead = x[:, outlines.next] - x
    back = ahead[:, outlines.previous]
    turn = np.arctan2(back[0] * ahead[1] - back[1] * ahead[0], (back * ahead).sum(axis=0))
    left, right = (np.bincount(outlines.body, np.maximum(way * turn, 0.0)) for way in (1.0, -1.0))
    return np.asarray(left, dtype=np.float64), np.asarray(right, dtype=np.float64)


def apart(outlines: Outlines, x: Floats, i: Integers, j: Integers) -> Floats:
    """Length of the outline between segments of one body, the shorter way (k,) [m]; inf between two loops."""
    length = np.hypot(*(x[:, outlines.next] - x))
    begins = outlines.previous >= np.arange(outlines.size)
    loop, before = np.cumsum(begins) - 1, np.cumsum(length) - length
    way = np.abs(before[i] - before[j])
    around = np.bincount(loop, length)[loop[i]] if length.size else way
    return np.asarray(np.where(loop[i] == loop[j], np.minimum(way, around - way), np.inf))


def _separates(outlines: Outlines, x: Floats, i: Integers, j: Integers) -> NDArray[np.bool_]:
    """Whether the line through segment i has the ends of segment j on its two sides, by more than rounding, (k,)."""
    origin, along = x[:, i], x[:, outlines.next[i]] - x[:, i]
    first, second = (
        along[0] * (x[1, k] - origin[1]) - along[1] * (x[0, k] - origin[0]) for k in (j, outlines.next[j])
    )
    least = ROUNDING * np.hypot(*along) * float(np.ptp(x, axis=1).max())
    return np.asarray((np.minimum(first, second) < -least) & (np.maximum(first, second) > least))
