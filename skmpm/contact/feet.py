"""Feet of contact points on the sides of other bodies, one by one: the loops of `projection` and `closest_points`."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.compiled import compiled
from skmpm.outline.cubics import Loops, foot, place, seen, tangent
from skmpm.outline.near import distance_to_segment

MAX_NORMALS_COSINE = -0.3  # largest cosine between outward normals of surfaces in contact, ideally -1; 0 at corners
# The edges beside a contact point may point into the other surface at an angle of up to this sine, or by this depth
# [cells], whichever is more: compressed boundary points are so close that their heights do not define a slope.
MAX_EDGE_SINE, MAX_EDGE_DEPTH = 0.5, 0.1
MAX_SLIDE = 0.95  # shift of a contact point that slides [segments]: the next boundary point has a contact of its own
MIN_CURVATURE_FACTOR = 0.1  # of 1 - g kappa, which is zero for a point at the centre of curvature
# [segments] A point beyond the end of a side by less is still in front of it. With 1e-9 boxes whose corners lie on
# each other take 39 iterations instead of 30 (test_statics).
END_TOLERANCE = 1e-6


@compiled
def contacts(
    first: int,
    last: int,
    ends: Ints,
    point: Ints,
    segment: Ints,
    shift: Array,
    travel: Array,
    x: Array,
    c: Array,
    start_c: Array,
    facing_x: Array,
    facing_c: Array,
    loops: Loops,
    limits: tuple[float, float, float],
    kept: Bools,
    pressed: Bools,
    chosen: Ints,
    parameter: Array,
    place: Array,
    beside: Bools,
) -> None:
    """Write the contacts of groups first:last of candidates.

    `chosen` are the segment of the foot, -1 where there is no contact, and that at the start of the step; `place` the
    normal, the gap and that at the start; `limits` are depth, reach, and depth of edges [m]. Groups `kept` are
    in contact at any gap, and beyond the ends of sides; those `pressed` together before are, however their edges have
    turned. The shifts of groups that `travel` [m] change to those here.
    """
    depth, reach, edge_depth = limits
    most = max(depth, reach)
    for group in range(first, last):
        chosen[0, group] = -1
        within = 1e300 if kept[group] else most
        i, t = nearest_of_group(ends[group], ends[group + 1], point, segment, x, loops.following, within)
        if i < 0:
            continue
        at = point[ends[group]]
        if travel[group] > 0.0:
            shift[group] = slid(at, shift[group], travel[group], (i, t, 0.0, 0.0), c, loops)
        i, t, x_normal, y_normal, gap, off = foot_of(at, shift[group], i, t, c, loops)
        if not kept[group] and (off or not -depth < gap < reach):
            continue
        i_before, _, x_facing, y_facing, gap_before, off_before = foot_of(at, shift[group], i, t, start_c, loops)
        if facing_c is not start_c:
            _, _, x_facing, y_facing, _, _ = foot_of(at, shift[group], i, t, facing_c, loops)
        deepest = 1e300 if pressed[group] else edge_depth
        if not _faces(at, (x_facing, y_facing), facing_x, loops, deepest):
            continue
        chosen[0, group], chosen[1, group], parameter[group] = i, i_before, t
        place[0, group], place[1, group], place[2, group], place[3, group] = x_normal, y_normal, gap, gap_before
        beside[group] = off_before


@compiled
def slide_on_walls(point: Ints, shift: Array, travel: Array, normal: Array, c: Array, loops: Loops) -> None:
    """Overwrite the shifts (k,) of contacts with walls that travel; normals (2, k)."""
    for k in range(point.size):
        if travel[k] > 0.0:
            shift[k] = slid(point[k], shift[k], travel[k], (0, 0.0, normal[0, k], normal[1, k]), c, loops)


@compiled
def nearest_of_group(
    begin: int, end: int, point: Ints, segment: Ints, x: Array, following: Ints, most: float
) -> tuple[int, float]:
    """Of candidates begin:end, the nearest segment and the parameter of the point on it; -1 if beyond `most`."""
    least, best, at = most, -1, 0.0
    for k in range(begin, end):
        s, distance = distance_to_segment(x, point[k], segment[k], following[segment[k]])
        if distance < least:
            least, best, at = distance, segment[k], s
    return best, at


@compiled
def slid(
    point: int, shift: float, travel: float, surface: tuple[int, float, float, float], c: Array, loops: Loops
) -> float:
    """The shift of a contact point that slides by `travel` [m] per slope of the gap along its outline.

    The `surface` is a curve, by a segment and its parameter near the foot, or by its normal alone a plane.
    """
    i, t, x_normal, y_normal = surface
    own, s = (loops.previous[point], 1.0 + shift) if shift < 0.0 else (point, shift)
    x_own, y_own, speed = tangent(c, own, s)
    if x_normal == 0.0 and y_normal == 0.0:
        at = place(c, own, s)
        i, t = foot(at, i, t, c, loops)
        x_normal, y_normal, _, _ = seen(at, c, i, t)
    step = -travel * (x_normal * x_own + y_normal * y_own) / speed
    return min(max(shift + step, -MAX_SLIDE), MAX_SLIDE)


@compiled
def foot_of(
    point: int, shift: float, segment: int, s: float, c: Array, loops: Loops
) -> tuple[int, float, float, float, float, bool]:
    """The foot of a contact point on the side of a segment, from an initial guess.

    Returns its segment and parameter, the normal, the gap, and whether the point lies beyond the end of the side. A
    foot exactly on a convex corner is left to that corner; two coincident corners may belong to flush sides.
    """
    y = place(c, loops.previous[point], 1.0 + shift) if shift < 0.0 else place(c, point, shift)
    i, t = foot(y, segment, s, c, loops)
    x_normal, y_normal, gap, along = seen(y, c, i, t)
    j = loops.following[i]
    on_corner = (loops.convex[i] and t <= END_TOLERANCE) or (loops.convex[j] and t >= 1.0 - END_TOLERANCE)
    off_end = (loops.corner[i] and t <= 0.0) or (loops.corner[j] and t >= 1.0)
    off_end &= abs(along) > END_TOLERANCE
    return i, t, x_normal, y_normal, gap, off_end or (on_corner and not loops.sharp[point])


@compiled
def _faces(c: int, normal: tuple[float, float], x: Array, loops: Loops, edge_depth: float) -> bool:
    """Whether a point faces the surface of its foot, with edges that do not point into it.

    Decided in one configuration for all iterates, so that the contacts do not depend on the rotation of edges between
    them.
    """
    x_ahead, y_ahead = x[0, loops.following[c]] - x[0, c], x[1, loops.following[c]] - x[1, c]
    x_back, y_back = x[0, loops.previous[c]] - x[0, c], x[1, loops.previous[c]] - x[1, c]
    x_chord, y_chord = x_ahead - x_back, y_ahead - y_back
    facing = y_chord * normal[0] - x_chord * normal[1]
    most = 0.0 if loops.sharp[c] else MAX_NORMALS_COSINE
    if not facing < most * np.sqrt(x_chord**2 + y_chord**2):
        return False
    ahead, back = x_ahead * normal[0] + y_ahead * normal[1], x_back * normal[0] + y_back * normal[1]
    keeps_off = ahead > -max(MAX_EDGE_SINE * np.sqrt(x_ahead**2 + y_ahead**2), edge_depth)
    return bool(keeps_off and back > -max(MAX_EDGE_SINE * np.sqrt(x_back**2 + y_back**2), edge_depth))


@compiled
def project(
    point: Ints,
    shift: Array,
    skipped: Bools,
    c: Array,
    loops: Loops,
    segment: Ints,
    s: Array,
    normal: Array,
    gap: Array,
    beside: Bools,
) -> None:
    """Overwrite the feet of contact points (k,) on sides."""
    for k in range(point.size):
        if not skipped[k]:
            segment[k], s[k], normal[0, k], normal[1, k], gap[k], beside[k] = foot_of(
                point[k], shift[k], segment[k], s[k], c, loops
            )
