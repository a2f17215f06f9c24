"""Candidates for contact: boundary points and segments of other bodies, or of other parts, near each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm import outline
from skmpm.contact.lattice_keys import lattice_code
from skmpm.contact.self_contact import SelfContact
from skmpm.contact.shifts import NO_SHIFTS, Shifts
from skmpm.outline import Cubics, Curve, Images
from skmpm.scene import Scene

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# A rigid boundary that turns by more than this within a spacing s of the other boundary is treated as an edge: beside
# edges boundaries stretch to twice their length, and a chord of 2 s would lie deeper in it than s SHARP_TURN / 2,
# which is 0.13 cells for points 0.74 cells apart.
SHARP_TURN = np.deg2rad(20.0)


@dataclass(frozen=True)
class Roles:
    """Which body of a pair contributes boundary points and which the curve."""

    rank: Ints  # (bodies,) the body of lower rank contributes the points
    spacing: Array  # (bodies,) mean distance of boundary points [m]
    bend: Array  # (m,) curvature of the boundaries of rigid bodies [1/m], zero elsewhere

    def edges(self, point: Ints, second: Ints) -> Bools:
        """Whether points (k,) of rigid bodies are edges, which are projected on the second bodies (k,) as corners."""
        return np.asarray(self.bend[point] * self.spacing[second] > SHARP_TURN)


@dataclass(frozen=True)
class Neighbours:
    """Candidate points and segments: complete if no boundary point moves by more than half the margin."""

    surfaces: Images  # what they are numbered by
    start: Cubics  # the outlines at the start of the step
    cell: float  # [m]
    reach: float  # detection distance [m]
    margin: float  # [m]
    point: Ints  # (n,) sorted by point, then by side
    segment: Ints  # (n,)
    begins: Ints  # (groups,) first candidate of each combination of point and side
    corner_pairs: Ints  # (2, k) pairs of convex corners of two bodies, or of parts of one
    own: SelfContact
    shifts: Shifts = NO_SHIFTS  # to the closest points of the curves

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

        In a periodic box they are those of the points and sides of the bodies, and of the lattice vector between
        these modulo three, which distinguishes neighbouring images.
        """
        curve, surfaces = self.curve, self.surfaces
        if surfaces.none:
            return np.asarray(point * curve.sides + curve.side[segment])
        boundary, own = surfaces.boundary, int(np.searchsorted(curve.outlines.body, surfaces.bodies))
        sides, body = int(curve.side[:own].max()) + 1, curve.outlines.body
        pair = boundary[point] * sides + curve.side[boundary[segment]]  # the bodies come before their images
        return np.asarray(lattice_code(surfaces.between(body[point], body[segment])) * own * sides + pair)


def neighbours(
    scene: Scene,
    surfaces: Images,
    curve: Curve,
    roles: Roles,
    own: SelfContact,
    x: Array,
    reach: float,
    margin: float,
) -> Neighbours:
    """Candidates for contact: all points of the body that contributes them, the corners of the other body.

    Of two parts of one body that which comes first along the outline contributes the points. Pairs of images are not
    candidates, since each is a pair of a body and an image, too.
    """
    boundary = curve.outlines
    others, itself = outline.candidates(boundary, x, reach + margin), own.facing(x, reach + margin)
    point, segment = (np.concatenate(parts) for parts in zip(others, itself, strict=True))
    first, second = boundary.body[point], boundary.body[segment]
    contributes = np.where(first == second, point < segment, roles.rank[first] < roles.rank[second])
    free = scene.movable[surfaces.body[first]] | scene.movable[surfaces.body[second]]
    if not surfaces.none:
        free &= (first < surfaces.bodies) | (second < surfaces.bodies)
    ends = np.concatenate([np.stack([point, end]) for end in (segment, boundary.next[segment])], axis=1)
    corner_pairs = np.unique(ends[:, np.tile(contributes & free, 2) & curve.convex[ends].all(axis=0)], axis=1)
    kept = (contributes | roles.edges(point, second) | curve.sharp[point]) & free
    point, segment = point[kept], segment[kept]
    order = np.lexsort((curve.side[segment], point))
    point, segment = point[order], segment[order]
    begins = np.ones(point.size, dtype=bool)
    begins[1:] = (point[1:] != point[:-1]) | (np.diff(curve.side[segment]) != 0)
    start, groups = curve.through(x), np.flatnonzero(begins)
    return Neighbours(surfaces, start, scene.cell, reach, margin, point, segment, groups, corner_pairs, own)
