"""Detection of outlines that intersect themselves, of bodies that are folded or pass through themselves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from skmpm.outline.measures import turning_angles
from skmpm.outline.topology import Floats, Integers, Outlines

# Total turns up to which a loop is taken to be free of self-intersections [rad]. Where a simple loop first touches
# itself its tangents are opposite, and the arc between the two points, which bounds the cavity, turns backward by pi;
# half of that allows for the discrete turns of a polygon and for one step beyond contact. A loop that folds at a
# point turns forward by 2 pi more than a simple loop.
MAX_BACKWARD_TURN, MAX_FORWARD_TURN = 0.5 * np.pi, 3.0 * np.pi
ROUND_OFF = 1e-12  # of coordinates, relative to the extent of all bodies


def crossings(outlines: Outlines, x: Floats, chosen: Integers) -> Integers:
    """Find pairs (2, k) of segments of one body that intersect, for the bodies `chosen`; the first < the second.

    Only bodies whose outlines turn backward by more than `MAX_BACKWARD_TURN` in total, or forward by more than
    `MAX_FORWARD_TURN`, are searched, which excludes convex bodies.

    Parameters
    ----------
    x : (2, m) positions of the boundary points [m]
    chosen : indices of bodies
    """
    forward, backward = turns(outlines, x)
    folded = np.flatnonzero((backward > MAX_BACKWARD_TURN) | (forward > MAX_FORWARD_TURN))
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
    """Total left and right turns along the outline of each body, (bodies,) [rad]."""
    turn = turning_angles(outlines, x)
    left, right = (np.bincount(outlines.body, np.maximum(sign * turn, 0.0)) for sign in (1.0, -1.0))
    return np.asarray(left, dtype=np.float64), np.asarray(right, dtype=np.float64)


def apart(outlines: Outlines, x: Floats, i: Integers, j: Integers) -> Floats:
    """Arc length between segments i and j of one outline, the shorter of both (k,) [m]; inf between two loops."""
    length = np.hypot(*(x[:, outlines.next] - x))
    begins = outlines.previous >= np.arange(outlines.size)
    loop, before = np.cumsum(begins) - 1, np.cumsum(length) - length
    arc = np.abs(before[i] - before[j])
    perimeter = np.bincount(loop, length)[loop[i]] if length.size else arc
    return np.asarray(np.where(loop[i] == loop[j], np.minimum(arc, perimeter - arc), np.inf))


def _separates(outlines: Outlines, x: Floats, i: Integers, j: Integers) -> NDArray[np.bool_]:
    """Whether the ends of segment j lie on opposite sides of the line through segment i, beyond round-off, (k,)."""
    origin, along = x[:, i], x[:, outlines.next[i]] - x[:, i]
    first, second = (
        along[0] * (x[1, k] - origin[1]) - along[1] * (x[0, k] - origin[0]) for k in (j, outlines.next[j])
    )
    least = ROUND_OFF * np.hypot(*along) * float(np.ptp(x, axis=1).max())
    return np.asarray((np.minimum(first, second) < -least) & (np.maximum(first, second) > least))
