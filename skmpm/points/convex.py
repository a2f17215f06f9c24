"""Ellipses, capsules and rounded polygons: equidistant boundary points, and a triangular lattice inside."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from skmpm.arrays import Array
from skmpm.points.cloud import Points
from skmpm.points.fill import Curve, filled, rounded
from skmpm.values import LENGTH, number, positive, vector

ORIGIN = np.zeros((2, 1))


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
    a, b = (positive("semi_axes", value, LENGTH) for value in vector("semi_axes", semi_axes).tolist())

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
    L, R = positive("length", length, LENGTH), positive("radius", radius, LENGTH)
    x, y = L / 2.0 + R, R
    curve, _, area = rounded(np.array([[x, -x, -x, x], [y, y, -y, -y]]), R, ORIGIN)
    return _filled(curve, area, centre, spacing, angle)


def polygon(
    centre: ArrayLike, radius: float, sides: int, *, rounding: float, spacing: float, angle: float = 0.0
) -> Points:
    """Points of a regular polygon with rounded corners.

    Parameters
    ----------
    centre : (2,) position of the centre [m]
    radius : radius of the circle through the corners before rounding [m]
    sides : number of sides, three or more; the corners of eight and more, which turn by less than 50 degrees, are
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
    R, r = positive("radius", radius, LENGTH), positive("rounding", rounding, LENGTH)
    if not (isinstance(sides, int | np.integer) and sides >= 3):
        raise ValueError(f"sides is {sides!r}; give an integer of three or more")
    inradius = R * np.cos(np.pi / sides)
    if r >= inradius:
        raise ValueError(f"rounding is {r:g}; give less than the radius of the inscribed circle, {inradius:.6g}")
    turns = 2.0 * np.pi * np.arange(sides) / sides
    curve, _, area = rounded(R * np.stack([np.cos(turns), np.sin(turns)]), r, ORIGIN)
    return _filled(curve, area, centre, spacing, angle, alike=int(sides))


def _filled(curve: Curve, area: float, centre: ArrayLike, spacing: float, angle: float, alike: int = 2) -> Points:
    """The points within a curve about the origin, moved and turned.

    All of `alike` parts of the curve have as many boundary points, so that regular shapes have no long axis.
    """
    c, h = vector("centre", centre), positive("spacing", spacing, LENGTH)
    turn = number("angle", angle, "give a finite number")
    return filled([(curve, np.arange(alike) / alike)], area, h, ORIGIN).placed(c, turn, about=(0.0, 0.0))
