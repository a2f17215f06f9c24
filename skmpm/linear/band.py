"""Banded Cholesky of all bodies at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.linalg.lapack import dtrtrs

from skmpm.linear.compliance import by_body
from skmpm.linear.solver import Solver, half_bandwidth

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Banded:
    """Cholesky factor of all bodies as one band: bodies do not couple, so neither do their bands."""

    factor: Array  # (bandwidth + 1, n), lower form
    blocks: Ints
    name: str = "banded"

    def __call__(self, b: Array, /) -> Array:
        """A^-1 b."""
        return np.asarray(cho_solve_banded((self.factor, True), b, check_finite=False))

    def compliance(self, H: sp.csr_array) -> sp.csr_array:
        """H A^-1 H' = sum over bodies of Z'Z, Z = L^-1 H_b', with each body's factor made dense."""
        return by_body(self.blocks, H, self._squares)

    def _squares(self, start: int, stop: int, right: Array) -> Array:
        size, width = stop - start, self.factor.shape[0]
        column = np.arange(size)
        L = np.zeros((size + width, size), order="F")
        L[column + np.arange(width)[:, None], column] = self.factor[:, start:stop]
        Z, _ = dtrtrs(L[:size], right, lower=1)
        return np.asarray(Z.T @ Z)


def banded(A: sp.bsr_array, blocks: Ints, rigid_motions: Array) -> Solver:
    """Banded Cholesky of all bodies at once (LAPACK pbtrf); best for bodies up to about 170 cells across."""
    width, n = half_bandwidth(A), A.shape[0]
    rows = np.repeat(np.arange(n // 2), np.diff(A.indptr))
    distance = 2 * (rows - A.indices)
    band = np.zeros((width + 1, n))
    for a, b in ((0, 0), (0, 1), (1, 0), (1, 1)):
        lower = distance + a - b >= 0
        band[distance[lower] + a - b, 2 * A.indices[lower] + b] = A.data[lower, a, b]
    return Banded(cholesky_banded(band, overwrite_ab=True, lower=True, check_finite=False), blocks)
