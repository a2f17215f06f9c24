"""Banded Cholesky of every body."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.arrays import Array, Bools, Ints
from skmpm.compiled import compiled
from skmpm.linear import cholesky
from skmpm.linear.blockwise import Rows, by_body, squares
from skmpm.linear.solver import NotPositiveDefinite, Solver
from skmpm.parallel import over_bodies

# Entries of bands in one array: glibc returns larger ones to the system when they are freed, and their pages take as
# long to be provided again as a sixth of the factorisation.
PART = 1_000_000


@dataclass(frozen=True)
class Banded:
    """Cholesky factors of the bodies, each in a band of its own width.

    Attributes
    ----------
    bands : the lower bands column by column, body after body, in parts of some bodies
    parts : (parts + 1,) first body of each part
    offsets : (bodies + 1,) where the band of each body begins, counted through all parts
    blocks : (bodies + 1,) first unknown of each body
    ends : (nodes,) after the last row, counted in its body, that columns of L reach up to those of each node
    name : of the solver
    """

    bands: tuple[Array, ...]
    parts: Ints
    offsets: Ints
    blocks: Ints
    ends: Ints
    name: str = "banded"

    def __call__(self, b: Array, /) -> Array:
        """A^-1 b; bodies where b is zero cost nothing."""
        columns = 1 if b.ndim == 1 else b.shape[1]
        x = np.array(b.T, dtype=np.float64, order="C").reshape(columns, b.shape[0])
        self.over_parts(lambda i, j, bands, offsets: cholesky.solve(i, j, bands, offsets, self.blocks, self.ends, x))
        return x.reshape(b.T.shape).T

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """H A^-1 H^T = sum over bodies of Z^T Z, Z = L^-1 H_b^T."""
        return by_body(self.blocks, H, self._squares)

    def _squares(self, rows: Rows, out: Array, begins: Ints) -> None:
        entries = np.searchsorted(rows.entry, np.arange(rows.row.size + 1))
        arguments = (self.blocks, self.ends, rows.ends, rows.first, entries, rows.dof, rows.value, out, begins)
        self.over_parts(lambda i, j, bands, offsets: squares(i, j, bands, offsets, *arguments))

    def over_parts(self, work: Callable[[int, int, Array, Ints], None]) -> None:
        """Call work(first, last, bands, offsets) for ranges of bodies and the bands they lie in."""

        def on_range(first: int, last: int) -> None:
            for begin, end, bands in zip(self.parts[:-1].tolist(), self.parts[1:].tolist(), self.bands, strict=True):
                if max(first, begin) < min(last, end):
                    work(max(first, begin), min(last, end), bands, self.offsets - self.offsets[begin])

        over_bodies(on_range, self.blocks)


def banded(A: sp.bsr_array, blocks: Ints, rigid_motions: Array) -> Solver:
    """Banded Cholesky of every body; for bodies of up to about 270 cells across.

    Parameters
    ----------
    A, blocks, rigid_motions : matrix (n, n), first unknowns of the bodies (bodies + 1,), rigid motions of all (n, 3)

    Returns
    -------
    the factorised matrix

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> scheme = skmpm.Scheme(linear=skmpm.linear.banded)
    >>> state = skmpm.step(scene, skmpm.initial(scene), 1e-3, scheme=scheme)
    >>> round(float(state.v[1].mean()), 5)
    -0.00981
    """
    blocks = np.asarray(blocks, dtype=np.int64)
    ends, heights = _profile(A, blocks)
    width, widest = half_bandwidth(_lengths(ends, blocks)), cholesky.WIDEST
    if width > widest:
        raise ValueError(f"linear.banded: half bandwidth {width}, at most {widest}; use linear.amg")
    offsets = np.append(0, np.cumsum(heights * np.diff(blocks)))
    chosen = np.ones(blocks.size - 1, dtype=bool)
    parts = np.searchsorted(offsets, np.arange(0, max(int(offsets[-1]), 1), PART))
    parts = np.unique(np.append(np.minimum(parts, blocks.size - 1), blocks.size - 1))
    bands = tuple(np.empty(size) for size in np.diff(offsets[parts]).tolist())
    return _factorised(Banded(bands, parts, offsets, blocks, ends), A, chosen)


def _factorised(factor: Banded, A: sp.bsr_array, chosen: Bools) -> Banded:
    """The factor with the blocks of A of the chosen bodies; its bands are overwritten."""
    failed = np.zeros(chosen.size, dtype=bool)
    arguments = (chosen, A.indptr, A.indices, A.data, factor.blocks, factor.ends, failed)
    factor.over_parts(lambda i, j, bands, offsets: cholesky.factorise(i, j, bands, offsets, *arguments))
    if failed.any():
        raise NotPositiveDefinite(np.flatnonzero(failed), lambda B: _factorised(factor, B, failed))
    return factor


def column_lengths(A: sp.bsr_array, blocks: Ints) -> Ints:
    """Entries below the diagonal of the Cholesky factor, in the column of each node's first unknown, (nodes,)."""
    return _lengths(_profile(A, blocks)[0], blocks)


def half_bandwidth(lengths: Ints) -> int:
    """Largest distance of an entry of the factor from the diagonal, from the lengths of its columns (nodes,)."""
    return int(lengths.max(initial=1)) - 1


def _lengths(ends: Ints, blocks: Ints) -> Ints:
    """The lengths of columns (nodes,) that reach up to some rows (nodes,)."""
    unknown = 2 * np.arange(ends.size)
    return np.asarray(ends + blocks[np.searchsorted(blocks, unknown, side="right") - 1] - unknown)


def _profile(A: sp.bsr_array, blocks: Ints) -> tuple[Ints, Ints]:
    """The rows that columns of L reach (nodes,), and the rows of the band of each body (bodies,)."""
    ends, heights = np.empty(A.indptr.size - 1, dtype=np.int64), np.empty(blocks.size - 1, dtype=np.int64)
    _write_profile(A.indptr, A.indices, blocks, ends, heights)
    return ends, heights


@compiled
def _write_profile(
    indptr: NDArray[np.integer], indices: NDArray[np.integer], blocks: Ints, ends: Ints, heights: Ints
) -> None:
    """Write what `_profile` returns."""
    for body in range(blocks.size - 1):
        start, stop, height = blocks[body] // 2, blocks[body + 1] // 2, cholesky.PANEL
        for node in range(start, stop):
            ends[node] = 2 * (node - start + 1)
        for row in range(start, stop):
            for e in range(indptr[row], indptr[row + 1]):
                if indices[e] < row:
                    ends[indices[e]] = max(ends[indices[e]], 2 * (row - start + 1))
        for node in range(start, stop):
            if node > start:
                ends[node] = max(ends[node], ends[node - 1])
            height = max(height, ends[node] - 2 * (node - start) + cholesky.PANEL // 2)
        heights[body] = height
