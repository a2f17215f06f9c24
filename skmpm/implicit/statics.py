"""Newton's method for quasi-static steps with floating bodies and contacts.

Springs in A limit the rigid motion of these bodies in one iteration; they do not enter the residual. Where contacts
leave rigid-body modes neutral, the proximal point method replaces them (`proximal_point`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit import newton
from skmpm.implicit.acceleration import AndersonAcceleration
from skmpm.implicit.bulk import Configuration
from skmpm.implicit.contact_problem import ContactProblem
from skmpm.implicit.contact_solve import solve
from skmpm.implicit.errors import StepRejected
from skmpm.implicit.floating import (
    check_step_motion,
    floating_bodies,
    limited,
)
from skmpm.implicit.frozen_geometry import (
    MAX_FROZEN_MOMENT,
    frozen_geometry_moment,
    unmet_moment,
    with_present_geometry,
)
from skmpm.implicit.iteration import (
    SLOW_RATE,
    STALLED_RATE,
    Solution,
    factorise,
    first_velocity,
    not_converged,
    unmet_criteria,
)
from skmpm.implicit.line_search import move
from skmpm.implicit.mechanisms import diagnose, rigid_initial_guess
from skmpm.implicit.proximal_point import (
    Iterate,
    OutOfBalance,
    converged,
    drifts_on_springs,
    evaluate,
    restart,
    update_proximal_term,
)
from skmpm.implicit.remedies import Remedies
from skmpm.implicit.residual import Increment
from skmpm.implicit.timer import Timer
from skmpm.linear import Solver

Array = NDArray[np.float64]

INNER_ITERATIONS = 8  # with one proximal centre, before a stalled iteration freezes the contact geometry


def advance(increment: Increment, problem: ContactProblem | None, kept: Solver | None, timer: Timer) -> Solution:
    """Solve one step; by `newton.advance` unless it is quasi-static with floating bodies and contacts.

    Raises
    ------
    StepRejected
        if there is no equilibrium, which limit analysis finds before the first iteration as far as it can, or if none
        is found
    """
    if problem is None or not increment.floating.any():
        return newton.advance(increment, problem, kept, timer)
    constraints = problem.linearise(increment.prescribed_only())
    bodies = floating_bodies(increment, constraints)
    guess = rigid_initial_guess(increment, problem, bodies, constraints)
    if guess is not None and increment.gauge is not None:
        guess = increment.gauge.initial_guess(guess)
    start = first_velocity(increment) if guess is None else (guess, increment.at(guess))
    mass = increment.bulk.assembly.mass
    remedies, of_centre = Remedies(mass), AndersonAcceleration(mass)
    iterate = Iterate(increment, problem.at(start[0]), bodies, *start, kept, remedies, of_centre)
    try:
        solution = _newton(iterate, start, timer, range(increment.scheme.max_newton + 1))
    except StepRejected as error:
        raise diagnose(increment, iterate.contact, bodies, error) from error

    def again() -> Solution:
        _thaw(iterate)
        return _newton(iterate, start, timer, range(solution.newton, 2 * solution.newton + 1))

    return with_present_geometry(solution, again)


def _newton(iterate: Iterate, start: tuple[Array, Configuration], timer: Timer, iterations: range) -> Solution:
    """Newton's method in so many iterations; a restart is from `start`, a velocity and its configuration."""
    increment, bodies = iterate.increment, iterate.bodies
    for iteration in iterations:
        balance = evaluate(iterate, iteration)
        if drifts_on_springs(iterate):
            balance = restart(iterate, start, iteration)
        check_step_motion(increment, bodies, iterate.w)
        if converged(iterate, balance):
            if frozen_geometry_moment(iterate.increment, iterate.contact, iterate.w).max() <= MAX_FROZEN_MOMENT:
                return _solution(iterate, balance)
            balance = _renew_geometry(iterate, iteration)
            if converged(iterate, balance):
                return _solution(iterate, balance)
        _iterate(iterate, update_proximal_term(iterate, balance), timer)
    raise not_converged(iterations[-1], _unmet(iterate, balance))


def _thaw(iterate: Iterate) -> None:
    """Go on without frozen contact geometry."""
    iterate.contact, iterate.before = iterate.contact.with_frozen_geometry(None), np.inf
    iterate.remedies.restart()


def _unmet(iterate: Iterate, balance: OutOfBalance) -> list[tuple[str, str]]:
    """The convergence criteria that are not met, where and by how much."""
    out_of_balance, no_drift = balance.gradient - balance.contact_impulse, np.zeros(iterate.increment.grid.bodies)
    unmet = unmet_criteria(
        iterate.increment, iterate.contact, out_of_balance, balance.without_proximal, balance.residual, no_drift
    )
    return unmet + unmet_moment(iterate.increment, iterate.contact, iterate.w)


def _renew_geometry(iterate: Iterate, iteration: int) -> OutOfBalance:
    """Freeze the contact geometry at w instead of the previous one; the out-of-balance impulses with it."""
    iterate.contact = iterate.contact.with_frozen_geometry(iterate.contact.current)
    iterate.remedies.forget()
    iterate.before = np.inf
    return evaluate(iterate, iteration)


def _solution(iterate: Iterate, balance: OutOfBalance) -> Solution:
    """The converged solution; a factor that contains the proximal weight is not kept for later steps."""
    increment = iterate.increment
    reaction = increment.reaction(balance.gradient - iterate.proximal_impulse - balance.contact_impulse)
    solver = iterate.solver if increment.proximal is None else None
    return Solution(
        iterate.w,
        iterate.contact,
        balance.iteration,
        iterate.refactorisation.count,
        balance.residual,
        balance.without_proximal,
        reaction,
        solver,
    )


def _iterate(iterate: Iterate, balance: OutOfBalance, timer: Timer) -> None:
    """One Newton iteration."""
    increment = iterate.increment
    slow, stalls = balance.relative > SLOW_RATE * iterate.before, balance.relative > STALLED_RATE * iterate.before
    patience = 2 if increment.proximal is None else INNER_ITERATIONS
    stalled = stalls and balance.iteration > iterate.centre_iteration + patience
    distance = max(balance.relative / increment.scheme.newton_tol, balance.residual / increment.scheme.gap_tol)
    due = iterate.refactorisation.due(increment, balance.iteration, balance.relative, iterate.before, distance)
    if iterate.solver is None or due:
        iterate.solver = None
        iterate.contact = iterate.contact.without_delassus()
        iterate.solver = factorise(increment, iterate.contact, iterate.configuration)
        iterate.refactorisation.made(balance.iteration)
        timer.lap("factorisation")
    contact = iterate.remedies.frozen(iterate.contact, stalled)
    first = increment.proximal is not None and balance.iteration == iterate.centre_iteration
    iterate.before = np.inf if first else balance.relative
    solved = solve(contact, iterate.solver, balance.gradient)
    iterate.contact, direction, contact_impulse = solved.contact, solved.direction, solved.impulse
    step = iterate.remedies.accelerated(iterate.w, direction, slow)
    direction = limited(increment, iterate.bodies, iterate.w, direction)
    iterate.w, iterate.configuration = move(
        increment,
        iterate.w,
        iterate.configuration,
        direction,
        balance.gradient - contact_impulse,
        contact_impulse,
        None if step is None else limited(increment, iterate.bodies, iterate.w, step),
    )
    timer.lap("bulk")
