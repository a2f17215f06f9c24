"""The time loop: step control, checkpoints, progress, and the error that ends a run."""

from __future__ import annotations

import logging
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import current_thread, main_thread
from time import perf_counter
from types import FrameType
from typing import Any

import numpy as np

from skmpm.arrays import ROUND_OFF
from skmpm.io import save, writable
from skmpm.preflight import preflight
from skmpm.preflight.explain import about
from skmpm.progress import SLOW, Progress
from skmpm.scene import (
    Scene,
    SceneError,
    State,
    StepFailed,
    at_rest,
    check_fits,
    check_initial_positions,
    check_scene,
    normal_speeds,
)
from skmpm.scheme import Scheme
from skmpm.step.algorithm import SHORTEST, check_time
from skmpm.step.errors import StepRejected
from skmpm.step.initial_state import check_scheme, initial
from skmpm.step.regrid import check_connected
from skmpm.stepping.functions_of_time import TIMES
from skmpm.stepping.step_control import RetrySummary, advance_with_chosen_step, advance_with_retries, with_step
from skmpm.stepping.step_length import Pace, pace_of
from skmpm.stepping.watches import first_warnings, watches_of

CHECKPOINT_EVERY = 30.0  # [s] of wall time

_log = logging.getLogger("skmpm")


def simulate(
    scene: Scene,
    *,
    until: float,
    dt: float | None = None,
    max_dt: float | None = None,
    waves: bool | None = None,
    scheme: Scheme = Scheme(),  # noqa: B008
    start: State | None = None,
    progress: bool = False,
    checkpoint: str | Path | None = None,
    warn: bool = True,
) -> Iterator[State]:
    """Advance a scene step by step; the last steps are shortened to end at `until`.

    Parameters
    ----------
    scene : the scene
    until : time at which the run ends [s]
    dt : length of the steps [s]; None: steps are chosen
    max_dt : largest length of a chosen step [s]
    waves : True: all chosen steps resolve waves, which travel a tenth of the radius of the smallest body in each;
        False: losses of energy do not limit steps; None: they do, unless six or more bodies are driven or fall
    scheme : how steps are solved
    start : state of this scene to continue from; None: the initial one. The scene may have other velocities of walls
        and supports, loads, springs, friction, gravity and moduli than before. Bodies and walls are where the state
        has them, also where the scene's `Wall.point` is another: a wall goes on from there
    progress : show step, time, ETA, solid fraction or stroke, and retries on a terminal or in a notebook
    checkpoint : file for the last state, written every half minute and when the run ends: at `until`, by an error,
        when the caller leaves the loop, or by SIGTERM (unless the caller handles that signal)
    warn : log the warnings of `preflight` at the beginning, not where a run goes on from a state; that takes as long
        as a step or two

    Yields
    ------
    the state after every step, until `t >= until`

    Raises
    ------
    StepFailed
        if the shortest step fails; its `state` is the last one that was yielded
    SceneError
        if steps cannot be chosen, if a velocity, load or gravity is not finite, or if `start` belongs to another
        scene: if numbers of points, walls, supports or grid nodes, the body or mass of a point, rigid bodies, or the
        normal or order of walls differ, or (unless `scheme.anchor` is finite) the positions of points at t = 0
    ValueError
        if dt or max_dt is not positive, if max_dt or waves is given beside dt, if waves is True without inertia, if
        until is negative, not finite or before the time of `start`, or if scheme is not a Scheme
    FileNotFoundError, IsADirectoryError
        if the directory of the checkpoint does not exist, or the checkpoint is a directory

    Notes
    -----
    Without dt, steps are chosen (`stepping.step_length`). In a step driven objects move by at most 0.14 cells, and
    bodies by 0.2 cells past each other, or more where something is driven. A step loses at most 1e-5 of the largest
    energy so far, unless six or more bodies are driven or fall, or it resolves waves: impacts may lose much in many
    such steps, and little with theta = 1/2. Steps are shorter while Newton's method takes many iterations, and a
    sixteenth as long after a failure. Quasi-static steps under loads that are functions of time need dt.

    With dt, a step that fails is repeated with half the length, down to dt / 1024; after four successful steps the
    length is doubled again, at times that are multiples of the longer step. States at multiples of dt are always
    yielded, with others between them after a failure. `state.report.dt` and `.retries` hold the length of the step
    and its failures. The logger "skmpm" reports every retry at level INFO, and their number at the end of the run,
    with a warning unless steps are chosen and fewer than a tenth failed.

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> for state in skmpm.simulate(scene, dt=1e-3, until=3e-3):
    ...     print(round(state.t, 4), round(float(state.v[1].mean()), 5))
    0.001 -0.00981
    0.002 -0.01962
    0.003 -0.02943
    """
    check_scene("simulate", scene)
    check_scheme("simulate", scheme)
    if dt is not None:
        check_time("simulate: dt", dt, SHORTEST, "None for chosen steps, or a time step greater than zero")
    for name, value in (("max_dt", max_dt), ("waves", waves)):
        if dt is not None and value is not None:
            raise ValueError(f"simulate: {name} = {value!r} beside dt = {dt:g} s; it is for chosen steps, without dt")
    if max_dt is not None:
        check_time("simulate: max_dt", max_dt, SHORTEST, "None, or the longest step to choose")
    if waves not in (None, True, False) or (waves and not scheme.inertia):
        raise ValueError(f"simulate: waves = {waves!r}; give None, True (with inertia only) or False")
    check_time("simulate: until", until, 0.0, "the time to stop at")
    path = None if checkpoint is None else writable(checkpoint)
    if start is not None:
        check_fits(scene, start, "start")
        if np.isinf(scheme.anchor):  # else the body grids may have been built again where the bodies were
            check_initial_positions(scene, start, "start")
        if until < start.t * (1.0 - ROUND_OFF):
            raise ValueError(
                f"simulate: until = {float(until):g} s lies before start, at t = {start.t:g} s; it is a time, not a"
                " duration: add start.t"
            )
        if scheme.inertia and (warning := _velocities_of_statics(scene, start)):
            _log.warning("%s", warning)
    first = with_step(_first(scene, scheme) if start is None else start, 0.0 if dt is None else float(dt))
    if warn and first.report.dt == 0.0:
        found = preflight(scene, dt, scheme=scheme, until=until or None).warnings
        for each in (*found, *about(found)):
            _log.warning("preflight: %s", each)
    began = first.step_control.began
    pace = pace_of(scene, scheme, began, until, max_dt=max_dt, waves=waves) if dt is None else None
    return _run(scene, first, until, scheme, pace, progress, path)


def run(scene: Scene, *, until: float, start: State | None = None, **options: Any) -> State:
    """Last state of a simulation, for which the states between do not matter.

    Parameters
    ----------
    scene, until, start : as for `simulate`
    options : all others of `simulate`: dt, max_dt, waves, scheme, progress, checkpoint, warn

    Returns
    -------
    the state at `until`; that of `start`, or the first, if no step leads there

    Raises
    ------
    StepFailed, SceneError, ValueError
        as `simulate`

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> round(float(skmpm.run(scene, until=3e-3, dt=1e-3).v[1].mean()), 5)
    -0.02943
    """
    state = start
    for state in simulate(scene, until=until, start=start, **options):  # noqa: B007
        pass
    return initial(scene, scheme=options.get("scheme", Scheme())) if state is None else state


def _velocities_of_statics(scene: Scene, state: State) -> str | None:
    """The warning of velocities that a quasi-static step left, where they are no slow motion."""
    if state.report.inertia:
        return None
    still, elastic = at_rest(scene, state), state.report.energy.elastic
    relative, of_walls = state.v - still.v, normal_speeds(scene, state.wall_velocity - still.wall_velocity)
    kinetic = 0.5 * float(state.mass @ (relative**2).sum(axis=0) + scene.wall_masses @ of_walls**2)
    if kinetic <= SLOW * elastic:
        return None
    fastest = max(np.hypot(*relative).max(), np.abs(of_walls).max(initial=0.0))
    return (
        "simulate: start is the state of a quasi-static step, whose velocities are displacements over its length, up"
        f" to {fastest:.3g} m/s; they have inertia from here"
        f" on: {kinetic / max(elastic, 1e-300):.2g} times the elastic energy. For a start from rest give"
        " start = skmpm.at_rest(scene, state)"
    )


def _first(scene: Scene, scheme: Scheme) -> State:
    """The initial state; SceneError if a body is not connected."""
    state = initial(scene, scheme=scheme)
    try:
        check_connected(scene, state)
    except StepRejected as error:
        raise SceneError(f"{error}; {error.remedy}") from error
    return state


def _run(
    scene: Scene,
    state: State,
    until: float,
    scheme: Scheme,
    pace: Pace | None,
    progress: bool,
    checkpoint: Path | None,
) -> Iterator[State]:
    """The loop of `simulate`."""
    saved, retried = perf_counter(), RetrySummary()
    times = None if pace is None else np.linspace(state.step_control.began, until, TIMES)
    watches = list(watches_of(scene, scheme, state, times))
    try:
        with Progress(scene, state, until, shown=progress) as bar, exit_at_sigterm(wanted=checkpoint is not None):
            while until - state.t > ROUND_OFF * _usual_step(state):
                if pace is None:
                    state, failures = advance_with_retries(scene, state, until, scheme)
                else:
                    state, failures = advance_with_chosen_step(scene, state, until, scheme, pace)
                retried = retried.after(state, failures)
                for warning in first_warnings(watches, state):
                    _log.warning("%s", warning)
                if checkpoint is not None and perf_counter() - saved > CHECKPOINT_EVERY:
                    save(checkpoint, state)
                    saved = perf_counter()
                bar.show_state(state)
                yield state
    except StepFailed as failure:
        retried = retried.given_up(failure)
        raise
    finally:
        if checkpoint is not None:
            save(checkpoint, state)
        if retried.failures:
            notable = pace is None or retried.frequent
            _log.log(logging.WARNING if notable else logging.INFO, "%s", retried)


def _usual_step(state: State) -> float:
    """The length of steps at a state [s], given or chosen; before the first step zero where it will be chosen."""
    return float(max(state.step_control.dt, state.step_control.chosen, state.report.dt))


@contextmanager
def exit_at_sigterm(*, wanted: bool) -> Iterator[None]:
    """Raise SystemExit at SIGTERM, which batch systems send before they kill, unless the caller handles it."""
    ours = signal.getsignal(signal.SIGTERM) in (signal.SIG_DFL, _exit)
    if not (wanted and current_thread() is main_thread() and ours):
        yield
        return
    run = object()
    _RUNS.append(run)
    signal.signal(signal.SIGTERM, _exit)
    try:
        yield
    finally:
        _RUNS.remove(run)
        last = not _RUNS and signal.getsignal(signal.SIGTERM) is _exit
        if last and current_thread() is main_thread():
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


_RUNS = list[object]()  # that end at SIGTERM


def _exit(number: int, frame: FrameType | None) -> None:
    raise SystemExit(128 + number)
