"""Banded Cholesky of every body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.compiled import compiled
from skmpm.linear import lapack
from skmpm.linear.blockwise import Rows, by_body
from skmpm.linear.solver import NotPositiveDefinite, Solver
from skmpm.parallel import over_bodies

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

PANEL = 4  # columns of L that are eliminated at once; a band has PANEL - 1 rows of zeros below its own
BLOCK = 64  # rows of Z in one product Z^T Z, by which zeros above the first entry of a column are left out


@dataclass(frozen=True)
class Banded:
    """Cholesky factors of the bodies, each in a band of its own width."""

    bands: Array  # the lower bands column by column, body after body
    offsets: Ints  # (bodies + 1,) where the band of each body begins
    blocks: Ints  # (bodies + 1,) first unknown of each body
    name: str = "banded"

    def __call__(self, b: Array, /) -> Array:
        """A^-1 b; bodies where b is zero cost nothing."""
        columns = 1 if b.ndim == 1 else b.shape[1]
        x = np.array(b.T, dtype=np.float64, order="C").reshape(columns, b.shape[0])
        over_bodies(lambda first, last: _solve(first, last, self.bands, self.offsets, self.blocks, x), self.blocks)
        return x.reshape(b.T.shape).T

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """H A^-1 H^T = sum over bodies of Z^T Z, Z = L^-1 H_b^T."""
        return by_body(self.blocks, H, self._squares)

    def _squares(self, rows: Rows, out: Array, begins: Ints) -> None:
        entries = np.searchsorted(rows.entry, np.arange(rows.row.size + 1))
        arguments = (
            self.bands, self.offsets, self.blocks, rows.ends, rows.first, entries, rows.dof, rows.value, out, begins,
        )  # fmt: skip
        over_bodies(lambda first, last: _squares(first, last, *arguments), self.blocks)


def _band_of(factor: Banded, body: int) -> Array:
    """The band of one body, (rows, unknowns): entry (i, j) of L in row i - j of column j."""
    unknowns = int(factor.blocks[body + 1] - factor.blocks[body])
    band = factor.bands[factor.offsets[body] : factor.offsets[body + 1]]
    return band.reshape((-1, unknowns), order="F")


def banded(A: sp.bsr_array, blocks: Ints, rigid_motions: Array) -> Solver:
    """Banded Cholesky of every body (LAPACK pbtrf); for bodies of up to about 170 cells across."""
    blocks = np.asarray(blocks, dtype=np.int64)
    heights = _widths(A, blocks) + PANEL
    offsets = np.append(0, np.cumsum(heights * np.diff(blocks)))
    return _factorised(
        Banded(np.empty(offsets[-1]), offsets, blocks), A, heights, np.ones(blocks.size - 1, dtype=bool)
    )


def _factorised(factor: Banded, A: sp.bsr_array, heights: Ints, chosen: NDArray[np.bool_]) -> Banded:
    """The factor with the blocks of A of the chosen bodies; its bands are overwritten."""
    blocks, failed = factor.blocks, np.zeros(chosen.size, dtype=bool)

    def factorise(first: int, last: int) -> None:
        _fill(first, last, chosen, A.indptr, A.indices, A.data, blocks, heights, factor.offsets, factor.bands)
        for body in (np.flatnonzero(chosen[first:last]) + first).tolist():
            if blocks[body + 1] > blocks[body]:
                failed[body] = lapack.factorise(_band_of(factor, body)) > 0

    over_bodies(factorise, blocks)
    if failed.any():
        raise NotPositiveDefinite(np.flatnonzero(failed), lambda B: _factorised(factor, B, heights, failed))
    return factor


def _widths(A: sp.bsr_array, blocks: Ints) -> Ints:
    """Half bandwidth of each body, in unknowns, (bodies,)."""
    nodes = A.indptr.size - 1
    reach = np.zeros(nodes, dtype=np.int64)
    filled = np.flatnonzero(np.diff(A.indptr))
    if filled.size:
        reach[filled] = np.maximum(filled - np.minimum.reduceat(A.indices, A.indptr[filled]), 0)
    widest = np.zeros(blocks.size - 1, dtype=np.int64)
    np.maximum.at(widest, np.searchsorted(blocks[1:], 2 * np.arange(nodes), side="right"), reach)
    return 2 * widest + 1


@compiled
def _fill(
    first: int,
    last: int,
    chosen: NDArray[np.bool_],
    indptr: NDArray[np.integer],
    indices: NDArray[np.integer],
    data: Array,
    blocks: Ints,
    heights: Ints,
    offsets: Ints,
    bands: Array,
) -> None:
    """Write the lower triangle of A to the bands of the chosen bodies."""
    for body in range(first, last):
        if not chosen[body]:
            continue
        height, start = heights[body], blocks[body] // 2
        bands[offsets[body] : offsets[body + 1]] = 0.0
        for row in range(start, blocks[body + 1] // 2):
            for e in range(indptr[row], indptr[row + 1]):
                column = indices[e]
                if column <= row:
                    at = offsets[body] + 2 * (column - start) * height + 2 * (row - column)
                    bands[at] = data[e, 0, 0]
                    bands[at + 1] = data[e, 1, 0]
                    bands[at + height] = data[e, 1, 1]
                    if column < row:
                        bands[at + height - 1] = data[e, 0, 1]


@compiled
def _solve(first: int, last: int, bands: Array, offsets: Ints, blocks: Ints, x: Array) -> None:
    """Overwrite right-hand sides x (k, n) by (L L^T)^-1 x in the bodies first:last where they are not zero."""
    for body in range(first, last):
        band, n = bands[offsets[body] : offsets[body + 1]], blocks[body + 1] - blocks[body]
        for k in range(x.shape[0]):
            own = x[k, blocks[body] : blocks[body + 1]]
            if own.any():
                _substitute(band, band.size // n, own)


@compiled
def _substitute(band: Array, height: int, x: Array) -> None:
    """Forward and back substitution in place, PANEL columns of L at once where there are as many.

    Entry (i, j) of L is band[j height + i - j]; it is zero beyond the band by less than PANEL rows.
    """
    n, width = x.size, height - PANEL
    full = n - n % PANEL
    for j in range(0, full, PANEL):
        a = j * height
        b, c, d = a + height - 1, a + 2 * (height - 1), a + 3 * (height - 1)  # band[b + i] is entry (j + i, j + 1)
        x0 = x[j] / band[a]
        x1 = (x[j + 1] - band[a + 1] * x0) / band[b + 1]
        x2 = (x[j + 2] - band[a + 2] * x0 - band[b + 2] * x1) / band[c + 2]
        x3 = (x[j + 3] - band[a + 3] * x0 - band[b + 3] * x1 - band[c + 3] * x2) / band[d + 3]
        x[j], x[j + 1], x[j + 2], x[j + 3] = x0, x1, x2, x3
        for i in range(PANEL, min(width + PANEL, n - j)):
            x[j + i] -= band[a + i] * x0 + band[b + i] * x1 + band[c + i] * x2 + band[d + i] * x3
    for j in range(full, n):
        x[j] /= band[j * height]
        for i in range(1, n - j):
            x[j + i] -= band[j * height + i] * x[j]
    for j in range(n - 1, full - 1, -1):
        for i in range(1, n - j):
            x[j] -= band[j * height + i] * x[j + i]
        x[j] /= band[j * height]
    for j in range(full - PANEL, -1, -PANEL):
        a = j * height
        b, c, d = a + height - 1, a + 2 * (height - 1), a + 3 * (height - 1)
        s0, s1, s2, s3 = x[j], x[j + 1], x[j + 2], x[j + 3]
        for i in range(PANEL, min(width + PANEL, n - j)):
            s0 -= band[a + i] * x[j + i]
            s1 -= band[b + i] * x[j + i]
            s2 -= band[c + i] * x[j + i]
            s3 -= band[d + i] * x[j + i]
        x3 = s3 / band[d + 3]
        x2 = (s2 - band[c + 3] * x3) / band[c + 2]
        x1 = (s1 - band[b + 2] * x2 - band[b + 3] * x3) / band[b + 1]
        x0 = (s0 - band[a + 1] * x1 - band[a + 2] * x2 - band[a + 3] * x3) / band[a]
        x[j], x[j + 1], x[j + 2], x[j + 3] = x0, x1, x2, x3


@compiled
def _squares(
    begin: int,
    end: int,
    bands: Array,
    offsets: Ints,
    blocks: Ints,
    ends: Ints,
    first: Ints,
    entries: Ints,
    dof: Ints,
    value: Array,
    out: Array,
    begins: Ints,
) -> None:
    """Z^T Z of every body, Z = L^-1 H_b^T, one after the other in `out`, which is zero."""
    for body in range(begin, end):
        start, n, m = blocks[body], blocks[body + 1] - blocks[body], ends[body + 1] - ends[body]
        if m == 0:
            continue
        Z, active = np.zeros((n, m)), np.zeros(n, dtype=np.int64)
        for j in range(m):
            row = ends[body] + j
            for e in range(entries[row], entries[row + 1]):
                Z[dof[e] - start, j] = value[e]
            active[first[row] - start] = j + 1
        for i in range(1, n):
            active[i] = max(active[i], active[i - 1])
        band = bands[offsets[body] : offsets[body + 1]]
        _forward(band, band.size // n, Z, active)
        square = out[begins[body] : begins[body + 1]].reshape((m, m))
        for i in range(0, n, BLOCK):
            some = active[min(i + BLOCK, n) - 1]
            if some > 0:
                rows = np.ascontiguousarray(Z[i : i + BLOCK, :some])
                square[:some, :some] += rows.T @ rows


@compiled
def _forward(band: Array, height: int, Z: Array, active: Ints) -> None:
    """Forward substitution L^-1 Z in place, PANEL rows at once; in row i only the first active[i] columns are filled.

    Entry (i, j) of L is band[j height + i - j]; it is zero beyond the band by less than PANEL rows.
    """
    n, width = Z.shape[0], height - PANEL
    for begin in range(0, n, PANEL):
        size = min(PANEL, n - begin)
        for i in range(begin, begin + size):
            for j in range(begin, i):
                factor = band[j * height + i - j]
                for k in range(active[j]):
                    Z[i, k] -= factor * Z[j, k]
            inverse = 1.0 / band[i * height]
            for k in range(active[i]):
                Z[i, k] *= inverse
        some = active[begin + size - 1]
        if size < PANEL or some == 0:
            continue
        a = begin * (height - 1)
        b, c, d = a + height - 1, a + 2 * (height - 1), a + 3 * (height - 1)
        i, last = begin + PANEL, min(begin + width + PANEL, n)
        while i < last:  # two rows at once, which halves the reads of the panel
            j = min(i + 1, last - 1)
            a0, a1, a2, a3 = band[a + i], band[b + i], band[c + i], band[d + i]
            b0, b1, b2, b3 = band[a + j], band[b + j], band[c + j], band[d + j]
            if j > i:
                for k in range(some):
                    x0, x1, x2, x3 = Z[begin, k], Z[begin + 1, k], Z[begin + 2, k], Z[begin + 3, k]
                    Z[i, k] -= a0 * x0 + a1 * x1 + a2 * x2 + a3 * x3
                    Z[j, k] -= b0 * x0 + b1 * x1 + b2 * x2 + b3 * x3
            else:
                for k in range(some):
                    Z[i, k] -= a0 * Z[begin, k] + a1 * Z[begin + 1, k] + a2 * Z[begin + 2, k] + a3 * Z[begin + 3, k]
            i += 2
