"""Sparse LU factorisation, the reference solver of the tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from skmpm.linear.blockwise import by_columns
from skmpm.linear.solver import Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Direct:
    """Sparse LU of the whole matrix: slow and simple, the reference solver of the tests."""

    factor: spla.SuperLU
    blocks: Ints
    name: str = "direct"

    def __call__(self, b: Array, /) -> Array:
        """A^-1 b."""
        return np.asarray(self.factor.solve(b))

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """H A^-1 H^T."""
        return by_columns(self, self.blocks, H)


def direct(A: sp.bsr_array, blocks: Ints, rigid_motions: Array) -> Solver:
    """Factorise the whole matrix with SuperLU."""
    lu = spla.splu(A.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    return Direct(lu, blocks)
