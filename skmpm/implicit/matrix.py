"""Factorisation of the Newton matrix A, modified where it is not positive definite."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.grid import BodyGrids
from skmpm.implicit.bulk import Configuration
from skmpm.implicit.gauge import Gauge
from skmpm.implicit.residual import Increment
from skmpm.linear import NotPositiveDefinite, Solver, diagonal, joined, on_gauge, without_added_inertia

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

MIN_ROTATIONAL_STIFFNESS = 0.25  # quadratic form of A for the rotation of a body, over its moment of inertia
SPRINGS = 6  # of a body on the gauge, at its outermost nodes in as many directions
# Of the inertia or the springs that rotations get over what they lack, the second and third times the ones before
# where those are not enough: the softest mode is not quite a rotation, and springs deform the body, too.
FACTORS = 2.0, 4.0, 4.0
MIN_NODAL_MASS = 0.3  # of a node with a spring, over the largest of the body
# Weights of the projected matrix in its mixture with A, tried in turn; beside corners 1/16 to 1/4 often suffice.
PROJECTED_SHARES = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0)


def solver_of(
    increment: Increment, configuration: Configuration, *, projected: bool = False, in_contact: bool = False
) -> Solver:
    """The scheme's solver for A, modified in bodies whose block is indefinite; LinAlgError if that is indefinite too.

    `projected` replaces the tangent of every point by its projection on the positive semi-definite ones. Otherwise an
    indefinite body gets rotational inertia. Where that is not enough, and in a static step with supports, its
    tangents are projected; with contacts (`in_contact`) as far as needed.
    """
    A = increment.matrix(configuration, projected=projected)
    if increment.gauge is not None and increment.gauge.rotation.any():
        return _on_gauge(increment, increment.gauge, A, configuration, in_contact)
    if in_contact and increment.long and not projected and _gets_inertia(increment):
        return _with_rotational_inertia(increment, A, configuration, None)
    try:
        return _solver(increment, A)
    except np.linalg.LinAlgError as error:
        if projected:
            raise
        return _modified(increment, A, configuration, _indefinite(increment, error), in_contact)


def _gets_inertia(increment: Increment) -> bool:
    """Whether indefinite bodies get rotational inertia: in dynamic steps, and in static ones where none is held."""
    return increment.metric is None or increment.supports is None


def with_bars(increment: Increment, configuration: Configuration, solver: Solver) -> Solver:
    """The solver for A with the stiffness of bars between bodies; the same without such springs."""
    springs, interval = increment.springs, increment.theta_dt
    if springs is None or springs.linear:
        return solver
    stiffness = interval**2 * springs.bar_stiffnesses(configuration.displacement)
    return joined(solver, springs.bars, stiffness, increment.grid.blocks)


def _modified(
    increment: Increment, A: sp.bsr_array, configuration: Configuration, failed: NotPositiveDefinite, in_contact: bool
) -> Solver:
    """A solver for A with the blocks of indefinite bodies modified."""
    if _gets_inertia(increment):
        return _with_rotational_inertia(increment, A, configuration, failed)
    # Contacts stabilise modes that A alone does not, such as those of the surface beside an indenting corner, so that
    # a small weight often suffices; any weight slows convergence. Bodies that buckle need all of it.
    return _projected(increment, A, configuration, failed, PROJECTED_SHARES if in_contact else (1.0,))


def _projected(
    increment: Increment,
    A: sp.bsr_array,
    configuration: Configuration,
    failed: NotPositiveDefinite,
    shares: Sequence[float],
) -> Solver:
    """A solver for A with the first definite mixture of exact and projected blocks of indefinite bodies."""
    exact, projected = A.data.copy(), increment.matrix(configuration, projected=failed.bodies).data
    for share in shares:
        own = np.repeat(np.isin(increment.grid.node_body, failed.bodies), np.diff(A.indptr))
        A.data[own] = (1.0 - share) * exact[own] + share * projected[own]
        try:
            return _solver(increment, A, failed)
        except np.linalg.LinAlgError as error:
            failed = _indefinite(increment, error)
    raise failed


def _with_rotational_inertia(
    increment: Increment, A: sp.bsr_array, configuration: Configuration, failed: NotPositiveDefinite | None
) -> Solver:
    """A solver with additional inertia of indefinite bodies: under pressure, their rotation is unstable by itself.

    A body under pressure p that rotates by phi while its loads keep their directions loses the energy p V phi^2,
    which exceeds its rotational energy in long steps. Translations keep their inertia, so that an iteration balances
    the momentum of the body; in scenes with supports, whose reactions enter that balance, they do not. Bodies that
    are indefinite all the same have their tangents projected. Nothing has `failed` yet in long steps of bodies that
    touch: those whose rotation is unstable are known to be indefinite.
    """
    grid, assembly = increment.grid, increment.bulk.assembly
    weight, diagonal = increment.mass[::2], assembly.diagonal_blocks
    arm = grid.arms(grid.position + configuration.displacement.reshape(-1, 2).T, weight)
    inertia, missing = _rotational_stiffness(increment, A, np.stack([-arm[1], arm[0]], axis=1).ravel())
    lacking, exact = missing / np.maximum(inertia, 1e-300), A.data[diagonal]
    factors = np.append(0.0, np.cumprod(FACTORS))
    unstable = lacking > MIN_ROTATIONAL_STIFFNESS if failed is None else np.zeros(grid.bodies, dtype=bool)
    attempt = unstable.astype(np.int64)  # of each body
    added, solver = np.zeros(grid.bodies), None
    while solver is None:
        if failed is not None:
            if not lacking[failed.bodies].any() or attempt[failed.bodies].max() == len(FACTORS):
                break  # what is unstable is no rotation
            attempt[failed.bodies] += 1
        added = factors[attempt] * lacking
        if added.any():
            A.data[diagonal] = exact + (added[grid.node_body] * weight)[:, None, None] * np.eye(2)
        try:
            solver = _solver(increment, A, failed)
        except np.linalg.LinAlgError as error:
            failed = _indefinite(increment, error)
    if solver is None:
        assert failed is not None
        added[failed.bodies] = 0.0
        shares = (1.0,) if increment.metric is None else PROJECTED_SHARES
        solver = _projected(increment, A, configuration, failed, shares)
    if increment.supports is not None or not added.any():
        return solver
    return without_added_inertia(solver, grid.node_body, added, grid.sums(weight[None])[0])


def _rotational_stiffness(increment: Increment, A: sp.bsr_array, rotation: Array) -> tuple[Array, Array]:
    """Moments of inertia (bodies,) [kg m] about the centres of mass, and what rotations lack of a share of them."""
    quadratic = np.stack([increment.mass * rotation**2, rotation * (A @ rotation)])
    inertia, stiffness = increment.grid.sums(quadratic[:, ::2] + quadratic[:, 1::2])
    return inertia, np.maximum(MIN_ROTATIONAL_STIFFNESS * inertia - stiffness, 0.0)


def _on_gauge(
    increment: Increment, gauge: Gauge, A: sp.bsr_array, configuration: Configuration, in_contact: bool
) -> Solver:
    """A solver for A on the gauge condition, from one for A with springs, which it takes off exactly.

    Of a body with the condition, A has one negative eigenvalue, and its mode is close to the rotation. Springs
    against it, each at one node, keep the bandwidth.
    """
    grid, diagonal = increment.grid, increment.bulk.assembly.diagonal_blocks
    inertia, missing = _rotational_stiffness(increment, A, gauge.rotation)
    held = np.flatnonzero(inertia > 0.0)
    node = _spring_nodes(grid, gauge.rotation.reshape(-1, 2), increment.bulk.assembly.mass[::2], held)
    lever = gauge.rotation.reshape(-1, 2)[node]  # (springs, held bodies, 2)
    size = np.hypot(lever[..., 0], lever[..., 1])
    direction = lever / size[..., None]
    stiffness = np.maximum(missing, MIN_ROTATIONAL_STIFFNESS * inertia)[held] / (size**2).sum(axis=0)
    failed: NotPositiveDefinite | None = None
    for factor in FACTORS:
        stiffness[slice(None) if failed is None else np.isin(held, failed.bodies)] *= factor
        sprung = _with_blocks(A, diagonal[node], stiffness, direction)
        try:
            solver = _solver(increment, sprung, failed)
            break
        except np.linalg.LinAlgError as error:
            failed = _indefinite(increment, error)
            if np.isin(failed.bodies, held).any():
                continue
            solver = _modified(increment, sprung, configuration, failed, in_contact)
            break
    else:
        raise np.linalg.LinAlgError("not positive definite with springs against the rotation of bodies")
    springs, of_body = np.zeros((grid.nodes, 2, SPRINGS)), np.zeros((grid.bodies, SPRINGS))
    of_body[held] = stiffness[:, None]
    for j in range(SPRINGS):
        springs[node[j], :, j] = direction[j]
    return on_gauge(solver, grid.node_body, springs.reshape(-1, SPRINGS), of_body, gauge.momentum)


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
    angle = 2.0 * np.pi * (np.arange(SPRINGS) + 0.5) / SPRINGS
    return grid.outermost(own, np.stack([rotation[:, 1], -rotation[:, 0]], axis=1), angle)[:, bodies]


def _solver(increment: Increment, A: sp.bsr_array, failed: NotPositiveDefinite | None = None) -> Solver:
    """The scheme's solver for A, which differs from a matrix that has `failed` in these bodies only."""
    grid, linear = increment.grid, increment.scheme.linear
    if increment.supports is not None:
        return increment.supports.factorised(linear, A, grid.blocks, grid.rigid_motions)
    if failed is not None:
        return failed.resume(A)
    if increment.scheme.explicit:
        linear = diagonal
    return linear(A, grid.blocks, grid.rigid_motions)


def _indefinite(increment: Increment, error: np.linalg.LinAlgError) -> NotPositiveDefinite:
    """The error of a solver that may not tell which bodies are indefinite: then all of them."""
    if isinstance(error, NotPositiveDefinite):
        return error
    return NotPositiveDefinite(np.arange(increment.grid.bodies), lambda A: _solver(increment, A))
