"""The gap function: contact pairs of a configuration, with their foot points, normals and gaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.compiled import compiled_in_order
from skmpm.contact import feet
from skmpm.contact.constraints import SurfaceGeometry
from skmpm.contact.neighbours import Neighbours
from skmpm.contact.projection import foot_points, project, tangent_shares
from skmpm.contact.shifts import Shifts, guarded
from skmpm.outline import Cubics, Curve
from skmpm.scene import Scene
from skmpm.scene.contact_keys import guard_keys


@dataclass(frozen=True)
class ContactPairs:
    """The contact pairs of a configuration."""

    bodies: Ints  # (2, k) walls are -1, -2, ...; images of bodies have numbers of their own
    point: Ints  # (k,) boundary point nearest to the contact point
    own: Ints  # (4, k) boundary points that define the contact point
    own_weights: Array  # (4, k) their weights in it
    key: Ints  # (k,) identity of the contact, the same in all steps
    stencil: Ints  # (4, k) boundary points that define the curve at the foot; unused for walls
    weights: Array  # (4, k) their weights in the foot; zero for walls
    tangent_shares: Array  # (4, k) their weights in the curve's unit tangent [1/m]; zero for walls and at corners
    curvature: Array  # (k,) of the curve, negative where it is convex [1/m]; zero for walls and at corners
    own_shares: Array  # (4, k) weights of `own` in the unit tangent at the contact point [1/m]
    along: Array  # (k,) cosine between both tangents
    normal: Array  # (2, k) at x + theta dt w
    gap: Array  # (k,) at the end of the step [m]
    before: Array  # (k,) gap at the start of the step [m]


def contacts_between_bodies(near: Neighbours, start: Array, moved: Array, theta: float) -> ContactPairs:
    """Contact pairs of bodies whose boundary points move from `start` by `moved`, both (2, m) [m]."""
    curve, boundary = near.curve, near.curve.outlines
    now = curve.through(start + moved)
    end = foot_points(near, now)
    at = now if theta == 1.0 else curve.through(start + theta * moved)
    driving = end if theta == 1.0 else project(near, at, end)
    shares, curvature = tangent_shares(at, driving)
    own, own_s = curve.shifted(end.point, end.shift)
    own_shares, along = _own_tangents(now if near.shifts.travel.any() else None, curve, own, own_s, end.normal)
    return ContactPairs(
        bodies=boundary.body[np.stack([end.point, end.segment])],
        point=end.point,
        own=curve.stencil(own),
        own_weights=curve.weights(own, own_s),
        key=end.key,
        stencil=curve.stencil(driving.segment),
        weights=curve.weights(driving.segment, driving.s),
        tangent_shares=shares,
        curvature=curvature,
        own_shares=own_shares,
        along=along,
        normal=driving.normal,
        gap=end.gap,
        before=end.before,
    )


def contacts_with_walls(scene: Scene, near: Neighbours, start: Array, moved: Array, walls: Array) -> ContactPairs:
    """Contact pairs of boundary points with walls, one wall after the other.

    `walls` (2, walls, 2) are points of the walls at the start of the step, and their displacements [m].
    """
    curve, boundary, points = near.curve, near.curve.outlines, near.numbers.points
    each, normals = np.arange(walls.shape[1]), np.ascontiguousarray(scene.normals)
    before, gap = np.empty((2, each.size, points))
    movable = scene.movable[boundary.body[:points]]
    kept = near.tension.holds(near.numbers.at_walls(each[:, None], np.arange(points)))
    found = np.empty((2, gap.size), dtype=np.int64)
    size = _wall_gaps(normals, start, moved, walls, movable, kept, near.reach, before, gap, found)
    wall, c = found[:, :size]
    key = near.numbers.at_walls(wall, c)
    shifts = near.shifts.at(key)
    now = curve.through(start + moved) if shifts.travel.any() else None
    if now is not None:
        feet.slide_on_walls(c, shifts.shift, shifts.travel, np.take(normals, wall, axis=1), now.c, curve.loops)
    doubled = guarded(shifts.shift)
    order = np.argsort(np.append(wall, wall[doubled]), kind="stable")
    wall, c = (np.append(values, values[doubled])[order] for values in (wall, c))
    key = np.append(key, guard_keys(key[doubled]))[order]
    shift = np.append(shifts.shift, np.zeros(np.count_nonzero(doubled)))[order]
    segment, s = curve.shifted(c, shift)
    own, weights = curve.stencil(segment), curve.weights(segment, s)
    normal = np.take(normals, wall, axis=1)
    own_shares, along = _own_tangents(now, curve, segment, s, normal)
    return ContactPairs(
        bodies=np.stack([boundary.body[c], -1 - wall]),
        point=c,
        own=own,
        own_weights=weights,
        key=key,
        stencil=np.repeat(c[None], 4, axis=0),
        weights=np.zeros((4, c.size)),
        tangent_shares=np.zeros((4, c.size)),
        curvature=np.zeros(c.size),
        own_shares=own_shares,
        along=along,
        normal=normal,
        gap=np.einsum("jk,jk->k", weights, gap[wall, own]),
        before=np.einsum("jk,jk->k", weights, before[wall, own]),
    )


def _own_tangents(now: Cubics | None, curve: Curve, segment: Ints, s: Array, normal: Array) -> tuple[Array, Array]:
    """Weights (4, k) [1/m] in the unit tangents at the contact points, and cosines (k,) to those of the surfaces.

    Zeros without a configuration, where no contact point slides.
    """
    if now is None:
        return np.zeros((4, s.size)), np.zeros(s.size)
    slope = now.at(segment, s, 1)
    speed = np.maximum(np.hypot(*slope), 1e-300)
    along = (slope[1] * normal[0] - slope[0] * normal[1]) / speed
    return curve.weights(segment, s, 1) / speed, along


@compiled_in_order
def _wall_gaps(
    normals: Array,
    start: Array,
    moved: Array,
    walls: Array,
    movable: Bools,
    kept: Bools,
    reach: float,
    before: Array,
    gap: Array,
    near: Ints,
) -> int:
    """Write gaps (walls, m) before and after all have moved, and the walls and points that are near or `kept`."""
    size = 0
    for i in range(gap.shape[0]):
        x, y, point, step = normals[0, i], normals[1, i], walls[0, i], walls[1, i]
        for c in range(gap.shape[1]):
            before[i, c] = x * (start[0, c] - point[0]) + y * (start[1, c] - point[1])
            gap[i, c] = before[i, c] + x * (moved[0, c] - step[0]) + y * (moved[1, c] - step[1])
            if (gap[i, c] < reach or kept[i, c]) and movable[c]:
                near[0, size], near[1, size] = i, c
                size += 1
    return size


def geometry_of(found: ContactPairs, shifts: Shifts) -> SurfaceGeometry:
    """The geometry of the surfaces of contact pairs with these shifts."""
    return SurfaceGeometry(
        stencil=found.stencil,
        tangent_shares=found.tangent_shares,
        own=found.own,
        own_shares=np.where(shifts.travel > 0.0, found.own_shares, 0.0),
        curvature=found.curvature,
        along=found.along,
        travel=shifts.travel,
        wide_from=shifts.wide_from,
    )
