"""Solver for diagonal matrices, such as the lumped mass of an explicit step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.linear.solver import Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Diagonal:
    """The inverse of a diagonal matrix."""

    inverse: Array  # (n,)
    name: str = "diagonal"

    def __call__(self, b: Array, /) -> Array:
        """A^-1 b, for b (n,) or (n, m)."""
        return np.asarray((self.inverse * b.T).T)

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """H A^-1 H^T."""
        return sp.csr_array(H @ sp.diags_array(self.inverse) @ H.T)


def diagonal(A: sp.bsr_array, blocks: Ints, rigid_motions: Array) -> Solver:
    """Division by the diagonal of A; off-diagonal entries are ignored."""
    return Diagonal(1.0 / A.diagonal())
