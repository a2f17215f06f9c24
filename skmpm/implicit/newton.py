"""Newton's method on the incremental potential, with the contact problem solved in every iteration.

Every iteration computes the gaps at the current w and solves the contact problem on the linearised bulk. Since that
includes the geometric stiffness of contact, convergence is fast with the matrix of the initial velocity; it is
factorised again where convergence is slow. Near a limit point of the contacts the contact problem may have no
solution: that iteration then goes without geometric stiffness. In a quasi-static step, which such iterations do not
solve, the contact geometry is frozen (`frozen_geometry`), and replaced by that of a later iterate where it makes a
moment.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.acceleration import AndersonAcceleration
from skmpm.implicit.bulk import Configuration
from skmpm.implicit.contact_problem import ContactIterate, ContactProblem
from skmpm.implicit.contact_solve import solve
from skmpm.implicit.errors import StepRejected
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
    out_of_balance_norm,
    unmet_criteria,
    with_contact,
)
from skmpm.implicit.line_search import move
from skmpm.implicit.residual import Increment, null_space
from skmpm.implicit.rotation import matrix_turns, turned_solver
from skmpm.implicit.timer import Timer
from skmpm.linear import Solver

Array = NDArray[np.float64]

# Iterations of a dynamic step with contacts after which it is given up unless one of them came closer to convergence:
# two to four are usual; contacts that snap by a cell take 20 to 30, most of them on a plateau of up to eight.
PATIENCE = 20


def advance(increment: Increment, problem: ContactProblem | None, kept: Solver | None, timer: Timer) -> Solution:
    """Solve one step from the initial guess, v0 unless that inverts points (`first_velocity`).

    StepRejected is raised after `max_newton` iterations, in a dynamic step with contacts after `PATIENCE` iterations
    without progress, and if the contact solver or the line search fails.
    """
    if problem is None:
        _check_resultants(increment)
    scheme, factor, (w, configuration) = increment.scheme, _Factor(kept), first_velocity(increment)
    contact: ContactIterate | None = None
    mass, before, last_impulse = increment.bulk.assembly.mass, np.inf, np.zeros_like(w)
    acceleration, relaxation = AndersonAcceleration(mass), 1.0
    patience = PATIENCE if problem and scheme.inertia else scheme.max_newton
    closest, progress = np.inf, 0
    for iteration in range(scheme.max_newton + 2):
        contact = (contact or problem).at(w) if problem else None
        balance = _evaluate(increment, contact, w, configuration)
        converged = iteration > 0 and balance.small
        if converged and contact and frozen_geometry_moment(increment, contact, w).max() > MAX_FROZEN_MOMENT:
            contact, before = contact.with_frozen_geometry(contact.current).at(w), np.inf
            acceleration = AndersonAcceleration(mass)
            balance = _evaluate(increment, contact, w, configuration)
            converged = balance.small
        if converged or (iteration == 1 and increment.one_solve and contact is None):
            final = increment.with_balanced_momentum(w, balance.contact_impulse, last_impulse)
            if final is not None:
                return _solution(increment, final, contact, balance, factor, iteration)
        if balance.distance < closest:
            closest, progress = balance.distance, iteration
        # A full step more balances the momentum of a converged iterate.
        if iteration >= scheme.max_newton + converged or iteration - progress >= patience:
            break
        if factor.due(increment, contact, iteration, balance.norm, before):
            factor, contact = factor.released(), contact.without_delassus() if contact else None
            factor = factor.renewed(increment, contact, configuration)
            timer.lap("factorisation")
        solver = factor.at(increment, configuration)
        # With inertia, stiffness that failed in one iteration is tried again in the next.
        stalled = not scheme.inertia and iteration > 2 and balance.norm > STALLED_RATE * before
        failed = contact is not None and not scheme.inertia and contact.stiffness_failures > 0
        relaxation = RELAXATION if contact and stalled else relaxation
        if contact and contact.frozen is None and (failed or stalled):
            contact = contact.with_frozen_geometry(contact.constraints)
            acceleration, relaxation = AndersonAcceleration(mass), 1.0
        contact, direction, last_impulse = _direction(contact, solver, balance)
        # Not with inertia: affine combinations of rotated bodies stretch them, by more than light contacts do.
        slow = not scheme.inertia and balance.norm > SLOW_RATE * before and not converged
        accelerated, before = acceleration.accelerate(w, direction, relaxation, wanted=slow), balance.norm
        out_of_balance = balance.gradient - last_impulse
        w, configuration = move(increment, w, configuration, direction, out_of_balance, last_impulse, accelerated)
        timer.lap("bulk")
    raise _not_converged(increment, w, contact, balance, last_impulse, iteration)


@dataclass(frozen=True)
class _Balance:
    """The residuals at an iterate."""

    gradient: Array  # out-of-balance impulse without contact (2 nodes,) [kg m/s per m]
    contact_impulse: Array  # (2 nodes,)
    contact: float  # residual of the contact law
    norm: float  # out-of-balance norm over the largest term
    distance: float  # from convergence: the larger of both residuals over their tolerances

    @property
    def small(self) -> bool:
        """Whether both residuals are within their tolerances."""
        return self.distance <= 1.0


def _evaluate(
    increment: Increment, contact: ContactIterate | None, w: Array, configuration: Configuration
) -> _Balance:
    """The residuals of the momentum balance and of the contact law, with the known contact impulses."""
    gradient, size = increment.gradient(w, configuration)
    contact_impulse, residual, scheme = np.zeros_like(gradient), 0.0, increment.scheme
    if contact:
        contact_impulse, residual, size = with_contact(increment, contact, size)
    norm = out_of_balance_norm(increment, contact, gradient - contact_impulse)
    norm = norm / size if size > 0.0 else 0.0
    distance = max(norm / scheme.newton_tol, residual / scheme.gap_tol)
    return _Balance(gradient, contact_impulse, residual, norm, distance)


@dataclass(frozen=True)
class _Factor:
    """The factorised matrix of the iteration."""

    solver: Solver | None
    count: int = 0  # factorisations in this step
    configuration: Configuration | None = None  # of the matrix, if it turns with bodies

    def due(
        self, increment: Increment, contact: ContactIterate | None, iteration: int, norm: float, before: float
    ) -> bool:
        """Whether a new one pays; linear materials keep theirs."""
        if self.solver is None:
            return True
        pays = needs_refactorisation(increment, contact, iteration, norm, before)
        return pays and not increment.linear

    def released(self) -> _Factor:
        """The same without its solver, so that only one is in memory."""
        return replace(self, solver=None)

    def at(self, increment: Increment, configuration: Configuration) -> Solver:
        """The solver for the matrix turned as bodies have turned since it was factorised."""
        assert self.solver is not None
        if self.configuration is None or self.configuration is configuration:
            return self.solver
        return turned_solver(increment, self.solver, self.configuration, configuration)

    def renewed(self, increment: Increment, contact: ContactIterate | None, configuration: Configuration) -> _Factor:
        """The factorised matrix at a configuration."""
        at = configuration if matrix_turns(increment) else None
        return _Factor(factorise(increment, contact, configuration), self.count + 1, at)


def _direction(
    contact: ContactIterate | None, solver: Solver, balance: _Balance
) -> tuple[ContactIterate | None, Array, Array]:
    """The contact problem with new impulses, the Newton direction and the contact impulse that belongs to it."""
    if contact is None:
        return None, -solver(balance.gradient), balance.contact_impulse
    found = solve(contact, solver, balance.gradient)
    return found.contact, found.direction, found.impulse


def _solution(
    increment: Increment,
    w: Array,
    contact: ContactIterate | None,
    balance: _Balance,
    factor: _Factor,
    iterations: int,
) -> Solution:
    reaction = increment.reaction(balance.gradient - balance.contact_impulse)
    return Solution(w, contact, iterations, factor.count, balance.contact, balance.norm, reaction, factor.solver)


def _not_converged(
    increment: Increment,
    w: Array,
    contact: ContactIterate | None,
    balance: _Balance,
    last_impulse: Array,
    iterations: int,
) -> StepRejected:
    """The error that names the criteria which are not met."""
    drift = increment.drift(w, balance.contact_impulse, last_impulse)
    out_of_balance = balance.gradient - balance.contact_impulse
    unmet = unmet_criteria(increment, contact, out_of_balance, balance.norm, balance.contact, drift)
    return not_converged(iterations, unmet + unmet_moment(increment, contact, w))


def _check_resultants(increment: Increment) -> None:
    """Raise StepRejected where the loads have a resultant on a rigid-body mode of a floating body."""
    if not increment.floating.any():
        return
    grid, motions = increment.grid, increment.grid.rigid_motions()
    turned, load = grid.rigid_motions(increment.start), increment.load(np.zeros_like(increment.start))
    for b in np.flatnonzero(increment.floating).tolist():
        dofs = slice(grid.blocks[b], grid.blocks[b + 1])
        free = null_space(increment.held_motions[b])
        dead, following = increment.force[dofs], (load - increment.force)[dofs]
        size = np.abs(load[dofs]).sum()
        resultant = dead @ motions[dofs] + following @ turned[dofs]
        if np.abs(free.T @ resultant).max(initial=0.0) > 1e-6 * size * np.sqrt(dofs.stop - dofs.start):
            raise StepRejected(
                f"body {b}",
                "its loads have a resultant that no support or contact balances:"
                f" ({resultant[0]:.3g}, {resultant[1]:.3g}) N/m",
                "add a Support or a wall, or use inertia",
                retryable=False,
            )
