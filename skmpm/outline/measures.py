"""Area, perimeter, moments, normals and dimensions of outlines, exact for polygons with holes."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array, Ints
from skmpm.compiled import compiled, compiled_in_order
from skmpm.outline.curve import CORNER_COSINE
from skmpm.outline.topology import Outlines

TURNED_AWAY = 0.5  # sine of the largest angle between a segment and the plane of a contact it belongs to


def area(outlines: Outlines, x: Array, bodies: int) -> Array:
    """Area enclosed by the polygons of each body, without its holes.

    Parameters
    ----------
    outlines, x : outlines, and positions (2, m) [m] of their boundary points
    bodies : number of bodies

    Returns
    -------
    (bodies,) [m2]; 0 for a body without outline

    Examples
    --------
    >>> import skmpm
    >>> points = skmpm.disc((0, 0), 1.0, spacing=0.05)
    >>> outlines = skmpm.outline.outlines([points.outline], offsets=[0])
    >>> x = points.x[:, outlines.point]
    >>> skmpm.outline.area(outlines, x, bodies=1).round(2).tolist()
    [3.14]
    """
    outlines.check(x, bodies)
    areas = np.zeros(bodies)
    _areas(x, outlines.next, outlines.body, np.searchsorted(outlines.body, np.arange(bodies)), areas)
    return areas


@compiled
def _areas(x: Array, following: Ints, body: Ints, first: Ints, areas: Array) -> None:
    """Add the areas (bodies,) by Green's theorem about a point of each body, which avoids cancellation."""
    for i in range(body.size):
        j, k = following[i], first[body[i]]
        cross = (x[0, i] - x[0, k]) * (x[1, j] - x[1, k]) - (x[1, i] - x[1, k]) * (x[0, j] - x[0, k])
        areas[body[i]] += 0.5 * cross


def centroid(outlines: Outlines, x: Array, bodies: int) -> Array:
    """Centroid of each body.

    Parameters
    ----------
    outlines, x : outlines, and positions (2, m) [m] of their boundary points
    bodies : number of bodies

    Returns
    -------
    (2, bodies) [m]; nan for a body without area

    Examples
    --------
    >>> import skmpm
    >>> points = skmpm.disc((0, 0), 1.0, spacing=0.05)
    >>> outlines = skmpm.outline.outlines([points.outline], offsets=[0])
    >>> x = points.x[:, outlines.point]
    >>> bool(abs(skmpm.outline.centroid(outlines, x, bodies=1)).max() < 1e-9)
    True
    """
    return _moments(outlines, x, bodies)[1]


def second_moments(outlines: Outlines, x: Array, bodies: int) -> Array:
    """Second moments of each body: the integral of (x - c)(x - c)^T, c the centroid.

    Parameters
    ----------
    outlines, x : outlines, and positions (2, m) [m] of their boundary points
    bodies : number of bodies

    Returns
    -------
    (2, 2, bodies) [m4]; nan for a body without area
    """
    return _moments(outlines, x, bodies)[2]


def perimeter(outlines: Outlines, x: Array, bodies: int) -> Array:
    """Length of the outline of each body, holes included.

    Parameters
    ----------
    outlines, x : outlines, and positions (2, m) [m] of their boundary points
    bodies : number of bodies

    Returns
    -------
    (bodies,) [m]; 0 for a body without outline

    Examples
    --------
    >>> import skmpm
    >>> points = skmpm.disc((0, 0), 1.0, spacing=0.05)
    >>> outlines = skmpm.outline.outlines([points.outline], offsets=[0])
    >>> x = points.x[:, outlines.point]
    >>> skmpm.outline.perimeter(outlines, x, bodies=1).round(2).tolist()
    [6.28]
    """
    outlines.check(x, bodies)
    length = np.linalg.norm(x[:, outlines.next] - x, axis=0)
    return np.asarray(np.bincount(outlines.body, length, bodies), dtype=np.float64)


def normals(outlines: Outlines, x: Array) -> Array:
    """Unit outward normals at the boundary points: those of the chords between their neighbours.

    Parameters
    ----------
    outlines, x : outlines, and positions (2, m) [m] of their boundary points

    Returns
    -------
    (2, m); zero where the two neighbours coincide
    """
    out = np.empty((2, outlines.size))
    _normals(x, outlines.previous, outlines.next, out)
    return out


@compiled_in_order
def _normals(x: Array, previous: Ints, following: Ints, out: Array) -> None:
    """Write the normals at boundary points x (2, m)."""
    for i in range(out.shape[1]):
        h, j = previous[i], following[i]
        along_x, along_y = x[0, j] - x[0, h], x[1, j] - x[1, h]
        length = np.sqrt(along_x**2 + along_y**2)
        length = length if length > 0.0 else 1.0
        out[0, i], out[1, i] = along_y / length, -along_x / length


def bend(outlines: Outlines, x: Array) -> Array:
    """Convex curvature of the boundary at its points, (m,) [1/m]; zero where it is straight or turns right.

    It is that of the circle with two chords as long as the shorter segment.
    """
    length = np.hypot(*(x[:, outlines.next] - x))
    shorter = np.minimum(length, length[outlines.previous])
    turn = np.maximum(turning_angles(outlines, x), 0.0)
    return np.asarray(2.0 * np.sin(0.5 * turn) / np.maximum(shorter, 1e-300))


def half_segments(outlines: Outlines, x: Array, c: Ints, normal: Array) -> Array:
    """Half the lengths of the segments after and before boundary points c (k,) in contact, (2, k) [m].

    A segment that turns away from the plane of the contact, with the unit normal (2, k), by more than 30 degrees, at
    a corner, is not in contact and counts as zero. Several contacts at a point share its segments.
    """
    halves = []
    for neighbour in (outlines.next, outlines.previous):
        edge = x[:, neighbour[c]] - x[:, c]
        length = np.hypot(*edge)
        counts = np.einsum("ik,ik->k", normal, edge) <= TURNED_AWAY * length
        several = np.maximum(np.bincount(c[counts], minlength=outlines.size), 1)
        halves.append(np.where(counts, length / 2.0, 0.0) / several[c])
    return np.stack(halves)


def turning_angles(outlines: Outlines, x: Array) -> Array:
    """Left turns of the boundary at its points, (m,) in [-pi, pi] [rad]."""
    turns = np.empty(outlines.size)
    _turning_angles(x, outlines.previous, outlines.next, turns)
    return turns


@compiled_in_order
def _turning_angles(x: Array, previous: Ints, following: Ints, turns: Array) -> None:
    """Write the left turns at boundary points x (2, m)."""
    for i in range(turns.size):
        h, j = previous[i], following[i]
        back_x, back_y, x_ahead, y_ahead = x[0, i] - x[0, h], x[1, i] - x[1, h], x[0, j] - x[0, i], x[1, j] - x[1, i]
        turns[i] = np.arctan2(back_x * y_ahead - back_y * x_ahead, back_x * x_ahead + back_y * y_ahead)


def chord_sagitta(outlines: Outlines, x: Array, bodies: int) -> Array:
    """Largest sagitta of the chords of each body, (bodies,) [m]; corners and straight sides have none.

    A chord of length e of an arc that turns by phi has the sagitta e/2 tan(phi/4).
    """
    sagitta, turn = np.zeros(bodies), np.abs(turning_angles(outlines, x))
    turn = np.where(np.cos(turn) < CORNER_COSINE, 0.0, turn)
    turn = np.maximum(turn, turn[outlines.next])
    length = np.hypot(*(x[:, outlines.next] - x))
    np.maximum.at(sagitta, outlines.body, 0.5 * length * np.tan(0.25 * turn))
    return sagitta


def dimensions(outlines: Outlines, x: Array, bodies: int) -> tuple[Array, Array, Array]:
    """Extents of each body along the principal axes of its second moments.

    All are nan for a body without area. `long` can be smaller than `short`, for example in a wide body whose area is
    concentrated in a tall core.

    Parameters
    ----------
    outlines, x : outlines, and positions (2, m) [m] of their boundary points
    bodies : number of bodies

    Returns
    -------
    long, short : (bodies,) extents along the axes of the largest and of the smallest second moment [m]
    angle : (bodies,) of the long axis, in (-pi/2, pi/2] [rad]

    Examples
    --------
    >>> import skmpm
    >>> points = skmpm.ellipse((0, 0), (2.0, 1.0), spacing=0.05)
    >>> outlines = skmpm.outline.outlines([points.outline], offsets=[0])
    >>> x = points.x[:, outlines.point]
    >>> long, short, angle = skmpm.outline.dimensions(outlines, x, bodies=1)
    >>> long.round(1).tolist(), short.round(1).tolist()
    ([4.0], [2.0])
    """
    M = second_moments(outlines, x, bodies)
    angle = np.arctan2(2 * M[0, 1], M[0, 0] - M[1, 1]) / 2
    angle[angle <= -np.pi / 2] += np.pi
    axis = np.array((np.cos(angle), np.sin(angle)))
    across = np.array((-axis[1], axis[0]))
    return _extent(outlines, x, axis), _extent(outlines, x, across), angle


def _extent(outlines: Outlines, x: Array, axis: Array) -> Array:
    """Extent (bodies,) [m] of each body along its unit axis (2, bodies)."""
    extent = np.full(axis.shape[1], np.nan)
    if outlines.size:
        body, start = np.unique(outlines.body, return_index=True)
        along = (axis[:, outlines.body] * x).sum(axis=0)
        extent[body] = np.maximum.reduceat(along, start) - np.minimum.reduceat(along, start)
    return extent


def _moments(outlines: Outlines, x: Array, bodies: int) -> tuple[Array, Array, Array]:
    """Area, centroid, central second moments by Green's theorem; a local origin avoids cancellation."""
    outlines.check(x, bodies)
    body = outlines.body

    def total(values: Array) -> Array:
        return np.asarray(np.bincount(body, values, bodies), dtype=np.float64)

    count = np.maximum(np.bincount(body, minlength=bodies), 1)
    origin = np.array([total(component) for component in x]) / count
    a = x - origin[:, body]
    b = a[:, outlines.next]
    cross = a[0] * b[1] - a[1] * b[0]
    A = total(cross) / 2
    inverse = np.divide(1.0, A, out=np.full(bodies, np.nan), where=A != 0)
    c = np.array([total(component * cross) for component in a + b]) / 6 * inverse
    s = a + b
    M = np.empty((2, 2, bodies))
    for i, j in np.ndindex(2, 2):
        M[i, j] = total((s[i] * s[j] + a[i] * a[j] + b[i] * b[j]) * cross) / 24 - A * c[i] * c[j]
    return A, origin + c, M
