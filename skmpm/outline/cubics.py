"""Compiled loops over the cubics of a curve, one per segment: points, tangents, and closest-point projection."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.compiled import compiled

MAX_NEWTON_STEPS, MAX_PARAMETER_STEP, PARAMETER_TOLERANCE = 8, 0.75, 1e-12  # of the projection, in units of s


class Loops(NamedTuple):
    """What compiled loops need to know of the segments (m,) of a curve, in which each begins at a boundary point."""

    previous: Ints
    following: Ints
    corner: Bools
    convex: Bools
    sharp: Bools
    low: Array  # smallest and largest parameters
    high: Array


@compiled
def foot(y: tuple[float, float], segment: int, s: float, c: Array, loops: Loops) -> tuple[int, float]:
    """Closest-point projection of y on cubics c (m, 4, 2): segment and parameter, from an initial guess.

    Newton's method for (y - X(s)) . X'(s) = 0, with the second derivative of the squared distance bounded from
    below; iterates move on to adjacent segments and stop at corners.
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
    """The point of the cubics c (m, 4, 2) at parameter t of segment i."""
    x = c[i, 0, 0] + t * (c[i, 1, 0] + t * (c[i, 2, 0] + t * c[i, 3, 0]))
    y = c[i, 0, 1] + t * (c[i, 1, 1] + t * (c[i, 2, 1] + t * c[i, 3, 1]))
    return x, y


@compiled
def tangent(c: Array, i: int, t: float) -> tuple[float, float, float]:
    """The unit tangent there, and the length of the derivative by t."""
    x = c[i, 1, 0] + t * (2.0 * c[i, 2, 0] + 3.0 * t * c[i, 3, 0])
    y = c[i, 1, 1] + t * (2.0 * c[i, 2, 1] + 3.0 * t * c[i, 3, 1])
    speed = max(np.sqrt(x**2 + y**2), 1e-300)
    return x / speed, y / speed, speed


@compiled
def seen(y: tuple[float, float], c: Array, i: int, t: float) -> tuple[float, float, float, float]:
    """The unit outward normal there, and where y lies: in front by a distance, and along by so many segments."""
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


@compiled
def see(y: Array, c: Array, segment: Ints, s: Array, normal: Array, gap: Array, along: Array) -> None:
    """Write normals (2, k) of points of the curve, and where y (2, k) lies relative to them (`Cubics.seen_from`)."""
    for k in range(s.size):
        normal[0, k], normal[1, k], gap[k], along[k] = seen((y[0, k], y[1, k]), c, segment[k], s[k])
