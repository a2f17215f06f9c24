"""One time step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from numbers import Real

import numpy as np

from skmpm.arrays import Array
from skmpm.contact.closest_points import with_largest_forces
from skmpm.linear.solver import one_thread
from skmpm.observe import with_fluids
from skmpm.parallel import threads
from skmpm.scene import PrescribedVelocities, Scene, State, StepFailed, check_fits, prescribed_velocities
from skmpm.scene.report import Timer
from skmpm.scheme import Scheme
from skmpm.step.acceptance import check_step
from skmpm.step.budget import budget_of
from skmpm.step.contact_problem import ContactIterate, ContactProblem, KnownForces
from skmpm.step.driven import prescribed_speeds_in_step
from skmpm.step.driven_walls import check_driven
from skmpm.step.end import box_as_prescribed, end_of_step
from skmpm.step.equations import Increment
from skmpm.step.errors import StepRejected
from skmpm.step.factor import Factor, take
from skmpm.step.gauge import gauge_condition
from skmpm.step.initial_state import check_contact, check_scheme, touches
from skmpm.step.new_state import contacts_of, end_state
from skmpm.step.newton import Solution, advance
from skmpm.step.no_equilibrium import round_the_edge
from skmpm.step.regrid import check_connected, check_parts_apart, regridded_state
from skmpm.step.report import report_of, unbalanced_ratio
from skmpm.step.scalar_unknowns import ScalarUnknowns
from skmpm.step.scene_forces import equilibrium_depends_on_dt, terms_of
from skmpm.step.start import configuration_at_start, scalar_unknowns, velocity_at_start
from skmpm.step.statics import settle

LOAD_STEPS = (
    "begin without gaps, apply loads in steps, as functions of time, or use inertia; a smaller dt changes nothing"
)

SHORTEST = 1e-100  # [s]; with shorter steps, velocities overflow


def step(scene: Scene, state: State, dt: float, *, scheme: Scheme = Scheme()) -> State:  # noqa: B008
    """Advance a state by one step; a pure function.

    Parameters
    ----------
    scene, state : a scene and its state
    dt : length of the step [s]
    scheme : how the step is solved

    Returns
    -------
    the state after the step

    Raises
    ------
    StepFailed
        if the equations of the step are not solved, or the result violates an acceptance check
        (`step.acceptance`); its `state` is the argument `state`
    ValueError
        if dt is not positive or scheme is not a Scheme; SceneError if the state belongs to another scene, or a
        prescribed velocity, load or gravity is not finite

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> state = skmpm.initial(scene)
    >>> for _ in range(3):
    ...     state = skmpm.step(scene, state, 1e-3)
    >>> round(float(state.t), 3)
    0.003
    >>> round(float(state.v[1].mean()), 5)
    -0.02943
    """
    check_scheme("step", scheme)
    check_fits(scene, state, "step")
    check_contact("step", scene, scheme)
    check_driven("step", scene)
    check_time("step: dt", dt, SHORTEST, "a time step greater than zero")
    timer, start, dt = Timer(), state, float(dt)
    state, regridded = regridded_state(scene, start, scheme)
    state = with_fluids(scene, state, state.t + scheme.theta * dt)
    motions = prescribed_velocities(scene, state.t, dt, state.box)
    unknowns = scalar_unknowns(scene, state, dt, scheme, motions)
    motions = unknowns.motions(motions, unknowns.inertia.v0)
    increment = _equations(scene, state, dt, scheme, motions, unknowns)
    timer.lap("transfer")
    try:
        check_connected(scene, state)
        check_parts_apart(scene, state, scheme)
        with one_thread(), threads(scheme.threads), np.errstate(all="raise", under="ignore"):
            factor = take(scene, state, increment)
            timer.lap("factorisation")
            problem_of = partial(_contact_problem, scene, increment, motions, timer)
            if scheme.inertia:
                solution = advance(increment, problem_of(state), factor, timer)
            else:
                fastest = max((speed for _, speed in prescribed_speeds_in_step(scene, motions)), default=0.0)
                solution = _equilibrium(scene, state, increment, fastest, problem_of, factor, timer)
            increment, solution = box_as_prescribed(increment, solution)
            end = end_of_step(increment, solution, motions)
            after = end_state(scene, state, increment, solution, end)
            timer.lap("transfer")
            budget = budget_of(scene, state, increment, solution, end, after)
            timer.lap("report")
            overlap = check_step(scene, scheme, state, after, budget, solution.solves)
            timer.lap("overlap")
    except (StepRejected, np.linalg.LinAlgError, ArithmeticError) as error:  # compiled loops: ZeroDivisionError
        raise _failure(scene, start, increment, error) from error
    unbalanced = unbalanced_ratio(scene, increment, solution, after)
    report = report_of(
        start.report.energy, increment, solution, budget, overlap, unbalanced=unbalanced, regridded=regridded
    )
    return replace(after, report=replace(report, seconds=dict(timer.seconds)))


def _equations(
    scene: Scene, state: State, dt: float, scheme: Scheme, motions: PrescribedVelocities, unknowns: ScalarUnknowns
) -> Increment:
    """The equations of the step without contact."""
    v0, at_start = velocity_at_start(scene, state, motions, scheme), configuration_at_start(scene, state, scheme)
    terms = tuple(terms_of(scene, state, at_start, dt, scheme))
    return Increment(
        at_start,
        np.concatenate([v0, unknowns.inertia.v0]),
        terms,
        dt,
        scheme,
        state.grids.supports,
        motions.supports,
        gauge=gauge_condition(scene, state, v0, terms, dt, scheme),
        depends_on_dt=scheme.inertia or equilibrium_depends_on_dt(scene),
        scalars=unknowns,
    )


def _contact_problem(
    scene: Scene,
    increment: Increment,
    motions: PrescribedVelocities,
    timer: Timer,
    state: State,
) -> ContactProblem | None:
    """The contact problem of the step, with the contact points to which the velocities of a state lead.

    None where a single body and no part of it can touch anything.
    """
    scheme, contacts = increment.scheme, state.contacts
    if not touches(scene, state, scheme):
        return None
    linearise = scheme.contact(scene, state, increment.grid, increment.dt, scheme.theta, motions, scheme.inertia)
    timer.lap("detection")
    known = KnownForces(contacts.key, contacts.force)
    held = scene.supporting >= 0
    return ContactProblem(linearise, increment, motions, known, timer, held)


def _equilibrium(
    scene: Scene,
    state: State,
    increment: Increment,
    fastest: float,
    problem_of: Callable[[State], ContactProblem | None],
    kept: Factor | None,
    timer: Timer,
) -> Solution:
    """The solution of a step without inertia; motions are prescribed that are at most as fast as this [m/s]."""
    contacts = state.contacts

    def problem_at(w: Array, found: ContactIterate | None) -> ContactProblem | None:
        nonlocal contacts
        if found is not None:
            contacts = with_largest_forces(contacts, contacts_of(found.constraints, found.r, increment.dt))
        v = state.v.copy()
        v[:, scene.deformable_points] = increment.grid.at_points(increment.on_nodes(w))
        problem = problem_of(replace(state, v=v, contacts=contacts))
        return problem if problem is None or found is None else problem.after(found)

    return settle(increment, problem_at, kept, timer, increment.dt * fastest)


def _failure(scene: Scene, start: State, increment: Increment, error: Exception) -> StepFailed:
    """The failure of the step from a state; it is retryable if a shorter step has other equations."""
    rejected, by_dt = _rejected(start, error), increment.depends_on_dt
    edge = "" if increment.scheme.inertia else round_the_edge(scene, start.contacts)
    remedies = [remedy for remedy in (rejected.remedy, edge) if remedy]
    problem = f"the step from t = {start.t:.6g} s with dt = {increment.dt:.3g} s failed: {rejected}"
    remedy = ", or ".join(remedies) if remedies or by_dt else LOAD_STEPS
    return StepFailed(problem, start, remedy=remedy, retryable=by_dt and rejected.retryable)


def _rejected(start: State, error: Exception) -> StepRejected:
    """An error of a step as one that says where: of floating-point errors the fastest body."""
    if isinstance(error, StepRejected):
        return error
    if not isinstance(error, ArithmeticError):
        return StepRejected("all bodies", str(error))
    b = start.body[int(np.argmax(np.abs(start.v).max(axis=0)))]
    remedy = "check its velocity, or give it more points"
    return StepRejected(f"body {b}, the fastest of all", f"floating-point error ({error})", remedy)


def check_time(name: str, value: object, lowest: float, expected: str) -> None:
    """Raise ValueError unless a value is a finite number of at least `lowest` [s]."""
    if not (isinstance(value, Real) and lowest <= float(value) < np.inf):
        raise ValueError(f"{name} = {value!r}; give {expected}, finite and in seconds")
