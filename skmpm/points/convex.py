"""Ellipses, capsules and rounded polygons: equidistant boundary points, and a triangular lattice inside."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import Delaunay, cKDTree

from skmpm.arrays import Array
from skmpm.points.cloud import Points
from skmpm.points.shapes import point, positive

# Least distance of a lattice point from the boundary, over the spacing. With 0.2, 0.3, 0.4, 0.6 and 0.8 a uniform
# stress is too small by 2.6, 2.7, 5.4, 12.6 and 13 % in the worst of 150 bodies whose points are 0.74 cells apart
# (`preflight.sampling`, ellipses, capsules and polygons as in tests/unit/test_shapes.py).
CLEARANCE = 0.3
# Points of a boundary, at least, and in every spacing, by which its length and distances from it are measured: those
# are too large by up to 0.03 spacings.
FINE, FINE_IN_SPACING = 2000, 4


def ellipse(centre: ArrayLike, semi_axes: ArrayLike, *, spacing: float, angle: float = 0.0) -> Points:
    """Points of an ellipse.

    Parameters
    ----------
    centre : (2,) position of the centre [m]
    semi_axes : (2,) half lengths along x and y before rotation [m]
    spacing : approximate distance between neighbouring points [m]
    angle : rotation about the centre, counter-clockwise [rad]

    Returns
    -------
    points and outline, for `Body`

    Raises
    ------
    ValueError
        if a semi-axis or the spacing is not positive, or the centre is not a finite point

    Examples
    --------
    >>> import skmpm
    >>> points = skmpm.ellipse((0, 0), (2e-3, 1e-3), spacing=2e-4)
    >>> points.x.shape
    (2, 215)
    >>> round(float(1e6 * points.volume.sum()), 3)
    6.283
    """
    a, b = (positive("semi_axes", value) for value in point("semi_axes", semi_axes).tolist())

    def curve(s: Array) -> Array:
        return np.stack([a * np.cos(2.0 * np.pi * s), b * np.sin(2.0 * np.pi * s)])

    return _filled(curve, np.pi * a * b, centre, spacing, angle)


def capsule(centre: ArrayLike, length: float, radius: float, *, spacing: float, angle: float = 0.0) -> Points:
    """Points of a capsule: a rectangle with half discs at its ends.

    Parameters
    ----------
    centre : (2,) position of the centre [m]
    length : length of the straight sides, along x before rotation [m]
    radius : radius of the half discs [m]
    spacing : approximate distance between neighbouring points [m]
    angle : rotation about the centre, counter-clockwise [rad]

    Returns
    -------
    points and outline, for `Body`

    Raises
    ------
    ValueError
        if a length, the radius or the spacing is not positive, or the centre is not a finite point

    Examples
    --------
    >>> import skmpm
    >>> points = skmpm.capsule((0, 0), length=2e-3, radius=1e-3, spacing=2e-4)
    >>> points.x.shape
    (2, 247)
    >>> round(float(1e6 * points.volume.sum()), 3)
    7.142
    """
    L, R = positive("length", length), positive("radius", radius)
    corners = np.array([[L / 2.0, -L / 2.0], [0.0, 0.0]])
    return _filled(_rounded(corners, R), 2.0 * L * R + np.pi * R**2, centre, spacing, angle)


def polygon(
    centre: ArrayLike, radius: float, sides: int, *, rounding: float, spacing: float, angle: float = 0.0
) -> Points:
    """Points of a regular polygon with rounded corners.

    Parameters
    ----------
    centre : (2,) position of the centre [m]
    radius : radius of the circle through the corners before rounding [m]
    sides : number of sides, three or more; the corners of ten and more, which turn by less than 50 degrees, are
        smooth in contact, and with arcs shorter than a spacing the polygon rolls like a round body
    rounding : radius of the arcs that replace the corners [m]; contact is smooth if it is a spacing or more
    spacing : approximate distance between neighbouring points [m]
    angle : rotation about the centre, counter-clockwise [rad]; at zero a corner lies at (radius, 0)

    Returns
    -------
    points and outline, for `Body`

    Raises
    ------
    ValueError
        if a length is not positive, there are fewer than three sides, or the arcs do not fit in the polygon

    Examples
    --------
    >>> import skmpm
    >>> points = skmpm.polygon((0, 0), 1e-3, sides=6, rounding=2e-4, spacing=2e-4)
    >>> points.x.shape
    (2, 91)
    >>> round(float(1e6 * points.volume.sum()), 3)
    2.585
    """
    R, r = positive("radius", radius), positive("rounding", rounding)
    if not (isinstance(sides, int | np.integer) and sides >= 3):
        raise ValueError(f"sides is {sides!r}; give an integer of three or more")
    inradius = R * np.cos(np.pi / sides)
    if r >= inradius:
        raise ValueError(f"rounding is {r:g}; give less than the radius of the inscribed circle, {inradius:.6g}")
    inner = (inradius - r) / np.cos(np.pi / sides)  # circle through the centres of the arcs
    turns = 2.0 * np.pi * np.arange(sides) / sides
    area = sides * inner**2 * np.sin(2.0 * np.pi / sides) / 2.0
    area += 2.0 * sides * inner * np.sin(np.pi / sides) * r + np.pi * r**2
    rounded = _rounded(inner * np.stack([np.cos(turns), np.sin(turns)]), r)
    return _filled(rounded, area, centre, spacing, angle, alike=sides)


def _rounded(corners: Array, radius: float) -> Callable[[Array], Array]:
    """The boundary of what lies within `radius` of a convex polygon (2, k), by its arc length from 0 to 1."""
    k = corners.shape[1]
    side = np.roll(corners, -1, axis=1) - corners
    length, heading = np.hypot(*side), np.arctan2(side[1], side[0])
    turn = np.mod(np.roll(heading, -1) - heading, 2.0 * np.pi)
    ends = np.concatenate([[0.0], np.cumsum(np.stack([length, radius * turn], axis=1).ravel())])

    def curve(s: Array) -> Array:
        along = s * ends[-1]
        piece = np.clip(np.searchsorted(ends, along, side="right") - 1, 0, 2 * k - 1)
        i, rest = piece // 2, along - ends[piece]
        on_arc = piece % 2 == 1
        phi = heading[i] + np.where(on_arc, rest / radius, 0.0)
        centre = corners[:, np.where(on_arc, (i + 1) % k, i)]
        forward = np.where(on_arc, 0.0, rest) * np.stack([np.cos(heading[i]), np.sin(heading[i])])
        return np.asarray(centre + forward + radius * np.stack([np.sin(phi), -np.cos(phi)]))

    return curve


def _filled(
    curve: Callable[[Array], Array], area: float, centre: ArrayLike, spacing: float, angle: float, alike: int = 2
) -> Points:
    """The points within a closed convex curve, counter-clockwise, a function of [0, 1); volumes have its area.

    All of `alike` parts of the curve have as many boundary points, so that regular shapes have no long axis.
    """
    c, h = point("centre", centre), positive("spacing", spacing)
    if not np.isfinite(angle):
        raise ValueError(f"angle is {angle!r}; give a finite number")
    s, fine, along = _finely(curve, FINE, alike)
    if FINE_IN_SPACING * along[-1] > FINE * h:
        s, fine, along = _finely(curve, int(np.ceil(FINE_IN_SPACING * along[-1] / h)), alike)
    count = alike * max(-(-8 // alike), round(along[-1] / h / alike))
    boundary = curve(np.interp(np.arange(count) / count * along[-1], along, s))
    x = np.concatenate([boundary, _lattice(fine[:, :-1], h)], axis=1)
    turned = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ x
    volume = _shares(x)
    return Points(c[:, None] + turned, volume * (area / volume.sum()), (np.arange(count),))


def _finely(curve: Callable[[Array], Array], pieces: int, alike: int) -> tuple[Array, Array, Array]:
    """Parameters from 0 to 1, points (2, n) and arc lengths of a curve in so many pieces, or a few more."""
    s = np.linspace(0.0, 1.0, alike * -(-pieces // alike) + 1)
    fine = curve(s)
    return s, fine, np.append(0.0, np.cumsum(np.hypot(*np.diff(fine, axis=1))))


def _lattice(boundary: Array, h: float) -> Array:
    """The points of a triangular lattice that lie inside a convex boundary (2, m) and not close to it, (2, k)."""
    reach = np.abs(boundary).max(axis=1)
    rows = np.arange(-int(reach[1] / (h * np.sqrt(0.75))) - 1, int(reach[1] / (h * np.sqrt(0.75))) + 2)
    columns = np.arange(-int(reach[0] / h) - 1, int(reach[0] / h) + 2)
    i, j = (a.ravel() for a in np.meshgrid(columns, rows))
    x = h * np.stack([i + 0.5 * (j % 2), np.sqrt(0.75) * j])
    distance, nearest = cKDTree(boundary.T).query(x.T)
    tangent = np.roll(boundary, -1, axis=1) - np.roll(boundary, 1, axis=1)
    offset = x - boundary[:, nearest]
    inside = tangent[0, nearest] * offset[1] - tangent[1, nearest] * offset[0] > 0.0
    return x[:, inside & (distance > CLEARANCE * h)]


def _shares(x: Array) -> Array:
    """The area of the triangles around each of the points (2, n) of a convex body, a third of each, (n,)."""
    corners = Delaunay(x.T).simplices
    a, b, c = x[:, corners[:, 0]], x[:, corners[:, 1]], x[:, corners[:, 2]]
    size = 0.5 * np.abs((b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0])
    return np.asarray(np.bincount(corners.ravel(), np.repeat(size, 3) / 3.0, x.shape[1]), dtype=np.float64)
