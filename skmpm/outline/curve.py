"""The smooth curve through the boundary points, the surface for contact with other bodies.

On each segment the curve is a cubic whose end tangents are means of the directions of two segments: on circles those
of the parabolas through three boundary points (Catmull & Rom 1974, with the reference lengths of the segments as
knots), with shares that `tangents` finds in the reference shape. The curve is a linear function of the boundary
points, its normal is continuous, straight parts are straight, and its deviation from a smooth outline through the
points is of fourth order in their spacing, that of the polygon of second order. Corners, where the boundary turns by
more than 50 degrees, remain corners and divide the outline into sides. At a re-entrant corner (notch) a side is
extended a little beyond its end, so that it still bounds the points in front of it there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.compiled import compiled, compiled_in_order
from skmpm.outline.cubics import Loops, backward_shares, project, values
from skmpm.outline.topology import Outlines

CORNER_COSINE = np.cos(np.deg2rad(50.0))  # of the turn: a regular octagon (45 degrees) is smooth, a hexagon is not
NOTCH_EXTENSION = 0.5  # [segments] extension of a side beyond a notch


@dataclass(frozen=True)
class Curve:
    """Tangents of the cubics as combinations of boundary points; topology and knots are those of the reference.

    Attributes
    ----------
    outlines : boundary points (m,) in closed loops
    corner : (m,) whether the boundary point is a corner of the reference outline
    convex : (m,) whether it is a corner that is convex in the current configuration
    sharp : (m,) convex corners and boundary points that deformation has made as sharp
    side : (m,) the side that each segment belongs to
    first : (3, m) tangent at the start of segment i -> next[i]: weights of previous[i], i, next[i]
    last : (3, m) tangent at its end: weights of i, next[i], next[next[i]]
    """

    outlines: Outlines
    corner: Bools
    convex: Bools
    sharp: Bools
    side: Ints
    first: Array
    last: Array

    @property
    def sides(self) -> int:
        """Upper bound of the numbers of sides, exclusive."""
        return int(self.side.max(initial=-1)) + 1

    def stencil(self, segment: Ints) -> Ints:
        """The four boundary points (4, k) that define the curve on segments (k,)."""
        boundary, j = self.outlines, self.outlines.next[segment]
        return np.stack([boundary.previous[segment], segment, j, boundary.next[j]])

    def shifted(self, point: Ints, shift: Array) -> tuple[Ints, Array]:
        """Segments (k,) and parameters (k,) of the places beside boundary points by shifts in (-1, 1) [segments]."""
        back = shift < 0.0
        return np.where(back, self.outlines.previous[point], point), np.where(back, 1.0 + shift, shift)

    def weights(self, segment: Ints, s: Array, derivative: int = 0) -> Array:
        """Weights (4, k) of the stencil in the curve at parameters s (k,) in [0, 1], or in its derivatives by s."""
        out = np.empty((4, segment.size))
        _weights(self.first, self.last, segment, np.asarray(s, dtype=np.float64), derivative, out)
        return out

    def through(self, x: Array) -> Cubics:
        """The curve through boundary points x (2, m) [m]."""
        c = np.empty((x.shape[1], 4, 2))
        _coefficients(x, self.outlines.previous, self.outlines.next, self.first, self.last, c)
        return Cubics(self, x, c)

    @cached_property
    def loops(self) -> Loops:
        """Topology and corners; parameters of the segments extend by `NOTCH_EXTENSION` beyond notches."""
        low = np.where(self.corner & ~self.convex, -NOTCH_EXTENSION, 0.0)
        following = self.outlines.next
        return Loops(
            self.outlines.previous, following, self.corner, self.convex, self.sharp, low, 1.0 - low[following]
        )

    def at_corner(self, segment: Ints, s: Array) -> Bools:
        """Whether points of the curve are corners or lie on the extension beyond a notch, (k,)."""
        start, end = self.corner[segment], self.corner[self.outlines.next[segment]]
        return np.asarray((start & (s <= 0.0)) | (end & (s >= 1.0)))


def curve(outlines: Outlines, x: Array, now: Array | None = None) -> Curve:
    """Smooth curve through boundary points, with the corners and knots of reference positions.

    Parameters
    ----------
    outlines : closed loops of the boundary points
    x : (2, m) reference positions [m]
    now : (2, m) positions [m], by default x, that decide which corners are convex, because a corner may fold inwards

    Returns
    -------
    the curve, of which `Curve.through` gives the cubics at any positions
    """
    corner, convex, sharp = np.empty((3, outlines.size), dtype=np.bool_)
    first, last = np.empty((2, 3, outlines.size))
    _tangents(x, outlines.previous, outlines.next, first, last, corner)
    _corners(x if now is None else now, outlines.previous, outlines.next, corner, convex, sharp)
    return Curve(outlines, corner, convex, sharp, _sides(outlines, corner), first, last)


@compiled_in_order
def _tangents(x: Array, previous: Ints, following: Ints, first: Array, last: Array, corner: Bools) -> None:
    """Write the weights of the tangents at both ends of the segments, and which boundary points are corners.

    They are means of the directions of the two segments at the point, times the length of the segment; at corners
    those of the chord.
    """
    length = np.empty(corner.size)
    for i in range(length.size):
        length[i] = _length(x, i, following[i])
    for i in range(length.size):
        corner[i] = _cosine(x, previous[i], i, following[i]) < CORNER_COSINE
    share = backward_shares(x, previous, following, corner)
    for i in range(length.size):
        j, here, back, front = following[i], length[i], length[previous[i]], length[following[i]]
        far, near = here / back * share[i], 1.0 - share[i]
        first[0, i], first[1, i], first[2, i] = (0.0, -1.0, 1.0) if corner[i] else (-far, far - near, near)
        far, near = here / front * (1.0 - share[j]), share[j]
        last[0, i], last[1, i], last[2, i] = (-1.0, 1.0, 0.0) if corner[j] else (-near, near - far, far)


@compiled_in_order
def _corners(
    x: Array,
    previous: Ints,
    following: Ints,
    corner: Bools,
    convex: Bools,
    sharp: Bools,
) -> None:
    """Write which corners are convex, and which boundary points are as sharp."""
    for i in range(corner.size):
        h, j = previous[i], following[i]
        left = (x[0, i] - x[0, h]) * (x[1, j] - x[1, i]) > (x[1, i] - x[1, h]) * (x[0, j] - x[0, i])
        convex[i] = corner[i] and left
        sharp[i] = convex[i] or (left and _cosine(x, h, i, j) < CORNER_COSINE)


@compiled_in_order
def _length(x: Array, i: int, j: int) -> float:
    """Distance of boundary points i and j, positive."""
    return float(max(np.sqrt((x[0, j] - x[0, i]) ** 2 + (x[1, j] - x[1, i]) ** 2), 1e-300))


@compiled_in_order
def _cosine(x: Array, h: int, i: int, j: int) -> float:
    """Cosine of the turn at boundary point i between h and j."""
    along = (x[0, i] - x[0, h]) * (x[0, j] - x[0, i]) + (x[1, i] - x[1, h]) * (x[1, j] - x[1, i])
    return float(along / (_length(x, h, i) * _length(x, i, j)))


@compiled
def _coefficients(x: Array, previous: Ints, following: Ints, first: Array, last: Array, c: Array) -> None:
    """Write the coefficients (m, 4, 2) of the cubics through boundary points x (2, m)."""
    for i in range(c.shape[0]):
        h, j = previous[i], following[i]
        k = following[j]
        for a in range(2):
            rise = x[a, j] - x[a, i]
            start = first[0, i] * x[a, h] + first[1, i] * x[a, i] + first[2, i] * x[a, j]
            end = last[0, i] * x[a, i] + last[1, i] * x[a, j] + last[2, i] * x[a, k]
            c[i, 0, a], c[i, 1, a] = x[a, i], start
            c[i, 2, a], c[i, 3, a] = 3.0 * rise - 2.0 * start - end, start + end - 2.0 * rise


def _sides(outlines: Outlines, corner: Bools) -> Ints:
    """Side of each segment (m,), numbered from corner to corner; a loop without corners is one side."""
    begins = outlines.previous >= np.arange(outlines.size)  # first point of each loop
    run = np.cumsum(corner | begins) - 1
    number = np.arange(int(run.max(initial=-1)) + 1)
    number[run[begins & ~corner]] = run[outlines.previous[begins & ~corner]]
    return np.asarray(number[run])


@compiled
def _weights(first: Array, last: Array, segment: Ints, s: Array, derivative: int, out: Array) -> None:
    """Write the weights (4, k) of the stencils from the tangents at the ends of the segments."""
    for k in range(segment.size):
        i = segment[k]
        start, at_start, end, at_end = _hermite(s[k], derivative)
        out[0, k] = at_start * first[0, i]
        out[1, k] = start + at_start * first[1, i] + at_end * last[0, i]
        out[2, k] = end + at_start * first[2, i] + at_end * last[1, i]
        out[3, k] = at_end * last[2, i]


@compiled
def _hermite(s: float, derivative: int) -> tuple[float, float, float, float]:
    """Cubic Hermite functions of start, tangent at the start, end, tangent at the end, or their first derivatives."""
    if derivative == 0:
        end = s * s * (3.0 - 2.0 * s)
        return 1.0 - end, s * (1.0 - s) ** 2, end, s * s * (s - 1.0)
    end = 6.0 * s * (1.0 - s)
    return -end, (1.0 - s) * (1.0 - 3.0 * s), end, s * (3.0 * s - 2.0)


@dataclass(frozen=True)
class Cubics:
    """The cubics X(s) = c0 + c1 s + c2 s^2 + c3 s^3 of the segments, 0 <= s <= 1.

    Attributes
    ----------
    curve : tangents as combinations of boundary points
    x : (2, m) boundary points [m]
    c : (m, 4, 2) coefficients [m]
    """

    curve: Curve
    x: Array
    c: Array

    def at(self, segment: Ints, s: Array, derivative: int = 0) -> Array:
        """Points of the curve (2, k) [m] or their derivatives with respect to s."""
        return values(self.c, segment, s, derivative)

    def normals(self, segment: Ints, s: Array) -> Array:
        """Unit outward normals (2, k)."""
        slope = self.at(segment, s, 1)
        return np.asarray(np.stack([slope[1], -slope[0]]) / np.maximum(np.hypot(*slope), 1e-300))

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
        project(y, segment, s, self.c, self.curve.loops)
        return segment, s
