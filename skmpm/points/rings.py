"""Discs and rings: points within, with exact moments, and on the boundary."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from skmpm.arrays import Array
from skmpm.points.cloud import Points
from skmpm.points.shapes import check_number
from skmpm.values import LENGTH, positive, vector


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
    c, R = vector("centre", centre), positive("radius", radius, LENGTH)
    h = positive("spacing", spacing, LENGTH)
    check_number(np.pi * R**2, h)
    return _rings(c, R * np.linspace(0.0, 1.0, max(1, round(R / h)) + 1), h)


def ring(centre: ArrayLike, inner: float, outer: float, *, spacing: float) -> Points:
    """Points of a ring, or of a tube in its cross-section: rings of equal thickness.

    Parameters
    ----------
    centre : (2,) position of the centre [m]
    inner, outer : radii [m]
    spacing : approximate distance between neighbouring points [m]

    Returns
    -------
    points and two loops of the outline, that of the hole clockwise

    Raises
    ------
    ValueError
        if a radius or the spacing is not positive, inner is not below outer, or the centre is not a finite point

    Notes
    -----
    Points of a ring lie at its root mean square radius and share its exact area equally. The innermost and the
    outermost ring have Radau rules with points on the boundaries. Area, centroid and second moments are exact.

    Examples
    --------
    >>> import skmpm
    >>> points = skmpm.ring((0, 0), 1e-3, 2e-3, spacing=2e-4)
    >>> len(points.outline)
    2
    >>> round(float(1e6 * points.volume.sum()), 3)
    9.425
    """
    c, h = vector("centre", centre), positive("spacing", spacing, LENGTH)
    a, b = positive("inner", inner, LENGTH), positive("outer", outer, LENGTH)
    if a >= b:
        raise ValueError(f"inner is {a:g} and outer {b:g}; give an inner radius below the outer one")
    check_number(np.pi * (b**2 - a**2), h)
    return _rings(c, np.linspace(a, b, max(2, round((b - a) / h)) + 1), h)


def _rings(c: Array, edges: Array, h: float) -> Points:
    """Points of rings about c (2,) between ascending radii (k,), of which the first is that of a hole or zero."""
    hole, area = edges[0] > 0.0, np.pi * np.diff(edges**2)
    radii = np.sqrt((edges[1:] ** 2 + edges[:-1] ** 2) / 2.0)
    r, share = _radau_ring(edges[-2], edges[-1])
    radii, area = np.append(radii[:-1], r), np.append(area[:-1], area[-1] * share)
    if hole:
        r, share = _radau_ring(edges[1], edges[0])
        radii, area = np.append(r[::-1], radii[1:]), np.append(area[0] * share[::-1], area[1:])
    counts = np.maximum(np.rint(2.0 * np.pi * radii / h).astype(np.int64), 8 if hole else 4)
    counts[-1] = max(8, counts[-1])
    ends, order = np.cumsum(counts), np.arange(counts.size)
    number = np.arange(ends[-1]) - np.repeat(ends - counts, counts)
    shift = 0.5 * ((order if hole else order[::-1]) % 2)  # rings are staggered; the last of a disc has a point at 0
    angle = 2.0 * np.pi * (number + np.repeat(shift, counts)) / np.repeat(counts, counts)
    x = c[:, None] + np.repeat(radii, counts) * np.stack([np.cos(angle), np.sin(angle)])
    outer, inner = np.arange(ends[-1] - counts[-1], ends[-1]), np.arange(counts[0])[::-1]
    return Points(x, np.repeat(area / counts, counts), (outer, inner) if hole else (outer,))


def _radau_ring(r0: float, R: float) -> tuple[Array, Array]:
    """Radii of the Radau rule of the ring between r0 and R, the second is R, and their shares of its area."""
    m1 = 2.0 / 3.0 * (R**2 + R * r0 + r0**2) / (R + r0)
    m2 = (R**2 + r0**2) / 2.0
    r2 = (m2 - m1 * R) / (m1 - R)
    share = (m1 - r2) / (R - r2)
    return np.array((r2, R)), np.array((1.0 - share, share))
