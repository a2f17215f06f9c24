"""Step control: a requested step is halved where it fails and doubled again after several successes.

Chosen steps follow `stepping.step_length`.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from skmpm.arrays import ROUND_OFF
from skmpm.scene import Scene, State, StepControl, StepFailed
from skmpm.scheme import Scheme
from skmpm.step.algorithm import step
from skmpm.stepping.step_length import BELOW, MAX_CHANGE, SLACK, TWICE, Pace, next_length

MAX_HALVINGS = 10  # so that the shortest step is a thousandth of a full one
PARTS = 2**MAX_HALVINGS  # of a full step: step lengths are multiples of a part, unless shortened to end at `until`
SUCCESSES_BEFORE_DOUBLING = 4  # steps
# Of a step: rather than with less of one a run ends with two equal ones. Round-off of gaps over a short step is a
# large velocity: 5e-12 s after 150 steps of 2 ms took the kinetic energy of a packing from 816 to 3644 J/m.
SLIVER = 1e-3
# Divides the length of a chosen step that failed: slow lids on fifty discs take the fewest steps so, of 4, 16 and 64.
CUT = 16.0
FREQUENT = 0.1  # of the steps: failures from which a run with chosen steps ends with a warning
SHORTEST_SHARE = CUT**-3  # of the limit: shortest chosen step

# Remedies in place of a smaller dt, where all of them have failed.
AT_ITS_LIMIT = 'look at the last state, and try what skmpm.explain("failures") says of its picture'
NO_EQUILIBRIUM = "there may be no equilibrium near, as beyond a limit load: use inertia, friction or a Support"

_log = logging.getLogger("skmpm")


@dataclass(frozen=True)
class RetrySummary:
    """The retries of a run, for the message at its end."""

    steps: int = 0  # successful
    failures: int = 0
    shortest: float = float("inf")  # that succeeded after failures [s]
    at: float = 0.0  # [s] time at which the shortest step began
    last: str = ""  # message of the last failure

    def after(self, state: State, failures: Sequence[StepFailed]) -> RetrySummary:
        """The summary with one more step, which reached `state` after some failures."""
        summary = replace(self, steps=self.steps + 1, failures=self.failures + len(failures))
        if failures and state.report.dt < self.shortest:
            summary = replace(summary, shortest=state.report.dt, at=state.t - state.report.dt)
        return replace(summary, last=str(failures[-1])) if failures else summary

    def given_up(self, failure: StepFailed) -> RetrySummary:
        """The summary of a run that ends with a step that failed for good."""
        return replace(self, failures=self.failures + failure.retries, last=str(failure))

    @property
    def frequent(self) -> bool:
        """Whether so many steps failed that their length is to be looked at; some do wherever steps are chosen."""
        return self.failures > FREQUENT * self.steps

    def __str__(self) -> str:
        return (
            f"{self.failures} steps failed and were repeated with shorter ones, {self.steps} succeeded"
            + (
                f"; the shortest was {self.shortest:.3g} s at t = {self.at:.6g} s"
                if self.shortest < float("inf")
                else ""
            )
            + f"; the last failure: {self.last}"
        )


def with_step(state: State, dt: float) -> State:
    """The state with its step control if that belongs to this dt [s], else with one that starts at full steps.

    dt is zero if steps are chosen.
    """
    control = state.step_control
    goes_on = control.dt == dt and max(dt, control.chosen) > 0.0 and control.began <= state.t
    return state if goes_on else replace(state, step_control=StepControl(dt=dt, began=state.t))


def advance_with_retries(scene: Scene, state: State, until: float, scheme: Scheme) -> tuple[State, list[StepFailed]]:
    """One step of the current length, at most to `until` [s], repeated with half the length while it fails.

    Also returns the failures. The length is doubled only at times that are multiples of the longer step, so that full
    steps begin at the same times as without failures.

    Raises
    ------
    StepFailed
        if the shortest step fails, or a shorter one would not help; its `state` is the argument `state`
    """
    start, failures = state, list[StepFailed]()
    while True:
        dt, ends = _length(state, until)
        try:
            after = step(scene, state, dt, scheme=scheme)
        except StepFailed as failure:
            if not failure.retryable or state.step_control.halvings == MAX_HALVINGS:
                raise _given_up(failure, start, scheme, len(failures)) from failure
            if not failures:
                _check_equilibrium(scene, start, min(dt, start.step_control.dt / PARTS), scheme)
            state = replace(state, step_control=_halved(state.step_control, dt))
            failures.append(failure)
            _log.info("%s; retrying with dt = %.3g s", failure, _length(state, until)[0])
            continue
        report = replace(after.report, retries=len(failures))
        shortened = dt < (1.0 - ROUND_OFF) * _step_of(state.step_control)
        control, t = _after_success(state.step_control, shortened), float(until) if ends else _on_grid(after)
        return replace(after, t=t, report=report, step_control=control), failures


def advance_with_chosen_step(
    scene: Scene, state: State, until: float, scheme: Scheme, pace: Pace
) -> tuple[State, list[StepFailed]]:
    """One step of a chosen length, at most to `until` [s], repeated with a sixteenth of the length while it fails.

    Also returns the failures.

    Raises
    ------
    StepFailed
        if the shortest step fails, or a shorter one would not help; its `state` is the argument `state`
    """
    failures, left = list[StepFailed](), until - state.t
    chosen = state.step_control.chosen
    limit = pace.limit(scene, state, left)
    length = wanted = min(limit, chosen or limit)
    if length < left < 2.0 * length:  # the last two are equal: forces on what accelerates depend on their ratio
        length = 0.5 * left
    halved = length
    while True:
        try:
            after = step(scene, state, length, scheme=scheme)
            by_loss, by_motion = (f(scene, state, after) for f in (pace.by_loss, pace.by_motion))
            accepted = min(TWICE * by_loss, (1.0 + SLACK) * by_motion)
            if length > accepted:  # an impact begins, or what contacts held moves
                limit = min(by_loss, BELOW * by_motion)
                length = max(limit, length / CUT)
                continue
        except StepFailed as failure:
            if not failure.retryable or length <= SHORTEST_SHARE * limit:
                raise _given_up(failure, state, scheme, len(failures)) from failure
            if not failures:
                _check_equilibrium(scene, state, SHORTEST_SHARE * limit, scheme)
            length /= CUT
            failures.append(failure)
            _log.info("%s; retrying with dt = %.3g s", failure, length)
            continue
        report = replace(after.report, retries=len(failures))
        # A step that `until` shortens says nothing about the length of the next one.
        by_end = length == left < chosen or length == halved < wanted
        chosen = (chosen or wanted) if by_end else next_length(length, report.newton / report.solves)
        # What accelerates is faster in the next step, by as much again.
        growth = by_motion / max(pace.by_motion(scene, state, state), 1e-300)
        chosen = min(chosen, BELOW * by_loss, by_motion * float(np.clip(growth, 1.0 / MAX_CHANGE, 1.0)))
        t = float(until) if left - length <= ROUND_OFF * length else after.t
        return replace(after, t=t, report=report, step_control=replace(state.step_control, chosen=chosen)), failures


def _on_grid(state: State) -> float:
    """The time of a state [s], as a whole number of parts of the requested step if it is one.

    Round-off of sums would add up: after 100,000 steps of 0.1 ms the last one would be divided in two.
    """
    dt, began = state.step_control.dt, state.step_control.began
    count = (state.t - began) / dt * PARTS
    return began + round(count) / PARTS * dt if abs(count - round(count)) <= ROUND_OFF * PARTS else state.t


def _check_equilibrium(scene: Scene, state: State, dt: float, scheme: Scheme) -> None:
    """Raise StepFailed where a static step of the shortest length fails, too: nothing between may be in equilibrium.

    Its result is not kept. Without it, bodies that nothing holds fall in one step after the other.
    """
    if scheme.inertia:
        return
    try:
        step(scene, state, dt, scheme=scheme)
    except StepFailed as failure:
        raise _given_up(failure, state, scheme, 1) from failure


def _step_of(step_control: StepControl) -> float:
    return float(step_control.dt / 2**step_control.halvings)


def _length(state: State, until: float) -> tuple[float, bool]:
    """Length of the next step [s], and whether it ends at `until`."""
    dt, left = _step_of(state.step_control), until - state.t
    if (1.0 + ROUND_OFF) * dt < left < (1.0 + SLIVER) * dt:
        return 0.5 * left, False
    return (left if left < (1.0 - ROUND_OFF) * dt else dt), left <= (1.0 + ROUND_OFF) * dt


def _halved(step_control: StepControl, failed: float) -> StepControl:
    """The step control after a failed step of length `failed` [s]: at most half of that."""
    halvings = step_control.halvings + 1
    while halvings < MAX_HALVINGS and step_control.dt / 2**halvings > 0.5 * (1.0 + ROUND_OFF) * failed:
        halvings += 1
    return replace(step_control, halvings=halvings, successes=0)


def _after_success(step_control: StepControl, shortened: bool) -> StepControl:
    """The step control after a success: doubled after `SUCCESSES_BEFORE_DOUBLING`, at multiples of that length.

    After a step that was shortened to end at `until`, full steps are counted from there.
    """
    part = 0 if shortened else (step_control.part + PARTS // 2**step_control.halvings) % PARTS
    successes = min(step_control.successes + 1, SUCCESSES_BEFORE_DOUBLING) if step_control.halvings else 0
    if successes < SUCCESSES_BEFORE_DOUBLING or part % (2 * PARTS // 2**step_control.halvings):
        return replace(step_control, successes=successes, part=part)
    return replace(step_control, halvings=step_control.halvings - 1, successes=0, part=part)


def _given_up(failure: StepFailed, state: State, scheme: Scheme, retries: int) -> StepFailed:
    """The error after the last retry, with the last state that was reached."""
    if not failure.retryable:
        return StepFailed(failure.problem, state, remedy=failure.remedy, retryable=False, retries=retries)
    remedy = failure.remedy or (AT_ITS_LIMIT if scheme.inertia else NO_EQUILIBRIUM)
    several = f"after {retries} {'retry' if retries == 1 else 'retries'} with ever smaller dt"
    tried = f"given up {several if retries else 'with the shortest dt'}"
    return StepFailed(failure.problem, state, remedy=remedy, retries=retries, tried=tried)
