"""Candidates for contact: boundary points and segments of other bodies, or of other parts, near each other."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.contact.constraints import lookup
from skmpm.contact.motion import contact_reach
from skmpm.contact.self_contact import SelfContact
from skmpm.contact.shifts import Shifts
from skmpm.outline import Cubics, Curve
from skmpm.outline.images import Images
from skmpm.outline.near import both_ways, candidates
from skmpm.outline.overlaps import box_pairs, boxes
from skmpm.scene import Contacts, Scene
from skmpm.scene.contact_keys import ContactKeys, first_keys, lattice_code

# A rigid boundary that turns by more than this within a spacing s of the other boundary is treated as an edge: beside
# edges boundaries stretch to twice their length, and a chord of 2 s would lie deeper in it than s SHARP_TURN / 2,
# which is 0.13 cells for points 0.74 cells apart. Edges are projected as corners are.
SHARP_TURN = np.deg2rad(20.0)


@dataclass(frozen=True)
class Roles:
    """Which body of a pair contributes boundary points and which the curve."""

    rank: Ints  # (bodies,) the body of lower rank contributes the points
    spacing: Array  # (bodies,) mean distance of boundary points [m]
    bend: Array  # (m,) curvature of the boundaries of rigid bodies [1/m], zero elsewhere


@dataclass(frozen=True)
class Tension:
    """The contacts that bear tension in a step, those of its start.

    They are contacts in all iterates, wherever these lead: were one lost, so would be its tension.
    """

    key: Ints  # (n,) identities of contacts
    strength: Array  # (n,) largest tensions [N/m]

    @classmethod
    def none(cls) -> Tension:
        """No contact bears tension."""
        return cls(np.zeros(0, dtype=np.int64), np.zeros(0))

    def strength_of(self, key: Ints) -> Array:
        """Largest tensions (k,) [N/m] of the contacts with keys (k,)."""
        return lookup(self.key, self.strength, key, 0.0)

    def holds(self, key: Ints) -> Bools:
        """Whether contacts with keys (k,), or their second ones at the boundary points, bear tension."""
        return np.isin(key, first_keys(self.key))


@dataclass(frozen=True)
class Neighbours:
    """Candidate points and segments, all if no boundary point moves by more than half the margin of the search."""

    surfaces: Images  # what they are numbered by
    roles: Roles
    start: Cubics  # the outlines at the start of the step
    cell: float  # [m]
    reach: float  # detection distance [m]
    point: Ints  # (n,) sorted by point, then by side
    segment: Ints  # (n,)
    begins: Ints  # (groups,) first candidate of each group, those of a point on one side
    corner_pairs: Ints  # (2, k) pairs of convex corners of two bodies, or of parts of one
    own: SelfContact
    loaded: Ints  # identities of the contacts that pressed bodies together at the start
    shifts: Shifts = field(default_factory=Shifts.none)  # to the closest points of the curves
    tension: Tension = field(default_factory=Tension.none)
    facing: Cubics | None = None  # outlines by which points face a side or not; those at the start if none

    @cached_property
    def key(self) -> Ints:
        """Identities of the contacts of the groups, (groups,)."""
        return self.keys(self.point[self.begins], self.segment[self.begins])

    @cached_property
    def pressed(self) -> Bools:
        """Whether the contacts of the groups pressed bodies together at the start, (groups,)."""
        return np.isin(self.key, self.loaded)

    @cached_property
    def of_groups(self) -> Shifts:
        """The shifts of the contact points of the groups."""
        return self.shifts.at(self.key)

    @cached_property
    def ends(self) -> Ints:
        """First candidate of each group, and the number of candidates, (groups + 1,)."""
        return np.append(self.begins, self.point.size)

    @property
    def none(self) -> bool:
        """Whether there are no candidates."""
        return self.point.size + self.corner_pairs.size == 0

    @property
    def curve(self) -> Curve:
        """Topology and tangents of the outlines' curve."""
        return self.start.curve

    def keys(self, point: Ints, segment: Ints) -> Ints:
        """Identities of the contacts of boundary points with the sides of segments, both (k,), in all steps.

        A contact of images has that of a contact of their bodies, with the lattice vector between them.
        """
        curve, surfaces = self.curve, self.surfaces
        if surfaces.none:
            return self.numbers.between(point, curve.side[segment])
        boundary, body = surfaces.boundary, curve.outlines.body
        code = lattice_code(surfaces.between(body[point], body[segment]))
        return self.numbers.between(boundary[point], curve.side[boundary[segment]], code)

    @cached_property
    def numbers(self) -> ContactKeys:
        """The identities of contacts of the bodies, whose boundary points come before those of their images."""
        points = int(np.searchsorted(self.curve.outlines.body, self.surfaces.bodies))
        sides = int(self.curve.side[:points].max(initial=-1)) + 1
        return ContactKeys(points, sides, len(self.surfaces.lattice))


def neighbours(
    scene: Scene,
    surfaces: Images,
    start: Cubics,
    roles: Roles,
    own: SelfContact,
    margin: float,
    pairs: Ints,
    contacts: Contacts,
) -> Neighbours:
    """Candidates for contact of `pairs_of_bodies`: all points of that which gives them, corners of the other.

    Of two parts of one body that which comes first along the outline contributes the points. Pairs of images are not
    candidates, since each is a pair of a body and an image, too.
    """
    curve, x, reach = start.curve, start.x, contact_reach(scene)
    first, second = pairs
    contributes = roles.rank[first] < roles.rank[second]
    least = np.where(contributes, -1.0, SHARP_TURN / np.maximum(roles.spacing[second], 1e-300))
    bend = np.where(curve.sharp, 1e300, roles.bend)
    point, segment = candidates(curve.outlines, x, reach + margin, pairs, bend, least)
    itself = own.facing(x, reach + margin)
    if itself[0].size:
        kept = (itself[0] < itself[1]) | curve.sharp[itself[0]]
        point, segment = (np.append(a, b[kept]) for a, b in zip((point, segment), itself, strict=True))
    if itself[0].size or curve.corner.any():  # else they are sorted already
        order = np.lexsort((segment, curve.side[segment], point))
        point, segment = point[order], segment[order]
    begins = np.ones(point.size, dtype=bool)
    begins[1:] = (point[1:] != point[:-1]) | (np.diff(curve.side[segment]) != 0)
    return Neighbours(
        surfaces=surfaces,
        roles=roles,
        start=start,
        cell=scene.cell,
        reach=reach,
        point=point,
        segment=segment,
        begins=np.flatnonzero(begins),
        corner_pairs=_corner_pairs(curve, roles, point, segment),
        own=own,
        loaded=first_keys(contacts.key[contacts.force[0] > 0.0]),
    )


def pairs_of_bodies(scene: Scene, surfaces: Images, x: Array, reach: float) -> Ints:
    """Pairs (2, p) of bodies near each other, in both orders and sorted, one of which moves and one is no image."""
    low, high = boxes(surfaces.outlines, x, surfaces.body.size)
    pairs = both_ways(box_pairs(low - 0.5 * reach, high + 0.5 * reach))
    kept = scene.movable[surfaces.body[pairs]].any(axis=0) & (pairs < surfaces.bodies).any(axis=0)
    return pairs[:, kept]


def _corner_pairs(curve: Curve, roles: Roles, point: Ints, segment: Ints) -> Ints:
    """Pairs (2, k) of convex corners of these candidates, the first of the body or part that contributes points."""
    if not curve.convex.any():
        return np.zeros((2, 0), dtype=np.int64)
    boundary = curve.outlines
    first, second = boundary.body[point], boundary.body[segment]
    contributes = np.where(first == second, point < segment, roles.rank[first] < roles.rank[second])
    ends = np.concatenate([np.stack([point, end]) for end in (segment, boundary.next[segment])], axis=1)
    return np.unique(ends[:, np.tile(contributes, 2) & curve.convex[ends].all(axis=0)], axis=1)
