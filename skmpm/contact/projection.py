"""Closest-point projection of boundary points on the outlines of other bodies, corners included.

Corners divide an outline into sides, which are smooth curves. A point may be in contact with several sides of one
body: both sides of a notch bound it. At a convex corner it is enough that the point lies in front of one of the two
sides. Corners of both bodies of a pair are projected, whichever body contributes the points, because a side may touch
a corner between two of its own boundary points; so are boundary points that deformation has made as sharp.

A boundary vertex is in contact only if both of its edges lead away from the other surface along the normal, as at a
vertex of the Minkowski difference of the two bodies; if an edge points into the surface, its other boundary points
are in contact instead.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.contact import feet
from skmpm.contact.corners import dot, wedge
from skmpm.contact.neighbours import Neighbours
from skmpm.contact.rows import among, joined
from skmpm.contact.shifts import guarded
from skmpm.outline import Cubics, Curve
from skmpm.parallel import over_points
from skmpm.scene.contact_keys import guard_keys

# [cells] of a contact: a deeper point is closer to the opposite side of thin bodies (test_sliding_contacts).
MAX_DEPTH = 1.0
# [cells] From a convex corner to the centre of the disc that rounds it in corner contact (test_contact).
CORNER_DISC_DEPTH = 0.05


@dataclass(frozen=True)
class FootPoints:
    """Projected contact points and their feet on sides or corners of other bodies."""

    point: Ints  # (k,) boundary point
    shift: Array  # (k,) of the contact point from it along the outline [segments]
    segment: Ints  # (k,) segment of the foot
    s: Array  # (k,) parameter of the foot on its segment
    corner_pair: Bools  # (k,) whether two corners are in contact; the segment begins at the second one
    normal: Array  # (2, k) outward unit normal of the surface at the foot
    gap: Array  # (k,) [m]
    before: Array  # (k,) gap at the start of the step [m]
    beside: Bools  # (k,) whether the point lies beyond the end of the side, or outside the wedge of the corner
    key: Ints  # (k,) identity of the contact


def foot_points(near: Neighbours, now: Cubics) -> FootPoints:
    """Contacts within reach in the configuration `now`."""
    found = _on_sides(near, now)
    if near.curve.convex.any():
        corner_pairs = _corner_pairs(near, now)
        kept = _outermost(near.curve, found) & ~_superseded(near.curve, found, corner_pairs)
        kept |= near.tension.holds(found.key) & ~np.isin(found.key, corner_pairs.key)
        found = joined([among(found, kept), _with_start(near, corner_pairs)])
    guards = among(found, guarded(found.shift))
    if guards.gap.size:
        guards = replace(guards, shift=np.zeros(guards.gap.size), key=guard_keys(guards.key))
        found = joined([found, _with_start(near, project(near, now, guards))])
    return found


def _with_start(near: Neighbours, found: FootPoints) -> FootPoints:
    """Contacts with their gaps at the start of the step."""
    start = project(near, near.start, found)
    return replace(found, before=_gap_before(start.gap, start.beside))


def _gap_before(gap: Array, beside: Bools) -> Array:
    """Gaps at the start of the step, (k,) [m]: a point that was beyond the end of a side did not overlap with it."""
    return np.where(beside, np.maximum(gap, 0.0), gap)


def _on_sides(near: Neighbours, now: Cubics) -> FootPoints:
    """Contacts with sides within reach, but on the body itself those across a gap only."""
    groups, start = near.begins.size, near.start
    chosen, s, place = np.empty((2, groups), dtype=np.int64), np.empty(groups), np.empty((4, groups))
    beside = np.empty(groups, dtype=bool)
    shift = near.of_groups.shift.copy()
    candidates = (near.ends, near.point, near.segment, shift, near.of_groups.travel)
    limits = (MAX_DEPTH * near.cell, near.reach, feet.MAX_EDGE_DEPTH * near.cell)
    facing = near.facing or start
    shapes = (now.x, now.c, start.c, facing.x, facing.c, near.curve.loops)
    before = near.tension.holds(near.key), near.pressed
    arguments = (*candidates, *shapes, limits, *before, chosen, s, place, beside)
    over_points(lambda first, last: feet.contacts(first, last, *arguments), groups)
    group = np.flatnonzero(chosen[0] >= 0)
    if near.own.bodies.size:
        point = near.point[near.begins[group]]
        group = group[near.own.across_gap(point, chosen[1, group], place[3, group])]
    segment, place = chosen[0, group], place[:, group]
    return FootPoints(
        point=near.point[near.begins[group]],
        shift=shift[group],
        segment=segment,
        s=s[group],
        corner_pair=np.zeros(group.size, dtype=bool),
        normal=place[:2],
        gap=place[2],
        before=_gap_before(place[3], beside[group]),
        beside=np.zeros(group.size, dtype=bool),
        key=near.key[group],
    )


def project(near: Neighbours, shape: Cubics, found: FootPoints) -> FootPoints:
    """Contacts in the configuration `shape`, from their feet in another one as initial guesses."""
    k = found.gap.size
    segment, s, normal, gap = found.segment.copy(), found.s.copy(), np.empty((2, k)), np.empty(k)
    beside, key = np.empty(k, dtype=bool), found.key
    feet.project(
        found.point, found.shift, found.corner_pair, shape.c, near.curve.loops, segment, s, normal, gap, beside
    )
    pairs = np.flatnonzero(found.corner_pair)
    if pairs.size:
        depth, key = CORNER_DISC_DEPTH * near.cell, key.copy()
        corners = wedge(near.curve, near.keys, shape.x, found.point[pairs], segment[pairs], depth)
        normal[:, pairs], gap[pairs], beside[pairs] = corners.normal, corners.gap, ~corners.seen
        keeps_other = near.tension.holds(corners.other_key) & ~near.tension.holds(corners.key)
        key[pairs] = np.where(keeps_other, corners.other_key, corners.key)
    return replace(found, segment=segment, s=s, normal=normal, gap=gap, beside=beside, key=key)


def tangent_shares(shape: Cubics, at: FootPoints) -> tuple[Array, Array]:
    """Weights (4, k) [1/m] of the stencils in the surfaces' unit tangents at the feet, and curvatures (k,) [1/m]."""
    curve, i = shape.curve, at.segment
    speed = np.hypot(*shape.at(i, at.s, 1))
    smooth = ~curve.at_corner(i, at.s)
    shares = np.where(smooth, curve.weights(i, at.s, 1) / speed, 0.0)
    curvature = np.where(smooth, dot(at.normal, shape.at(i, at.s, 2)) / speed**2, 0.0)
    return shares, curvature


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
    none, both, neither = np.zeros(c.size), np.ones(c.size, dtype=bool), np.zeros(c.size, dtype=bool)
    at = FootPoints(c, none, j, none, both, np.zeros((2, c.size)), none, none, neither, near.keys(c, j))
    found = project(near, now, at)
    return among(found, ~found.beside & (np.abs(found.gap) < near.reach))


def _superseded(curve: Curve, found: FootPoints, corner_pairs: FootPoints) -> Bools:
    """Whether contacts (k,) of a corner with a side are replaced by one of two corners, at an end of that side."""
    boundary, sides = curve.outlines, curve.sides
    c, j = corner_pairs.point, corner_pairs.segment
    pairs = [(a, curve.side[b]) for p, q in ((c, j), (j, c)) for a, b in ((p, q), (p, boundary.previous[q]))]
    keys = np.concatenate([a * sides + b for a, b in pairs])
    return np.isin(found.point * sides + curve.side[found.segment], keys)
