"""Where contact points meet the sides of other outlines: corners, notches and all.

Corners cut an outline into sides, smooth curves. A point may touch several sides of one body: in a notch those to
both hands bound it. Where sides meet in a corner that sticks out it is enough to be in front of one of them.
Corners are points whichever body gives them: a side may touch a corner between two of its own points. So are places
that deformation has made as sharp.

A contact of a vertex has a normal along which both edges of the vertex lead away from the other side (a vertex of the
Minkowski difference of the two bodies); what edges that point into it touch is touched by other points. See `tips`
for two corners that meet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm import outline
from skmpm.contact.corner_contact import dot, wedge
from skmpm.contact.tables import among, joined
from skmpm.outline import Cubics, Curve
from skmpm.scene import Scene

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

MAX_DEPTH = 1.0  # a point deeper than this many cells belongs to the other side of the body
FACING = -0.3  # largest cosine between the normals of two surfaces in contact; of a corner 0
MAX_EDGE_SINE = 0.5  # sine of the angle by which the boundary beside a contact point may dip into the other surface
CORNER_RADIUS = 0.05  # depth below a tip of the centre of the disc that rounds it [cells]
MAX_EDGE_DEPTH = 0.1  # by how much it may always do so [cells]
# A rigid boundary that turns by more within a spacing s of the other boundary is an edge: a chord of 2 s, as
# boundaries are stretched beside edges, would lie deeper in it than s EDGE / 2, 0.13 cells for points 0.74 cells
# apart.
SHARP_TURN = np.deg2rad(20.0)
END_TOLERANCE = 1e-6  # of a segment: how far beside the end of a side a point is still in front of it


@dataclass(frozen=True)
class Roles:
    """What the bodies of a pair give, the points or the curve."""

    rank: Ints  # (bodies,) the lower one of a pair gives the points
    spacing: Array  # (bodies,) mean distance of boundary points [m]
    bend: Array  # (m,) curvature of the boundaries of rigid bodies [1/m], zero elsewhere

    def give(self, point: Ints, first: Ints, second: Ints) -> Bools:
        """Whether points (k,) of bodies (k,) touch the curves of other bodies (k,)."""
        edge = self.bend[point] * self.spacing[second] > SHARP_TURN
        return np.asarray((self.rank[first] < self.rank[second]) | edge)


@dataclass(frozen=True)
class Neighbours:
    """Candidate points and segments, complete as long as no boundary point moves by more than half the margin."""

    start: Cubics  # the outlines at the start of the step
    cell: float
    reach: float
    margin: float
    point: Ints  # (n,) sorted by point, then by side
    segment: Ints  # (n,)
    begins: Ints  # where those of another point or side begin
    corner_pairs: Ints  # (2, k) pairs of corners

    @property
    def none(self) -> bool:
        """Whether no body comes near another."""
        return self.point.size + self.corner_pairs.size == 0

    @property
    def curve(self) -> Curve:
        """The outlines' curve."""
        return self.start.curve


def neighbours(
    scene: Scene, curve: Curve, roles: Roles, x: Array, cell: float, reach: float, margin: float
) -> Neighbours:
    """Which points may touch which segments: all of the body that gives the points, of the other one its corners."""
    boundary = curve.outlines
    point, segment = outline.candidates(boundary, x, reach + margin)
    first, second = boundary.body[point], boundary.body[segment]
    gives, free = roles.rank[first] < roles.rank[second], scene.deformable[first] | scene.deformable[second]
    ends = np.concatenate([np.stack([point, end]) for end in (segment, boundary.next[segment])], axis=1)
    corner_pairs = np.unique(ends[:, np.tile(gives & free, 2) & curve.convex[ends].all(axis=0)], axis=1)
    kept = (roles.give(point, first, second) | curve.sharp[point]) & free
    point, segment = point[kept], segment[kept]
    order = np.lexsort((curve.side[segment], point))
    point, segment = point[order], segment[order]
    begins = np.ones(point.size, dtype=bool)
    begins[1:] = (point[1:] != point[:-1]) | (np.diff(curve.side[segment]) != 0)
    return Neighbours(curve.through(x), cell, reach, margin, point, segment, np.flatnonzero(begins), corner_pairs)


@dataclass(frozen=True)
class FootPoints:
    """Contact points and their feet on sides, or on corners, of other bodies."""

    point: Ints  # (k,) boundary vertex
    segment: Ints  # (k,)
    s: Array  # (k,)
    corner_pair: Bools  # (k,) whether two corners meet there, that of the segment at its start
    normal: Array  # (2, k) from the foot to the point
    gap: Array  # (k,) [m]
    beside: Bools  # (k,) whether the point is off the end of the side, or sees no tip
    key: Ints  # (k,) identity


def foot_points(near: Neighbours, now: Cubics) -> tuple[FootPoints, FootPoints]:
    """All contacts within reach of outlines as they are now; where their feet were at the start of the step."""
    point, segment, s = _nearest(near, now.x)
    found = project(near, now, point, segment, s, np.zeros(point.size, dtype=bool))
    close = (found.gap > -MAX_DEPTH * near.cell) & (found.gap < near.reach)
    found = among(found, np.flatnonzero(~found.beside & close))
    before = project(near, near.start, found.point, found.segment, found.s, found.corner_pair)
    chosen = np.flatnonzero(_faces(near, before))
    chosen = chosen[_outermost(near.curve, among(found, chosen))]
    corner_pairs = _corner_pairs(near, now)
    chosen = chosen[~_superseded(near.curve, among(found, chosen), corner_pairs)]
    tips_before = project(
        near, near.start, corner_pairs.point, corner_pairs.segment, corner_pairs.s, corner_pairs.corner_pair
    )
    return joined([among(found, chosen), corner_pairs]), joined([among(before, chosen), tips_before])


def _nearest(near: Neighbours, x: Array) -> tuple[Ints, Ints, Array]:
    """Of every point and every side near it the nearest segment, and where on it."""
    c, i = near.point, near.segment
    s, distance = outline.closest(x[:, c], x[:, i], x[:, near.curve.outlines.next[i]])
    if c.size == 0:
        return c, i, s
    smallest = np.minimum.reduceat(distance, near.begins)
    group = np.repeat(np.arange(smallest.size), np.diff(near.begins, append=c.size))
    nearest = np.flatnonzero(distance == smallest[group])
    nearest = nearest[np.unique(group[nearest], return_index=True)[1]]
    kept = nearest[distance[nearest] < MAX_DEPTH * near.cell]
    return c[kept], i[kept], s[kept]


def project(near: Neighbours, shape: Cubics, c: Ints, segment: Ints, s: Array, corner_pair: Bools) -> FootPoints:
    """Project points c (k,) on the sides of segments (k,), from a start nearby; tips on their corners."""
    curve, x = near.curve, shape.x
    there, at = shape.project(x[:, c], segment, s)
    segment, s = np.where(corner_pair, segment, there), np.where(corner_pair, 0.0, at)
    slope = shape.at(segment, s, 1)
    speed = np.maximum(np.hypot(*slope), 1e-300)
    apart, normal = x[:, c] - shape.at(segment, s), np.stack([slope[1], -slope[0]]) / speed
    gap = dot(apart, normal)
    along = np.abs(apart[0] * normal[1] - apart[1] * normal[0])
    key = c * curve.sides + curve.side[segment]
    # What is right on a corner is touched by it; two corners at the same place may be flush sides.
    on_corner = _on_corner(curve, segment, s) & ~curve.sharp[c]
    off_end = curve.at_corner(segment, s) & (along > END_TOLERANCE * speed)
    beside = ~corner_pair & (off_end | on_corner)
    corner_pairs = wedge(curve, x, c[corner_pair], segment[corner_pair], CORNER_RADIUS * near.cell)
    normal[:, corner_pair], gap[corner_pair], beside[corner_pair], key[corner_pair] = (
        corner_pairs.normal,
        corner_pairs.gap,
        ~corner_pairs.seen,
        corner_pairs.key,
    )
    return FootPoints(c, segment, s, corner_pair, normal, gap, beside, key)


def _on_corner(curve: Curve, segment: Ints, s: Array) -> Bools:
    """Whether places are corners that stick out, (k,)."""
    start, end = curve.convex[segment], curve.convex[curve.outlines.next[segment]]
    return np.asarray((start & (s <= END_TOLERANCE)) | (end & (s >= 1.0 - END_TOLERANCE)))


def tangent_shares(shape: Cubics, at: FootPoints) -> tuple[Array, Array]:
    """Shares (4, k) of the stencils in the unit tangents of the surfaces under the feet; their curvatures [1/m]."""
    curve, i = shape.curve, at.segment
    speed = np.hypot(*shape.at(i, at.s, 1))
    smooth = ~curve.at_corner(i, at.s)
    shares = np.where(smooth, curve.weights(i, at.s, 1) / speed, 0.0)
    curvature = np.where(smooth, dot(at.normal, shape.at(i, at.s, 2)) / speed**2, 0.0)
    return shares, curvature


def _faces(near: Neighbours, before: FootPoints) -> Bools:
    """Whether points face the surfaces of their feet and their edges do not dip into these.

    At the start of the step: who touches whom does not hang on how edges turn from iterate to iterate.
    """
    curve, x, c, n = near.curve, near.start.x, before.point, before.normal
    facing = dot(outline.normals(curve.outlines, x)[:, c], n)
    keeps_off = np.ones(c.size, dtype=bool)
    for neighbour in (curve.outlines.next, curve.outlines.previous):
        edge = x[:, neighbour[c]] - x[:, c]
        # Squeezed together, boundary points are at heights that say little about the slope between them.
        keeps_off &= dot(edge, n) > -np.maximum(MAX_EDGE_SINE * np.hypot(*edge), MAX_EDGE_DEPTH * near.cell)
    return np.asarray((facing < np.where(curve.sharp[c], 0.0, FACING)) & keeps_off)


def _outermost(curve: Curve, found: FootPoints) -> Bools:
    """Where two sides meet in a corner that sticks out: only the one that the point is more in front of."""
    boundary, sides = curve.outlines, curve.sides
    corner = np.flatnonzero(curve.convex)
    before, after = curve.side[boundary.previous[corner]], curve.side[corner]
    key = found.key  # sorted, as points and sides are
    kept = np.ones(key.size, dtype=bool)
    for own, other in ((before, after), (after, before)):
        across = np.full(sides, -1)
        across[own] = other
        there = across[curve.side[found.segment]]
        place = np.minimum(np.searchsorted(key, found.point * sides + there), max(key.size - 1, 0))
        rival = (there >= 0) & (key[place] == found.point * sides + there)
        kept &= ~(rival & (found.gap[place] > found.gap))
    return kept


def _corner_pairs(near: Neighbours, now: Cubics) -> FootPoints:
    """Corners that see each other tip to tip."""
    c, j = near.corner_pairs
    found = project(near, now, c, j, np.zeros(c.size), np.ones(c.size, dtype=bool))
    return among(found, ~found.beside & (np.abs(found.gap) < near.reach))


def _superseded(curve: Curve, found: FootPoints, corner_pairs: FootPoints) -> Bools:
    """Whether feet are of one of two tips on a side beside the other, (k,)."""
    boundary, sides = curve.outlines, curve.sides
    c, j = corner_pairs.point, corner_pairs.segment
    pairs = [(a, curve.side[b]) for p, q in ((c, j), (j, c)) for a, b in ((p, q), (p, boundary.previous[q]))]
    keys = np.concatenate([a * sides + b for a, b in pairs])
    return np.isin(found.key, keys)
