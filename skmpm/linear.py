"""Solvers of A v = b, A symmetric positive definite and block diagonal, one block per body.

Each solver is a function (A, blocks, rigid_motions) -> solve; `solve(b)` returns A^-1 b, and
`solve.compliance(H)` returns H A^-1 H', which contact needs. `blocks` (bodies + 1,) are the bodies' first unknowns,
`rigid_motions` (n, 3) the motions that store no energy. `default` picks between `banded` and `amg` by size.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import pyamg
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.linalg.lapack import dtrtrs
from threadpoolctl import threadpool_limits

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


CROSSOVER = 700  # half bandwidth

Linear = Callable[[sp.bsr_array, Ints, Array], Solver]


def half_bandwidth(A: sp.bsr_array) -> int:
    """Largest distance of an entry from the diagonal."""
    nodes = A.shape[0] // 2
    rows = np.repeat(np.arange(nodes), np.diff(A.indptr))
    return 2 * int((rows - A.indices).max(initial=0)) + 1


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
        return _by_body(self.blocks, H, self._squares)

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


@dataclass(frozen=True)
class Direct:
    """Sparse LU of the whole matrix: slow, plain, the oracle of the tests."""

    factor: spla.SuperLU
    blocks: Ints
    name: str = "direct"

    def __call__(self, b: Array, /) -> Array:
        """A^-1 b."""
        return np.asarray(self.factor.solve(b))

    def compliance(self, H: sp.csr_array) -> sp.csr_array:
        """H A^-1 H'."""
        return _by_columns(self, self.blocks, H)


def direct(A: sp.bsr_array, blocks: Ints, rigid_motions: Array) -> Solver:
    """SuperLU of the whole matrix."""
    lu = spla.splu(A.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    return Direct(lu, blocks)


@dataclass(frozen=True)
class Amg:
    """Conjugate gradients preconditioned by smoothed aggregation."""

    A: sp.csr_array
    preconditioner: spla.LinearOperator
    blocks: Ints
    tol: float
    iterations: list[int] = field(default_factory=list)  # of every solve so far
    name: str = "amg"

    def __call__(self, b: Array, /) -> Array:
        """A^-1 b, to a relative residual of `tol`."""
        if b.ndim == 2:
            columns = np.empty(b.shape)
            for j, column in enumerate(b.T):
                columns[:, j] = self(column)
            return columns
        count = 0

        def counted(_: Array) -> None:
            nonlocal count
            count += 1

        with threadpool_limits(1, user_api="blas"):
            x, failed = spla.cg(
                self.A, b, rtol=self.tol, atol=0.0, maxiter=500, M=self.preconditioner, callback=counted
            )
        self.iterations.append(count)
        if failed:
            raise np.linalg.LinAlgError(
                f"amg did not reach a relative residual of {self.tol:g} in {count} iterations;"
                " use linear.banded, a larger ghost penalty or more points per cell"
            )
        return np.asarray(x)

    def compliance(self, H: sp.csr_array) -> sp.csr_array:
        """H A^-1 H', as many solves as the body with most contacts has rows."""
        return _by_columns(self, self.blocks, H)


def amg(A: sp.bsr_array, blocks: Ints, rigid_motions: Array, *, tol: float = 1e-10) -> Solver:
    """Conjugate gradients with pyamg's smoothed aggregation, the three rigid motions as near-null space.

    Vanek, Mandel & Brezina, Computing 56 (1996). Bodies do not couple, so aggregates do not cross them.
    """
    state = np.random.get_state()  # noqa: NPY002  (pyamg draws from the global generator)
    try:
        np.random.seed(0)  # noqa: NPY002
        with threadpool_limits(1, user_api="blas"):
            levels = pyamg.smoothed_aggregation_solver(
                sp.bsr_matrix(A.copy()), B=rigid_motions, strength="symmetric", max_coarse=200
            )
    finally:
        np.random.set_state(state)  # noqa: NPY002
    return Amg(A.tocsr(), levels.aspreconditioner(), blocks, tol)


def default(A: sp.bsr_array, blocks: Ints, rigid_motions: Array) -> Solver:
    """`banded` up to a half bandwidth of 700, a body about 170 cells across, `amg` beyond.

    That is where their times meet for one solve (`examples/crossover.py`); contact, which needs many solves with one
    factor, moves it further up.
    """
    return (banded if half_bandwidth(A) <= CROSSOVER else amg)(A, blocks, rigid_motions)


def _split(blocks: Ints, H: sp.csr_array) -> tuple[Any, ...]:
    """Entries of H by body: (body, dof, local row, value) and each body's rows as (offsets, rows)."""
    entries = H.tocoo()
    body = np.searchsorted(blocks, entries.col, side="right") - 1
    key = body.astype(np.int64) * H.shape[0] + entries.row
    keys, local = np.unique(key, return_inverse=True)
    offsets = np.searchsorted(keys, np.arange(blocks.size) * H.shape[0])
    return body, entries.col, local - offsets[body], entries.data, offsets, keys % max(H.shape[0], 1)


def _by_body(blocks: Ints, H: sp.csr_array, squares: Callable[[int, int, Array], Array]) -> sp.csr_array:
    """Sum of the bodies' dense H_b A_b^-1 H_b', computed by `squares(start, stop, H_b')`."""
    body, dof, local, value, offsets, rows = _split(blocks, H)
    order = np.argsort(body, kind="stable")
    dof, local, value = dof[order], local[order], value[order]
    ends = np.searchsorted(body[order], np.arange(blocks.size))
    data, row, column = [], [], []
    for b in np.flatnonzero(np.diff(offsets)):
        start, stop, mine = int(blocks[b]), int(blocks[b + 1]), slice(ends[b], ends[b + 1])
        right = np.zeros((stop - start, offsets[b + 1] - offsets[b]), order="F")
        right[dof[mine] - start, local[mine]] = value[mine]
        data.append(squares(start, stop, right).ravel())
        here = rows[offsets[b] : offsets[b + 1]]
        row.append(np.repeat(here, here.size))
        column.append(np.tile(here, here.size))
    return _collect(data, row, column, H.shape[0])


def _by_columns(solve: Solver, blocks: Ints, H: sp.csr_array) -> sp.csr_array:
    """H A^-1 H' by solving for one row of every body at a time: rows of different bodies share a right side."""
    body, dof, local, value, offsets, rows = _split(blocks, H)
    data, row, column = [], [], []
    count = np.diff(offsets)
    for j in range(int(count.max(initial=0))):
        chosen = local == j
        b = np.zeros(H.shape[1])
        b[dof[chosen]] = value[chosen]
        product = np.bincount(offsets[body] + local, value * solve(b)[dof], rows.size)
        has = count > j
        source = np.repeat(np.where(has, rows[np.minimum(offsets[:-1] + j, rows.size - 1)], 0), count)
        kept = np.repeat(has, count)
        data.append(product[kept])
        row.append(rows[kept])
        column.append(source[kept])
    return _collect(data, row, column, H.shape[0])


def _collect(data: list[Any], row: list[Any], column: list[Any], size: int) -> sp.csr_array:
    if not data:
        return sp.csr_array((size, size))
    entries = (np.concatenate(data), (np.concatenate(row), np.concatenate(column)))
    return sp.csr_array(sp.coo_array(entries, shape=(size, size)).tocsr())
