"""Newton's method on the incremental potential, with the contact problem solved in every iteration."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.implicit.contact_problem import ContactProblem
from skmpm.implicit.errors import NotConverged
from skmpm.implicit.floating import null_space
from skmpm.implicit.frozen_geometry import MAX_FROZEN_MOMENT, frozen_geometry_moment, unmet_moment
from skmpm.implicit.iteration import (
    RELAXATION,
    SLOW_RATE,
    STALLED_RATE,
    Solution,
    factorised,
    first_velocity,
    matrix_is_due,
    not_converged,
    unmet_criteria,
    with_contact,
)
from skmpm.implicit.line_search import move
from skmpm.implicit.mixing import Mixing
from skmpm.implicit.residual import Increment
from skmpm.implicit.timer import Timer
from skmpm.linear import Solver

Array = NDArray[np.float64]

# Iterations of a dynamic step with contacts: three are usual, and two shorter steps cost less than more than eight.
MAX_ITERATIONS_WITH_CONTACT = 8


def advance(increment: Increment, contact: ContactProblem | None, kept: Solver | None, timer: Timer) -> Solution:
    """Solve one step from w = v0.

    Every iteration measures the gaps at the current w and solves the contact problem on the linearised bulk. Since
    that includes the geometric stiffness of contact, convergence is fast with the matrix of the initial velocity; it
    is refactorised where convergence is slow. Near a limit point of the contacts there may be no solution: then the
    contact geometry is frozen, and gaps, Signorini's and Coulomb's laws are solved with it; it is renewed where
    forces along it make a moment. In a dynamic step, contacts that have not converged after
    `MAX_ITERATIONS_WITH_CONTACT` iterations need a shorter step. NotConverged is raised after these, or `max_newton`,
    iterations, or if the contact solver or the line search fails.
    """
    if contact is None:
        _check_resultants(increment)
    scheme, solver, (w, at) = increment.scheme, kept, first_velocity(increment)
    projected, before, matrices = False, np.inf, 0
    mixing, relaxation, solved = Mixing(increment.bulk.assembly.mass), 1.0, np.zeros_like(w)
    limit = min(MAX_ITERATIONS_WITH_CONTACT, scheme.max_newton) if contact and scheme.inertia else scheme.max_newton
    for iteration in range(limit + 2):
        gradient, size = increment.gradient(w, at)
        contact_impulse, residual, imbalance, small = _measured(increment, contact, w, gradient, size)
        solved_at_once = iteration == 1 and increment.one_solve and contact is None
        converged = iteration > 0 and small
        if converged and contact and frozen_geometry_moment(increment, contact, w).max() > MAX_FROZEN_MOMENT:
            contact.frozen, mixing, before = contact.current, Mixing(increment.bulk.assembly.mass), np.inf
            contact_impulse, residual, imbalance, converged = _measured(increment, contact, w, gradient, size)
        final = increment.momentum_corrected(w, contact_impulse, solved) if solved_at_once or converged else None
        if final is not None:
            reaction = increment.reaction(gradient - contact_impulse)
            return Solution(final, contact, iteration, matrices, residual, imbalance, reaction, solver)
        if iteration >= limit + converged:  # a full step more balances the momentum of a converged iterate
            break
        slow, stalled = imbalance > SLOW_RATE * before, iteration > 2 and imbalance > STALLED_RATE * before
        due = matrix_is_due(increment, contact, iteration, imbalance, before)
        if solver is None or (due and not increment.material_response.linear):
            solver = None  # so that only one factor is in memory
            touches, projected = contact is not None and contact.constraints.size > 0, projected and imbalance > 0.01
            solver, projected = factorised(increment, contact, at, projected=projected, touches=touches)
            matrices += 1
            timer.lap("factorisation")
        relaxation = RELAXATION if contact and stalled else relaxation
        if contact and contact.frozen is None and (contact.stiffness_failures > 0 or stalled):
            contact.frozen, mixing, relaxation = contact.constraints, Mixing(increment.bulk.assembly.mass), 1.0
        before = imbalance
        direction, solved = contact.solve(solver, gradient) if contact else (-solver(gradient), contact_impulse)
        mixed = mixing.mixed(w, direction, 1.0 if converged else relaxation, wanted=slow and not converged)
        w, at = move(increment, w, at, direction, mixed, gradient - solved, solved)
        timer.lap("bulk")
    drift = increment.drift(w, contact_impulse, solved)
    unmet = unmet_criteria(increment, contact, gradient - contact_impulse, imbalance, residual, drift)
    raise not_converged(limit, unmet + unmet_moment(increment, contact, w))


def _measured(
    increment: Increment, contact: ContactProblem | None, w: Array, gradient: Array, size: float
) -> tuple[Array, float, float, bool]:
    """Contact impulse at w, residual of the contact law, relative out-of-balance norm; whether both are small."""
    contact_impulse, residual = np.zeros_like(w), 0.0
    if contact:
        contact_impulse, residual, size = with_contact(increment, contact, w, size)
    norm = float(np.linalg.norm(increment.on_free_dofs(gradient - contact_impulse)))
    imbalance, scheme = norm / size if size > 0.0 else 0.0, increment.scheme
    return contact_impulse, residual, imbalance, imbalance <= scheme.newton_tol and residual <= scheme.gap_tol


def _check_resultants(increment: Increment) -> None:
    """Raise NotConverged where the loads have a resultant on a rigid-body mode of a floating body."""
    if not increment.floating.any():
        return
    grid, motions = increment.grid, increment.grid.rigid_motions()
    violation = increment.support_violation(sp.csr_array(motions)).toarray()
    owner = grid.node_body[increment.constrained_dofs // 2]
    for b in np.flatnonzero(increment.floating).tolist():
        own = slice(grid.blocks[b], grid.blocks[b + 1])
        free = null_space(violation[owner == b].T @ violation[owner == b])
        size, resultant = np.abs(increment.force[own]).sum(), increment.force[own] @ motions[own]
        if np.abs(free.T @ resultant).max(initial=0.0) > 1e-6 * size * np.sqrt(own.stop - own.start):
            raise NotConverged(
                f"body {b}",
                "its loads have a resultant that no support or contact balances:"
                f" ({resultant[0]:.3g}, {resultant[1]:.3g}) N/m",
                "add a Support or a wall, or use inertia",
                retryable=False,
            )
