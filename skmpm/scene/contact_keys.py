"""Identities of contacts, by which they are known from step to step.

A contact is known by its pair of boundary point and side, one with a wall by its boundary point. One across a
periodic box is known by the lattice vector between point and side, too. Lattice vectors count modulo three, which
distinguishes neighbouring images, however far bodies have moved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skmpm.arrays import Ints


@dataclass(frozen=True)
class ContactKeys:
    """The identities of the contacts of some boundary points and sides: first those between them, then at walls."""

    points: int
    sides: int
    edges: int = 0  # of a periodic box

    def between(self, point: Ints, side: Ints, code: Ints | int = 0) -> Ints:
        """Identities (k,) of contacts of points (k,) with sides (k,), from codes of lattice vectors (k,)."""
        return np.asarray((code * self.points + point) * self.sides + side)

    def at_walls(self, wall: Ints | int, point: Ints) -> Ints:
        """Identities (k,) of contacts of points (k,) with walls (k,)."""
        return np.asarray(self.points * (3**self.edges * self.sides + wall) + point)

    def parts(self, key: Ints) -> tuple[Ints, Ints, Ints]:
        """Points, sides and codes, each (k,), of contacts between points and sides."""
        pair, side = np.divmod(key, self.sides)
        code, point = np.divmod(pair, self.points)
        return point, side, code

    def points_at_walls(self, key: Ints) -> Ints:
        """Points (k,) of contacts with walls."""
        return np.asarray(key % self.points)

    def recut(self, key: Ints, change: Ints) -> Ints:
        """Identities (k,) after the edges of the box H have become H T: lattice vectors v become T^-1 v.

        `change` (2, 2) is T.
        """
        (a, b), (c, d) = change
        inverse = np.array([[d, -b], [-c, a]]) * int(a * d - b * c)
        point, side, code = self.parts(first_keys(key))
        now = self.between(point, side, lattice_code(inverse @ np.stack(np.divmod(code, 3))))
        return np.where(key < 0, guard_keys(now), now)


def lattice_code(v: Ints) -> Ints:
    """Number of a lattice vector v (edges, k) modulo three, (k,), zero for v = 0."""
    return np.asarray(3 ** np.arange(len(v))[::-1] @ (v % 3))


def guard_keys(key: Ints) -> Ints:
    """Identities of the second contacts at the boundary points, from those of the shifted ones, (k,)."""
    return -1 - key


def first_keys(key: Ints) -> Ints:
    """Identities (k,) of contacts, of the shifted ones instead of second ones at their boundary points."""
    return np.where(key < 0, -1 - key, key)
