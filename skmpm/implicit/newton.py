"""Newton's method on the incremental potential, with the contact problem solved in every iteration."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.implicit.acceleration import AndersonAcceleration
from skmpm.implicit.contact_problem import ContactIterate, ContactProblem
from skmpm.implicit.contact_solve import solve
from skmpm.implicit.errors import StepRejected
from skmpm.implicit.floating import null_space
from skmpm.implicit.frozen_geometry import MAX_FROZEN_MOMENT, frozen_geometry_moment, unmet_moment
from skmpm.implicit.iteration import (
    RELAXATION,
    SLOW_RATE,
    STALLED_RATE,
    Solution,
    factorise,
    first_velocity,
    needs_refactorisation,
    not_converged,
    unmet_criteria,
    with_contact,
)
from skmpm.implicit.line_search import move
from skmpm.implicit.residual import Increment
from skmpm.implicit.timer import Timer
from skmpm.linear import Solver

Array = NDArray[np.float64]

# Iterations of a dynamic step with contacts: three are usual, and two shorter steps cost less than more than eight.
MAX_ITERATIONS_WITH_CONTACT = 8


def advance(increment: Increment, problem: ContactProblem | None, kept: Solver | None, timer: Timer) -> Solution:
    """Solve one step from the initial guess, v0 unless that inverts points (`first_velocity`).

    Every iteration computes the gaps at the current w and solves the contact problem on the linearised bulk. Since
    that includes the geometric stiffness of contact, convergence is fast with the matrix of the initial velocity; it
    is refactorised where convergence is slow. Near a limit point of the contacts there may be no solution: then the
    contact geometry is frozen (`frozen_geometry`), and replaced by that of a later iterate where it makes a moment.
    StepRejected is raised after `max_newton` iterations, in a dynamic step with contacts after
    `MAX_ITERATIONS_WITH_CONTACT`, and if the contact solver or the line search fails.
    """
    if problem is None:
        _check_resultants(increment)
    scheme, solver, (w, configuration) = increment.scheme, kept, first_velocity(increment)
    mass, projected, before, factorisations = increment.bulk.assembly.mass, False, np.inf, 0
    contact: ContactIterate | None = None
    acceleration, relaxation, last_impulse = AndersonAcceleration(mass), 1.0, np.zeros_like(w)
    limit = min(MAX_ITERATIONS_WITH_CONTACT, scheme.max_newton) if problem and scheme.inertia else scheme.max_newton
    for iteration in range(limit + 2):
        gradient, size = increment.gradient(w, configuration)
        contact = (contact or problem).at(w) if problem else None
        contact_impulse, residual, imbalance, satisfied = _evaluate(increment, contact, gradient, size)
        converged = iteration > 0 and satisfied
        if converged and contact and frozen_geometry_moment(increment, contact, w).max() > MAX_FROZEN_MOMENT:
            contact = contact.with_frozen_geometry(contact.current).at(w)
            acceleration, before = AndersonAcceleration(mass), np.inf
            contact_impulse, residual, imbalance, converged = _evaluate(increment, contact, gradient, size)
        if converged or (iteration == 1 and increment.one_solve and contact is None):
            final = increment.with_balanced_momentum(w, contact_impulse, last_impulse)
            if final is not None:
                reaction = increment.reaction(gradient - contact_impulse)
                return Solution(final, contact, iteration, factorisations, residual, imbalance, reaction, solver)
        if iteration >= limit + converged:  # a full step more balances the momentum of a converged iterate
            break
        slow, stalled = imbalance > SLOW_RATE * before, iteration > 2 and imbalance > STALLED_RATE * before
        due = needs_refactorisation(increment, contact, iteration, imbalance, before)
        if solver is None or (due and not increment.material_response.linear):
            solver, projected = None, projected and imbalance > 0.01  # so that only one factor is in memory
            contact = contact.without_delassus() if contact else None
            solver, projected = factorise(increment, contact, configuration, projected=projected)
            factorisations += 1
            timer.lap("factorisation")
        relaxation = RELAXATION if contact and stalled else relaxation
        if contact and contact.frozen is None and (contact.stiffness_failures > 0 or stalled):
            contact = contact.with_frozen_geometry(contact.constraints)
            acceleration, relaxation = AndersonAcceleration(mass), 1.0
        before = imbalance
        if contact:
            found = solve(contact, solver, gradient)
            contact, direction, last_impulse = found.contact, found.direction, found.impulse
        else:
            direction, last_impulse = -solver(gradient), contact_impulse
        wanted, factor = slow and not converged, 1.0 if converged else relaxation
        step = acceleration.accelerate(w, direction, factor, wanted=wanted)
        w, configuration = move(increment, w, configuration, direction, step, gradient - last_impulse, last_impulse)
        timer.lap("bulk")
    drift = increment.drift(w, contact_impulse, last_impulse)
    unmet = unmet_criteria(increment, contact, gradient - contact_impulse, imbalance, residual, drift)
    raise not_converged(limit, unmet + unmet_moment(increment, contact, w))


def _evaluate(
    increment: Increment, contact: ContactIterate | None, gradient: Array, size: float
) -> tuple[Array, float, float, bool]:
    """Contact impulse, residual of the contact law, relative out-of-balance norm; whether both are small."""
    contact_impulse, residual = np.zeros_like(gradient), 0.0
    if contact:
        contact_impulse, residual, size = with_contact(increment, contact, size)
    norm = float(np.linalg.norm(increment.on_free_dofs(gradient - contact_impulse)))
    imbalance, scheme = norm / size if size > 0.0 else 0.0, increment.scheme
    return contact_impulse, residual, imbalance, imbalance <= scheme.newton_tol and residual <= scheme.gap_tol


def _check_resultants(increment: Increment) -> None:
    """Raise StepRejected where the loads have a resultant on a rigid-body mode of a floating body."""
    if not increment.floating.any():
        return
    grid, motions = increment.grid, increment.grid.rigid_motions()
    violation = increment.support_violation(sp.csr_array(motions)).toarray()
    owner = grid.node_body[increment.constrained_dofs // 2]
    for b in np.flatnonzero(increment.floating).tolist():
        dofs = slice(grid.blocks[b], grid.blocks[b + 1])
        free = null_space(violation[owner == b].T @ violation[owner == b])
        size, resultant = np.abs(increment.force[dofs]).sum(), increment.force[dofs] @ motions[dofs]
        if np.abs(free.T @ resultant).max(initial=0.0) > 1e-6 * size * np.sqrt(dofs.stop - dofs.start):
            raise StepRejected(
                f"body {b}",
                "its loads have a resultant that no support or contact balances:"
                f" ({resultant[0]:.3g}, {resultant[1]:.3g}) N/m",
                "add a Support or a wall, or use inertia",
                retryable=False,
            )
