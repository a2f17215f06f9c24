"""Discs and boxes: points within, with exact moments, and on the boundary."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from skmpm.arrays import Array
from skmpm.points.cloud import Points

MOST = 2e7  # points of a body, whose run needs 24 GB


def disc(centre: ArrayLike, radius: float, *, spacing: float) -> Points:
    """Points of a disc: rings of equal thickness, the outermost points on the boundary.

    Parameters
    ----------
    centre : (2,) position of the centre [m]
    radius : radius of the disc [m]
    spacing : approximate distance between neighbouring points [m]

    Returns
    -------
    points and outline, for `Body`

    Raises
    ------
    ValueError
        if radius or spacing is not positive, or the centre is not a finite point

    Notes
    -----
    The points of a ring lie at its root mean square radius and share its exact area equally. The outermost ring has a
    two-point Radau rule in the radial direction (weight r dr, exact for 1, r, r2) with a point on the boundary. Area,
    centroid and second moments are exact. The outline is the boundary points, equally spaced, at least 8.

    Examples
    --------
    >>> import skmpm
    >>> points = skmpm.disc((0, 0), 1e-3, spacing=2e-4)
    >>> points.x.shape
    (2, 110)
    >>> round(float(1e6 * points.volume.sum()), 3)
    3.142
    """
    c, R = point("centre", centre), positive("radius", radius)
    h = positive("spacing", spacing)
    check_number(np.pi * R**2, h)
    edges = R * np.linspace(0.0, 1.0, max(1, round(R / h)) + 1)
    area = np.pi * np.diff(edges**2)
    radii = np.sqrt((edges[1:] ** 2 + edges[:-1] ** 2) / 2)
    inner, boundary, share = radau_ring(edges[-2], R)
    radii = np.append(radii[:-1], (inner, boundary))
    area = np.append(area[:-1], area[-1] * np.array((1 - share, share)))
    counts = np.maximum(np.rint(2 * np.pi * radii / h).astype(np.int64), 4)
    counts[-1] = max(8, counts[-1])

    position = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    shift = np.arange(counts.size)[::-1] % 2 / 2  # neighbouring rings are staggered, one boundary point is at angle 0
    angle = 2 * np.pi * (position + np.repeat(shift, counts)) / np.repeat(counts, counts)
    x = c[:, None] + np.repeat(radii, counts) * np.array((np.cos(angle), np.sin(angle)))
    return Points(x, np.repeat(area / counts, counts), (np.arange(position.size - counts[-1], position.size),))


def radau_ring(r0: float, R: float) -> tuple[float, float, float]:
    """Other radius and R of the Radau rule of the ring between r0 and R with a point at R, and the share there."""
    m1 = 2 / 3 * (R**2 + R * r0 + r0**2) / (R + r0)
    m2 = (R**2 + r0**2) / 2
    r2 = (m2 - m1 * R) / (m1 - R)
    return r2, R, (m1 - r2) / (R - r2)


def box(corner: ArrayLike, size: ArrayLike, *, spacing: float) -> Points:
    """Points of a rectangle: a tensor rule that includes edges and corners.

    Parameters
    ----------
    corner : (2,) lower left corner [m]
    size : (2,) width and height [m]
    spacing : approximate length of the intervals [m]

    Returns
    -------
    points and outline, for `Body`

    Raises
    ------
    ValueError
        if a size or the spacing is not positive, or the corner is not a finite point

    Notes
    -----
    In each direction the first and the last interval carry a two-point Radau rule that includes the end, the others a
    midpoint: area and first moments are exact, second moments of n intervals (n - 2) / n^3 too small, of 8 by 1.2 %.
    The boundary points are the outline.

    Examples
    --------
    >>> import skmpm
    >>> points = skmpm.box((0, 0), (2e-3, 1e-3), spacing=2e-4)
    >>> points.x.shape
    (2, 84)
    >>> round(float(1e6 * points.volume.sum()), 3)
    2.0
    """
    c, h = point("corner", corner), positive("spacing", spacing)
    width, height = (positive("size", length) for length in point("size", size).tolist())
    check_number(width * height, h)
    (x, u), (y, v) = (_radau_interval(length, h) for length in (width, height))
    index = np.arange(x.size * y.size).reshape(x.size, y.size)
    boundary = np.concatenate((index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]))
    position = c[:, None] + np.array((np.repeat(x, y.size), np.tile(y, x.size)))
    return Points(position, np.outer(u, v).ravel(), (boundary,))


def _radau_interval(L: float, h: float) -> tuple[Array, Array]:
    """Points and weights on [0, L]: Radau at both ends (1/4 there, 3/4 at two thirds), otherwise midpoints."""
    n = max(2, round(L / h))
    middle = np.arange(1, n - 1) + 0.5
    x = np.concatenate(((0, 2 / 3), middle, (n - 2 / 3, n))) / n
    w = np.concatenate(((1 / 4, 3 / 4), np.ones(n - 2), (3 / 4, 1 / 4))) / n
    return L * x, L * w


def check_number(area: float, spacing: float) -> None:
    """Raise ValueError if an area has more points a spacing apart than a computer holds."""
    if (number := area / spacing**2) > MOST:
        raise ValueError(
            f"spacing is {spacing:g}, at which an area of {area:.3g} has {number:.0e} points; give both in the same"
            " unit, metres, or a larger spacing"
        )


def positive(name: str, value: float) -> float:
    """The value; ValueError if it is not a finite number above zero."""
    if np.ndim(value) or not 0 < float(value) < np.inf:
        raise ValueError(f"{name} is {value!r}; give a finite number > 0")
    return float(value)


def not_negative(name: str, value: float) -> float:
    """The value; ValueError if it is not zero or a finite number above it."""
    if np.ndim(value) or not 0 <= float(value) < np.inf:
        raise ValueError(f"{name} is {value!r}; give 0 or a positive number")
    return float(value)


def point(name: str, value: ArrayLike) -> Array:
    """The value as an array (2,); ValueError if it is not two finite numbers."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.zeros(0)
    if array.shape != (2,) or not np.isfinite(array).all():
        raise ValueError(f"{name} is {value!r}; give two finite numbers")
    return array
