"""Identities of contacts, by which they are known from step to step.

A contact is known by its pair of boundary point and side. One across a periodic box is known by the lattice vector
between them, too. Lattice vectors count modulo three, which distinguishes neighbouring images, however far bodies
have moved.
"""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Ints


def lattice_code(k: Ints) -> Ints:
    """Number of a lattice vector k (edges, c) modulo three, (c,), zero for k = 0."""
    return np.asarray(3 ** np.arange(len(k))[::-1] @ (k % 3))


def recut_keys(key: Ints, pairs: int, change: Ints) -> Ints:
    """Keys (c,) of contacts after the edges of the box H have become H T: lattice vectors k become T^-1 k.

    `pairs` is the number of pairs of a boundary point and a side, `change` (2, 2) is T.
    """
    (a, b), (c, d) = change
    inverse = np.array([[d, -b], [-c, a]]) * int(a * d - b * c)
    guard = key < 0
    plain = np.where(guard, -1 - key, key)
    code, pair = np.divmod(plain, pairs)
    now = lattice_code(inverse @ np.stack(np.divmod(code, 3))) * pairs + pair
    return np.where(guard, -1 - now, now)


def guard_keys(key: Ints) -> Ints:
    """Identities of the second contacts at the boundary points, from those of the shifted ones, (k,)."""
    return -1 - key
