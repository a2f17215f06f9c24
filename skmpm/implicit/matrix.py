"""Solvers for the matrix of an increment, steadied where it is not positive definite."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.implicit.bulk import Configuration
from skmpm.implicit.residual import Increment
from skmpm.linear import HeldRotation, Solver, diagonal

Array = NDArray[np.float64]

LEAST_INERTIA = 0.25  # of a body's inertia must be left of what resists its turning
SHARES = (1 / 16, 1 / 8, 1 / 4, 1 / 2)  # of the projected matrix that are tried; beside corners 1/16 to 1/4 often do


def solver_of(increment: Increment, at: Configuration, *, projected: bool, touches: bool = False) -> Solver:
    """The scheme's solver for A, steadied where it needs that; LinAlgError where it is not positive definite."""
    A = increment.matrix(at, projected=projected)
    try:
        return _solver(increment, A)
    except np.linalg.LinAlgError:
        if projected:
            raise
        if touches and not increment.scheme.inertia and not increment.floats.any():
            return _convexified(increment, A, at)
        if not increment.scheme.inertia:  # nothing else than the whole projection stops bodies that turn or buckle
            raise
        return _steadied(increment, A, at)


def _convexified(increment: Increment, A: sp.bsr_array, at: Configuration) -> Solver:
    """A solver for the mixture of the exact A and the projected one that is nearest to A and positive definite.

    Contacts hold what A alone does not, such as the surface beside a corner that is pressed in, so the little
    that is missing is enough: what is added delays convergence in all directions.
    """
    projected = increment.matrix(at, projected=True)
    for share in SHARES:
        data = (1.0 - share) * A.data + share * projected.data
        try:
            return _solver(increment, sp.bsr_array((data, A.indices, A.indptr), shape=A.shape))
        except np.linalg.LinAlgError:
            continue
    return _solver(increment, projected)


def _steadied(increment: Increment, A: sp.bsr_array, at: Configuration) -> Solver:
    """A solver with more inertia for bodies that pressure would drive round if contacts did not hold them.

    A pressed body has less energy as it turns with its loads left behind, by 2 p V theta^2 / 2; in long steps
    that exceeds its inertia. Translations keep theirs, so that an iteration balances the momentum of the body.
    """
    grid, mass = increment.grid, increment.bulk.assembly.mass
    weight = mass[::2]
    x = grid.position + at.displacement.reshape(-1, 2).T
    arm = x - grid.means(x, weight)[:, grid.node_body]
    turn = np.stack([-arm[1], arm[0]], axis=1).ravel()
    resisting = np.stack([mass * turn**2, turn * (A @ turn)]).reshape(2, -1, 2).sum(axis=-1)
    inertia, held = grid.sums(resisting)
    missing = np.maximum(LEAST_INERTIA - held / np.maximum(inertia, 1e-300), 0.0)
    data, constraints = A.data.copy(), np.repeat(np.arange(grid.nodes), np.diff(A.indptr))
    data[constraints == A.indices] += (missing[grid.node_body] * weight)[:, None, None] * np.eye(2)
    solver = _solver(increment, sp.bsr_array((data, A.indices, A.indptr), shape=A.shape))
    if increment.supports is not None:
        return solver
    return HeldRotation(solver, grid.node_body, missing, grid.sums(weight[None])[0])


def _solver(increment: Increment, A: sp.bsr_array) -> Solver:
    grid, linear = increment.grid, increment.scheme.linear
    if increment.supports is not None:
        return increment.supports.factorised(linear, A, grid.blocks, grid.rigid_motions())
    if increment.scheme.explicit and increment.scheme.ghost == 0.0:
        linear = diagonal
    return linear(A, grid.blocks, grid.rigid_motions())
