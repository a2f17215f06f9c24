"""Newton's method on the incremental potential, with the contact problem solved in every iteration.

Every iteration computes the gaps at the current w and solves the contact problem on the linearised bulk. Since that
includes the geometric stiffness of contact, convergence is fast with the matrix of the initial velocity, or with one
of an earlier step (`factor`); it is factorised again where convergence is slow. Near a limit point of the
contacts the contact problem may have no solution: that iteration then goes without geometric stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from skmpm.arrays import Array
from skmpm.material import determinant
from skmpm.scene.report import Timer
from skmpm.step.contact_problem import ContactIterate, ContactProblem
from skmpm.step.contact_solve import solve
from skmpm.step.convergence import PATIENCE, Balance, Persistence, not_converged
from skmpm.step.equations import Increment
from skmpm.step.errors import StepRejected, at_point
from skmpm.step.factor import Factor, Refactorisation, factorise
from skmpm.step.line_search import search
from skmpm.step.matrix import solver_of
from skmpm.step.rotation import drift, missing_spin, with_balanced_momentum
from skmpm.step.terms import Configuration


@dataclass(frozen=True)
class Solution:
    """A converged step."""

    w: Array  # (n,) [m/s]
    contact: ContactIterate | None
    newton: int  # iterations
    factorisations: int
    residual: float  # of the contact law at the end of the step
    imbalance: float  # relative out-of-balance norm
    reaction: Array  # (q,) impulses on the supports, q = 2 supports + 2 that turn [kg m/s per m]
    factor: Factor | None  # of the last iteration
    spin: Array | float  # (2 nodes,) velocity that w lacks for the balance of angular momentum [m/s]
    configuration: Configuration  # of w but for translations of bodies, in which stresses were evaluated
    solves: int = 1  # of a static step

    @property
    def contact_impulse(self) -> Array | None:
        """The contact impulse, (n,) [kg m/s per m]; None where nothing can touch."""
        return None if self.contact is None else self.contact.impulse


def advance(increment: Increment, problem: ContactProblem | None, kept: Factor | None, timer: Timer) -> Solution:
    """Solve one step, or one of a static step, from an admissible guess.

    StepRejected is raised after `max_newton` iterations, with contacts after some without progress (`Persistence`),
    and if the contact solver or the line search fails.
    """
    w, configuration = admissible_guess(increment)
    contact = None if problem is None else problem.at(w)
    iterate = _Iterate(increment, w, configuration, contact, kept, np.zeros_like(w))
    most = increment.scheme.max_newton
    persistence = Persistence(most, PATIENCE if contact is not None and increment.mass.any() else most)
    while True:
        balance = Balance.at(increment, iterate.w, iterate.configuration, iterate.contact)
        converged = balance.distance <= 1.0 and iterate.iteration > 0  # the initial guess is no solution
        if converged and (solution := _solution(iterate, balance)):
            return solution
        if persistence.ends(iterate.iteration, balance.distance):
            moved = drift(increment, iterate.w, balance.contact_impulse, iterate.last_impulse)
            raise not_converged(increment, iterate.contact, balance, iterate.iteration, moved)
        _factorise(iterate, balance, timer)
        direction = _direction(iterate, balance)
        _move(iterate, balance, direction, timer)


@dataclass
class _Iterate:
    """A velocity, and what is known for the next one. The iteration changes it in place."""

    increment: Increment
    w: Array  # (n,) [m/s]
    configuration: Configuration
    contact: ContactIterate | None
    factor: Factor | None
    last_impulse: Array  # (n,) contact impulse of the last solve [kg m/s per m]
    refactorisation: Refactorisation = field(default_factory=Refactorisation)
    iteration: int = 0
    before: float = np.inf  # out-of-balance norm of the iteration before


def admissible_guess(increment: Increment) -> tuple[Array, Configuration]:
    """The velocity at which Newton's method starts, with its configuration.

    It is the initial guess; if that inverts a point (det F <= 0) of a nonlinear material, the solution without
    contact of the equations linearised about rest; and if that inverts a point too, rest.

    Raises
    ------
    StepRejected
        instead of a start from rest in scenes with supports, whose prescribed velocities exclude it
    """
    w = increment.initial_guess()
    configuration = increment.at(w)
    if increment.bulk.linear or np.isfinite(increment.bulk.energy(configuration)):
        return w, configuration
    rest = increment.with_scalars(np.zeros_like(increment.displacement_at_start), increment.of_scalars(w))
    configuration = increment.at(rest)
    gradient = increment.on_nodes(increment.gradient(rest, configuration)[0])
    prescribed = increment.prescribed_only()
    nodes = prescribed - solver_of(increment, configuration)(gradient + increment.matrix(configuration) @ prescribed)
    linear = increment.with_scalars(nodes, increment.of_scalars(w))
    trial = increment.at(linear)
    if np.isfinite(increment.bulk.energy(trial)):
        return linear, trial
    if increment.supports is None:
        return rest, configuration
    worst = int(np.argmin(determinant(trial.F)))
    where = at_point(increment.grid, worst, increment.displacement_at_start)
    raise StepRejected(where, "the supports move so far in one step that points are inverted (det F <= 0)")


def _factorise(iterate: _Iterate, balance: Balance, timer: Timer) -> None:
    """Factorise the matrix where that pays."""
    increment, iteration = iterate.increment, iterate.iteration
    touching = iterate.contact is not None and iterate.contact.constraints.size > 0
    norms = balance.norm, iterate.before, balance.distance
    due = iterate.refactorisation.due(increment, iteration, *norms, in_contact=touching)
    if iterate.factor is not None and not due:
        return
    iterate.factor = None  # so that only one solver is in memory
    iterate.factor = factorise(increment, iterate.configuration, in_contact=touching)
    iterate.refactorisation.made(iteration)
    timer.lap("factorisation")


def _direction(iterate: _Iterate, balance: Balance) -> Array:
    """The Newton direction, (n,) [m/s], with new contact impulses."""
    factor = iterate.factor
    assert factor is not None
    if iterate.contact is None:
        iterate.last_impulse, solver = balance.contact_impulse, factor.at(iterate.increment, iterate.configuration)
        return -iterate.increment.solved(solver, balance.gradient)
    found, iterate.factor = solve(iterate.contact, factor, iterate.configuration, balance.gradient)
    iterate.contact, iterate.last_impulse = found.contact, found.impulse
    return found.direction


def _move(iterate: _Iterate, balance: Balance, direction: Array, timer: Timer) -> None:
    """Move along the direction as far as the potential decreases; all of it if no configuration is inadmissible."""
    iterate.before, increment, w = balance.norm, iterate.increment, iterate.w
    if increment.bulk.linear:
        iterate.w, iterate.configuration = w + direction, increment.at(w + direction)
    else:
        impulse = iterate.last_impulse
        found = search(increment, w, iterate.configuration, direction, balance.gradient - impulse, impulse)
        iterate.w, iterate.configuration = found
    timer.lap("bulk")
    iterate.iteration += 1
    iterate.contact = None if iterate.contact is None else iterate.contact.at(iterate.w)


def _solution(iterate: _Iterate, balance: Balance) -> Solution | None:
    """The solution, with the momentum of every body balanced to round-off; None if that would change gaps."""
    increment, factor = iterate.increment, iterate.factor
    w = with_balanced_momentum(increment, iterate.w, balance.contact_impulse, iterate.last_impulse)
    if w is None:
        return None
    reaction = increment.reaction(balance.out_of_balance)
    spin = missing_spin(increment, w, balance.out_of_balance)
    numbers = iterate.iteration, iterate.refactorisation.count, balance.contact, balance.norm
    return Solution(w, iterate.contact, *numbers, reaction, factor, spin, iterate.configuration)
