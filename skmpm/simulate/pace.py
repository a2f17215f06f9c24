"""How long steps are: as asked, halved where they fail, and doubled again once they go well."""

from __future__ import annotations

import logging
from dataclasses import replace

from skmpm.scene import Pace, Scene, State, StepFailed
from skmpm.scheme import Scheme
from skmpm.simulate.algorithm import step

HALVINGS = 10  # at most: the shortest step is a thousandth of the one asked for
CALM = 4  # good steps before the next is twice as long; even, so that full steps begin where they would have
ROUNDING = 1e-9  # share of a step by which the sum of many may miss `until`

_log = logging.getLogger("skmpm")


def asked(state: State, dt: float) -> State:
    """The state with the pace it was saved with if that was made for this dt [s], else with full steps."""
    return state if state.pace.dt == dt else replace(state, pace=Pace(dt=dt))


def advanced(scene: Scene, state: State, until: float, scheme: Scheme) -> State:
    """One step of the length that the pace allows, at most to `until` [s]; what fails is tried with half the length.

    Full steps begin where they would without failures: halves go on until they fill one.

    Raises
    ------
    StepFailed
        when the shortest step fails too, or where a shorter one does not help; its `state` is the one given here
    """
    given, retries = state, 0
    while True:
        dt, ends = _length(state, until)
        try:
            after = step(scene, state, dt, scheme=scheme)
        except StepFailed as failure:
            if not failure.curable or state.pace.halvings == HALVINGS:
                raise _given_up(failure, given, retries) from failure
            state, retries = replace(state, pace=_halved(state.pace, dt)), retries + 1
            _log.warning("%s; trying dt = %.3g s", failure, _length(state, until)[0])
            continue
        t = float(until) if ends else after.t
        return replace(after, t=t, report=replace(after.report, retries=retries), pace=_went_well(state.pace))


def _step_of(pace: Pace) -> float:
    return float(pace.dt / 2**pace.halvings)


def _length(state: State, until: float) -> tuple[float, bool]:
    """Length of the next step [s], and whether it ends at `until`."""
    dt, left = _step_of(state.pace), until - state.t
    return (left if left < (1.0 - ROUNDING) * dt else dt), left <= (1.0 + ROUNDING) * dt


def _halved(pace: Pace, failed: float) -> Pace:
    """The pace after a step of length `failed` [s]: at most half of that."""
    halvings = pace.halvings + 1
    while halvings < HALVINGS and pace.dt / 2**halvings > 0.5 * (1.0 + ROUNDING) * failed:
        halvings += 1
    return replace(pace, halvings=halvings, calm=0)


def _went_well(pace: Pace) -> Pace:
    """The pace after a good step: longer after `CALM` of them, which fill two or more of the longer ones."""
    if pace.halvings == 0:
        return pace
    if pace.calm + 1 < CALM:
        return replace(pace, calm=pace.calm + 1)
    return replace(pace, halvings=pace.halvings - 1, calm=0)


def _given_up(failure: StepFailed, state: State, retries: int) -> StepFailed:
    """The failure after the last retry, with the state that the run stands at."""
    tried = f"; given up after {retries} retries with ever smaller dt" if retries else ""
    return StepFailed(f"{failure}{tried}", state, curable=failure.curable)
