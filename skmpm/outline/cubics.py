"""The curve through the boundary points in one configuration: one cubic per segment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from skmpm.outline.topology import Floats, Integers

if TYPE_CHECKING:
    from skmpm.outline.curve import Curve

MAX_NEWTON_STEPS, MAX_PARAMETER_STEP, PARAMETER_TOLERANCE = 8, 0.75, 1e-12  # of the projection, in units of s


@dataclass(frozen=True)
class Cubics:
    """The cubics X(s) = c0 + c1 s + c2 s^2 + c3 s^3 of the segments, 0 <= s <= 1."""

    curve: Curve
    x: Floats  # (2, m) boundary points [m]
    c: Floats  # (m, 4, 2) [m]

    def at(self, segment: Integers, s: Floats, derivative: int = 0) -> Floats:
        """Points of the curve (2, k) [m] or their derivatives with respect to s."""
        return _value(self.c[segment].T, s, derivative)

    def normals(self, segment: Integers, s: Floats) -> Floats:
        """Unit outward normals (2, k)."""
        slope = self.at(segment, s, 1)
        return np.asarray(np.stack([slope[1], -slope[0]]) / np.maximum(np.hypot(*slope), 1e-300))

    def area(self, bodies: int) -> Floats:
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

    def project(self, y: Floats, segment: Integers, s: Floats) -> tuple[Integers, Floats]:
        """Closest-point projection of y (2, k): segments (k,) and parameters (k,), from initial guesses.

        Newton's method for (y - X(s)) . X'(s) = 0; iterates move on to adjacent segments and stop at corners.
        """
        segment, s = segment.copy(), s.copy()
        moving = np.arange(s.size)
        for _ in range(MAX_NEWTON_STEPS):
            i, t = segment[moving], s[moving]
            step = self._step(y[:, moving], i, t)
            segment[moving], s[moving] = self._walk(i, t + np.clip(step, -MAX_PARAMETER_STEP, MAX_PARAMETER_STEP))
            moving = moving[np.abs(step) >= PARAMETER_TOLERANCE]
            if moving.size == 0:
                break
        return segment, self.curve.kept(segment, s)

    def _step(self, y: Floats, segment: Integers, s: Floats) -> Floats:
        """Newton step in s, (k,), with the second derivative of the squared distance bounded from below."""
        c = self.c[segment].T
        (ax, ay), slope, bend = y - _value(c, s, 0), _value(c, s, 1), _value(c, s, 2)
        square = slope[0] ** 2 + slope[1] ** 2
        curvature = square - (ax * bend[0] + ay * bend[1])
        return np.asarray((ax * slope[0] + ay * slope[1]) / np.maximum(curvature, 0.25 * square + 1e-300))

    def _walk(self, segment: Integers, s: Floats) -> tuple[Integers, Floats]:
        """Move to the adjacent segment where s is beyond an end that is not a corner."""
        boundary, corner = self.curve.outlines, self.curve.corner
        onward, backward = (s > 1.0) & ~corner[boundary.next[segment]], (s < 0.0) & ~corner[segment]
        s = np.where(onward, s - 1.0, np.where(backward, s + 1.0, self.curve.kept(segment, s)))
        return np.where(onward, boundary.next[segment], np.where(backward, boundary.previous[segment], segment)), s


def _value(c: Floats, s: Floats, derivative: int) -> Floats:
    """Values (2, k) of cubics with coefficients c (2, 4, k), or their derivatives."""
    if derivative == 0:
        return np.asarray(c[:, 0] + s * (c[:, 1] + s * (c[:, 2] + s * c[:, 3])))
    if derivative == 1:
        return np.asarray(c[:, 1] + s * (2.0 * c[:, 2] + 3.0 * s * c[:, 3]))
    return np.asarray(2.0 * c[:, 2] + 6.0 * s * c[:, 3])
