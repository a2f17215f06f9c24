"""Banded Cholesky of all bodies at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.linalg.blas import dtrmm, dtrsm

from skmpm.linear.blockwise import by_body
from skmpm.linear.solver import Solver, half_bandwidth

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Banded:
    """Cholesky factor of all bodies as one band: bodies do not couple, so neither do their bands."""

    factor: Array  # (bandwidth + 1, n), lower form, columns contiguous
    blocks: Ints
    name: str = "banded"

    def __call__(self, b: Array, /) -> Array:
        """A^-1 b."""
        return np.asarray(cho_solve_banded((self.factor, True), b, check_finite=False))

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """H A^-1 H' = sum over bodies of Z'Z, Z = L^-1 H_b'."""
        return by_body(self.blocks, H, self._squares)

    def _squares(self, start: int, stop: int, right: Array, first: Ints) -> Array:
        """Z'Z of one body by forward substitution, block row after block row, each as high as the band is wide.

        What L has in a block row is a lower and an upper triangle; columns are left alone until they begin.
        """
        width, out = self.factor.shape[0] - 1, np.zeros((first.size, first.size))
        carried = np.zeros((width, 0), order="F")
        for begin in range(start, stop, width):
            end = min(begin + width, stop)
            active = int(np.searchsorted(first, end - start))
            block = np.asfortranarray(right[begin - start : end - start, :active])
            if carried.shape[1]:
                above = dtrmm(1.0, self._square(begin - width, width, width), carried)
                block[:, : carried.shape[1]] -= above[: end - begin]
            carried = dtrsm(1.0, self._square(begin, 0, end - begin), block, lower=1)
            out[:active, :active] += carried.T @ carried
        return out

    def _square(self, column: int, below: int, size: int) -> Array:
        """L from this column and `below` its diagonal on: entry (i, j) of L is i + j bandwidths into the factor.

        One triangle of it; what is stored in the place of the other belongs to other columns.
        """
        width, entries = self.factor.shape[0] - 1, self.factor.ravel(order="K")
        begin = column * (width + 1) + below
        return entries[begin : begin + width * size].reshape((width, size), order="F")[:size]


def banded(A: sp.bsr_array, blocks: Ints, rigid_motions: Array) -> Solver:
    """Banded Cholesky of all bodies at once (LAPACK pbtrf); best for bodies up to about 170 cells across."""
    band = _band(A, half_bandwidth(A))
    return Banded(cholesky_banded(band, overwrite_ab=True, lower=True, check_finite=False), blocks)


def _band(A: sp.bsr_array, width: int) -> Array:
    """The lower triangle of A by columns, (width + 1, n): entry (i, j) in row i - j of column j."""
    n = A.shape[0]
    rows = np.repeat(np.arange(n // 2), np.diff(A.indptr))
    lower = np.flatnonzero(A.indices <= rows)
    row, column = rows[lower], A.indices[lower].astype(np.int64)
    at, data = 2 * (column * (width + 1) + row - column), A.data[lower]
    band = np.zeros((width + 1) * n)
    for a, b in ((0, 0), (1, 0), (1, 1)):
        band[at + a + b * width] = data[:, a, b]
    beside = row > column
    band[at[beside] + width] = data[beside, 0, 1]
    return band.reshape((width + 1, n), order="F")
