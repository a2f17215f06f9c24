"""Closest points of smooth outlines, where the contact of curved surfaces acts while it is light.

Contact at boundary points alone makes a polygon of a round body: it stands on the chord between two of them, which
resists rolling like a coefficient of rolling friction of half the angle by which the outline turns from one to the
next. Therefore the boundary point closest to another surface has a second contact at a place of the smooth outline
beside it, where the gap has no slope, at most half a segment away. The place is chosen once per step, in the
configuration to which the velocities at the start of the step lead, and is then a point of the material: gap, force
and friction are those of this point.

Under load the surfaces flatten against each other. In a contact wider than a segment every boundary point bears its
part of the load, and the closest point, which is that of small unevennesses, has no meaning. Therefore the shift
decreases with the half-width that the contact has under its last force by Hertz's theory, and is zero in a wide one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm import outline
from skmpm.contact.constraints import lookup
from skmpm.contact.corner_contact import dot
from skmpm.contact.neighbours import Neighbours, Roles
from skmpm.contact.projection import nearest, wall_keys
from skmpm.contact.shifts import MIN_SHIFT, NO_SHIFTS, Shifts, guard_keys
from skmpm.contact.tables import among, joined
from skmpm.outline import Cubics, Curve
from skmpm.scene import Contacts, Scene

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Turn of a segment against the other surface [rad] that is neglected: its chord has half of it as rolling friction.
MIN_TURN = 1e-3
# Half-widths of contacts over the length of a segment up to which the shift is full and from which on it is zero.
LIGHT, WIDE = 0.3, 0.6


def closest_points(
    scene: Scene, near: Neighbours, roles: Roles, ahead: Cubics, walls: Array, contacts: Contacts
) -> Shifts:
    """Shifts of contact points from boundary points to the closest points in the configuration `ahead`.

    `walls` (walls, 2) [m] are points of the walls then, `contacts` those of the last step.
    """
    if near.point.size == 0 and walls.size == 0:
        return NO_SHIFTS
    length, turn = _turns(ahead.curve, scene.initial_positions[:, ahead.curve.outlines.point])
    found = [_on_wall(scene, near, i, point, ahead, length, turn) for i, point in enumerate(walls)]
    if near.point.size:
        found.append(_on_bodies(scene, near, roles, ahead, length, turn))
    return _shifts(joined(found), contacts)


@dataclass(frozen=True)
class _Segments:
    """Segments on which the gap may have a minimum."""

    key: Ints  # (2, k) contacts of their ends
    slope: Array  # (2, k) of the gap at their ends
    turn: Array  # (k,) against the other surface in the reference [rad]
    length: Array  # (k,) in the reference [m]
    compliance: Array  # (k,) (1 - nu^2) / E of both bodies together [1/Pa]


def _turns(curve: Curve, x: Array) -> tuple[Array, Array]:
    """Lengths (m,) [m] of the segments and their turns (m,) [rad], left turns positive; nan beside corners."""
    boundary, corner = curve.outlines, curve.corner | curve.sharp
    half = np.where(corner, np.nan, 0.5 * outline.turning_angles(boundary, x))
    return np.hypot(*(x[:, boundary.next] - x)), half + half[boundary.next]


def _on_wall(
    scene: Scene, near: Neighbours, i: int, point: Array, ahead: Cubics, length: Array, turn: Array
) -> _Segments:
    """Segments near wall i at `point` (2,) [m]."""
    curve, boundary = near.curve, near.curve.outlines
    normal = np.asarray(scene.walls[i].normal, dtype=float)
    close = (normal @ (ahead.x - point[:, None]) < near.reach) & scene.movable[boundary.body]
    c = np.flatnonzero(close | close[boundary.next])
    ends = np.stack([c, boundary.next[c]])
    slope = np.stack([normal @ _tangents(ahead, end) for end in ends])
    return _Segments(wall_keys(curve, i, ends), slope, turn[c], length[c], scene.compliance[boundary.body[c]])


def _on_bodies(scene: Scene, near: Neighbours, roles: Roles, ahead: Cubics, length: Array, turn: Array) -> _Segments:
    """Segments near other bodies."""
    curve, boundary, owner = near.curve, near.curve.outlines, near.surfaces.owner
    c, segment, s = nearest(near, ahead.x)
    ranks = roles.rank[boundary.body[np.stack([c, segment])]]
    chosen = (ranks[0] < ranks[1]) & scene.movable[owner[c]]  # not the corners of the other body
    c, segment, s = c[chosen], segment[chosen], s[chosen]
    foot, t = ahead.project(ahead.x[:, c], segment, s)
    slope = dot(ahead.normals(foot, t), _tangents(ahead, c))
    key, key_of_end = (end * curve.sides + curve.side[foot] for end in (c, boundary.next[c]))
    i = np.flatnonzero(np.isin(key_of_end, key))
    j = np.searchsorted(key, key_of_end[i])  # sorted, as points and sides are
    c, end_foot, foot = c[i], foot[j], foot[i]
    return _Segments(
        key=np.stack([near.keys(c, foot), near.keys(boundary.next[c], end_foot)]),
        slope=np.stack([slope[i], slope[j]]),
        turn=turn[c] + length[c] * turn[foot] / length[foot],
        length=length[c],
        compliance=scene.compliance[owner[c]] + scene.compliance[owner[foot]],
    )


def _shifts(segments: _Segments, contacts: Contacts) -> Shifts:
    """The shifts of contacts at the ends of segments on which the slope of the gap changes its sign."""
    at = among(segments, (segments.slope[0] < 0.0) & (segments.slope[1] >= 0.0) & (segments.turn > MIN_TURN))
    keys = np.concatenate([at.key, guard_keys(at.key)])
    force = lookup(contacts.key, contacts.force[0], keys.ravel(), 0.0).reshape(4, -1).sum(axis=0)
    width = np.sqrt(4.0 / np.pi * np.maximum(force, 0.0) * at.compliance * at.length / at.turn) / at.length
    share = np.clip((WIDE - width) / (WIDE - LIGHT), 0.0, 1.0)
    s = at.slope[0] / (at.slope[0] - at.slope[1])
    contact = np.where(s > 0.5, at.key[1], at.key[0])
    shift = share * np.where(s > 0.5, s - 1.0, s)
    return among(Shifts(contact, shift, 0.125 * at.length * at.turn), np.abs(shift) >= MIN_SHIFT)


def _tangents(shape: Cubics, c: Ints) -> Array:
    """Unit tangents (2, k) of the outlines at boundary points c (k,)."""
    slope = shape.at(c, np.zeros(c.size), 1)
    return np.asarray(slope / np.maximum(np.hypot(*slope), 1e-300))
