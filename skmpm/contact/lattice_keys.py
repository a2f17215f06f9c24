"""Identities of contacts in a periodic box: of the pair of point and side, and of the lattice vector between them.

Lattice vectors count modulo three, which distinguishes neighbouring images, however far bodies have moved.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]


def lattice_code(k: Ints) -> Ints:
    """Number of a lattice vector k (2, c) modulo three, (c,), zero for k = 0."""
    i, j = k % 3
    return np.asarray(3 * i + j)


def recut_keys(key: Ints, pairs: int, change: Ints) -> Ints:
    """The same contacts (c,) after the edges of the box H have become H T, `change` T (2, 2).

    `pairs` is the number of pairs of a boundary point and a side. Lattice vectors k become T^-1 k.
    """
    (a, b), (c, d) = change
    inverse = np.array([[d, -b], [-c, a]]) * int(a * d - b * c)
    guard = key < 0
    plain = np.where(guard, -1 - key, key)
    code, pair = np.divmod(plain, pairs)
    now = lattice_code(inverse @ np.stack(np.divmod(code, 3))) * pairs + pair
    return np.where(guard, -1 - now, now)
