"""What a solver is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class Solver(Protocol):
    """A factorised matrix."""

    @property
    def name(self) -> str:
        """Which solver this is."""

    def __call__(self, b: Array, /) -> Array:
        """A^-1 b, for b (n,) or (n, m)."""

    def compliance(self, H: sp.csr_array) -> sp.csr_array:
        """H A^-1 H', (k, k), for rows H (k, n)."""


Linear = Callable[[sp.bsr_array, Ints, Array], Solver]


def half_bandwidth(A: sp.bsr_array) -> int:
    """Largest distance of an entry from the diagonal."""
    nodes = A.shape[0] // 2
    rows = np.repeat(np.arange(nodes), np.diff(A.indptr))
    return 2 * int((rows - A.indices).max(initial=0)) + 1
