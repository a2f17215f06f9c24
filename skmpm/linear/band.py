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
    """Cholesky factor of all bodies in one band matrix; bodies are not coupled, so their factors do not overlap."""

    factor: Array  # (bandwidth + 1, n), lower form, columns contiguous
    blocks: Ints
    name: str = "banded"

    def __call__(self, b: Array, /) -> Array:
        """A^-1 b."""
        return np.asarray(cho_solve_banded((self.factor, True), b, check_finite=False))

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """H A^-1 H^T = sum over bodies of Z^T Z, Z = L^-1 H_b^T."""
        return by_body(self.blocks, H, self._squares)

    def _squares(self, start: int, stop: int, right: Array, first: Ints) -> Array:
        """Z^T Z of one body by forward substitution in block rows whose height is the half bandwidth.

        In each block row L consists of a lower and an upper triangle. Columns are skipped up to their first non-zero.
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
        """View of the square block of L that begins at this column, `below` rows below the diagonal.

        Entry (i, j) of L is stored at i + j bandwidths. One triangle of the view belongs to the block, the other one
        to other columns of L.
        """
        width, entries = self.factor.shape[0] - 1, self.factor.ravel(order="K")
        begin = column * (width + 1) + below
        return entries[begin : begin + width * size].reshape((width, size), order="F")[:size]


def banded(A: sp.bsr_array, blocks: Ints, rigid_motions: Array) -> Solver:
    """Banded Cholesky of all bodies at once (LAPACK pbtrf); for bodies of up to about 170 cells across."""
    band = _band(A, half_bandwidth(A))
    return Banded(cholesky_banded(band, overwrite_ab=True, lower=True, check_finite=False), blocks)


def _band(A: sp.bsr_array, width: int) -> Array:
    """The lower triangle of A in band storage, (width + 1, n): entry (i, j) in row i - j of column j."""
    n = A.shape[0]
    rows = np.repeat(np.arange(n // 2), np.diff(A.indptr))
    lower = np.flatnonzero(A.indices <= rows)
    row, column = rows[lower], A.indices[lower].astype(np.int64)
    at, data = 2 * (column * (width + 1) + row - column), A.data[lower]
    band = np.zeros((width + 1) * n)
    for a, b in ((0, 0), (1, 0), (1, 1)):
        band[at + a + b * width] = data[:, a, b]
    off_diagonal = row > column
    band[at[off_diagonal] + width] = data[off_diagonal, 0, 1]
    return band.reshape((width + 1, n), order="F")
