"""The loop around the step: paces it, saves what it found, and gives up with a reason."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from time import perf_counter

from skmpm.implicit import NotConverged
from skmpm.io import save, writable
from skmpm.progress import Progress
from skmpm.scene import Scene, SceneError, State, check_fits
from skmpm.scheme import Scheme
from skmpm.simulate.algorithm import SHORTEST, check_time
from skmpm.simulate.anchor import check_whole
from skmpm.simulate.pace import ROUNDING, advanced, asked
from skmpm.simulate.start import check_scheme, initial

CHECKPOINT_EVERY = 30.0  # [s]


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

    A step that fails is tried again with half the length, down to dt / 1024; after four good steps it is doubled,
    where steps of that length would have begun. What is yielded then lies between the times asked for:
    `state.report.dt` and `.retries` say so, and the logger "skmpm" warns with the reason.

    `start` continues from a state; `progress` shows step, time, ETA, residual and retries on a terminal; `checkpoint`
    is a file that keeps the last state, written every half minute and when the run ends: at `until`, by an error, or
    because the caller's loop does.

    Raises
    ------
    StepFailed
        when the shortest step's equations are not solved; its `state` is the last good one
    SceneError
        when `start` is no state of this scene, a velocity, load or gravity is not finite
    ValueError
        when dt or until is not a time, the scheme no Scheme
    FileNotFoundError, IsADirectoryError
        when there is no directory for the checkpoint, or it is one
    """
    check_scheme("simulate", scheme)
    check_time("simulate: dt", dt, SHORTEST, "a time step greater than zero")
    check_time("simulate: until", until, 0.0, "the time to stop at")
    if start is not None:
        check_fits(scene, start, "start")
    first = asked(_first(scene, scheme) if start is None else start, float(dt))
    return _run(scene, first, until, scheme, progress, None if checkpoint is None else writable(checkpoint))


def _first(scene: Scene, scheme: Scheme) -> State:
    """The initial state, of bodies that are whole."""
    state = initial(scene, scheme=scheme)
    try:
        check_whole(scene, state)
    except NotConverged as error:
        raise SceneError(str(error)) from error
    return state


def _run(
    scene: Scene, state: State, until: float, scheme: Scheme, progress: bool, checkpoint: Path | None
) -> Iterator[State]:
    """The loop of `simulate`."""
    saved = perf_counter()
    try:
        with Progress(state.t, until, shown=progress) as bar:
            while until - state.t > ROUNDING * state.pace.dt:
                state = advanced(scene, state, until, scheme)
                if checkpoint is not None and perf_counter() - saved > CHECKPOINT_EVERY:
                    save(checkpoint, state)
                    saved = perf_counter()
                bar.show(state)
                yield state
    finally:
        if checkpoint is not None:
            save(checkpoint, state)
