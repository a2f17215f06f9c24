"""Images of outlines in a periodic box.

The plane is tiled by the box, whose edges are the columns h_1 and h_2 of a matrix H, and every body has images at
H k for all pairs k of integers. Bodies are first moved into one box, each by a lattice vector. Two of them meet, or a
body meets itself, where one meets an image of the other; since with k, -k of the other one is the same meeting, only
half of the vectors k are needed, and of the images only those whose bounding boxes come close to one of the bodies.
The edges are replaced by the shortest ones of the same lattice (Lagrange and Gauss), however slanted the box is. A
box that is periodic in one direction has one edge: H is a column, and k one integer.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.outline.curve import Cubics
from skmpm.outline.near import penetration
from skmpm.outline.overlaps import box_pairs, boxes, overlap
from skmpm.outline.topology import Outlines, ranges

NO_AREA = 1e-14  # of the area of a polygon's overlap, over that of the box around all


@dataclass(frozen=True, eq=False)
class Images:
    """Outlines of n bodies, moved into one box, and of those images that come close to them.

    Attributes
    ----------
    outlines : m boundary points; bodies 0, ..., n - 1, then a number for each image
    boundary : (m,) the boundary point of a body that each one is an image of
    body : (n + images,) the body that each one is an image of
    lattice : (edges, n + images) k of the lattice vector H k by which each one is displaced; 0 edges without
    bodies : n
    """

    outlines: Outlines
    boundary: Ints
    body: Ints
    lattice: Ints
    bodies: int

    @property
    def none(self) -> bool:
        """Whether these are the bodies where they are, without a periodic box."""
        return self.body.size == self.bodies and not self.lattice.any()

    @cached_property
    def owner(self) -> Ints:
        """The body that each boundary point belongs to, (m,)."""
        return self.body[self.outlines.body]

    def bodies_of(self, number: Ints) -> Ints:
        """The bodies that these are images of; walls, below zero, stay what they are."""
        return np.where(number < 0, number, self.body[np.maximum(number, 0)])

    def at(self, x: Array, box: Array | None) -> Array:
        """Positions (2, m) [m], from those x of the boundary points of the bodies and H (2, edges) [m]."""
        if box is None or self.none:
            return x
        return np.asarray(x[:, self.boundary] + (box @ self.lattice)[:, self.outlines.body])

    def between(self, first: Ints, second: Ints) -> Ints:
        """Lattice vectors k (edges, c) from bodies `second` to the images of them that `first` meet, both (c,)."""
        return np.asarray(self.lattice[:, second] - self.lattice[:, first])

    def overlap(self, x: Array) -> tuple[Ints, Array]:
        """Pairs of bodies (2, p) whose bounding boxes overlap, with the area that they share (p,) [m2].

        `x` (2, m) [m] as `at` returns it. A pair that meets across several edges of the box is named as often.
        """
        pairs, area = overlap(self.outlines, x, self.body.size)
        kept = (pairs < self.bodies).any(axis=0)
        return np.sort(self.body[pairs[:, kept]], axis=0), area[kept]

    def depth(self, shape: Cubics) -> tuple[Ints, Array, Array]:
        """Pairs of bodies (2, p) whose boxes overlap, with the area (p,) [m2] and depth (p,) [m] of their overlap.

        The depth is that of curves. Those of polygons that only touch overlap by what smoothing has added, which does
        not count.
        """
        pairs, area = overlap(self.outlines, shape.x, self.body.size)
        kept = (pairs < self.bodies).any(axis=0)
        pairs, area, depth = pairs[:, kept], area[kept], np.zeros(np.count_nonzero(kept))
        over = area > NO_AREA * float(np.ptp(shape.x, axis=1).prod())
        depth[over] = penetration(shape, pairs[:, over])
        return np.sort(self.body[pairs], axis=0), area, depth


def without_images(outlines: Outlines, bodies: int) -> Images:
    """Images of bodies without a periodic box: the bodies alone, where they are."""
    each = np.arange(bodies)
    return Images(outlines, np.arange(outlines.size), each, np.zeros((0, bodies), dtype=np.int64), bodies)


def images(outlines: Outlines, x: Array, bodies: int, box: Array | None, reach: float) -> Images:
    """Bodies moved into one box, and their images whose bounding boxes come closer than `reach` to one of a body.

    `x` (2, m) [m] are the boundary points, `box` (2, edges) [m] the edges of the box as columns, None without one;
    `reach` is in m.
    """
    if box is None:
        return without_images(outlines, bodies)
    reduction = reduced(box)
    edges = box @ reduction
    low, high = boxes(outlines, x, bodies)
    real = np.flatnonzero(low[0] <= high[0])
    home = np.zeros((edges.shape[1], bodies), dtype=np.int64)
    home[:, real] = -np.floor(np.linalg.pinv(edges) @ (0.5 * (low + high)[:, real])).astype(np.int64)
    low, high = low + edges @ home, high + edges @ home
    steps = _half_plane(edges, float((high - low)[:, real].max(initial=0.0)) + reach)
    body, lattice = _near(low, high, real, edges, steps, reach)
    first = np.searchsorted(outlines.body, np.arange(bodies + 1))
    count = np.diff(first)[body]
    copied = ranges(first[body], count)
    shift = np.repeat(outlines.size + np.cumsum(count) - count - first[body], count)
    extended = Outlines(
        point=np.append(outlines.point, outlines.point[copied]),
        body=np.append(outlines.body, np.repeat(bodies + np.arange(body.size), count)),
        next=np.append(outlines.next, outlines.next[copied] + shift),
        previous=np.append(outlines.previous, outlines.previous[copied] + shift),
    )
    return Images(
        extended,
        np.append(np.arange(outlines.size), copied),
        np.append(np.arange(bodies), body),
        reduction @ np.concatenate([home, home[:, body] + lattice], axis=1),
        bodies,
    )


def reduced(box: Array) -> Ints:
    """Unimodular matrix (edges, edges) from the edges of a box to the shortest ones of its lattice."""
    change = np.eye(box.shape[1], dtype=np.int64)
    while box.shape[1] > 1:
        a, b = (box @ change).T
        if a @ a > b @ b:
            change = np.stack([change[:, 1], -change[:, 0]], axis=1)  # keeps the orientation
            a, b = b, -a
        times = int(np.rint((a @ b) / (a @ a)))
        if times == 0:
            return change
        change[:, 1] -= times * change[:, 0]
    return change


def heights(box: Array) -> Array:
    """Distances (edges,) [m] between the opposite sides of a box with edges (2, edges) [m] as columns."""
    return np.asarray(1.0 / np.sqrt((np.linalg.pinv(box) ** 2).sum(axis=1)))


def lattice_vectors(most: Ints) -> Ints:
    """All vectors (edges, s) of integers whose components are at most `most` (edges,), of either sign."""
    return np.stack(np.meshgrid(*(np.arange(-n, n + 1) for n in most), indexing="ij")).reshape(most.size, -1)


def _half_plane(edges: Array, size: float) -> Ints:
    """One of k and -k of each lattice vector that may lie between boxes of bodies in one periodic box, (edges, s).

    `size` [m] is the largest side of these boxes.
    """
    k = lattice_vectors(1 + (size / heights(edges)).astype(np.int64))
    return k[:, first_half(k)]


def first_half(k: Ints) -> Bools:
    """Which (s,) of lattice vectors k (edges, s) and -k: that whose last component other than zero is positive."""
    found = k[0] > 0
    for row in k[1:]:
        found = (row > 0) | ((row == 0) & found)
    return np.asarray(found)


def _near(low: Array, high: Array, real: Ints, edges: Array, steps: Ints, reach: float) -> tuple[Ints, Ints]:
    """Bodies (c,) and lattice vectors (edges, c) of the images whose boxes come closer than `reach` to a body's."""
    body, lattice = np.tile(real, steps.shape[1]), np.repeat(steps, real.size, axis=1)
    grown = [low[:, real] - 0.5 * reach, high[:, real] + 0.5 * reach]
    moved = [a[:, np.tile(np.arange(real.size), steps.shape[1])] + edges @ lattice for a in grown]
    inside = (moved[0] < grown[1].max(axis=1, keepdims=True)) & (moved[1] > grown[0].min(axis=1, keepdims=True))
    kept = np.flatnonzero(inside.all(axis=0))
    pairs = box_pairs(*(np.concatenate([a, b[:, kept]], axis=1) for a, b in zip(grown, moved, strict=True)))
    found = np.zeros(kept.size, dtype=np.bool_)
    found[pairs[1, (pairs[0] < real.size) & (pairs[1] >= real.size)] - real.size] = True
    return body[kept[found]], lattice[:, kept[found]]
