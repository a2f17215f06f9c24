"""Conjugate gradients preconditioned with smoothed aggregation multigrid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyamg
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from pyamg.aggregation import fit_candidates, standard_aggregation
from pyamg.relaxation.smoothing import change_smoothers
from pyamg.strength import symmetric_strength_of_connection
from pyamg.util.utils import get_block_diag

from skmpm.arrays import Array, Ints
from skmpm.linear.blockwise import by_columns
from skmpm.linear.solver import Solver, one_thread

CONNECTION_THRESHOLD = 0.08  # strength of connection on the finest level, that of Vanek, Mandel & Brezina (1996)
COARSEST_SIZE = 300  # unknowns of a level that a dense pseudoinverse solves directly
MAX_LEVELS = 10  # safeguard against coarsening that stalls
POWER_ITERATIONS = 8  # estimate the largest eigenvalue up to a tenth too small, which changes no number of iterations


@dataclass(frozen=True)
class Amg:
    """Conjugate gradients preconditioned by smoothed aggregation.

    Attributes
    ----------
    A : (n, n)
    preconditioner : one W cycle
    blocks : (bodies + 1,) first unknown of each body
    tol : relative residual of a solve
    callback : takes the number of iterations of every solve
    name : of the solver
    """

    A: sp.csr_array
    preconditioner: spla.LinearOperator
    blocks: Ints
    tol: float
    callback: Callable[[int], object] | None = None
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

        with one_thread():
            x, failed = spla.cg(
                self.A, b, rtol=self.tol, atol=0.0, maxiter=500, M=self.preconditioner, callback=counted
            )
        if self.callback is not None:
            self.callback(count)
        if failed:
            raise np.linalg.LinAlgError(
                f"amg did not reach a relative residual of {self.tol:g} in {count} iterations;"
                " use linear.banded, a larger ghost penalty or more points per cell"
            )
        return np.asarray(x)

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """H A^-1 H^T, as many solves as the body with most contacts has rows."""
        return by_columns(self, self.blocks, H)


def amg(
    A: sp.bsr_array,
    blocks: Ints,
    rigid_motions: Array,
    *,
    tol: float = 1e-10,
    callback: Callable[[int], object] | None = None,
) -> Solver:
    """Conjugate gradients with pyamg's smoothed aggregation, the three rigid motions as near-null space.

    Parameters
    ----------
    A, blocks, rigid_motions : matrix (n, n), first unknowns of the bodies (bodies + 1,), rigid motions of all (n, 3)
    tol : relative residual of a solve
    callback : takes the number of iterations of every solve

    Returns
    -------
    the matrix with its preconditioner

    Notes
    -----
    Bodies are not coupled, so no aggregate extends over two bodies. W cycles, whose coarse levels are cheap, limit
    the number of iterations for large bodies: 14 at 1e4 unknowns, 16 at 1e6 (nu = 0.3, quasi-static; nu = 0.45: 24
    and 26).

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> scheme = skmpm.Scheme(linear=skmpm.linear.amg)
    >>> state = skmpm.step(scene, skmpm.initial(scene), 1e-3, scheme=scheme)
    >>> round(float(state.v[1].mean()), 5)
    -0.00981
    """
    with one_thread():
        hierarchy = _hierarchy(sp.bsr_matrix((A.data, A.indices, A.indptr), shape=A.shape), rigid_motions)
    return Amg(hierarchy.levels[0].A, hierarchy.aspreconditioner(cycle="W"), blocks, tol, callback)


def _hierarchy(A: sp.bsr_matrix, modes: Array) -> Any:
    """Smoothed aggregation of A and its near-null space `modes` (n, 3), by pyamg's kernels.

    Nodes are strongly connected if the block between them exceeds `CONNECTION_THRESHOLD`, halved from level to level,
    relative to their diagonal blocks (Vanek, Mandel & Brezina, Computing 56, 1996). Without a threshold levels
    coarsen too fast, and the number of iterations grows with the size of the body. Levels are built from block
    matrices but stored as CSR, which takes a quarter of the time in a sweep.
    """
    levels = [_level(A)]
    while A.shape[0] > COARSEST_SIZE and len(levels) < MAX_LEVELS:
        P, modes = _prolongation(A, levels[-1].A, modes, CONNECTION_THRESHOLD * 0.5 ** (len(levels) - 1))
        levels[-1].P = P.tocsr()
        levels[-1].R = levels[-1].P.T
        A = sp.bsr_matrix(P.T @ (A @ P))
        levels.append(_level(A))
    hierarchy = pyamg.MultilevelSolver(levels, coarse_solver="pinv")
    sweeps = ("gauss_seidel", {"sweep": "symmetric"})
    change_smoothers(hierarchy, sweeps, sweeps)
    return hierarchy


def _level(A: sp.bsr_matrix) -> Any:
    level = pyamg.MultilevelSolver.Level()
    level.A = A.tocsr()
    return level


def _prolongation(
    A: sp.bsr_matrix, rows: sp.csr_matrix, modes: Array, threshold: float
) -> tuple[sp.bsr_matrix, Array]:
    """Prolongation (I - 4/3 / rho D^-1 A) T, and the near-null space of the next level; `rows` is A as CSR.

    T are the modes on each aggregate, D the diagonal blocks of A, and rho the largest eigenvalue of D^-1 A by the
    power method, up to a tenth too small, which changes no number of iterations.
    """
    aggregates, _ = standard_aggregation(symmetric_strength_of_connection(A, threshold))
    on_aggregates, modes = fit_candidates(aggregates, modes)
    each = np.arange(A.indptr.size)
    inverse = sp.bsr_matrix((get_block_diag(A, A.blocksize[0], inv_flag=True), each[:-1], each), shape=A.shape)
    x = np.random.default_rng(0).normal(size=A.shape[0])
    for _ in range(POWER_ITERATIONS):
        x = inverse @ (rows @ (x / np.linalg.norm(x)))
    smoothed = on_aggregates - (4.0 / 3.0 / np.linalg.norm(x)) * (inverse @ (A @ on_aggregates))
    return sp.bsr_matrix(smoothed), modes
