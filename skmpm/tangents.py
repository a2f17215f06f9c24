"""Tangents of a smooth curve through the points of closed loops."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.compiled import compiled_in_order

STRAIGHT = 1e-4  # turns [rad] that are not told from none


@compiled_in_order
def backward_shares(x: Array, previous: Ints, following: Ints, corner: Bools) -> Array:
    """Shares (m,) of the direction of the segment behind each point x (2, m) in the tangent there.

    Where the curvature is the same on both sides they are those of the parabola through three points. Otherwise, with
    the curvatures p and q at the points ahead and behind, the odds of the segment behind are p (p + 5 q) to
    q (q + 5 p) times as large: exact to the next order in the spacing where the curvature varies, and a straight part
    stays straight beside an arc, as with Akima's tangents (J. ACM 17, 1970). Beside a `corner` (m,) the curvature is
    that of the point itself.
    """
    length, bend, share = np.empty((3, previous.size))
    for i in range(length.size):
        j = following[i]
        length[i] = max(np.sqrt((x[0, j] - x[0, i]) ** 2 + (x[1, j] - x[1, i]) ** 2), 1e-300)
    for i in range(length.size):
        h, j = previous[i], following[i]
        back_x, back_y, x_ahead, y_ahead = x[0, i] - x[0, h], x[1, i] - x[1, h], x[0, j] - x[0, i], x[1, j] - x[1, i]
        turn = np.arctan2(back_x * y_ahead - back_y * x_ahead, back_x * x_ahead + back_y * y_ahead)
        bend[i] = abs(turn) / (length[h] + length[i])
    for i in range(length.size):
        h, j = previous[i], following[i]
        around = length[h] + length[i]
        p, q = around * bend[i if corner[j] else j], around * bend[i if corner[h] else h]
        ahead = length[i] * (p * (p + 5.0 * q) + STRAIGHT**2)
        share[i] = ahead / (ahead + length[h] * (q * (q + 5.0 * p) + STRAIGHT**2))
    return share
