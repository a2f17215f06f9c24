"""Non-overlapping motion of rigid convex shapes, for `packing`: contacts by separating axes, rotations included.

The separation of two convex polygons along an outward normal of an edge is a lower bound of their distance, and the
largest of them, over the edges of both, says whether they overlap (the separating axis theorem; Ericson, Real-Time
Collision Detection, 2005, section 5.2). Constraints are the distances of the nearest vertices of the one polygon from
that edge of the other: as long as none is negative, the shapes do not overlap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from skmpm.arrays import Array, Ints
from skmpm.compiled import compiled
from skmpm.outline import outlines
from skmpm.outline.measures import chord_sagitta
from skmpm.outline.topology import ranges
from skmpm.packing.discs import MARGIN, OVERLAP, Box, Contacts, least_motion
from skmpm.points import Points
from skmpm.points.cloud import signed_area

ROWS = 3  # constraints of a pair: of the nearest vertex, and of the outermost ones that are nearly as close ...
NEARLY = 0.1  # ... by this [mean radius]
ROUNDS = 20  # linearisations per step
STRAIGHT = 1e-9  # sine of an angle of a polygon that turns the wrong way by round-off


@dataclass(frozen=True)
class Shapes:
    """N convex polygons about their centroids, in units of their mean radius."""

    vertices: Array  # (2, m) counter-clockwise, one shape after the other
    offsets: Ints  # (N + 1,)
    skin: Array  # (N,) by which the curve through the vertices leaves the polygon at most
    area: Array  # (N,)
    inertia: Array  # (N,) second moment of the area about the centroid
    inside: Array  # (N,) smallest distance of an edge from the centroid
    reach: Array  # (N,) largest distance of a vertex from the centroid
    radius: Array  # (N,) of the disc of that area

    def at(self, x: Array, size: float) -> Array:
        """The vertices (2, m) of shapes scaled by `size`, at positions and angles x (3, N)."""
        shape = np.repeat(np.arange(self.area.size), np.diff(self.offsets))
        c, s = np.cos(x[2])[shape], np.sin(x[2])[shape]
        return np.asarray(
            x[:2, shape] + size * np.stack([c, s]) * self.vertices[0] + size * np.stack([-s, c]) * self.vertices[1]
        )


def shapes_of(clouds: Sequence[Points], unit: float) -> Shapes:
    """The outer outlines of clouds of points about their centres of area, in units of `unit` [m].

    Raises
    ------
    ValueError
        if one has no outline, or is not convex
    """
    loops, inside, centres = [], [], [np.average(cloud.x, axis=1, weights=cloud.volume) for cloud in clouds]
    for i, (cloud, centre) in enumerate(zip(clouds, centres, strict=True)):
        if not cloud.outline:
            raise ValueError(f"shape {i} has no outline; give the points of a disc, ellipse, polygon, ... or a mesh")
        outer = [loop for loop in cloud.outline if signed_area(cloud.x[:, loop]) > 0.0]
        if len(outer) != 1:
            raise ValueError(f"shape {i} has {len(outer)} outer loops; packing takes shapes of one piece")
        loop = np.round((cloud.x[:, outer[0]] - centre[:, None]) / unit, 10)
        edge = np.roll(loop, -1, axis=1) - loop
        ahead = np.roll(edge, -1, axis=1)
        turn = (edge[0] * ahead[1] - edge[1] * ahead[0]) / (np.hypot(*edge) * np.hypot(*ahead))
        if turn.min() < -STRAIGHT * loop.shape[1]:
            where = cloud.x[:, outer[0][(int(turn.argmin()) + 1) % loop.shape[1]]]
            raise ValueError(f"shape {i} is not convex at {where}; packing takes convex shapes only")
        loops.append(loop)
        inside.append(((loop[0] * edge[1] - loop[1] * edge[0]) / np.hypot(*edge)).min())
    counts = np.array([loop.shape[1] for loop in loops])
    vertices, offsets = np.concatenate(loops, axis=1), np.append(0, np.cumsum(counts)).astype(np.int64)
    boundary = outlines([(np.arange(n),) for n in counts], offsets)
    area = np.round([cloud.volume.sum() / unit**2 for cloud in clouds], 10)  # rounded as lengths: any unit will do
    arm = [(cloud.x - centre[:, None]) / unit for cloud, centre in zip(clouds, centres, strict=True)]
    inertia = [(a**2).sum(axis=0) @ cloud.volume / unit**2 for a, cloud in zip(arm, clouds, strict=True)]
    reach = np.maximum.reduceat(np.hypot(*vertices), offsets[:-1])
    skin = chord_sagitta(boundary, vertices, len(clouds))
    of_area = np.round(inertia, 10), np.array(inside), reach, np.sqrt(area / np.pi)
    return Shapes(vertices, offsets, skin, area, *of_area)


def separate(shapes: Shapes, x: Array, size: float, box: Box, friction: float, tolerance: float) -> Array | None:
    """Move shapes at x (3, N) as little as possible until none overlap; None if that does not converge."""
    for _ in range(ROUNDS):
        contacts = _contacts(shapes, x, size, box)
        if contacts.gap.min(initial=0.0) >= -tolerance * float(shapes.radius.min()):
            return x
        slack = 0.5 * OVERLAP[0] * float(shapes.radius.min())
        motion = least_motion(contacts, shapes.area, size**2 * shapes.inertia, friction, slack)
        if motion is None or max(np.abs(motion[:2]).max(), np.abs(size * shapes.reach * motion[2]).max()) > MARGIN:
            return None
        x = x + motion
    return None


def _contacts(shapes: Shapes, x: Array, size: float, box: Box) -> Contacts:
    v, skin = shapes.at(x, size), size * shapes.skin
    a, b, image = _near_pairs(x[:2], size * shapes.reach, box)
    normal, point, gap = np.zeros((a.size, 2)), np.zeros((a.size, ROWS, 2)), np.full((a.size, ROWS), np.inf)
    _pairs(a, *_with_images(shapes.offsets, v, skin, b, image), NEARLY, normal, point, gap)
    rows, which = np.nonzero(gap < MARGIN)
    wall_first, wall_normal, wall_point, wall_gap = _at_walls(shapes, v, skin, box)
    first = np.concatenate([a[rows], wall_first])
    points = np.concatenate([point[rows, which].T, wall_point], axis=1)
    of_second = point[rows, which].T - x[:2, b[rows]] - image[:, rows]
    normals = np.concatenate([normal[rows].T, wall_normal], axis=1)
    gaps = np.concatenate([gap[rows, which], wall_gap])
    return Contacts(first, b[rows], normals, points - x[:2, first], of_second, gaps)


def _near_pairs(x: Array, reach: Array, box: Box) -> tuple[Ints, Ints, Array]:
    """Pairs of shapes whose circumscribed circles are closer than the margin, and displacements of the second (2, k).

    These lead to the image of the second shape nearest to the first; they are zero but in a periodic box.
    """
    a, b, apart = box.pairs(x, 2.0 * float(reach.max()) + MARGIN)
    near = np.hypot(*apart) < reach[a] + reach[b] + MARGIN
    image = np.where(box.periodic[:, None], x[:, a] - x[:, b] - apart, 0.0)
    return a[near].astype(np.int64), b[near].astype(np.int64), image[:, near]


def _with_images(offsets: Ints, v: Array, skin: Array, second: Ints, image: Array) -> tuple[Ints, Ints, Array, Array]:
    """The second shapes of pairs, and all shapes, with copies of those that are displaced by `image` (2, pairs)."""
    moved = np.flatnonzero(image.any(axis=0))
    number, copies = second.copy(), second[moved]
    number[moved] = skin.size + np.arange(moved.size)
    count = np.diff(offsets)[copies]
    own = ranges(offsets[copies], count)
    vertices = np.concatenate([v, v[:, own] + np.repeat(image[:, moved], count, axis=1)], axis=1)
    return number, np.append(offsets, offsets[-1] + np.cumsum(count)), vertices, np.append(skin, skin[copies])


def _at_walls(shapes: Shapes, v: Array, skin: Array, box: Box) -> tuple[Ints, Array, Array, Array]:
    """Shapes, normals, points, gaps of the nearest and the outermost nearly as close vertices at the four walls."""
    if box.periodic.all():
        return np.zeros(0, dtype=np.int64), np.zeros((2, 0)), np.zeros((2, 0)), np.zeros(0)
    shape = np.repeat(np.arange(skin.size), np.diff(shapes.offsets))
    found = []
    for axis, sign in ((axis, sign) for sign in (1.0, -1.0) for axis in np.flatnonzero(~box.periodic).tolist()):
        gap = (v[axis] if sign > 0.0 else box.size[axis] - v[axis]) - skin[shape]
        least = np.minimum.reduceat(gap, shapes.offsets[:-1])
        close = np.flatnonzero((gap < MARGIN) & (gap <= least[shape] + NEARLY))
        order = close[np.lexsort((v[1 - axis, close], shape[close]))]
        ends = np.diff(shape[order]) != 0
        kept = np.append(ends, True) | np.append(True, ends) | (gap[order] == least[shape[order]])
        normal = np.zeros((2, int(kept.sum())))
        normal[axis] = sign
        found.append((shape[order[kept]], normal, v[:, order[kept]], gap[order[kept]]))
    first, normal, point, gap = (np.concatenate(parts, axis=-1) for parts in zip(*found, strict=True))
    return first, normal, point, gap


@compiled
def _pairs(
    first: Ints,
    second: Ints,
    offsets: Ints,
    v: Array,
    skin: Array,
    nearly: float,
    normal: Array,
    point: Array,
    gap: Array,
) -> None:
    """Write the separating axis of every pair, from the second to the first, and the vertices nearest along it."""
    for p in range(first.size):
        best, edge, incident, ex, ey, nx, ny = -1e300, 0, 0, 0.0, 0.0, 0.0, 0.0
        for side in range(2):  # edges of the second against vertices of the first, and the other way round
            one, other = (second[p], first[p]) if side == 0 else (first[p], second[p])
            start, end = offsets[one], offsets[one + 1]
            for i in range(start, end):
                j = i + 1 if i + 1 < end else start
                dx, dy = v[0, j] - v[0, i], v[1, j] - v[1, i]
                length = np.sqrt(dx * dx + dy * dy)
                ax, ay = dy / length, -dx / length
                least = 1e300
                for q in range(offsets[other], offsets[other + 1]):
                    distance = ax * (v[0, q] - v[0, i]) + ay * (v[1, q] - v[1, i])
                    if distance < least:
                        least = distance
                        if least <= best:
                            break
                if least > best:
                    best, edge, incident, ex, ey, nx, ny = least, side, other, v[0, i], v[1, i], ax, ay
        sign = 1.0 if edge == 0 else -1.0
        normal[p, 0], normal[p, 1] = sign * nx, sign * ny
        skins = skin[first[p]] + skin[second[p]]
        lowest, low, high, low_q, high_q = 1e300, 1e300, -1e300, -1, -1
        for q in range(offsets[incident], offsets[incident + 1]):
            distance = nx * (v[0, q] - ex) + ny * (v[1, q] - ey)
            if distance < lowest:
                lowest = distance
                gap[p, 0], point[p, 0, 0], point[p, 0, 1] = distance - skins, v[0, q], v[1, q]
            if distance <= best + nearly:
                along = -ny * v[0, q] + nx * v[1, q]
                if along < low:
                    low, low_q = along, q
                if along > high:
                    high, high_q = along, q
        for k, q in ((1, low_q), (2, high_q)):
            distance = nx * (v[0, q] - ex) + ny * (v[1, q] - ey)
            if distance > lowest or v[0, q] != point[p, 0, 0] or v[1, q] != point[p, 0, 1]:
                gap[p, k], point[p, k, 0], point[p, k, 1] = distance - skins, v[0, q], v[1, q]
