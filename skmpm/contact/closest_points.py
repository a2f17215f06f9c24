"""Closest points of smooth outlines, where the contact of curved surfaces acts while it is light.

Contact at boundary points alone makes a polygon of a round body: it stands on the chord between two of them, which
resists rolling like a coefficient of rolling friction of half the angle by which the outline turns from one to the
next. Therefore the boundary point closest to another surface has a second contact at a place of the smooth outline
beside it, where the gap has no slope, at most half a segment away. The place is chosen once per step, in the
configuration to which the velocities at the start of the step lead, and is then a point of the material: gap, force
and friction are those of this point.

Under load the surfaces flatten against each other. In a contact wider than a segment every boundary point bears its
part of the load, and the closest point, which is that of small unevennesses, has no meaning. Therefore the shift
decreases with the half-width that the contact has by Hertz's theory under the force between the two bodies, and is
zero in a wide one. A static step is solved again if a contact has become wide in it.

A change dF of that force moves the contact by up to b = (length turn / 8) dF / F = 0.6 dF / E*, F the force of a wide
contact. In a step in which waves do not cross a cell it is inertia that resists this, m = rho h^2 / 2 of a node, and
the force changes by m b / dt^2 = 0.3 dF (h / (c dt))^2 in return: more than dF in short steps, so that contacts would
open and close in turn. There the force is a mean over steps, of which the last has a share of `FOLLOWS` (c dt / h)^2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.compiled import compiled
from skmpm.contact.constraints import lookup
from skmpm.contact.feet import foot_of, nearest_of_group
from skmpm.contact.neighbours import Neighbours
from skmpm.contact.projection import MAX_DEPTH
from skmpm.contact.rows import among, joined
from skmpm.contact.shifts import Shifts, guarded
from skmpm.outline import Cubics
from skmpm.outline.cubics import Loops, tangent
from skmpm.scene import Contacts, Scene, between_bodies, pair_numbers

# Turn of a segment against the other surface [rad] that is neglected: its chord has half of it as rolling friction.
MIN_TURN = 1e-3
# Half-widths of contacts over the length of a segment up to which the shift is full and from which on it is zero.
LIGHT, WIDE = 0.3, 0.6
# In static steps: the half-width up to which contact points are the closest ones and slide with the iterate, and the
# least turn of a segment under load, over that in the reference. Shares of the shift have no place there: the contact
# would be a vertex in part, and solves alternate between its sides (test_sliding_contacts).
SLIDING, LEAST_TURN = 0.5, 0.5
# A tenth of the largest stable share, 3.3 (c dt / h)^2. Forces of a disc that comes to rest on a wall alternate from
# step to step, with c dt / h = 0.06, by 35 % without means, by 10 % with 1, and by 0.1 % with 0.3 and 0.1
# (test_closest_points).
FOLLOWS = 0.3


def closest_points(
    scene: Scene, near: Neighbours, ahead: Cubics, walls: Array, contacts: Contacts, *, slide: bool
) -> Shifts:
    """Shifts of contact points from boundary points to the closest points in the configuration `ahead`.

    `walls` (walls, 2) [m] are points of the walls then, and `contacts` those of the last step or solve. The points
    may `slide` with the iterate.
    """
    if near.point.size == 0 and walls.size == 0:
        return Shifts.none()
    reference = scene.initial_positions[:, ahead.curve.outlines.point]
    found = [_on_wall(scene, near, i, point, ahead, reference) for i, point in enumerate(walls)]
    if near.point.size:
        found.append(_on_bodies(scene, near, ahead, reference))
    return _shifts(joined(found), contacts, slide=slide)


def lasting_force(before: Contacts, contacts: Contacts, courant: float) -> Array:
    """Lasting forces (k,) [N/m] of the contacts at the end of a step, from those `before`; `courant` is c dt / h."""
    known = lookup(pair_numbers(before.bodies), before.lasting_force, pair_numbers(contacts.bodies), 0.0)
    now = between_bodies(contacts.bodies, contacts.force[0])
    return np.asarray(known + min(FOLLOWS * courant**2, 1.0) * (now - known))


def with_largest_forces(before: Contacts, contacts: Contacts) -> Contacts:
    """Contacts at two times, all of them, with the larger one of the lasting forces of each pair of bodies."""
    both = joined([before, contacts])
    pair = np.unique(pair_numbers(both.bodies), return_inverse=True)[1]
    largest = np.zeros(pair.size)
    np.maximum.at(largest, pair, both.lasting_force)
    return replace(both, lasting_force=largest[pair])


@dataclass(frozen=True)
class _Minima:
    """Segments on which the gap has a minimum."""

    key: Ints  # (2, k) contacts of their ends
    bodies: Ints  # (2, k) in contact; walls are -1, -2, ...
    slope: Array  # (2, k) of the gap at their ends
    turn: Array  # (k,) against the other surface in the reference [rad]
    length: Array  # (k,) in the reference [m]
    compliance: Array  # (k,) (1 - nu^2) / E of both bodies together [1/Pa]


def _on_wall(scene: Scene, near: Neighbours, i: int, point: Array, ahead: Cubics, reference: Array) -> _Minima:
    """Minima of the gap to wall i at `point` (2,) [m]."""
    curve, boundary, normal, own = near.curve, near.curve.outlines, scene.normals[:, i], near.numbers.points
    found, values = np.empty(own, dtype=np.int64), np.empty((4, own))
    size = _minima_on_wall(
        normal,
        point,
        near.reach,
        scene.movable[boundary.body[:own]],
        ahead.x,
        ahead.c,
        curve.loops,
        reference,
        found,
        values,
    )
    c, (*slope, turn, length) = found[:size], values[:, :size]
    key = near.numbers.at_walls(i, np.stack([c, boundary.next[c]]))
    bodies = np.stack([boundary.body[c], np.full(size, -1 - i)])
    return _Minima(key, bodies, np.stack(slope), turn, length, scene.compliance[bodies[0]])


def _on_bodies(scene: Scene, near: Neighbours, ahead: Cubics, reference: Array) -> _Minima:
    """Minima of the gaps to other bodies."""
    curve, boundary, owner = near.curve, near.curve.outlines, near.surfaces.owner
    c, segment = near.point[near.begins], near.segment[near.begins]
    ranks = near.roles.rank[boundary.body[np.stack([c, segment])]]
    chosen = (ranks[0] < ranks[1]) & scene.movable[owner[c]]  # not the corners of the other body
    found, values = np.empty((3, c.size), dtype=np.int64), np.empty((4, c.size))
    most = max(MAX_DEPTH * near.cell, near.reach)
    groups = (near.ends, near.point, near.segment, curve.side, chosen, most)
    size = _minima_on_bodies(*groups, ahead.x, ahead.c, curve.loops, reference, found, values)
    (one, other, foot), (*slope, turn, length) = found[:, :size], values[:, :size]
    bodies = np.stack([owner[c[one]], owner[foot]])
    key, compliance = near.key[np.stack([one, other])], scene.compliance[bodies].sum(axis=0)
    return _Minima(key, bodies, np.stack(slope), turn, length, compliance)


@compiled
def _minima_on_wall(
    normal: Array,
    point: Array,
    reach: float,
    movable: Bools,
    x: Array,
    c: Array,
    loops: Loops,
    reference: Array,
    found: Ints,
    values: Array,
) -> int:
    """Write the segments, and the slopes at their ends, their turns and lengths; return their number."""
    size = 0
    for i in range(movable.size):
        j = loops.following[i]
        gap = normal[0] * (x[0, i] - point[0]) + normal[1] * (x[1, i] - point[1])
        gap_ahead = normal[0] * (x[0, j] - point[0]) + normal[1] * (x[1, j] - point[1])
        if not movable[i] or min(gap, gap_ahead) >= reach:
            continue
        x_here, y_here, _ = tangent(c, i, 0.0)
        x_ahead, y_ahead, _ = tangent(c, j, 0.0)
        slope, slope_ahead = normal[0] * x_here + normal[1] * y_here, normal[0] * x_ahead + normal[1] * y_ahead
        turn, length = _turn(i, reference, loops)
        if slope < 0.0 <= slope_ahead and turn > MIN_TURN:
            found[size], values[0, size], values[1, size] = i, slope, slope_ahead
            values[2, size], values[3, size] = turn, length
            size += 1
    return size


@compiled
def _minima_on_bodies(
    ends: Ints,
    point: Ints,
    segment: Ints,
    side: Ints,
    chosen: Bools,
    most: float,
    x: Array,
    c: Array,
    loops: Loops,
    reference: Array,
    found: Ints,
    values: Array,
) -> int:
    """Write the minima over bodies of the chosen groups of candidates, as `_minima_on_wall`; return their number.

    Written are the candidates of both ends, and the segment of the foot of the first.

    The other surface turns as at the feet of both ends, so that mirror images have mirrored shifts.
    """
    slope, feet, key = np.empty(chosen.size), np.full(chosen.size, -1), np.empty(chosen.size, dtype=np.int64)
    sides = side.max() + 1
    for g in range(chosen.size):
        at = point[ends[g]]
        key[g] = at * sides + side[segment[ends[g]]]  # ascends, as points and sides do
        if chosen[g]:
            i, t = nearest_of_group(ends[g], ends[g + 1], point, segment, x, loops.following, most)
            if i >= 0:
                feet[g], t, x_normal, y_normal, _, _ = foot_of(at, 0.0, i, t, c, loops)
                x_tangent, y_tangent, _ = tangent(c, at, 0.0)
                slope[g] = x_normal * x_tangent + y_normal * y_tangent
    size = 0
    for g in range(chosen.size):
        if feet[g] < 0 or slope[g] >= 0.0:
            continue
        at = point[ends[g]]
        wanted = loops.following[at] * sides + side[segment[ends[g]]]
        other = np.searchsorted(key, wanted)
        if other == key.size or key[other] != wanted or feet[other] < 0 or slope[other] < 0.0:
            continue
        turn, length = _turn(at, reference, loops)
        (turn_1, length_1), (turn_2, length_2) = (
            _turn(feet[g], reference, loops),
            _turn(feet[other], reference, loops),
        )
        if min(length, length_1, length_2) == 0.0:
            continue
        turn += length * (turn_1 + turn_2) / (length_1 + length_2)
        if turn > MIN_TURN:
            found[0, size], found[1, size], found[2, size] = g, other, feet[g]
            values[0, size], values[1, size], values[2, size], values[3, size] = slope[g], slope[other], turn, length
            size += 1
    return size


@compiled
def _turn(i: int, x: Array, loops: Loops) -> tuple[float, float]:
    """Turn [rad] of a segment, left turns positive, and its length [m]; both zero beside corners."""
    j = loops.following[i]
    if loops.corner[i] or loops.sharp[i] or loops.corner[j] or loops.sharp[j]:
        return 0.0, 0.0
    h, k, turn = loops.previous[i], loops.following[j], 0.0
    for a, b, c in ((h, i, j), (i, j, k)):
        back_x, back_y, x_ahead, y_ahead = x[0, b] - x[0, a], x[1, b] - x[1, a], x[0, c] - x[0, b], x[1, c] - x[1, b]
        turn += 0.5 * np.arctan2(back_x * y_ahead - back_y * x_ahead, back_x * x_ahead + back_y * y_ahead)
    return turn, np.sqrt((x[0, j] - x[0, i]) ** 2 + (x[1, j] - x[1, i]) ** 2)


def _shifts(at: _Minima, contacts: Contacts, *, slide: bool) -> Shifts:
    """The shifts of contacts at the ends of segments on which the slope of the gap changes its sign."""
    force = lookup(pair_numbers(contacts.bodies), contacts.lasting_force, pair_numbers(at.bodies), 0.0)
    wide, soft = np.full(force.size, np.inf), at.compliance > 0.0  # forces that make contacts as wide as a segment
    np.divide(0.25 * np.pi * at.length * at.turn, at.compliance, out=wide, where=soft)
    width = np.sqrt(np.maximum(force, 0.0) / wide)
    if slide:
        turn = np.maximum(at.slope[1] - at.slope[0], LEAST_TURN * at.turn)
        share, s = (width < SLIDING).astype(float), np.clip(0.5 - 0.5 * at.slope.sum(axis=0) / turn, 0.0, 1.0)
        travel = share * at.length / turn
    else:
        share = np.clip((WIDE - width) / (WIDE - LIGHT), 0.0, 1.0)
        s, travel = at.slope[0] / (at.slope[0] - at.slope[1]), np.zeros(width.size)
    contact = np.where(s > 0.5, at.key[1], at.key[0])
    shift = share * np.where(s > 0.5, s - 1.0, s)
    wide_from = np.where(travel > 0.0, SLIDING**2 * wide, np.inf)
    found = Shifts(contact, shift, 0.125 * at.length * at.turn, travel, wide_from)
    return among(found, share > 0.0 if slide else guarded(shift))
