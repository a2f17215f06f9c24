"""Conjugate gradients with smoothed aggregation."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyamg
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray
from pyamg.relaxation.smoothing import change_smoothers
from threadpoolctl import threadpool_limits

from skmpm.linear.compliance import by_columns
from skmpm.linear.solver import Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

THRESHOLD = 0.08  # of strong connections


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
        return by_columns(self, self.blocks, H)


def amg(A: sp.bsr_array, blocks: Ints, rigid_motions: Array, *, tol: float = 1e-10) -> Solver:
    """Conjugate gradients with pyamg's smoothed aggregation, the three rigid motions as near-null space.

    Bodies do not couple, so aggregates do not cross them. W cycles, whose coarse levels cost little, keep
    the iterations of a large body few: 14 at 1e4 unknowns, 16 at 1e6 (nu = 0.3, quasi-static; nu = 0.45: 24 and 27).
    """
    state = np.random.get_state()  # noqa: NPY002  (pyamg draws from the global generator)
    try:
        np.random.seed(0)  # noqa: NPY002
        with threadpool_limits(1, user_api="blas"):
            hierarchy = _hierarchy(sp.bsr_matrix((A.data, A.indices, A.indptr), shape=A.shape), rigid_motions)
    finally:
        np.random.set_state(state)  # noqa: NPY002
    return Amg(hierarchy.levels[0].A, hierarchy.aspreconditioner(cycle="W"), blocks, tol)


def _hierarchy(A: sp.bsr_matrix, rigid_motions: Array) -> Any:
    """Pyamg's levels: made of blocks, then stored row by row, where a sweep costs a quarter.

    Nodes are strongly connected where the block between them exceeds `THRESHOLD`, halved from level to level, of
    those on the diagonal (Vanek, Mandel & Brezina, Computing 56, 1996). Without it coarse levels are too coarse, and
    iterations grow with the body.
    """
    hierarchy = pyamg.smoothed_aggregation_solver(
        A,
        B=rigid_motions,
        strength=[("symmetric", {"theta": THRESHOLD * 0.5**level}) for level in range(10)],
        smooth=("jacobi", {"weighting": "block"}),
        improve_candidates=None,
        presmoother=None,
        postsmoother=None,
        max_coarse=200,
    )
    for level in hierarchy.levels:
        level.A = level.A.tocsr()
    for level in hierarchy.levels[:-1]:
        level.P, level.R = level.P.tocsr(), level.R.tocsr()
    sweeps = ("gauss_seidel", {"sweep": "symmetric"})
    change_smoothers(hierarchy, sweeps, sweeps)
    return hierarchy
