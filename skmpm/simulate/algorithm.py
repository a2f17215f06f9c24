"""The algorithm on one screen."""

from __future__ import annotations

from dataclasses import replace
from numbers import Real

import numpy as np

from skmpm.implicit import ContactProblem, Increment, NotConverged, Timer, advance
from skmpm.implicit.errors import SMALLER
from skmpm.linear import Delassus, one_thread
from skmpm.scene import PrescribedVelocities, Scene, State, StepFailed, check_fits, prescribed_velocities
from skmpm.scheme import Scheme
from skmpm.simulate.acceptance import check_step
from skmpm.simulate.energy_budget import budget_of, report_of
from skmpm.simulate.forces import dead, driven_bodies, external_force
from skmpm.simulate.grid_to_points import end_state, kept_solver
from skmpm.simulate.initial_state import can_touch, check_explicit, check_scheme
from skmpm.simulate.regrid import assembly_of, bulk_of, check_whole, derived_of, regridded_state
from skmpm.simulate.rigid_edges import pressed_edge
from skmpm.transfer import to_nodes

STEPWISE = "apply loads in steps, as functions of time, or use inertia; not a smaller dt"
SHORTEST = 1e-100  # [s]; shorter steps divide by zero


def step(scene: Scene, state: State, dt: float, *, scheme: Scheme = Scheme()) -> State:  # noqa: B008
    """Advance `state` by `dt` [s]; pure: nothing is changed, nothing is kept.

    Raises
    ------
    StepFailed
        when the step's equations are not solved, or where it leads cannot be (`simulate.acceptance`); its `state` is
        the one given here
    ValueError
        when dt is not a time, the scheme no Scheme; SceneError when the state is none of this scene, a prescribed
        velocity, load or gravity not finite
    """
    check_scheme("step", scheme)
    check_fits(scene, state, "step")
    check_explicit("step", scene, scheme)
    check_time("step: dt", dt, SHORTEST, "a time step greater than zero")
    timer, given = Timer(), state
    state, regridded = regridded_state(scene, given, scheme)
    own = scene.deformable[state.body]
    v0 = to_nodes(assembly_of(state), state.mass[own], state.v[:, own], state.C[:, :, own])
    if not scheme.inertia:  # a body goes on only as far as something drives it
        v0 *= np.repeat(driven_bodies(scene, state)[assembly_of(state).grid.node_body], 2)
    force, motions = (
        external_force(scene, state, state.t + scheme.theta * dt),
        prescribed_velocities(scene, state.t, dt),
    )
    bulk, supports = bulk_of(scene, state, scheme), derived_of(state).supports
    increment = Increment(bulk, state.displacement, v0, force, dt, scheme, supports, motions.supports)
    timer.lap("transfer")
    try:
        check_whole(scene, state)
        with one_thread(), np.errstate(all="raise", under="ignore"):
            solver, delassus = kept_solver(scene, state, increment)
            contact = _contact_problem(scene, state, increment, motions, timer, delassus)
            solution = advance(increment, contact, solver, timer)
            end = increment.end(solution.w)
            after = end_state(scene, state, increment, solution, end, motions)
            timer.lap("transfer")
            budget = budget_of(scene, state, increment, solution, end, motions)
            timer.lap("report")
            overlap = check_step(scene, scheme, state, after, budget)
            timer.lap("overlap")
    except (NotConverged, np.linalg.LinAlgError, FloatingPointError) as error:
        reason = _overflow(state) if isinstance(error, FloatingPointError) else error
        edge = "" if scheme.inertia else pressed_edge(scene, given.contacts)
        again = scheme.inertia or not dead(scene, given)  # else a smaller dt is the same step
        remedy = str(reason) if again else str(reason).replace(f"; {SMALLER}", f"; {STEPWISE}")
        message = f"the step from t = {given.t:.6g} s with dt = {dt:.3g} s failed: {remedy}{edge}"
        raise StepFailed(message, given, retryable=again and getattr(error, "retryable", True)) from error
    report = report_of(given.report.energy, increment, solution, budget, overlap, regridded=regridded)
    return replace(after, report=replace(report, seconds=dict(timer.seconds)))


def _contact_problem(
    scene: Scene,
    state: State,
    increment: Increment,
    motions: PrescribedVelocities,
    timer: Timer,
    delassus: Delassus | None,
) -> ContactProblem | None:
    """The step's contacts; None, and the contact module untouched, where nothing can touch anything."""
    if not can_touch(scene):
        return None
    scheme, contacts = increment.scheme, state.contacts
    linearise = scheme.contact(scene, state, increment.grid, increment.dt, scheme.theta, motions)
    timer.lap("detection")
    return ContactProblem(
        linearise, increment, contacts.key, contacts.force, timer, supported=scene.supporting >= 0, delassus=delassus
    )


def _overflow(state: State) -> str:
    """Why numbers overflow, as far as the state tells."""
    fastest = int(np.argmax(np.abs(state.v).max(axis=0)))
    return f"body {state.body[fastest]}, the fastest of all: numbers overflow; use a smaller dt or check its velocity"


def check_time(name: str, value: object, lowest: float, what: str) -> None:
    """Raise ValueError unless a value is a time of at least `lowest` [s]."""
    if not (isinstance(value, Real) and lowest <= float(value)):
        raise ValueError(f"{name} = {value!r}; give {what} in seconds")
