"""Points of a polygon or a digitised contour, with holes: corners stay, the rest of the boundary is resampled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skmpm.arrays import Array
from skmpm.outline import area as measured_area
from skmpm.outline import centroid, outlines
from skmpm.outline.curve import CORNER_COSINE
from skmpm.outline.tips import tip_angles
from skmpm.outline.widths import thickness
from skmpm.points.cloud import Points, check_crossings, encloses, signed_area
from skmpm.points.fill import FINE, FINE_IN_SPACING, Curve, consecutive, filled, rounded
from skmpm.points.shapes import check_number
from skmpm.values import LENGTH, not_negative, positive

# Spacings to either side of a vertex over which its turn is taken, and from corner to corner: the steps of a contour
# along pixels of 0.2 spacings make at most two corners, those of 0.3 make 26 of 209 points.
SEEN = 0.5
# Of gears and stars of 0.3 to 3 spacings the polygon of the boundary points, which is up to 0.35 spacings off the
# boundary, had up to 28 % too much area. Eight points on a circle, as of a small `disc`, lose 10 %.
MAX_AREA_ERROR = 10.0  # [%]
# [spacings] of the thinnest part. A uniform stress in inclined strips 20 long, with points 0.74 cells apart, is wrong
# by up to 9, 5, 5, 2 and 1 % at widths of 0.2, 0.3, 0.5, 1 and 2.5; of combs with thinner teeth corners are lost.
THINNEST = 0.5
REPEATED = 1e-6  # [spacings] between vertices that are one: beside nearly equal ones round-off made sides cross


def from_outline(
    vertices: ArrayLike | Sequence[ArrayLike], *, spacing: float, rounding: float = 0.0, smoothing: float = 0.0
) -> Points:
    """Points of a polygon or of a digitised contour, which may be concave and have holes.

    Boundary points lie on the polygon, about a spacing apart. Its corners are among them, vertices at which it turns
    by more than 50 degrees over half a spacing; without one the intervals are equal all around.

    Parameters
    ----------
    vertices : (2, n) boundary in order, in either sense [m]; or a list of such loops, first the outer one, then holes
    spacing : approximate distance between neighbouring points [m]
    rounding : radius of arcs that replace the vertices, convex and re-entrant ones [m]; none by default
    smoothing : length along each loop over which it is averaged before all else [m], against noise and steps of
        pixels; none by default

    Returns
    -------
    points and loops of the outline, the outer one first

    Raises
    ------
    ValueError
        if a loop has fewer than three vertices, no area or numbers that are not finite, crosses itself or another, or
        is a hole outside; if the arcs do not fit; if the smoothing takes a tenth of the area of a loop, or makes
        loops cross; if the spacing is not positive, or too large for the shape

    Notes
    -----
    The inside is filled by a triangular lattice, and each point has a third of the triangles around it. The volumes
    add up to the area of the polygon, with its arcs. A vertex within 1e-6 spacings of the one before is left out.
    Contours of curves need vertices closer than the spacing: on longer chords a round body rolls as a polygon.

    Boundary points take the noise of single places of a contour. Against it give `smoothing` two to four spacings,
    and two pixels or more. Each loop becomes its moving average, scaled about its centroid to the area it had, and
    corners become arcs about as long as `smoothing`. Of discs of radius 17 spacings with steps of R/20, 94 corners
    vanish with two to four spacings, and their sides turn off the circle by 27 to 13 degrees at most, without by 83.
    With noise of 1 %, 78 corners vanish, and the sides turn off by 17 to 8 degrees, without by 75.

    Examples
    --------
    >>> import skmpm
    >>> x = [0.0, 3e-3, 3e-3, 1e-3, 1e-3, 0.0]
    >>> y = [0.0, 0.0, 1e-3, 1e-3, 2e-3, 2e-3]
    >>> points = skmpm.from_outline((x, y), spacing=2e-4)
    >>> round(float(1e6 * points.volume.sum()), 3)
    4.0
    """
    h = positive("spacing", spacing, LENGTH)
    r, window = not_negative("rounding", rounding, LENGTH), not_negative("smoothing", smoothing, LENGTH)
    loops = _loops(vertices, h)
    check_number(abs(sum(map(signed_area, loops))), h)
    if window > 0.0:
        loops = _smoothed(loops, window, h)
    centre = 0.5 * (loops[0].min(axis=1, keepdims=True) + loops[0].max(axis=1, keepdims=True))
    curves, area = list[tuple[Curve, Array]](), 0.0
    for loop in loops:
        curve, breaks, within = rounded(loop, r, centre)
        curves.append((curve, _knots(curve, breaks, h)))
        area += within
    points = filled(curves, area, h, centre)
    own = outlines([points.outline], offsets=[0])
    x = points.x[:, own.point]
    share, width = 100.0 * measured_area(own, x, 1)[0] / area, thickness(own, x, 1)[0]
    if abs(share - 100.0) > MAX_AREA_ERROR:
        raise ValueError(
            f"spacing is {h:g}; the polygon of boundary points has {share:.0f} % of the area, give a smaller one"
        )
    if width < THINNEST * h:
        raise ValueError(
            f"spacing is {h:g}, too large for the thinnest part of {width:.3g} m; give {width / THINNEST:.3g} or less"
        )
    return points


def _loops(vertices: ArrayLike | Sequence[ArrayLike], h: float) -> list[Array]:
    """Loops (2, n) without repeated vertices, the outer one counter-clockwise, the others clockwise inside of it."""
    given: Any = vertices
    try:
        several = all(np.ndim(loop) > 1 for loop in given) and np.shape(given[:1])[1:] != (1, 2)
        loops = [np.asarray(loop, dtype=np.float64) for loop in (given if several else [given])]
    except (TypeError, ValueError):
        loops = []
    if not loops:
        raise ValueError(f"vertices is {type(given).__name__!r}; give positions (2, n), or a list of such loops")
    for k, x in enumerate(loops):
        if x.ndim != 2 or x.shape[0] != 2 or x.shape[1] < 3:
            rows = {(2,): "v.T of these v, ", (1, 2): "v[:, 0].T of these v, "}.get(x.shape[1:], "")
            raise ValueError(
                f"loop {k} has shape {x.shape}; give {rows}(2, n), components first, with three vertices or more"
            )
        if not np.isfinite(x).all():
            raise ValueError(f"vertex {np.isfinite(x).all(axis=0).argmin()} of loop {k} is not finite; leave it out")
    every, numbers = np.concatenate(loops, axis=1), consecutive([x.shape[1] for x in loops])
    least = [REPEATED * min(h, np.ptp(x, axis=1).max()) for x in loops]
    kept = [np.hypot(*(x - np.roll(x, 1, axis=1))) > d for x, d in zip(loops, least, strict=True)]
    own = [of_loop[chosen] for of_loop, chosen in zip(numbers, kept, strict=True)]
    if problem := check_crossings(every, [of_loop for of_loop in own if of_loop.size]):
        raise ValueError(f"vertices: {problem}")
    loops = [every[:, of_loop] for of_loop in own]
    for k, x in enumerate(loops):
        if x.shape[1] < 3 or abs(signed_area(x)) < 1e-12 * np.ptp(x, axis=1).max() ** 2:
            raise ValueError(f"loop {k} has no area; list three vertices or more in order around it")
        if k > 0 and [j for j, other in enumerate(loops) if j != k and encloses(other, x[:, 0])] != [0]:
            raise ValueError(f"loop {k} is no hole, it lies outside of loop 0 or in another hole; make it a body")
    places, visits = np.unique(np.concatenate(loops, axis=1), axis=1, return_counts=True)
    if visits.max() > 1:
        raise ValueError(f"the boundary touches itself at {places[:, visits.argmax()]} m; move its parts apart there")
    return [x if (signed_area(x) > 0.0) == (k == 0) else x[:, ::-1] for k, x in enumerate(loops)]


def _smoothed(loops: Sequence[Array], window: float, h: float) -> list[Array]:
    """The moving averages of loops (2, n) over a length [m], scaled about their centroids to the areas they had."""
    smooth = list[Array]()
    for k, loop in enumerate(loops):
        x = _averaged(loop, window, h)
        share = signed_area(x) / signed_area(loop)
        if share < 1.0 - 0.01 * MAX_AREA_ERROR:
            raise ValueError(
                f"smoothing is {window:g}; the average of loop {k}, which is {_sides(loop)[1].sum():.3g} m long, has"
                f" {100.0 * share:.0f} % of its area, give a smaller one"
            )
        centre = centroid(outlines([[np.arange(x.shape[1])]], offsets=[0]), x, 1)
        smooth.append(centre + (x - centre) / np.sqrt(share))
    if check_crossings(np.concatenate(smooth, axis=1), consecutive([x.shape[1] for x in smooth])):
        raise ValueError(f"smoothing is {window:g}; the averages of the loops cross, give a smaller one")
    return smooth


def _averaged(loop: Array, window: float, h: float) -> Array:
    """The moving average (2, m) of a loop (2, n) by its arc length, exact at equal intervals of it."""
    side, length = _sides(loop)
    origin = loop[:, :1]
    x, ends = loop - origin, np.append(0.0, np.cumsum(length))
    sums = np.append(np.zeros((2, 1)), np.cumsum(length * (x + 0.5 * side), axis=1), axis=1)

    def integral(s: Array) -> Array:
        turns, along = np.divmod(s, ends[-1])
        i = np.minimum(np.searchsorted(ends, along, side="right") - 1, length.size - 1)
        rest = along - ends[i]
        whole: Array = turns * sums[:, -1:] + sums[:, i] + rest * (x[:, i] + 0.5 * rest / length[i] * side[:, i])
        return whole

    count = max(FINE, int(np.ceil(FINE_IN_SPACING * ends[-1] / h)))
    s = ends[-1] * np.arange(count) / count
    return origin + (integral(s + 0.5 * window) - integral(s - 0.5 * window)) / window


def _sides(loop: Array) -> tuple[Array, Array]:
    """Vectors (2, n) from vertex to vertex and their lengths (n,)."""
    side = np.roll(loop, -1, axis=1) - loop
    return side, np.hypot(*side)


def _knots(curve: Curve, breaks: Array, h: float) -> Array:
    """Of the ascending parameters of a curve those of its corners, the sharpest of any within half a spacing."""
    x = curve(breaks)
    own = outlines([[np.arange(breaks.size)]], offsets=[0])
    turn = np.abs(np.pi - tip_angles(own, x, SEEN * h))
    length = _sides(x)[1].sum()
    kept = list[float]()
    for i in np.argsort(-turn, kind="stable")[: np.count_nonzero(np.cos(turn) < CORNER_COSINE)]:
        away = np.abs(breaks[i] - np.array(kept))
        if (length * np.minimum(away, 1.0 - away) > (1.0 - 1e-9) * SEEN * h).all():
            kept.append(breaks[i])
    return np.sort(kept) if kept else np.zeros(1)
