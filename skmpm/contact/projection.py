"""Closest-point projection of boundary points on the outlines of other bodies, corners included.

Corners divide an outline into sides, which are smooth curves. A point may be in contact with several sides of one
body: both sides of a notch bound it. At a convex corner it is enough that the point lies in front of one of the two
sides. Corners of both bodies of a pair are projected, whichever body contributes the points, because a side may touch
a corner between two of its own boundary points; so are boundary points that deformation has made as sharp.

A boundary vertex is in contact only if both of its edges lead away from the other surface along the normal, as at a
vertex of the Minkowski difference of the two bodies; if an edge points into the surface, its other boundary points
are in contact instead. Contact of two convex corners is treated in `corner_contact`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm import outline
from skmpm.compiled import compiled
from skmpm.contact.corner_contact import dot, wedge
from skmpm.contact.neighbours import Neighbours
from skmpm.contact.shifts import guard_keys
from skmpm.contact.tables import among, joined
from skmpm.outline import Cubics, Curve, distance_to_segment

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

MAX_DEPTH = 1.0  # [cells] of a contact: a deeper point is closer to the opposite side of thin bodies
MAX_NORMALS_COSINE = -0.3  # largest cosine between outward normals of surfaces in contact, ideally -1; 0 at corners
# The edges beside a contact point may point into the other surface at an angle of up to this sine, or by this depth
# [cells], whichever is more: compressed boundary points are so close that their heights do not define a slope.
MAX_EDGE_SINE, MAX_EDGE_DEPTH = 0.5, 0.1
CORNER_DISC_DEPTH = 0.05  # [cells] from a convex corner to the centre of the disc that rounds it in corner contact
END_TOLERANCE = 1e-6  # [segments] a point beyond the end of a side by less is still in front of the side


@dataclass(frozen=True)
class FootPoints:
    """Projected boundary points and their feet on sides or corners of other bodies."""

    point: Ints  # (k,) boundary point
    shift: Array  # (k,) of the contact point from it along the outline [segments]
    segment: Ints  # (k,) segment of the foot
    s: Array  # (k,) parameter of the foot on its segment
    corner_pair: Bools  # (k,) whether two corners are in contact; the segment begins at the second one
    guard: Bools  # (k,) whether the contact of a shifted contact point is kept at the boundary point, too
    normal: Array  # (2, k) outward unit normal of the surface at the foot
    gap: Array  # (k,) [m]
    beside: Bools  # (k,) whether the point lies beyond the end of the side, or outside the wedge of the corner
    key: Ints  # (k,) identity of the contact


def foot_points(near: Neighbours, now: Cubics) -> tuple[FootPoints, FootPoints]:
    """Contacts within reach in the configuration `now`, and their projections at the start of the step."""
    point, segment, s = nearest(near, now.x)
    neither = np.zeros(point.size, dtype=bool)
    found = project(near, now, point, segment, s, neither, neither)
    close = (found.gap > -MAX_DEPTH * near.cell) & (found.gap < near.reach)
    found = among(found, np.flatnonzero(~found.beside & close))
    before = _again(near, near.start, found)
    chosen = np.flatnonzero(_faces(near, before) & near.own.across_gap(before.point, before.segment, before.gap))
    chosen = chosen[_outermost(near.curve, among(found, chosen))]
    corner_pairs = _corner_pairs(near, now)
    chosen = chosen[~_superseded(near.curve, among(found, chosen), corner_pairs)]
    found = joined([among(found, chosen), corner_pairs])
    guards = _guards(near, now, found)
    found = joined([found, guards])
    return found, _again(near, near.start, found)


def _again(near: Neighbours, shape: Cubics, found: FootPoints) -> FootPoints:
    """Contacts projected in the configuration `shape`."""
    return project(near, shape, found.point, found.segment, found.s, found.corner_pair, found.guard)


def _guards(near: Neighbours, shape: Cubics, found: FootPoints) -> FootPoints:
    """Contacts at the boundary points from which contact points are shifted."""
    own = among(found, found.shift != 0.0)
    return project(near, shape, own.point, own.segment, own.s, own.corner_pair, np.ones(own.point.size, dtype=bool))


def nearest(near: Neighbours, x: Array) -> tuple[Ints, Ints, Array]:
    """For each point and each side near it, the nearest segment and the parameter of the nearest point on it."""
    chosen, s = np.empty_like(near.begins), np.empty(near.begins.size)
    ends, following = np.append(near.begins, near.point.size), near.curve.outlines.next
    found = _nearest(x, near.point, near.segment, ends, following, MAX_DEPTH * near.cell, chosen, s)
    return near.point[chosen[:found]], near.segment[chosen[:found]], s[:found]


@compiled
def _nearest(
    x: Array, point: Ints, segment: Ints, ends: Ints, following: Ints, most: float, chosen: Ints, parameter: Array
) -> int:
    """The nearest candidate of each group, with its parameter, where it is closer than `most`; their number."""
    found = 0
    for group in range(ends.size - 1):
        least, best, at = most, -1, 0.0
        for k in range(ends[group], ends[group + 1]):
            s, distance = distance_to_segment(x, point[k], segment[k], following[segment[k]])
            if distance < least:
                least, best, at = distance, k, s
        if best >= 0:
            chosen[found], parameter[found] = best, at
            found += 1
    return found


def project(
    near: Neighbours, shape: Cubics, c: Ints, segment: Ints, s: Array, corner_pair: Bools, guard: Bools
) -> FootPoints:
    """Project points c (k,) on the sides of segments (k,), from initial guesses s, or on corners for corner pairs."""
    curve = near.curve
    shift = np.where(guard, 0.0, near.shifts.of(near.keys(c, segment)))
    y = shape.at(*curve.shifted(c, shift))
    foot_segment, foot_s = shape.project(y, segment, s)
    segment, s = np.where(corner_pair, segment, foot_segment), np.where(corner_pair, 0.0, foot_s)
    normal, gap, along = shape.seen_from(y, segment, s)
    key = near.keys(c, segment)
    # A foot exactly on a convex corner is left to that corner; two coincident corners may belong to flush sides.
    on_corner = _on_corner(curve, segment, s) & ~curve.sharp[c]
    off_end = curve.at_corner(segment, s) & (np.abs(along) > END_TOLERANCE)
    beside = ~corner_pair & (off_end | on_corner)
    if corner_pair.any():
        depth = CORNER_DISC_DEPTH * near.cell
        corners = wedge(curve, near.keys, shape.x, c[corner_pair], segment[corner_pair], depth)
        normal[:, corner_pair], gap[corner_pair] = corners.normal, corners.gap
        beside[corner_pair], key[corner_pair] = ~corners.seen, corners.key
    key = np.where(guard, guard_keys(key), key)
    return FootPoints(c, shift, segment, s, corner_pair, guard, normal, gap, beside, key)


def _on_corner(curve: Curve, segment: Ints, s: Array) -> Bools:
    """Whether feet are at convex corners, (k,)."""
    start, end = curve.convex[segment], curve.convex[curve.outlines.next[segment]]
    return np.asarray((start & (s <= END_TOLERANCE)) | (end & (s >= 1.0 - END_TOLERANCE)))


def wall_keys(curve: Curve, i: int, c: Ints) -> Ints:
    """Identities of the contacts of boundary points c (k,) with wall i."""
    return np.asarray(curve.outlines.size * (curve.sides + i) + c)


def tangent_shares(shape: Cubics, at: FootPoints) -> tuple[Array, Array]:
    """Weights (4, k) [1/m] of the stencils in the surfaces' unit tangents at the feet, and curvatures (k,) [1/m]."""
    curve, i = shape.curve, at.segment
    speed = np.hypot(*shape.at(i, at.s, 1))
    smooth = ~curve.at_corner(i, at.s)
    shares = np.where(smooth, curve.weights(i, at.s, 1) / speed, 0.0)
    curvature = np.where(smooth, dot(at.normal, shape.at(i, at.s, 2)) / speed**2, 0.0)
    return shares, curvature


def _faces(near: Neighbours, before: FootPoints) -> Bools:
    """Whether points face the surfaces of their feet, with edges that do not point into these, (k,).

    Decided at the start of the step, so that the contacts do not depend on the rotation of edges between iterates.
    """
    curve, x, c, n = near.curve, near.start.x, before.point, before.normal
    facing = dot(outline.normals(curve.outlines, x)[:, c], n)
    keeps_off = np.ones(c.size, dtype=bool)
    for neighbour in (curve.outlines.next, curve.outlines.previous):
        edge = x[:, neighbour[c]] - x[:, c]
        keeps_off &= dot(edge, n) > -np.maximum(MAX_EDGE_SINE * np.hypot(*edge), MAX_EDGE_DEPTH * near.cell)
    return np.asarray((facing < np.where(curve.sharp[c], 0.0, MAX_NORMALS_COSINE)) & keeps_off)


def _outermost(curve: Curve, found: FootPoints) -> Bools:
    """Whether contacts are kept, (k,): of two sides at a convex corner, only the one with the larger gap."""
    boundary, sides = curve.outlines, curve.sides
    corner = np.flatnonzero(curve.convex)
    before, after = curve.side[boundary.previous[corner]], curve.side[corner]
    key = found.point * sides + curve.side[found.segment]  # sorted, as points and sides are
    kept = np.ones(key.size, dtype=bool)
    for own, other in ((before, after), (after, before)):
        across = np.full(sides, -1)
        across[own] = other
        other_side = across[curve.side[found.segment]]
        other_key = found.point * sides + other_side
        index = np.minimum(np.searchsorted(key, other_key), max(key.size - 1, 0))
        rival = (other_side >= 0) & (key[index] == other_key)
        kept &= ~(rival & (found.gap[index] > found.gap))
    return kept


def _corner_pairs(near: Neighbours, now: Cubics) -> FootPoints:
    """Contacts of two convex corners within reach."""
    c, j = near.corner_pairs
    found = project(near, now, c, j, np.zeros(c.size), np.ones(c.size, dtype=bool), np.zeros(c.size, dtype=bool))
    return among(found, ~found.beside & (np.abs(found.gap) < near.reach))


def _superseded(curve: Curve, found: FootPoints, corner_pairs: FootPoints) -> Bools:
    """Whether contacts (k,) of a corner with a side are replaced by one of two corners, at an end of that side."""
    boundary, sides = curve.outlines, curve.sides
    c, j = corner_pairs.point, corner_pairs.segment
    pairs = [(a, curve.side[b]) for p, q in ((c, j), (j, c)) for a, b in ((p, q), (p, boundary.previous[q]))]
    keys = np.concatenate([a * sides + b for a, b in pairs])
    return np.isin(found.point * sides + curve.side[found.segment], keys)
