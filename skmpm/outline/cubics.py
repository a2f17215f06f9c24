"""The curve through the boundary points in one configuration: one cubic per segment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from skmpm.arrays import Array, Ints
from skmpm.compiled import compiled

if TYPE_CHECKING:
    from skmpm.outline.curve import Curve, Loops

MAX_NEWTON_STEPS, MAX_PARAMETER_STEP, PARAMETER_TOLERANCE = 8, 0.75, 1e-12  # of the projection, in units of s


@dataclass(frozen=True)
class Cubics:
    """The cubics X(s) = c0 + c1 s + c2 s^2 + c3 s^3 of the segments, 0 <= s <= 1."""

    curve: Curve
    x: Array  # (2, m) boundary points [m]
    c: Array  # (m, 4, 2) [m]

    def at(self, segment: Ints, s: Array, derivative: int = 0) -> Array:
        """Points of the curve (2, k) [m] or their derivatives with respect to s."""
        return _values(self.c, segment, s, derivative)

    def normals(self, segment: Ints, s: Array) -> Array:
        """Unit outward normals (2, k)."""
        slope = self.at(segment, s, 1)
        return np.asarray(np.stack([slope[1], -slope[0]]) / np.maximum(np.hypot(*slope), 1e-300))

    def seen_from(self, y: Array, segment: Ints, s: Array) -> tuple[Array, Array, Array]:
        """Unit outward normals (2, k) at points of the curve, and where y (2, k) lies relative to these points.

        In front by a distance (k,) [m], negative behind, and along the tangent by (k,) [segments].
        """
        normal, gap, along = np.empty_like(y), np.empty_like(s), np.empty_like(s)
        _see(y, self.c, segment, s, normal, gap, along)
        return normal, gap, along

    def area(self, bodies: int) -> Array:
        """Area enclosed by the curves of each body, without its holes, (bodies,) [m2]; 0 without outline.

        Half the integral of X x X' along the cubics, exactly: sum over i < j of (j - i) / (i + j) c_i x c_j / 2.
        """
        body = self.curve.outlines.body
        count = np.maximum(np.bincount(body, minlength=bodies), 1)
        origin = np.stack([np.bincount(body, component, bodies) / count for component in self.x])
        c = self.c.copy()
        c[:, 0] -= origin[:, body].T  # avoids cancellation far from the origin
        i, j = np.triu_indices(4, 1)
        cross = c[:, i, 0] * c[:, j, 1] - c[:, i, 1] * c[:, j, 0]
        return np.asarray(np.bincount(body, cross @ ((j - i) / (i + j)) / 2.0, bodies), dtype=np.float64)

    def perimeter(self, bodies: int) -> Array:
        """Length of the curves of each body, holes included, (bodies,) [m]; 0 without outline.

        By Gauss's quadrature with three points a segment.
        """
        places, weights = np.polynomial.legendre.leggauss(3)
        segment = np.arange(self.curve.outlines.size)
        speed = np.stack([np.hypot(*self.at(segment, np.full(segment.size, 0.5 + 0.5 * s), 1)) for s in places])
        return np.asarray(np.bincount(self.curve.outlines.body, 0.5 * weights @ speed, bodies), dtype=np.float64)

    def project(self, y: Array, segment: Ints, s: Array) -> tuple[Ints, Array]:
        """Closest-point projection of y (2, k): segments (k,) and parameters (k,), from initial guesses."""
        segment, s = segment.astype(np.int64), s.astype(np.float64)
        _project(y, segment, s, self.c, self.curve.loops)
        return segment, s


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
def _project(y: Array, segment: Ints, s: Array, c: Array, loops: Loops) -> None:
    """Overwrite the initial guesses `segment` and `s` (k,) by the projections of y (2, k)."""
    for k in range(s.size):
        segment[k], s[k] = foot((y[0, k], y[1, k]), segment[k], s[k], c, loops)


@compiled
def _values(c: Array, segment: Ints, s: Array, derivative: int) -> Array:
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
def _see(y: Array, c: Array, segment: Ints, s: Array, normal: Array, gap: Array, along: Array) -> None:
    """Write what `Cubics.seen_from` returns."""
    for k in range(s.size):
        normal[0, k], normal[1, k], gap[k], along[k] = seen((y[0, k], y[1, k]), c, segment[k], s[k])
