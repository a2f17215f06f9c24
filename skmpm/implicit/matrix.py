"""Factorisation of the Newton matrix A, modified where it is not positive definite."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.grid import BodyGrids
from skmpm.implicit.bulk import Configuration
from skmpm.implicit.gauge import Gauge
from skmpm.implicit.residual import Increment
from skmpm.linear import Solver, diagonal, on_gauge, without_added_inertia

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

MIN_ROTATIONAL_STIFFNESS = 0.25  # quadratic form of A for the rotation of a body, over its moment of inertia
SPRINGS = 6  # of a body on the gauge, at its outermost nodes in as many directions
SPRING_FACTORS = 2.0, 8.0, 32.0  # over what the rotation lacks, tried in turn: springs deform the body, too
MIN_NODAL_MASS = 0.3  # of a node with a spring, over the largest of the body
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
    if increment.gauge is not None and increment.gauge.rotation.any():
        return _on_gauge(increment, increment.gauge, A, configuration)
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
    grid, weight = increment.grid, increment.bulk.assembly.mass[::2]
    arm = grid.arms(grid.position + configuration.displacement.reshape(-1, 2).T, weight)
    inertia, missing = _rotational_stiffness(increment, A, np.stack([-arm[1], arm[0]], axis=1).ravel())
    added = missing / np.maximum(inertia, 1e-300)
    data = A.data.copy()
    data[increment.bulk.assembly.diagonal_blocks] += (added[grid.node_body] * weight)[:, None, None] * np.eye(2)
    solver = _solver(increment, sp.bsr_array((data, A.indices, A.indptr), shape=A.shape))
    if increment.supports is not None:
        return solver
    return without_added_inertia(solver, grid.node_body, added, grid.sums(weight[None])[0])


def _rotational_stiffness(increment: Increment, A: sp.bsr_array, rotation: Array) -> tuple[Array, Array]:
    """Moments of inertia (bodies,) [kg m] about the centres of mass, and what rotations lack of a share of them.

    In a quasi-static step, where A has the weight of the stiffness alone, so has the inertia. Newton iterations are
    the same with a hundredth of it and with four times as much.
    """
    mass = increment.bulk.assembly.mass if increment.scheme.inertia else increment.stiffness_as_mass
    quadratic = np.stack([mass * rotation**2, rotation * (A @ rotation)]).reshape(2, -1, 2).sum(axis=-1)
    inertia, stiffness = increment.grid.sums(quadratic)
    return inertia, np.maximum(MIN_ROTATIONAL_STIFFNESS * inertia - stiffness, 0.0)


def _on_gauge(increment: Increment, gauge: Gauge, A: sp.bsr_array, configuration: Configuration) -> Solver:
    """A solver for A on the gauge condition, from one for A with springs, which it takes off exactly.

    Of a body with the condition, A has one negative eigenvalue, and its mode is close to the rotation. Springs
    against it, each at one node, keep the bandwidth.
    """
    grid = increment.grid
    inertia, missing = _rotational_stiffness(increment, A, gauge.rotation)
    held = np.flatnonzero(inertia > 0.0)
    node = _spring_nodes(grid, gauge.rotation.reshape(-1, 2), increment.bulk.assembly.mass[::2], held)
    diagonal = increment.bulk.assembly.diagonal_blocks
    lever = gauge.rotation.reshape(-1, 2)[node]  # (springs, held bodies, 2)
    size = np.hypot(lever[..., 0], lever[..., 1])
    direction = lever / size[..., None]
    enough = np.maximum(missing, MIN_ROTATIONAL_STIFFNESS * inertia)[held] / (size**2).sum(axis=0)
    springs, stiffness = np.zeros((grid.nodes, 2, SPRINGS)), np.zeros((grid.bodies, SPRINGS))
    for j in range(SPRINGS):
        springs[node[j], :, j] = direction[j]
    for factor in SPRING_FACTORS:
        stiffness[held] = factor * enough[:, None]
        try:
            solver = _definite(increment, _with_blocks(A, diagonal[node], factor * enough, direction), configuration)
        except np.linalg.LinAlgError:
            continue
        return on_gauge(solver, grid.node_body, springs.reshape(-1, SPRINGS), stiffness, gauge.momentum)
    raise np.linalg.LinAlgError("not positive definite with springs against the rotation of bodies")


def _definite(increment: Increment, A: sp.bsr_array, configuration: Configuration) -> Solver:
    """A solver for A, with additional inertia if it is indefinite."""
    try:
        return _solver(increment, A)
    except np.linalg.LinAlgError:
        return _with_rotational_inertia(increment, A, configuration)


def _with_blocks(A: sp.bsr_array, block: Ints, stiffness: Array, direction: Array) -> sp.bsr_array:
    """A with k q q^T in its blocks (s, b), k (b,) and unit vectors q (s, b, 2)."""
    data = A.data.copy()
    np.add.at(data, block, np.einsum("b,sbi,sbj->sbij", stiffness, direction, direction))
    return sp.bsr_array((data, A.indices, A.indptr), shape=A.shape)


def _spring_nodes(grid: BodyGrids, rotation: Array, weight: Array, bodies: Ints) -> Ints:
    """The outermost nodes of bodies (b,) in `SPRINGS` directions, without those of sparse cells, (springs, b)."""
    full, chosen = np.zeros(grid.bodies), np.zeros(grid.bodies, dtype=bool)
    np.maximum.at(full, grid.node_body, weight)
    chosen[bodies] = True
    own = np.flatnonzero(chosen[grid.node_body] & (weight > MIN_NODAL_MASS * full[grid.node_body]))
    body, nodes = grid.node_body[own], []
    for angle in 2.0 * np.pi * (np.arange(SPRINGS) + 0.5) / SPRINGS:
        along = np.cos(angle) * rotation[own, 1] - np.sin(angle) * rotation[own, 0]  # of the arm
        order = np.lexsort((along, body))
        nodes.append(own[order[np.append(np.diff(body[order]) > 0, True)]])
    return np.stack(nodes)


def _solver(increment: Increment, A: sp.bsr_array) -> Solver:
    grid, linear = increment.grid, increment.scheme.linear
    if increment.supports is not None:
        return increment.supports.factorised(linear, A, grid.blocks, grid.rigid_motions())
    if increment.scheme.explicit and increment.scheme.ghost == 0.0:
        linear = diagonal
    return linear(A, grid.blocks, grid.rigid_motions())
