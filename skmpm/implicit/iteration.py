"""Newton iterations of dynamic and quasi-static steps: initial velocity, refactorisation, convergence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.bulk import Configuration
from skmpm.implicit.contact_problem import ContactProblem
from skmpm.implicit.errors import NotConverged, indefinite, worst_body
from skmpm.implicit.matrix import solver_of
from skmpm.implicit.residual import MAX_DRIFT, Increment
from skmpm.linear import Solver
from skmpm.material import determinant

Array = NDArray[np.float64]

RELAXATION = 0.5  # factor on accelerated steps once the iteration has stalled
SLOW_RATE = 0.3  # ratio of successive out-of-balance norms above which acceleration and a new matrix set in
STALLED_RATE = 0.8  # the same, for an iteration near a limit point of the contacts
MIN_RATE = 0.05  # the same, the best that is expected of an old matrix where bodies rotate freely
REFACTORISE_ABOVE = 20.0  # out-of-balance norm over `newton_tol`: below it, iterations with the old matrix cost less
# The same after the first iteration: below it, one iteration with a new matrix usually converges; above it, the rate
# of that iteration decides, in which contacts are found and which says little of the next.
REFACTORISE_AT_ONCE = 500.0


@dataclass(frozen=True)
class Solution:
    """A converged step."""

    w: Array  # (2 nodes,) [m/s]
    contact: ContactProblem | None
    newton: int  # iterations
    factorisations: int
    residual: float  # of the contact law at the end of the step
    imbalance: float  # relative out-of-balance norm
    reaction: Array  # (2 supports,) impulses on the supports [kg m/s per m]
    solver: Solver | None  # of the last iteration


def first_velocity(increment: Increment) -> tuple[Array, Configuration]:
    """The initial guess, or the linear solution from rest if that guess inverts a point (det F <= 0)."""
    w = increment.initial_guess()
    at = increment.at(w)
    if increment.material_response.linear or np.isfinite(increment.energy(w, at)):
        return w, at
    rest = np.zeros_like(w)
    at = increment.at(rest)
    gradient, _ = increment.gradient(rest, at)
    prescribed = increment.prescribed_only()
    linear = prescribed - solver_of(increment, at, projected=True)(
        gradient + increment.matrix(at, projected=True) @ prescribed
    )
    trial = increment.at(linear)
    if np.isfinite(increment.energy(linear, trial)):
        return np.asarray(linear), trial
    if increment.supports is None:
        return rest, at
    worst = int(np.argmin(determinant(trial.F)))
    b = int(increment.grid.cell_body[increment.grid.cell_of_point[worst]])
    raise NotConverged(f"body {b}", "the supports move so far in one step that points are inverted (det F <= 0)")


def matrix_is_due(
    increment: Increment, contact: ContactProblem | None, iteration: int, imbalance: float, before: float
) -> bool:
    """Whether to refactorise: at the current convergence rate the old matrix needs more than one more iteration.

    Without friction or without inertia bodies rotate and move more, so that matrices become outdated sooner.
    Otherwise the rate of the first iteration, in which contacts are found, is no measure of the next.
    """
    tol = increment.scheme.newton_tol
    if iteration == 0:
        return True
    if imbalance <= REFACTORISE_ABOVE * tol:
        return False
    frictionless = contact is not None and contact.constraints.size > 0 and not contact.constraints.tangential
    steady = increment.scheme.inertia and not frictionless
    if iteration == 1 and steady and imbalance > REFACTORISE_AT_ONCE * tol:
        return imbalance > SLOW_RATE * before
    rate = max(imbalance / max(before, 1e-300), 0.0 if steady else MIN_RATE)
    return rate > SLOW_RATE or imbalance * rate > tol


def factorised(
    increment: Increment, contact: ContactProblem | None, at: Configuration, *, projected: bool, touches: bool = False
) -> tuple[Solver, bool]:
    """A solver for the exact A if it is positive definite, else for the projected one, and whether it is projected.

    The Delassus operator of the previous solver is released first, so that only one factor is in memory.
    """
    if contact is not None:
        contact.delassus = None
    if not projected:
        try:
            return solver_of(increment, at, projected=False, touches=touches), False
        except np.linalg.LinAlgError:
            pass
    try:
        return solver_of(increment, at, projected=True), True
    except np.linalg.LinAlgError as error:
        raise indefinite(increment.grid, error) from error


def with_contact(increment: Increment, contact: ContactProblem, w: Array, size: float) -> tuple[Array, float, float]:
    """Contact impulse at w (2 nodes,), residual of the contact law, and the norm of the largest term with contact."""
    impulse, residual = contact.measure(w)
    round_off = contact.impulse_round_off / increment.scheme.newton_tol
    return impulse, residual, max(size, float(np.linalg.norm(impulse)), round_off)


def unmet_criteria(
    increment: Increment,
    contact: ContactProblem | None,
    out_of_balance: Array,
    imbalance: float,
    residual: float,
    drift: Array,
) -> list[tuple[str, str]]:
    """The convergence criteria that are not met, where and by how much; `out_of_balance` (2 nodes,)."""
    scheme, unmet = increment.scheme, list[tuple[str, str]]()
    if not imbalance <= scheme.newton_tol:
        size = f"out-of-balance force {imbalance:.2g} (tolerance {scheme.newton_tol:g})"
        unmet.append((worst_body(increment.grid, increment.on_free_dofs(out_of_balance)), size))
    if contact is not None and not residual <= scheme.gap_tol:
        unmet.append((contact.worst_pair(), f"contact residual {residual:.2g} (tolerance {scheme.gap_tol:g})"))
    if not drift.max() <= MAX_DRIFT:
        b = int(np.argmax(drift))
        size = f"out-of-balance momentum that moves it by {drift[b]:.2g} cells (tolerance {MAX_DRIFT:g})"
        unmet.append((f"body {b}", size))
    return unmet


def not_converged(limit: int, unmet: list[tuple[str, str]]) -> NotConverged:
    """The error after `limit` iterations, with the criteria that are not met."""
    criteria = ", ".join(f"{problem} at {where}" for where, problem in unmet)
    return NotConverged(unmet[0][0], f"no convergence in {limit} Newton iterations: {criteria}")
