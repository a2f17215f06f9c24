"""The algorithm on one screen, and the loop around it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

from skmpm.implicit import Increment, NotConverged, Timer, Touching, advance
from skmpm.io import save
from skmpm.progress import Progress
from skmpm.scene import Scene, State, StepFailed
from skmpm.scheme import Scheme
from skmpm.simulate.anchor import anchored, assembly_of, bulk_of, gravity_at
from skmpm.simulate.report import report_of
from skmpm.simulate.start import can_touch, initial
from skmpm.simulate.update import kept_solver, moved
from skmpm.transfer import to_nodes

CHECKPOINT_EVERY = 30.0  # [s]


def step(scene: Scene, state: State, dt: float, *, scheme: Scheme = Scheme()) -> State:  # noqa: B008
    """Advance `state` by `dt` [s]; pure: nothing is changed, nothing is kept.

    Raises
    ------
    StepFailed
        when the step's equations are not solved; its `state` is the one given here
    """
    if not (np.isfinite(dt) and dt > 0.0):
        raise ValueError(f"step: dt = {dt}; give a time step in seconds, greater than zero")
    timer = Timer()
    state = anchored(scene, state, scheme)
    own = scene.deformable[state.body]
    v0 = to_nodes(assembly_of(state), state.mass[own], state.v[:, own], state.C[:, :, own])
    free = v0 + scheme.theta * dt * gravity_at(scene, state, state.t + scheme.theta * dt)
    increment = Increment(bulk_of(scene, state), state.displacement, v0, free, dt, scheme)
    timer.lap("transfer")
    try:
        touching = _touching(scene, state, increment, timer)
        solution = advance(increment, touching, kept_solver(state, increment), timer)
    except NotConverged as error:
        message = f"the step from t = {state.t:.6g} s with dt = {dt:.3g} s failed: {error}"
        raise StepFailed(message, state) from error
    after = moved(scene, state, increment, solution)
    timer.lap("transfer")
    return replace(after, report=report_of(scene, state, after, increment, solution, timer))


def _touching(scene: Scene, state: State, increment: Increment, timer: Timer) -> Touching | None:
    """The step's contacts; None, and the contact module untouched, where nothing can touch anything."""
    if not can_touch(scene):
        return None
    linearise = increment.scheme.contact(scene, state, increment.bulk.assembly.sheets, increment.dt)
    timer.lap("detection")
    return Touching(linearise, increment, state.contacts.key, state.contacts.force, timer)


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
    """
    state = initial(scene, scheme=scheme) if start is None else start
    saved = perf_counter()
    with Progress(state.t, until, shown=progress) as bar:
        while state.t < until * (1.0 - 1e-12):
            try:
                state = step(scene, state, min(dt, until - state.t), scheme=scheme)
            except StepFailed as failure:
                if checkpoint is not None:
                    save(checkpoint, failure.state)
                raise
            if checkpoint is not None and perf_counter() - saved > CHECKPOINT_EVERY:
                save(checkpoint, state)
                saved = perf_counter()
            bar.show(state)
            yield state
    if checkpoint is not None:
        save(checkpoint, state)
