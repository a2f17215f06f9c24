"""Compiled loops over closed curves: tangents at their points, cubics between these, closest-point projection."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.compiled import compiled, compiled_in_order

MAX_NEWTON_STEPS, MAX_PARAMETER_STEP, PARAMETER_TOLERANCE = 8, 0.75, 1e-12  # of the projection, in units of s
STRAIGHT = 1e-4  # turns [rad] that are not told from none


class Loops(NamedTuple):
    """Segments (m,) of a curve for compiled loops; each begins at a boundary point.

    Attributes
    ----------
    previous : (m,) segment before
    following : (m,) segment after
    corner : (m,) whether the segment begins at a corner
    convex : (m,) whether at one that is convex now
    sharp : (m,) as `Curve.sharp`
    low : (m,) smallest parameter
    high : (m,) largest parameter
    """

    previous: Ints
    following: Ints
    corner: Bools
    convex: Bools
    sharp: Bools
    low: Array
    high: Array


@compiled
def foot(y: tuple[float, float], segment: int, s: float, c: Array, loops: Loops) -> tuple[int, float]:
    """Segment and parameter of the point of a curve that is closest to y, from those of a first guess.

    Newton's method for (y - X(s)) . X'(s) = 0, with the second derivative of the squared distance bounded from below;
    iterates move on to adjacent segments and stop at corners. `c` (m, 4, 2) [m] are the cubics of the segments.
    """
    i, t = segment, s
    for _ in range(MAX_NEWTON_STEPS):
        apart, square, bend = 0.0, 0.0, 0.0
        for a in range(2):
            away = y[a] - (c[i, 0, a] + t * (c[i, 1, a] + t * (c[i, 2, a] + t * c[i, 3, a])))
            slope = c[i, 1, a] + t * (2.0 * c[i, 2, a] + 3.0 * t * c[i, 3, a])
            square += slope**2
            apart += away * slope
            bend += away * (2.0 * c[i, 2, a] + 6.0 * t * c[i, 3, a])
        step = apart / max(square - bend, 0.25 * square + 1e-300)
        t += min(max(step, -MAX_PARAMETER_STEP), MAX_PARAMETER_STEP)
        if t > 1.0 and not loops.corner[loops.following[i]]:
            i, t = loops.following[i], t - 1.0
        elif t < 0.0 and not loops.corner[i]:
            i, t = loops.previous[i], t + 1.0
        else:
            t = min(max(t, loops.low[i]), loops.high[i])
        if abs(step) < PARAMETER_TOLERANCE:
            break
    return i, min(max(t, loops.low[i]), loops.high[i])


@compiled
def place(c: Array, i: int, t: float) -> tuple[float, float]:
    """Point of the curve with cubics c (m, 4, 2) [m] on segment i at the parameter t in [0, 1] [m]."""
    x = c[i, 0, 0] + t * (c[i, 1, 0] + t * (c[i, 2, 0] + t * c[i, 3, 0]))
    y = c[i, 0, 1] + t * (c[i, 1, 1] + t * (c[i, 2, 1] + t * c[i, 3, 1]))
    return x, y


@compiled
def tangent(c: Array, i: int, t: float) -> tuple[float, float, float]:
    """Unit tangent of the curve on segment i at the parameter t, and the length of the derivative by t [m]."""
    x = c[i, 1, 0] + t * (2.0 * c[i, 2, 0] + 3.0 * t * c[i, 3, 0])
    y = c[i, 1, 1] + t * (2.0 * c[i, 2, 1] + 3.0 * t * c[i, 3, 1])
    speed = max(np.sqrt(x**2 + y**2), 1e-300)
    return x / speed, y / speed, speed


@compiled
def seen(y: tuple[float, float], c: Array, i: int, t: float) -> tuple[float, float, float, float]:
    """Unit outward normal of the curve on segment i at the parameter t, and where a position y lies relative to it.

    That is the distance in front of the curve [m], negative behind it, and along the tangent [segments].
    """
    along_x, along_y, speed = tangent(c, i, t)
    x = place(c, i, t)
    apart_x, apart_y = y[0] - x[0], y[1] - x[1]
    gap, along = apart_x * along_y - apart_y * along_x, apart_x * along_x + apart_y * along_y
    return along_y, -along_x, gap, along / speed


@compiled
def project(y: Array, segment: Ints, s: Array, c: Array, loops: Loops) -> None:
    """Overwrite the initial guesses `segment` and `s` (k,) by the projections of y (2, k)."""
    for k in range(s.size):
        segment[k], s[k] = foot((y[0, k], y[1, k]), segment[k], s[k], c, loops)


@compiled
def values(c: Array, segment: Ints, s: Array, derivative: int) -> Array:
    """Values (2, k) of the cubics c (m, 4, 2) of segments (k,), or their derivatives."""
    out = np.empty((2, segment.size))
    for k in range(segment.size):
        i, t = segment[k], s[k]
        for a in range(2):
            if derivative == 0:
                out[a, k] = c[i, 0, a] + t * (c[i, 1, a] + t * (c[i, 2, a] + t * c[i, 3, a]))
            elif derivative == 1:
                out[a, k] = c[i, 1, a] + t * (2.0 * c[i, 2, a] + 3.0 * t * c[i, 3, a])
            else:
                out[a, k] = 2.0 * c[i, 2, a] + 6.0 * t * c[i, 3, a]
    return out


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
