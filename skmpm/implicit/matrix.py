"""Factorisation of the Newton matrix A, modified where it is not positive definite."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.implicit.bulk import Configuration
from skmpm.implicit.residual import Increment
from skmpm.linear import AddedInertia, Solver, diagonal

Array = NDArray[np.float64]

MIN_ROTATIONAL_STIFFNESS = 0.25  # quadratic form of A for the rotation of a body, over its moment of inertia
# Weights of the projected matrix in its mixture with A, tried in turn; beside corners 1/16 to 1/4 often suffice.
PROJECTED_SHARES = (1 / 16, 1 / 8, 1 / 4, 1 / 2)


def solver_of(
    increment: Increment, configuration: Configuration, *, projected: bool, in_contact: bool = False
) -> Solver:
    """The scheme's solver for A, or for a modified matrix if A is indefinite; LinAlgError if that is indefinite too.

    `projected` replaces the tangent of every point by its projection on the positive semi-definite ones. Otherwise an
    indefinite A gets rotational inertia in a dynamic step, and in a quasi-static step without floating bodies a part
    of the projected matrix if there are contacts (`in_contact`).
    """
    A = increment.matrix(configuration, projected=projected)
    try:
        return _solver(increment, A)
    except np.linalg.LinAlgError:
        if projected:
            raise
        if in_contact and not increment.scheme.inertia and not increment.floating.any():
            return _convexified(increment, A, configuration)
        if not increment.scheme.inertia:  # only the full projection stabilises bodies that rotate or buckle
            raise
        return _with_rotational_inertia(increment, A, configuration)


def _convexified(increment: Increment, A: sp.bsr_array, configuration: Configuration) -> Solver:
    """A solver for the first positive definite mixture of exact and projected A, with weights `PROJECTED_SHARES`.

    Contacts stabilise modes that A alone does not, such as those of the surface beside an indenting corner, so a
    small weight of the projected matrix often suffices; any weight slows convergence in all directions. If no mixture
    is positive definite, the solver is for the projected A.
    """
    projected = increment.matrix(configuration, projected=True)
    for share in PROJECTED_SHARES:
        data = (1.0 - share) * A.data + share * projected.data
        try:
            return _solver(increment, sp.bsr_array((data, A.indices, A.indptr), shape=A.shape))
        except np.linalg.LinAlgError:
            continue
    return _solver(increment, projected)


def _with_rotational_inertia(increment: Increment, A: sp.bsr_array, configuration: Configuration) -> Solver:
    """A solver with additional inertia for bodies under pressure whose rotation is unstable without contacts.

    A body under pressure p that rotates by phi while its loads keep their directions loses the energy p V phi^2,
    which exceeds its rotational energy in long steps. Translations keep their inertia, so that an iteration balances
    the momentum of the body; in scenes with supports, whose reactions enter that balance, they do not.
    """
    grid, mass = increment.grid, increment.bulk.assembly.mass
    weight = mass[::2]
    arm = grid.arms(grid.position + configuration.displacement.reshape(-1, 2).T, weight)
    rotation = np.stack([-arm[1], arm[0]], axis=1).ravel()
    quadratic = np.stack([mass * rotation**2, rotation * (A @ rotation)]).reshape(2, -1, 2).sum(axis=-1)
    inertia, stiffness = grid.sums(quadratic)
    added = np.maximum(MIN_ROTATIONAL_STIFFNESS - stiffness / np.maximum(inertia, 1e-300), 0.0)
    data, row = A.data.copy(), np.repeat(np.arange(grid.nodes), np.diff(A.indptr))
    data[row == A.indices] += (added[grid.node_body] * weight)[:, None, None] * np.eye(2)
    solver = _solver(increment, sp.bsr_array((data, A.indices, A.indptr), shape=A.shape))
    if increment.supports is not None:
        return solver
    return AddedInertia(solver, grid.node_body, added, grid.sums(weight[None])[0])


def _solver(increment: Increment, A: sp.bsr_array) -> Solver:
    grid, linear = increment.grid, increment.scheme.linear
    if increment.supports is not None:
        return increment.supports.factorised(linear, A, grid.blocks, grid.rigid_motions())
    if increment.scheme.explicit and increment.scheme.ghost == 0.0:
        linear = diagonal
    return linear(A, grid.blocks, grid.rigid_motions())
