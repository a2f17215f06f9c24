"""Newton on the incremental potential, with the contacts solved in every iteration."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.implicit.contact_problem import ContactProblem, Timer
from skmpm.implicit.errors import NotConverged
from skmpm.implicit.floating import null_space
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
)
from skmpm.implicit.line_search import move
from skmpm.implicit.mixing import Mixing
from skmpm.implicit.residual import Increment
from skmpm.linear import Solver

Array = NDArray[np.float64]

MAX_ITERATIONS_WITH_CONTACT = (
    8  # iterations with contacts; it takes three where all is well, and two shorter steps take less than many
)


def advance(increment: Increment, contact: ContactProblem | None, kept: Solver | None, timer: Timer) -> Solution:
    """Solve one step from w = v0.

    Every iteration measures the gaps where the current w ends and solves the contacts against the linearised bulk.
    How the forces of loaded contacts turn is part of the contact problem, so convergence is fast with the matrix of
    the velocity to start from; a new one is made where it is not. Where a contact is about to snap there may be
    nothing to converge to: then normals stay as they are, and gaps, Signorini's and Coulomb's laws are solved along
    them. With inertia, contacts that have not converged after `HASTE` iterations are left to a shorter step.

    Raises
    ------
    NotConverged
        after these, or `max_newton`, iterations, or when the contact solver or the line search fails
    """
    if contact is None:
        _check_balance(increment)
    scheme, solver, (w, at) = increment.scheme, kept, first_velocity(increment)
    projected, before, matrices = False, np.inf, 0
    mixing, share, solved = Mixing(increment.bulk.assembly.mass), 1.0, np.zeros_like(w)
    limit = min(MAX_ITERATIONS_WITH_CONTACT, scheme.max_newton) if contact and scheme.inertia else scheme.max_newton
    for iteration in range(limit + 2):
        gradient, size = increment.gradient(w, at)
        contact_impulse, residual = contact.measure(w) if contact else (np.zeros_like(w), 0.0)
        if contact:
            size = max(size, float(np.linalg.norm(contact_impulse)), contact.round_off / scheme.newton_tol)
        imbalance = (
            float(np.linalg.norm(increment.unsupported(gradient - contact_impulse))) / size if size > 0.0 else 0.0
        )
        exact = iteration == 1 and increment.exact and contact is None
        close = iteration > 0 and imbalance <= scheme.newton_tol and residual <= scheme.gap_tol
        balanced = increment.balanced(w, contact_impulse, solved) if exact or close else None
        if balanced is not None:
            reaction = increment.reaction(gradient - contact_impulse)
            return Solution(balanced, contact, iteration, matrices, residual, imbalance, reaction, solver)
        if iteration >= limit + close:  # one full step more balances what is close
            break
        slow, stuck = imbalance > SLOW_RATE * before, iteration > 2 and imbalance > STALLED_RATE * before
        late = matrix_is_due(increment, contact, iteration, imbalance, before)
        if solver is None or (late and not increment.material_response.linear):
            solver = None  # the factors of two matrices need not be in memory at once
            touches, projected = contact is not None and contact.constraints.size > 0, projected and imbalance > 0.01
            solver, projected = factorised(increment, contact, at, projected=projected, touches=touches)
            matrices += 1
            timer.lap("factorisation")
        share = RELAXATION if contact and stuck else share
        if contact and contact.frozen is None and (contact.rejected > 0 or stuck):
            contact.frozen, mixing, share = contact.constraints, Mixing(increment.bulk.assembly.mass), 1.0
        before = imbalance
        if contact:
            direction, contact_impulse = contact.solve(solver, gradient)
        else:
            direction = -solver(gradient)
        mixed, solved = (
            mixing.mixed(w, direction, 1.0 if close else share, wanted=slow and not close),
            contact_impulse,
        )
        w, at = move(increment, w, at, direction, mixed, gradient - contact_impulse, contact_impulse)
        timer.lap("bulk")
    drift = increment.drift(w, contact_impulse, solved)
    unmet = unmet_criteria(increment, contact, gradient - contact_impulse, imbalance, residual, drift)
    raise not_converged(limit, unmet)


def _check_balance(increment: Increment) -> None:
    """Raise NotConverged where loads would send a body away for ever that neither inertia nor anything else holds."""
    if not increment.floats.any():
        return
    grid, motions = increment.grid, increment.grid.rigid_motions()
    stopped, owner = increment.stopped(sp.csr_array(motions)).toarray(), grid.node_body[increment.fixed // 2]
    for b in np.flatnonzero(increment.floats).tolist():
        own = slice(grid.blocks[b], grid.blocks[b + 1])
        free = null_space(stopped[owner == b].T @ stopped[owner == b])
        size, net = np.abs(increment.force[own]).sum(), increment.force[own] @ motions[own]
        if np.abs(free.T @ net).max(initial=0.0) > 1e-6 * size * np.sqrt(own.stop - own.start):
            raise NotConverged(
                f"body {b}",
                f"it is held by nothing along its loads, which do not balance: net {net[0]:.3g}, {net[1]:.3g} N/m",
                "add a Support or a wall, or use inertia",
                retryable=False,
            )
