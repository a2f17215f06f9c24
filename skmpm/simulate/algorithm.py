"""The algorithm on one screen, and the loop around it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from numbers import Real
from pathlib import Path
from time import perf_counter

import numpy as np

from skmpm.implicit import Increment, NotConverged, Timer, Touching, advance
from skmpm.io import save
from skmpm.linear import one_thread
from skmpm.progress import Progress
from skmpm.scene import Scene, State, StepFailed
from skmpm.scheme import Scheme
from skmpm.simulate.anchor import anchored, assembly_of, bulk_of, derived_of
from skmpm.simulate.forces import external_force, told
from skmpm.simulate.report import report_of
from skmpm.simulate.start import can_touch, initial
from skmpm.simulate.update import kept_solver, moved
from skmpm.transfer import to_nodes

CHECKPOINT_EVERY = 30.0  # [s]
SHORTEST = 1e-100  # [s]; shorter steps divide by zero
ROUNDING = 1e-9  # share of a step by which the sum of many may miss `until`


def step(scene: Scene, state: State, dt: float, *, scheme: Scheme = Scheme()) -> State:  # noqa: B008
    """Advance `state` by `dt` [s]; pure: nothing is changed, nothing is kept.

    Raises
    ------
    StepFailed
        when the step's equations are not solved; its `state` is the one given here
    ValueError
        when dt is not a time; SceneError when a prescribed velocity, load or gravity is not finite
    """
    _check_time("step: dt", dt, SHORTEST, "a time step greater than zero")
    timer, given = Timer(), state
    state = anchored(scene, given, scheme)
    own = scene.deformable[state.body]
    v0 = to_nodes(assembly_of(state), state.mass[own], state.v[:, own], state.C[:, :, own])
    force, moved_as = external_force(scene, state, state.t + scheme.theta * dt), told(scene, state.t + 0.5 * dt)
    bulk, supports = bulk_of(scene, state, locking=scheme.locking), derived_of(state).supports
    increment = Increment(bulk, state.displacement, v0, force, dt, scheme, supports, moved_as)
    timer.lap("transfer")
    try:
        with one_thread():
            touching = _touching(scene, state, increment, timer)
            solution = advance(increment, touching, kept_solver(scene, state, increment), timer)
    except (NotConverged, np.linalg.LinAlgError) as error:
        message = f"the step from t = {state.t:.6g} s with dt = {dt:.3g} s failed: {error}"
        raise StepFailed(message, given) from error
    after = moved(scene, state, increment, solution)
    timer.lap("transfer")
    return replace(after, report=report_of(scene, state, after, increment, solution, timer))


def _touching(scene: Scene, state: State, increment: Increment, timer: Timer) -> Touching | None:
    """The step's contacts; None, and the contact module untouched, where nothing can touch anything."""
    if not can_touch(scene):
        return None
    linearise = increment.scheme.contact(
        scene, state, increment.bulk.assembly.sheets, increment.dt, increment.scheme.theta
    )
    timer.lap("detection")
    return Touching(linearise, increment, state.contacts.key, state.contacts.force, timer)


def _check_time(name: str, value: object, lowest: float, what: str) -> None:
    if not (isinstance(value, Real) and lowest <= float(value)):
        raise ValueError(f"{name} = {value!r}; give {what} in seconds")


def simulate(
    scene: Scene,
    *,
    dt: float,
    until: float,
    scheme: Scheme = Scheme(),  # noqa: B008
    start: State | None = None,
    progress: bool = False,
    checkpoint: str | Path | None = None,
) -> Iterator[State]:
    """Yield the state after every step until `t >= until` [s]; the last step is shortened to end there.

    `start` continues from a state; `progress` shows step, time, ETA and residual on a terminal; `checkpoint` is a
    file that keeps the last state, written every half minute, at the end and before a failure is raised.

    Raises
    ------
    StepFailed
        when a step's equations are not solved; its `state` is the last good one
    ValueError
        when dt or until is not a time
    """
    _check_time("simulate: dt", dt, SHORTEST, "a time step greater than zero")
    _check_time("simulate: until", until, 0.0, "the time to stop at")
    state = initial(scene, scheme=scheme) if start is None else start
    saved = perf_counter()
    with Progress(state.t, until, shown=progress) as bar:
        while until - state.t > ROUNDING * dt:
            left = until - state.t
            last = left <= (1.0 + ROUNDING) * dt
            try:
                state = step(scene, state, left if left < (1.0 - ROUNDING) * dt else dt, scheme=scheme)
            except StepFailed as failure:
                if checkpoint is not None:
                    save(checkpoint, failure.state)
                raise
            if last:
                state = replace(state, t=float(until))
            if checkpoint is not None and perf_counter() - saved > CHECKPOINT_EVERY:
                save(checkpoint, state)
                saved = perf_counter()
            bar.show(state)
            yield state
    if checkpoint is not None:
        save(checkpoint, state)
