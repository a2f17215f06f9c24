"""How long steps are: as asked, halved where they fail, and doubled again once they go well."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace

from skmpm.scene import Scene, State, StepControl, StepFailed
from skmpm.scheme import Scheme
from skmpm.simulate.algorithm import step

MAX_HALVINGS = 10  # at most: the shortest step is a thousandth of the one asked for
PARTS = 2**MAX_HALVINGS  # of a full step: what a step of any length is a multiple of
SUCCESSES_BEFORE_DOUBLING = 4  # good steps before the next may be twice as long
TIME_TOLERANCE = 1e-9  # share of a step by which the sum of many may miss `until`

_log = logging.getLogger("skmpm")


@dataclass(frozen=True)
class RetrySummary:
    """The retries of a run, for one summary at its end."""

    steps: int = 0
    failures: int = 0
    shortest: float = float("inf")  # [s]
    at: float = 0.0  # [s] where the shortest step began
    last: str = ""  # why the last one failed

    def after(self, state: State, failures: Sequence[StepFailed]) -> RetrySummary:
        """With one more step, which led to `state` after some failures."""
        kept = replace(self, steps=self.steps + 1, failures=self.failures + len(failures))
        if not failures:
            return kept
        if state.report.dt < self.shortest:
            kept = replace(kept, shortest=state.report.dt, at=state.t - state.report.dt)
        return replace(kept, last=str(failures[-1]))

    def __str__(self) -> str:
        return (
            f"{self.failures} steps failed and were repeated with half the length, {self.steps} succeeded; the"
            f" shortest was {self.shortest:.3g} s at t = {self.at:.6g} s; the last failure: {self.last}"
        )


def with_step(state: State, dt: float) -> State:
    """The state with the pace it was saved with if that was made for this dt [s], else with full steps."""
    return state if state.step_control.dt == dt else replace(state, step_control=StepControl(dt=dt))


def advanced(scene: Scene, state: State, until: float, scheme: Scheme) -> tuple[State, list[StepFailed]]:
    """One step of the length that the pace allows, at most to `until` [s]; what fails is tried with half the length.

    Also returns the failures on the way. Full steps begin where they would without failures: a step grows only where
    a longer one would have begun.

    Raises
    ------
    StepFailed
        when the shortest step fails too, or where a shorter one does not help; its `state` is the one given here
    """
    given, failures = state, list[StepFailed]()
    while True:
        dt, ends = _length(state, until)
        try:
            after = step(scene, state, dt, scheme=scheme)
        except StepFailed as failure:
            if not failure.retryable or state.step_control.halvings == MAX_HALVINGS:
                raise _given_up(failure, given, len(failures)) from failure
            state = replace(state, step_control=_halved(state.step_control, dt))
            failures.append(failure)
            _log.info("%s; trying dt = %.3g s", failure, _length(state, until)[0])
            continue
        report, shortened = (
            replace(after.report, retries=len(failures)),
            dt < (1.0 - TIME_TOLERANCE) * _step_of(state.step_control),
        )
        t = float(until) if ends else after.t
        return replace(after, t=t, report=report, step_control=_went_well(state.step_control, shortened)), failures


def _step_of(step_control: StepControl) -> float:
    return float(step_control.dt / 2**step_control.halvings)


def _length(state: State, until: float) -> tuple[float, bool]:
    """Length of the next step [s], and whether it ends at `until`."""
    dt, left = _step_of(state.step_control), until - state.t
    return (left if left < (1.0 - TIME_TOLERANCE) * dt else dt), left <= (1.0 + TIME_TOLERANCE) * dt


def _halved(step_control: StepControl, failed: float) -> StepControl:
    """The pace after a step of length `failed` [s]: at most half of that."""
    halvings = step_control.halvings + 1
    while halvings < MAX_HALVINGS and step_control.dt / 2**halvings > 0.5 * (1.0 + TIME_TOLERANCE) * failed:
        halvings += 1
    return replace(step_control, halvings=halvings, successes=0)


def _went_well(step_control: StepControl, shortened: bool) -> StepControl:
    """The pace after a good step: longer after `CALM` of them, where a step twice as long would begin.

    After a step that was shortened to end at `until`, full steps begin anew.
    """
    part = 0 if shortened else (step_control.part + PARTS // 2**step_control.halvings) % PARTS
    successes = min(step_control.successes + 1, SUCCESSES_BEFORE_DOUBLING) if step_control.halvings else 0
    if successes < SUCCESSES_BEFORE_DOUBLING or part % (2 * PARTS // 2**step_control.halvings):
        return replace(step_control, successes=successes, part=part)
    return replace(step_control, halvings=step_control.halvings - 1, successes=0, part=part)


def _given_up(failure: StepFailed, state: State, retries: int) -> StepFailed:
    """The failure after the last retry, with the state that the run stands at."""
    tried = f"; given up after {retries} retries with ever smaller dt" if retries else ""
    return StepFailed(f"{failure}{tried}", state, retryable=failure.retryable)
