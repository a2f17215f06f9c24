"""Factorisation of the Newton matrix A, with mass and stiffness added where it is not positive definite."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from skmpm.arrays import Array
from skmpm.linear import NotPositiveDefinite, Solver
from skmpm.linear.corrected import joined, without_added_mass
from skmpm.material import LinearElastic, poisson_ratio, youngs_modulus
from skmpm.step.bulk import Bulk
from skmpm.step.equations import Increment
from skmpm.step.terms import Configuration

# Of the next three test_implicit fails with other values.
MIN_ROTATIONAL_STIFFNESS = 0.25  # quadratic form of A for the rotation of a body, over its moment of inertia
FACTOR = 2.0  # mass that a body gets over what its rotation lacks: the softest mode is not quite a rotation
# Shares of the gradient stiffness of a body, tried in turn: none, none with this mass, and so on.
SHARES = np.array([0.0, 0.0, 1 / 16, 1 / 4, 1.0, 4.0, 16.0, 64.0])


def solver_of(increment: Increment, configuration: Configuration, *, in_contact: bool = False) -> Solver:
    """The scheme's solver for A, on the gauge if any, with mass and stiffness added to indefinite bodies.

    A factorisation that fails tells which bodies are indefinite. In long steps of bodies that touch (`in_contact`),
    and on the gauge, those whose rotation is unstable are known to be.

    Raises
    ------
    LinAlgError
        if A is indefinite whatever is added, or the equations are linear, whose solution needs A itself
    """
    A, gauge = increment.matrix(configuration), increment.gauge
    on_gauge = gauge is not None and bool(gauge.rotation.any())
    if on_gauge or (in_contact and increment.long):
        return _stabilised(increment, A, configuration, None)
    try:
        return _solver(increment, A)
    except np.linalg.LinAlgError as error:
        return _stabilised(increment, A, configuration, _indefinite(increment, error))


def check_stiffness(increment: Increment) -> None:
    """Raise LinAlgError if A is indefinite even free of stress: cells with few points resist few motions."""
    assembly, unstressed = increment.bulk.assembly, []
    for material, points in increment.bulk.materials:
        law = LinearElastic(youngs_modulus(material), poisson_ratio(material), material.density)
        unstressed.append((law, points))
    step = replace(
        increment, at_start=Bulk(assembly, unstressed, None, None).at(np.zeros_like(increment.displacement_at_start))
    )
    _solver(step, step.matrix(step.at_start))


def coupled(increment: Increment, configuration: Configuration, solver: Solver) -> Solver:
    """The solver for A with stiffnesses that couple bodies; the same without such terms."""
    for ends, stiffness in increment.couplings(configuration):
        solver = joined(solver, ends, increment.theta_dt**2 * stiffness, increment.grid.blocks)
    return solver


def _stabilised(
    increment: Increment, A: sp.bsr_array, configuration: Configuration, failed: NotPositiveDefinite | None
) -> Solver:
    """A solver for A plus tau M plus a share of the gradient stiffness, the first of each body that make it definite.

    A body under pressure p that rotates by phi while its loads keep their directions loses the energy p V phi^2,
    which exceeds its rotational energy in long steps: it gets mass M. Beside an edge that is pressed in, and where
    bodies buckle, deformations are unstable, too: these get stiffness. The iteration takes both back. Translations
    of bodies get neither, so that an iteration balances their momentum.
    """
    grid, assembly = increment.grid, increment.bulk.assembly
    weight, blocks = assembly.mass[::2], assembly.diagonal_blocks
    mass, inertia = grid.sums(np.stack([weight, increment.on_nodes(increment.mass)[::2]]))
    supported = np.unique(grid.node_body[increment.constrained_dofs // 2])
    least = MIN_ROTATIONAL_STIFFNESS * inertia / np.maximum(mass, 1e-300)
    lacking = np.maximum(least - _rotational_stiffness(increment, A, configuration), 0.0)
    lacking[supported] = 0.0
    exact, of_block = A.data.copy(), np.repeat(grid.node_body, np.diff(A.indptr))
    stage = np.where((lacking > least) & (failed is None), 1, 0)
    while True:
        if failed is not None:
            b = failed.bodies
            stage[b] += np.where((stage[b] > 0) | (lacking[b] > 0.0), 1, 2)
            if increment.linear or stage.max() == SHARES.size:
                raise failed
            stiffness = increment.theta_dt**2 * increment.bulk.gradient_stiffness
            A.data[:] = exact + SHARES[stage][of_block, None, None] * stiffness
        tau = FACTOR * lacking * (stage > 0)
        A.data[blocks] += (tau[grid.node_body] * weight)[:, None, None] * np.eye(2)
        try:
            solver = _solver(increment, A, failed)
        except np.linalg.LinAlgError as error:
            failed = _indefinite(increment, error)
            continue
        momentum = None if increment.gauge is None else increment.gauge.momentum
        if momentum is None and not tau.any():
            return solver
        return without_added_mass(solver, grid.blocks, tau * mass, inertia, momentum)


def _rotational_stiffness(increment: Increment, A: sp.bsr_array, configuration: Configuration) -> Array:
    """Quadratic forms of A for the rotations of bodies about their centres, over that of the mass (bodies,)."""
    grid, mass = increment.grid, increment.bulk.assembly.mass
    arm = grid.arms(grid.at(configuration.displacement), mass[::2])
    rotation = np.stack([-arm[1], arm[0]], axis=1).ravel()
    quadratic = np.stack([mass * rotation**2, rotation * (A @ rotation)])
    inertia, stiffness = grid.sums(quadratic[:, ::2] + quadratic[:, 1::2])
    return np.asarray(stiffness / np.maximum(inertia, 1e-300))


def _solver(increment: Increment, A: sp.bsr_array, failed: NotPositiveDefinite | None = None) -> Solver:
    """The scheme's solver for A, which differs from a matrix that has `failed` in these bodies only."""
    grid, linear = increment.grid, increment.scheme.linear
    if increment.supports is not None:
        return increment.supports.factorised(linear, A, grid.blocks, grid.rigid_motions)
    if failed is not None:
        return failed.resume(A)
    return linear(A, grid.blocks, grid.rigid_motions)


def _indefinite(increment: Increment, error: np.linalg.LinAlgError) -> NotPositiveDefinite:
    """The error of a solver that may not tell which bodies are indefinite: then all of them."""
    if isinstance(error, NotPositiveDefinite):
        return error
    return NotPositiveDefinite(np.arange(increment.grid.bodies), lambda A: _solver(increment, A))
