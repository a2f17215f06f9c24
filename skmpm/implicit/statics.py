"""Newton's method for quasi-static steps in which contact alone constrains bodies.

Springs in A limit the rigid motion of these bodies in one iteration; they do not enter the residual. Where contacts
leave rigid-body modes neutral, the proximal point method replaces them (`proximal_point`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit import newton
from skmpm.implicit.bulk import Configuration
from skmpm.implicit.contact_problem import ContactProblem
from skmpm.implicit.errors import NotConverged
from skmpm.implicit.floating import (
    FloatingBodies,
    check_step_motion,
    floating_bodies,
    limited,
)
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
)
from skmpm.implicit.line_search import move
from skmpm.implicit.mechanisms import diagnosed, rigid_predictor
from skmpm.implicit.mixing import Mixing
from skmpm.implicit.proximal_point import (
    Iterate,
    OutOfBalance,
    converged,
    measured,
    restarted,
    slides_away,
    with_proximal_term,
)
from skmpm.implicit.residual import Increment
from skmpm.implicit.timer import Timer
from skmpm.linear import Solver

Array = NDArray[np.float64]

ITERATIONS_PER_POINT = 8  # with one proximal point, before a stalled iteration freezes the contact geometry


def advance(increment: Increment, contact: ContactProblem | None, kept: Solver | None, timer: Timer) -> Solution:
    """Solve one step; by `newton.advance` unless contact alone constrains bodies of a quasi-static step.

    Raises
    ------
    NotConverged
        if there is no equilibrium, which limit analysis finds before the first iteration as far as it can, or if none
        is found
    """
    if contact is None or not increment.floating.any():
        return newton.advance(increment, contact, kept, timer)
    constraints = contact.linearise(increment.prescribed_only())
    bodies = floating_bodies(increment, constraints)
    predictor = rigid_predictor(increment, contact, bodies, constraints)
    try:
        start = first_velocity(increment) if predictor is None else (predictor, increment.at(predictor))
        return _newton(increment, contact, bodies, start, kept, timer)
    except NotConverged as error:
        raise diagnosed(increment, contact, bodies, error) from error


def _newton(
    increment: Increment,
    contact: ContactProblem,
    bodies: FloatingBodies,
    start: tuple[Array, Configuration],
    kept: Solver | None,
    timer: Timer,
) -> Solution:
    """Newton's method from a velocity and its configuration."""
    mass = increment.bulk.assembly.mass
    iterate = Iterate(increment, contact, bodies, *start, kept, Mixing(mass), Mixing(mass))
    for iteration in range(increment.scheme.max_newton + 1):
        now = measured(iterate, iteration)
        if slides_away(iterate):
            now = restarted(iterate, start, iteration)
        check_step_motion(increment, bodies, iterate.w)
        if converged(iterate, now):
            if frozen_geometry_moment(iterate.increment, contact, iterate.w).max() <= MAX_FROZEN_MOMENT:
                return _solution(iterate, now)
            now = _with_current_geometry(iterate, iteration)
            if converged(iterate, now):
                return _solution(iterate, now)
        _iterate(iterate, with_proximal_term(iterate, now), timer)
    raise not_converged(increment.scheme.max_newton, _unmet(iterate, now))


def _unmet(iterate: Iterate, now: OutOfBalance) -> list[tuple[str, str]]:
    """The convergence criteria that are not met, where and by how much."""
    missing, no_drift = now.gradient - now.contact_impulse, np.zeros(iterate.increment.grid.bodies)
    unmet = unmet_criteria(iterate.increment, iterate.contact, missing, now.without_drag, now.residual, no_drift)
    return unmet + unmet_moment(iterate.increment, iterate.contact, iterate.w)


def _with_current_geometry(iterate: Iterate, iteration: int) -> OutOfBalance:
    """The out-of-balance impulses with the contact geometry at w, which is frozen instead of the previous one."""
    iterate.contact.frozen = iterate.contact.current
    iterate.restart_mixing()
    iterate.before = np.inf
    return measured(iterate, iteration)


def _solution(iterate: Iterate, now: OutOfBalance) -> Solution:
    """The converged solution; a factor that contains the drag is not kept for later steps."""
    increment = iterate.increment
    reaction = increment.reaction(now.gradient - iterate.drag_impulse - now.contact_impulse)
    solver = iterate.solver if increment.proximal is None else None
    return Solution(
        iterate.w,
        iterate.contact,
        now.iteration,
        iterate.factorisations,
        now.residual,
        now.without_drag,
        reaction,
        solver,
    )


def _iterate(iterate: Iterate, now: OutOfBalance, timer: Timer) -> None:
    """One Newton iteration."""
    increment, contact = iterate.increment, iterate.contact
    slow, stalls = now.relative > SLOW_RATE * iterate.before, now.relative > STALLED_RATE * iterate.before
    patience = 2 if increment.proximal is None else ITERATIONS_PER_POINT
    stalled = stalls and now.iteration > iterate.point_iteration + patience
    due = matrix_is_due(increment, contact, now.iteration, now.relative, iterate.before)
    if iterate.solver is None or (due and not increment.material_response.linear):
        iterate.solver, projected = None, iterate.projected and now.relative > 0.01
        iterate.solver, iterate.projected = factorised(increment, contact, iterate.at, projected=projected)
        iterate.factorisations += 1
        timer.lap("factorisation")
    iterate.relaxation = RELAXATION if stalled else iterate.relaxation
    if contact.frozen is None and (contact.stiffness_failures > 0 or stalled):
        contact.frozen, iterate.relaxation = contact.constraints, 1.0
        iterate.restart_mixing()
    first = increment.proximal is not None and now.iteration == iterate.point_iteration
    iterate.before = np.inf if first else now.relative
    direction, contact_impulse = contact.solve(iterate.solver, now.gradient)
    step, accelerated = iterate.mixing.mixed(iterate.w, direction, iterate.relaxation, wanted=slow)
    direction = limited(increment, iterate.bodies, iterate.w, direction)
    mixed = limited(increment, iterate.bodies, iterate.w, step) if accelerated else direction, accelerated
    iterate.w, iterate.at = move(
        increment, iterate.w, iterate.at, direction, mixed, now.gradient - contact_impulse, contact_impulse
    )
    timer.lap("bulk")
