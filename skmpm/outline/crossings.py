"""Detection of outlines that intersect themselves, of bodies that are folded or pass through themselves."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from skmpm.arrays import EXACT, Array, Bools, Ints
from skmpm.compiled import compiled_in_order
from skmpm.outline.near import closest, inside
from skmpm.outline.topology import Outlines

# Total turns up to which a loop is taken to be free of self-intersections [rad]. Where a simple loop first touches
# itself its tangents are opposite, and the arc between the two points, which bounds the cavity, turns backward by pi;
# half of that allows for the discrete turns of a polygon and for one step beyond contact. A loop that folds at a
# point turns forward by 2 pi more than a simple loop.
MAX_BACKWARD_TURN, MAX_FORWARD_TURN = 0.5 * np.pi, 3.0 * np.pi
JUST_OUTSIDE = 1e-6  # [segments] from a boundary point along its normal


def crossings(outlines: Outlines, x: Array, chosen: Ints) -> Ints:
    """Pairs of segments of one body that intersect.

    Only bodies whose outlines turn backward by more than `MAX_BACKWARD_TURN` in total, or forward by more than
    `MAX_FORWARD_TURN`, are searched, which excludes convex bodies.

    Parameters
    ----------
    outlines, x : outlines, and positions (2, m) [m] of their boundary points
    chosen : indices of the bodies to be searched

    Returns
    -------
    (2, k) segments, the first < the second
    """
    segment = np.flatnonzero(np.isin(outlines.body, np.intersect1d(folded(outlines, x), chosen)))
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


def folded(outlines: Outlines, x: Array) -> Ints:
    """Bodies whose outlines turn so far that they may meet or cross themselves; convex ones never do."""
    forward, backward = turns(outlines, x)
    return np.flatnonzero((backward > MAX_BACKWARD_TURN) | (forward > MAX_FORWARD_TURN))


def depth(outlines: Outlines, x: Array, body: int) -> Array:
    """Depths at which boundary points of a body lie inside it, below the surface that they penetrate.

    A point lies inside if the outline winds around a place just outside the outline there. Its depth is the distance
    of the nearest segment whose outward normal opposes that of the point.

    Parameters
    ----------
    outlines, x : outlines, and positions (2, m) [m] of their boundary points
    body : index of the body

    Returns
    -------
    (k,) [m], of the points that lie inside
    """
    own = np.flatnonzero(outlines.body == body)
    if not own.size:
        return np.zeros(0)
    along = x[:, outlines.next[own]] - x[:, own]
    length = np.maximum(np.hypot(*along), 1e-300)
    both = along / length + (along / length)[:, outlines.previous[own] - own[0]]
    normal = np.stack([both[1], -both[0]])  # between those of the two edges
    c = np.flatnonzero(inside(outlines, x, body, x[:, own] + JUST_OUTSIDE * length.min() * normal))
    k, j = np.repeat(c, own.size), np.tile(np.arange(own.size), c.size)
    distance = closest(x[:, own[k]], x[:, own[j]], x[:, outlines.next[own[j]]])[1]
    opposes = normal[0, k] * along[1, j] - normal[1, k] * along[0, j] < 0.0
    return np.asarray(np.where(opposes, distance, np.inf).reshape(c.size, own.size).min(axis=1))


def turns(outlines: Outlines, x: Array) -> tuple[Array, Array]:
    """Total left and right turns along the outline of each body, (bodies,) each [rad]."""
    left, right = np.zeros((2, int(outlines.body.max(initial=-1)) + 1))
    _turns(x, outlines.previous, outlines.next, outlines.body, left, right)
    return left, right


@compiled_in_order
def _turns(x: Array, previous: Ints, following: Ints, body: Ints, left: Array, right: Array) -> None:
    """Add the left and right turns (bodies,) at boundary points; their difference is 2 pi for each turn of a tangent.

    The tangent has turned once more when it passes the direction of x, so that only right turns need their angles.
    """
    for i in range(body.size):
        h, j = previous[i], following[i]
        back_x, back_y, x_ahead, y_ahead = x[0, i] - x[0, h], x[1, i] - x[1, h], x[0, j] - x[0, i], x[1, j] - x[1, i]
        cross, along = back_x * y_ahead - back_y * x_ahead, back_x * x_ahead + back_y * y_ahead
        if cross < 0.0:
            turn = np.arctan2(-cross, along)
            right[body[i]] += turn
            left[body[i]] += turn
            if _upward(back_x, back_y) and not _upward(x_ahead, y_ahead):
                left[body[i]] -= 2.0 * np.pi
        elif _upward(x_ahead, y_ahead) and not _upward(back_x, back_y) and (cross > 0.0 or along < 0.0):
            left[body[i]] += 2.0 * np.pi


@compiled_in_order
def _upward(x: float, y: float) -> bool:
    """Whether a direction has an angle in [0, pi)."""
    return y > 0.0 or (y == 0.0 and x > 0.0)


def apart(outlines: Outlines, x: Array, i: Ints, j: Ints) -> Array:
    """Arc length (k,) [m] between segments i and j (k,) of an outline, the shorter way; inf between loops."""
    length = np.hypot(*(x[:, outlines.next] - x))
    begins = outlines.previous >= np.arange(outlines.size)
    loop, before = np.cumsum(begins) - 1, np.cumsum(length) - length
    arc = np.abs(before[i] - before[j])
    perimeter = np.bincount(loop, length)[loop[i]] if length.size else arc
    return np.asarray(np.where(loop[i] == loop[j], np.minimum(arc, perimeter - arc), np.inf))


def _separates(outlines: Outlines, x: Array, i: Ints, j: Ints) -> Bools:
    """Whether the ends of segment j lie on opposite sides of the line through segment i, beyond round-off, (k,)."""
    origin, along = x[:, i], x[:, outlines.next[i]] - x[:, i]
    first, second = (
        along[0] * (x[1, k] - origin[1]) - along[1] * (x[0, k] - origin[0]) for k in (j, outlines.next[j])
    )
    least = EXACT * np.hypot(*along) * float(np.ptp(x, axis=1).max())
    return np.asarray((np.minimum(first, second) < -least) & (np.maximum(first, second) > least))
