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
from skmpm.step.convergence import Persistence, not_converged, unmet_criteria, with_contact
from skmpm.step.equations import Increment
from skmpm.step.errors import StepRejected, at_node
from skmpm.step.factor import Factor, Refactorisation, factorise
from skmpm.step.line_search import move
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
    reaction: Array  # (2 supports,) impulses on the supports [kg m/s per m]
    factor: Factor | None  # of the last iteration
    spin: Array | float = 0.0  # (2 nodes,) velocity that w lacks for the balance of angular momentum [m/s]
    configuration: Configuration | None = (
        None  # of w but for translations of bodies, in which stresses were evaluated
    )
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
    iterate = _first(increment, problem, kept)
    persistence = Persistence.for_equations(increment, in_contact=problem is not None)
    while True:
        balance = _balance(iterate)
        if balance.converged and (solution := _solution(iterate, balance)):
            return solution
        if persistence.ends(balance.iteration, balance.distance):
            raise _not_converged(iterate, balance)
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


def _first(increment: Increment, problem: ContactProblem | None, kept: Factor | None) -> _Iterate:
    """The iterate at the initial guess."""
    w, configuration = admissible_guess(increment)
    contact = None if problem is None else problem.at(w)
    return _Iterate(increment, w, configuration, contact, kept, np.zeros_like(w))


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
    node = increment.grid.nodes_of_cell[0, increment.grid.cell_of_point[worst]]
    where = at_node(increment.grid, int(node), increment.displacement_at_start)
    raise StepRejected(where, "the supports move so far in one step that points are inverted (det F <= 0)")


@dataclass(frozen=True)
class _Balance:
    """The residuals at an iterate."""

    iteration: int
    gradient: Array  # out-of-balance impulse without contact (n,) [kg m/s per m]
    contact_impulse: Array  # (n,)
    contact: float  # residual of the contact law
    norm: float  # out-of-balance norm over the largest term
    distance: float  # from convergence: the larger of both residuals over their tolerances

    @property
    def out_of_balance(self) -> Array:
        """The out-of-balance impulse, (n,) [kg m/s per m]."""
        return self.gradient - self.contact_impulse

    @property
    def small(self) -> bool:
        """Whether both residuals are within their tolerances."""
        return self.distance <= 1.0

    @property
    def converged(self) -> bool:
        """Whether the iterate is a solution; the initial guess is none."""
        return self.small and self.iteration > 0


def _balance(iterate: _Iterate) -> _Balance:
    """The residuals of the momentum balance and of the contact law, with the known contact impulses."""
    increment, contact, scheme = iterate.increment, iterate.contact, iterate.increment.scheme
    gradient, size = increment.gradient(iterate.w, iterate.configuration)
    contact_impulse, residual = np.zeros_like(gradient), 0.0
    if contact:
        contact_impulse, residual, size = with_contact(increment, contact, size)
    norm = float(np.linalg.norm(increment.on_free_dofs(gradient - contact_impulse)))
    norm = norm / size if size > 0.0 else 0.0
    distance = max(norm / scheme.newton_tol, residual / scheme.gap_tol)
    return _Balance(iterate.iteration, gradient, contact_impulse, residual, norm, distance)


def _factorise(iterate: _Iterate, balance: _Balance, timer: Timer) -> None:
    """Factorise the matrix where that pays."""
    increment, iteration = iterate.increment, iterate.iteration
    touching = iterate.contact is not None and iterate.contact.constraints.size > 0
    norms = balance.norm, iterate.before, balance.distance
    due = iterate.refactorisation.due(increment, iteration, *norms, in_contact=touching)
    if iterate.factor is not None and not due:
        return
    iterate.factor = None  # so that only one solver is in memory
    iterate.contact = None if iterate.contact is None else iterate.contact.without_delassus()
    iterate.factor = factorise(increment, iterate.configuration, in_contact=touching)
    iterate.refactorisation.made(iteration)
    timer.lap("factorisation")


def _direction(iterate: _Iterate, balance: _Balance) -> Array:
    """The Newton direction, (n,) [m/s], with new contact impulses."""
    assert iterate.factor is not None
    solver = iterate.factor.at(iterate.increment, iterate.configuration)
    if iterate.contact is None:
        iterate.last_impulse = balance.contact_impulse
        return -iterate.increment.solved(solver, balance.gradient)
    found = solve(iterate.contact, solver, balance.gradient)
    iterate.contact, iterate.last_impulse = found.contact, found.impulse
    return found.direction


def _move(iterate: _Iterate, balance: _Balance, direction: Array, timer: Timer) -> None:
    """Move along the direction as far as the potential decreases."""
    iterate.before, out_of_balance = balance.norm, balance.gradient - iterate.last_impulse
    iterate.w, iterate.configuration = move(
        iterate.increment, iterate.w, iterate.configuration, direction, out_of_balance, iterate.last_impulse
    )
    timer.lap("bulk")
    iterate.iteration += 1
    iterate.contact = None if iterate.contact is None else iterate.contact.at(iterate.w)


def _solution(iterate: _Iterate, balance: _Balance) -> Solution | None:
    """The solution, with the momentum of every body balanced to round-off; None if that would change gaps."""
    increment, factor = iterate.increment, iterate.factor
    w = with_balanced_momentum(increment, iterate.w, balance.contact_impulse, iterate.last_impulse)
    if w is None:
        return None
    reaction = increment.reaction(balance.out_of_balance)
    spin = missing_spin(increment, w, balance.out_of_balance)
    numbers = balance.iteration, iterate.refactorisation.count, balance.contact, balance.norm
    return Solution(w, iterate.contact, *numbers, reaction, factor, spin, iterate.configuration)


def _not_converged(iterate: _Iterate, balance: _Balance) -> StepRejected:
    """The error that names the criteria which are not met."""
    increment, contact = iterate.increment, iterate.contact
    moved = drift(increment, iterate.w, balance.contact_impulse, iterate.last_impulse)
    unmet = unmet_criteria(increment, contact, balance.out_of_balance, balance.norm, balance.contact, moved)
    return not_converged(increment, balance.iteration, unmet)
