"""Step control: retries with half the step, doubling after successes, checkpoints, and the final error."""

import json
import logging
import signal
import subprocess
import sys
from dataclasses import replace
from functools import partial
from importlib import import_module
from itertools import pairwise

import numpy as np
import pytest
from test_simulate import CELL, DT, SOFT, R, free, identical, round_body, squeeze

from skmpm.compiled import compiled
from skmpm.grid.assembly import Assembly
from skmpm.io import load, save
from skmpm.material import NeoHookean
from skmpm.points import Points, disc
from skmpm.preflight import preflight
from skmpm.scene import Body, Load, Scene, SceneError, StepFailed, Wall
from skmpm.scheme import Scheme
from skmpm.simulation import simulate
from skmpm.step.algorithm import step
from skmpm.step.initial_state import initial

STEP_CONTROL = import_module("skmpm.stepping.step_control")
IMPACT = Scene(
    [round_body(velocity=(0, -20.0), material=SOFT)], cell=CELL, walls=[Wall((0, -R - 3e-4), (0, 1), friction=0.5)]
)


def scripted(monkeypatch, fails, **options):
    """Steps that only advance time, and fail where `fails(t, dt)`, with options of the error; the tried (t, dt)."""
    tried = []

    def fake(scene, state, dt, *, scheme):
        tried.append((state.t, dt))
        if fails(state.t, dt):
            raise StepFailed("scripted", state, **options)
        return replace(state, t=state.t + dt, report=replace(state.report, dt=dt, retries=0))

    monkeypatch.setattr(STEP_CONTROL, "step", fake)
    return tried


def ended(scene, until, **options):
    *_, state = simulate(scene, dt=DT, until=until, **options)
    return state


# --- the length of steps


def test_without_failures_every_step_is_a_full_one_and_made_once(monkeypatch):
    tried = scripted(monkeypatch, lambda t, dt: False)
    states = list(simulate(free(), dt=DT, until=6.5 * DT))
    assert tried == [(k * DT, DT) for k in range(6)] + [(6 * DT, 0.5 * DT)]
    assert all(s.report.retries == 0 and s.step_control.halvings == 0 for s in states)


def test_round_off_of_times_does_not_add_up(monkeypatch):
    """After 12,000 steps of 1 ms a table with a row for each had left one out. Some steps fail, and are divided."""
    scripted(monkeypatch, lambda t, dt: 0.01 < t < 0.02 and dt > 4e-4)
    states = list(simulate(free(), dt=1e-3, until=12.0, warn=False))
    full = np.array([state.t for state in states if not state.step_control.part])
    assert full.size == 12_000
    np.testing.assert_array_equal(full, 1e-3 * np.arange(1, 12_001))


def test_a_failed_step_is_halved_until_it_succeeds_and_doubled_at_multiples_of_full_steps(monkeypatch):
    """Steps longer than dt/4 fail before t = 4 dt: then quarters, halves, and full ones that begin at whole dt."""
    tried = scripted(monkeypatch, lambda t, dt: t < 4 * DT and dt > DT / 4)
    states = list(simulate(free(), dt=DT, until=12 * DT))
    times = [s.t / DT for s in states]
    assert times == sorted(times)
    assert set(range(1, 13)) <= set(times)  # what was asked for is among them
    assert [s.report.dt / DT for s in states[-4:]] == [1.0] * 4
    assert states[0].report.retries == 2
    assert max(s.report.dt for s in states if s.t <= 4 * DT) == DT / 4
    # After four good quarters a half is tried, fails before 4 dt, and costs one retry.
    assert sum(s.report.retries for s in states) == len(tried) - len(states) <= 6
    for s, after in pairwise(states):
        assert after.t == s.t + after.report.dt
        assert after.t / after.report.dt == round(after.t / after.report.dt)


@pytest.mark.parametrize("until", [0.3, 2.7])
def test_a_shortened_last_step_that_fails_is_halved_too(monkeypatch, until):
    tried = scripted(monkeypatch, lambda t, dt: dt > DT / 16)
    assert ended(free(), until * DT).t == until * DT
    failed = [dt for _, dt in tried if dt > DT / 16]
    assert len(failed) <= 5 + len(tried) // 4
    assert all(b <= 0.5 * a or b == a for a, b in pairwise(failed))


def test_it_gives_up_after_ten_halvings_with_the_last_good_state(monkeypatch, tmp_path):
    tried = scripted(monkeypatch, lambda t, dt: t >= 2 * DT)
    last = None
    with pytest.raises(StepFailed, match=r"scripted; look at the last state.*; given up after 10 retries") as failure:
        for state in simulate(free(), dt=DT, until=6 * DT, checkpoint=tmp_path / "run"):
            last = state
    assert len(tried) == 2 + 11
    assert tried[-1] == (2 * DT, DT / 1024)
    assert failure.value.state is last
    identical(load(tmp_path / "run"), last)


@pytest.mark.parametrize(
    ("options", "advice"),
    [
        ({}, "; use a smaller dt"),
        ({"remedy": "compress less"}, "; use a smaller dt, or compress less"),
        ({"remedy": "compress less", "retryable": False}, "; compress less"),
        ({"remedy": "compress less", "tried": "given up"}, "; compress less; given up"),
    ],
)
def test_a_smaller_dt_is_advised_where_it_may_help_and_was_not_tried(options, advice):
    failure = StepFailed("it failed", initial(free()), **options)
    assert str(failure) == "it failed" + advice


def test_a_remedy_of_its_own_stays_after_the_last_retry(monkeypatch):
    """It was mixed with the general one: "try what ... says of its picture or cell, or compress less"."""
    scripted(monkeypatch, lambda t, dt: True, remedy="compress less")
    with pytest.raises(StepFailed, match=r"scripted; compress less; given up after 10 retries with ever smaller dt$"):
        ended(free(), DT, warn=False)


def test_what_a_smaller_step_cannot_cure_is_not_tried_again():
    """A body that nothing holds, under a load, in a quasi-static step."""
    scene = free(gravity=(0.0, -10.0))
    with pytest.raises(StepFailed, match=r"body 0: no equilibrium was found: it falls.*add a Support") as failure:
        ended(scene, 4 * DT, scheme=Scheme(inertia=False))
    assert "retries" not in str(failure.value)


def test_a_static_step_is_not_halved_where_the_shortest_one_fails_too(monkeypatch):
    tried = scripted(monkeypatch, lambda t, dt: True)
    with pytest.raises(StepFailed, match="there may be no equilibrium near") as failure:
        ended(free(), DT, scheme=Scheme(inertia=False), warn=False)
    assert tried == [(0.0, DT), (0.0, DT / 1024)]
    assert failure.value.retries == 1
    tried.clear()
    with pytest.raises(StepFailed, match="there may be no equilibrium near"):
        list(simulate(free(), until=DT, scheme=Scheme(inertia=False), warn=False))
    assert len(tried) == 2


def test_the_shortest_static_step_that_succeeds_is_not_kept(monkeypatch):
    tried = scripted(monkeypatch, lambda t, dt: dt > 0.3 * DT)
    states = list(simulate(free(), dt=DT, until=DT, scheme=Scheme(inertia=False), warn=False))
    assert tried == [(0.0, dt * DT) for dt in (1.0, 1 / 1024, 0.5, 0.25)] + [
        (k * 0.25 * DT, 0.25 * DT) for k in (1, 2, 3)
    ]
    assert [state.report.retries for state in states] == [2, 0, 0, 0]


def test_a_moment_that_nothing_balances_is_named_as_one():
    pair = [Load(lambda x: x[0] > 0.9, (0.0, 1.0)), Load(lambda x: x[0] < -0.9, (0.0, -1.0))]
    static, body = Scheme(inertia=False), Body(disc((0.0, 1.0), 1.0, spacing=0.07), NeoHookean(1e3, 0.3, 1.0))
    scene = Scene([body], cell=0.1, loads=pair)  # at rest after a quarter turn, 16 cells away
    with pytest.raises(StepFailed, match=r"body 0: no equilibrium was found: it turns, by .*; add a Support"):
        step(scene, initial(scene, scheme=static), 0.01, scheme=static)


def test_every_retry_is_logged_at_level_info_and_all_of_them_in_one_warning(monkeypatch, caplog):
    scripted(monkeypatch, lambda t, dt: dt > DT / 2 and t < 4 * DT)
    with caplog.at_level(logging.INFO, logger="skmpm"):
        ended(free(), 8 * DT, warn=False)
    prescribed, warned = (
        [r.message for r in caplog.records if r.levelno == n] for n in (logging.INFO, logging.WARNING)
    )
    assert len(prescribed) == 2
    assert all("scripted; use a smaller dt; retrying with dt = 3.81e-06 s" in message for message in prescribed)
    assert len(warned) == 1
    assert warned[0].startswith("2 steps failed and were repeated with shorter ones, 12 succeeded; the shortest")
    assert "3.81e-06 s at t = 0 s; the last failure: scripted" in warned[0]


@pytest.mark.parametrize(("fails", "level"), [(1, logging.INFO), (60, logging.WARNING)])
def test_few_failures_of_chosen_steps_are_no_warning(monkeypatch, caplog, fails, level):
    """Four hundred steps, the first `fails` of which fail once."""
    failed = set()

    def once(t, dt):
        again = t in failed
        failed.add(t)
        return not again and len(failed) <= fails

    tried = scripted(monkeypatch, once)
    monkeypatch.setattr(STEP_CONTROL, "next_length", lambda length, newton: 2.5e-5)
    with caplog.at_level(logging.INFO, logger="skmpm"):
        states = list(simulate(IMPACT, until=1e-3))
    assert len(states) > 20 and len(tried) == len(states) + fails
    assert caplog.records[-1].levelno == level and "steps failed and were repeated" in caplog.records[-1].message


def test_a_run_without_failures_logs_nothing(monkeypatch, caplog):
    scripted(monkeypatch, lambda t, dt: False)
    ended(free(), 4 * DT, warn=False)
    assert not caplog.records


def test_warnings_of_preflight_are_logged_once_where_a_run_begins(caplog):
    """Of a body on which nothing acts; a run that goes on from a state was warned of at its beginning."""
    scene = free()
    (warning,) = preflight(scene, DT).warnings
    *_, state = simulate(scene, dt=DT, until=3 * DT)
    assert {record.levelno for record in caplog.records} == {logging.WARNING}
    said = [record.message for record in caplog.records]
    assert said[0] == f"preflight: {warning}" and said[1].startswith("preflight: about [...]") and len(said) == 2
    caplog.clear()
    ended(scene, 3 * DT, warn=False)
    ended(scene, 5 * DT, start=state)
    assert not caplog.records
    ended(scene, DT, start=initial(scene))
    assert len(caplog.records) == 2
    caplog.clear()
    simulate(replace(squeeze(), cell=10 * R), dt=DT, until=DT)
    assert any("[resolution]" in record.message and "R/h = 0.1;" in record.message for record in caplog.records)


@pytest.mark.parametrize("chosen", [False, True])
def test_retries_of_a_run_that_fails_are_counted_as_they_are_logged(monkeypatch, caplog, chosen):
    """Some in steps that succeed at last, the others in the last step, which does not."""
    scripted(monkeypatch, lambda t, dt: dt > 2e-6 or t > 2 * DT)
    scene, dt = (IMPACT, None) if chosen else (free(), DT)
    with caplog.at_level(logging.INFO, logger="skmpm"), pytest.raises(StepFailed) as failure:
        list(simulate(scene, dt=dt, until=1.0, warn=False))
    logged = sum("; retrying with dt" in record.message for record in caplog.records)
    assert logged > failure.value.retries > 0
    assert caplog.records[-1].message.startswith(f"{logged} steps failed and were repeated")


def test_what_fails_with_the_shortest_step_at_once_is_given_up_in_the_same_words(monkeypatch):
    """Steps are at their shortest already, as in statics near a limit load: not a smaller dt, but what may help."""
    scripted(monkeypatch, lambda t, dt: dt > DT / 1024 or t > 0.0)
    with pytest.raises(
        StepFailed, match=r"scripted; there may be no equilibrium near.* use inertia.*shortest dt"
    ) as e:
        ended(free(), DT, scheme=Scheme(inertia=False), warn=False)
    assert "use a smaller dt" not in str(e.value)


@pytest.mark.parametrize("seed", range(20))
def test_states_at_round_times_exist_whatever_fails_in_between(monkeypatch, seed):
    """One good half step and another failure, and all steps were off by half a step for good."""
    rng = np.random.default_rng(seed)
    tried = scripted(monkeypatch, lambda t, dt: t < 20 * DT and dt > DT / 8 and rng.random() < 0.4)
    states = list(simulate(free(), dt=DT, until=40 * DT))
    assert len(tried) > len(states), "something failed"
    assert set(range(1, 41)) <= {s.t / DT for s in states}
    assert all((s.t - s.report.dt) / s.report.dt % 1.0 == 0.0 for s in states), "a multiple of itself"
    assert [s.report.dt for s in states[-8:]] == [DT] * 8


def test_a_half_step_that_is_followed_by_a_failure_does_not_shift_the_full_ones(monkeypatch):
    """The case that showed it: 0 fails, a half step succeeds, the second half fails."""
    failing = {(0.0, DT), (0.5 * DT, 0.5 * DT)}
    scripted(monkeypatch, lambda t, dt: (t, dt) in failing)
    states = list(simulate(free(), dt=DT, until=8 * DT))
    assert set(range(1, 9)) <= {s.t / DT for s in states}
    assert states[-1].report.dt == DT


# --- real failures


def test_an_impact_that_one_newton_iteration_cannot_take_goes_on_in_shorter_steps():
    """The end is that of short steps throughout, to the change of one Newton tolerance in many steps."""
    states = list(simulate(IMPACT, dt=16 * DT, until=32 * DT, scheme=Scheme.accurate(max_newton=3)))
    assert sum(s.report.retries for s in states) > 0
    assert states[-1].t == 32 * DT
    fine = ended(IMPACT, 32 * DT)
    mean, wanted = (s.v @ s.mass / s.mass.sum() for s in (states[-1], fine))
    assert abs(mean - wanted).max() < 0.05 * 20.0
    for s in states:
        assert np.linalg.det(s.F.transpose(2, 0, 1)).min() > 0.0
        assert s.report.imbalance <= 1e-6


def test_bodies_do_not_jump_past_each_other():
    """Two discs at 3.6 R per step: it would take each beyond the other, where no contact would be found."""
    speed = 0.9 * R / DT
    discs = [round_body((s * 1.3 * R, 0.0), SOFT, velocity=(-s * speed, 0.0)) for s in (-1, 1)]
    scene = Scene(discs, cell=CELL)
    with pytest.raises(StepFailed, match=r"body [01] near .*: a point moves .* cells past others.*smaller dt"):
        step(scene, initial(scene), 4 * DT)
    alone = Scene(discs[:1], cell=CELL)
    step(alone, initial(alone), 4 * DT)  # nothing is in its way


def test_a_disc_that_turns_between_plates_jumps_over_nothing():
    """R/h = 15 and 0.12 rad a step move its boundary by 1.8 cells, along the plates."""
    cell, dt = R / 15, 2e-5
    body = Body(disc((0.0, R), R, spacing=0.74 * cell), NeoHookean(1e7, 0.45, 990.0), spin=0.12 / dt)
    scene = Scene([body], cell=cell, walls=[Wall((0, 0), (0, 1)), Wall((0, 2 * R), (0, -1))])
    states = list(simulate(scene, dt=dt, until=4 * dt))
    assert np.hypot(*(states[1].x - states[0].x)).max() > 1.5 * cell
    assert sum(s.report.retries for s in states) == 0


def test_common_motion_is_no_jump():
    speed = 2.0 * CELL / DT
    discs = [round_body((3.0 * R * i, 0.0), SOFT, velocity=(speed, 0.0)) for i in (0, 1)]
    scene = Scene(discs, cell=CELL, walls=[Wall((0, -2 * R), (0, 1)), Wall((-2 * R, 0), (1, 0), velocity=(speed, 0))])
    assert step(scene, initial(scene), DT).report.retries == 0


def test_numbers_that_overflow_are_a_failed_step_not_a_result():
    scene = free(SOFT, velocity=lambda x: np.stack([1e200 * x[0], 0.0 * x[1]]))
    with np.errstate(all="ignore"), pytest.raises(StepFailed, match=r"body 0.*floating-point error \(overflow .*dt"):
        step(scene, initial(scene), DT)


def test_a_division_by_zero_in_a_compiled_loop_is_a_failed_step(monkeypatch):
    """Where NumPy raises a FloatingPointError, compiled loops raise a ZeroDivisionError."""

    @compiled
    def divided(a: float) -> float:
        return 1.0 / a

    monkeypatch.setattr(Assembly, "ghost_energy", lambda self, displacement: divided(0.0))
    scene = free(SOFT)
    with pytest.raises(StepFailed, match=r"body 0.*floating-point error \(division by zero\)"):
        step(scene, initial(scene), DT)


# --- nothing is lost


def test_a_restart_while_steps_are_short_is_bit_exact(monkeypatch, tmp_path):
    """Cut where the pace is at a quarter, in the middle of a full step."""
    scheme = Scheme(max_newton=3)
    states = list(simulate(IMPACT, dt=16 * DT, until=32 * DT, scheme=scheme))
    cut = next(k for k, s in enumerate(states) if s.step_control.halvings > 1 and s.step_control.successes == 1)
    save(tmp_path / "run", states[cut])
    again = list(simulate(IMPACT, dt=16 * DT, until=32 * DT, scheme=scheme, start=load(tmp_path / "run")))
    assert len(again) == len(states) - cut - 1
    for one, other in zip(again, states[cut + 1 :], strict=True):
        identical(one, other)


def test_another_dt_starts_with_full_steps(monkeypatch):
    scripted(monkeypatch, lambda t, dt: dt > DT / 4)
    slow = ended(free(), 2 * DT)
    assert slow.step_control.halvings > 0
    tried = scripted(monkeypatch, lambda t, dt: False)
    next(simulate(free(), dt=DT / 2, until=4 * DT, start=slow))
    assert tried == [(2 * DT, DT / 2)]


def test_a_loop_that_is_left_early_leaves_its_last_state(tmp_path):
    path = tmp_path / "run"
    run = simulate(free(velocity=(1.0, 0.0)), dt=DT, until=9 * DT, checkpoint=path)
    for _, state in zip(range(3), run, strict=False):
        last = state
    run.close()
    identical(load(path), last)


def test_a_killed_run_loses_at_most_the_steps_since_its_last_checkpoint(tmp_path):
    """Killed at any moment (-9): the file holds a whole state, and going on from it ends where the run would have."""
    path = tmp_path / "run"
    code = f"""
import sys
sys.path.insert(0, {str(__file__.rpartition("/")[0])!r})
from importlib import import_module
import_module("skmpm.simulation").CHECKPOINT_EVERY = 0.0
from test_simulate import DT, simulate, squeeze
for state in simulate(squeeze(), dt=DT, until=4000 * DT, checkpoint={str(path)!r}):
    print(round(state.t / DT), flush=True)
"""
    draw = np.random.default_rng(3)
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout:
            if int(line) >= 4:
                break
        try:  # at any moment of the next few steps
            process.wait(timeout=float(draw.uniform(0.0, 0.2)))
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
        prescribed = int([line, *process.stdout.readlines()][-1])
    assert process.returncode == -signal.SIGKILL
    left = load(path)
    assert prescribed <= round(left.t / DT) <= prescribed + 1
    assert not [p for p in tmp_path.iterdir() if p != path and not p.name.startswith(".skmpm-")]
    identical(ended(squeeze(), left.t + 3 * DT, start=left), ended(squeeze(), left.t + 3 * DT))


@pytest.mark.parametrize("handled", [False, True])
def test_sigterm_leaves_a_checkpoint_unless_the_caller_handles_it(tmp_path, handled):
    """Queues send it before they kill."""
    path = tmp_path / "run"
    code = f"""
import signal, sys
sys.path.insert(0, {str(__file__.rpartition("/")[0])!r})
from test_simulate import DT, simulate, squeeze
if {handled}:
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(7))
for state in simulate(squeeze(), dt=DT, until=4000 * DT, checkpoint={str(path)!r}):
    print(round(state.t / DT), flush=True)
"""
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout:
            if int(line) >= 4:
                break
        process.send_signal(signal.SIGTERM)
        prescribed = int([line, *process.stdout.readlines()][-1])
    assert process.returncode == (7 if handled else 128 + signal.SIGTERM)
    assert prescribed <= round(load(path).t / DT) <= prescribed + 1


def test_the_handler_of_sigterm_is_put_back(tmp_path):
    before = signal.getsignal(signal.SIGTERM)
    run = simulate(free(velocity=(1.0, 0.0)), dt=DT, until=3 * DT, checkpoint=tmp_path / "run")
    next(run)
    assert signal.getsignal(signal.SIGTERM) is not before
    run.close()
    assert signal.getsignal(signal.SIGTERM) is before


def test_sigterm_ends_a_run_after_another_one_has_ended(tmp_path):
    before = signal.getsignal(signal.SIGTERM)
    one, other = (simulate(free(), dt=DT, until=3 * DT, checkpoint=tmp_path / name) for name in "ab")
    next(one), next(other)
    ours = signal.getsignal(signal.SIGTERM)
    one.close()
    assert signal.getsignal(signal.SIGTERM) is ours is not before
    other.close()
    assert signal.getsignal(signal.SIGTERM) is before


# --- states of other scenes


@pytest.mark.parametrize(
    ("other", "prescribed"),
    [
        (free(), "walls"),
        (Scene([round_body(material=SOFT, radius=1.1 * R)], cell=CELL, walls=IMPACT.walls), "points"),
        (replace(IMPACT, cell=1.5 * CELL), "(cells of|grid nodes)"),
        (
            Scene([Body(b.points, b.material) for b in squeeze().bodies], cell=CELL, walls=IMPACT.walls),
            "points",
        ),
    ],
    ids=["walls", "points", "cell", "bodies"],
)
def test_a_state_of_another_scene_is_refused_before_anything_is_done(other, prescribed, tmp_path):
    state = ended(IMPACT, 2 * DT)
    save(tmp_path / "run", state)
    for start in (state, load(tmp_path / "run")):
        with pytest.raises(SceneError, match=rf"state .* {prescribed}.*continue with the scene"):
            next(simulate(other, dt=DT, until=4 * DT, start=start))


def test_reordered_walls_and_bodies_are_refused_on_restart():
    """Their numbers agree, but a state knows where its walls face and what its bodies weigh."""
    scene = squeeze()
    state = ended(scene, 2 * DT)
    swapped = replace(scene, walls=scene.walls[::-1])
    with pytest.raises(
        SceneError, match=r"start: wall 0 of the state has the normal \[.*keep the walls and their order"
    ):
        next(simulate(swapped, dt=DT, until=4 * DT, start=state))
    heavy = replace(scene.bodies[1], material=replace(SOFT, density=2.0 * SOFT.density))
    mixed = replace(scene, bodies=[scene.bodies[0], heavy])
    state = ended(mixed, 2 * DT)
    with pytest.raises(SceneError, match=r"start: points of body 1 have other masses .*keep the bodies"):
        next(simulate(scene, dt=DT, until=4 * DT, start=state))


def test_walls_and_bodies_that_changed_places_are_refused_on_restart():
    """Two floors with one normal, two discs of as many points and one density."""
    lower = Wall((0, -1.5 * R), (0, 1))
    scene = replace(squeeze(), walls=[*squeeze().walls, lower])
    state = ended(scene, 2 * DT)
    swapped = [lower, scene.walls[1], scene.walls[0]]
    with pytest.raises(SceneError, match=r"start: walls 0 and 2 have passed each other .* keep the walls"):
        next(simulate(replace(scene, walls=swapped), dt=DT, until=4 * DT, start=state))
    with pytest.raises(SceneError, match=r"start: body 0 of the state began where body 1 of the scene does"):
        next(simulate(replace(scene, bodies=scene.bodies[::-1]), dt=DT, until=4 * DT, start=state))


def test_bodies_of_the_scene_that_were_moved_are_refused_on_restart(tmp_path):
    """A state knows where its points began; walls go on from where it has them, whatever the scene says."""
    scene = squeeze()
    save(tmp_path / "run", ended(scene, 2 * DT))
    state = load(tmp_path / "run")
    apart = Body(replace(scene.bodies[1].points, x=scene.bodies[1].points.x + np.array([[0.0], [5e-4 * CELL]])), SOFT)
    moved = replace(scene, bodies=[scene.bodies[0], apart])
    with pytest.raises(
        SceneError, match=rf"start: a point of body 1 of the scene lies {5e-4 * CELL:.3g} m from where"
    ):
        next(simulate(moved, dt=DT, until=4 * DT, start=state))
    with pytest.raises(SceneError, match="start: a point of body 1"):
        next(simulate(scene, dt=DT, until=4 * DT, start=ended(moved, 2 * DT)))
    walls = [replace(wall, point=np.asarray(wall.point) - 0.1 * R * np.asarray(wall.normal)) for wall in scene.walls]
    identical(
        ended(replace(scene, walls=walls), 4 * DT, start=state), ended(scene, 4 * DT, start=load(tmp_path / "run"))
    )
    nearby = replace(apart, points=replace(apart.points, x=scene.bodies[1].points.x + 1e-8 * CELL))
    with pytest.raises(SceneError, match="start: a point of body 1"):
        next(simulate(replace(scene, bodies=[scene.bodies[0], nearby]), dt=DT, until=4 * DT, start=state))
    often = Scheme(anchor=1e-9)
    *_, rebuilt = simulate(scene, dt=DT, until=4 * DT, scheme=often)
    next(simulate(scene, dt=DT, until=6 * DT, start=rebuilt))


def test_a_scene_that_differs_by_round_off_is_the_same_one(tmp_path):
    """Its lines give other last digits on another number of threads; order is recognised all the same."""
    scene = squeeze()
    save(tmp_path / "run", ended(scene, 2 * DT))
    digits = 1e-10 * CELL * np.random.default_rng(0).uniform(-0.7, 0.7, (2, scene.offsets[-1]))
    parts = np.split(digits, scene.offsets[1:-1], axis=1)
    bodies = [
        replace(body, points=replace(body.points, x=body.points.x + part))
        for body, part in zip(scene.bodies, parts, strict=True)
    ]
    again, swapped = (replace(scene, bodies=order) for order in (bodies, bodies[::-1]))
    state = ended(again, 4 * DT, start=load(tmp_path / "run"))
    np.testing.assert_allclose(state.x, ended(scene, 4 * DT).x, rtol=0, atol=1e-9 * CELL)
    with pytest.raises(SceneError, match=r"start: body 0 of the state began where body 1 of the scene does"):
        next(simulate(swapped, dt=DT, until=4 * DT, start=load(tmp_path / "run")))


def test_a_pace_is_plain_numbers_in_a_checkpoint(tmp_path):
    save(tmp_path / "run", ended(IMPACT, 2 * DT))
    with np.load(tmp_path / "run", allow_pickle=False) as archive:
        about = json.loads(archive["header"].tobytes())
    control = {"dt": DT, "halvings": 0, "successes": 0, "part": 0, "chosen": 0.0, "began": 0.0}
    assert about["state"]["step_control"] == control


def test_a_body_whose_cells_fall_apart_is_refused():
    """A box with a point per cell and a row of cells between them that has none: nothing would hold its halves."""
    x = np.array([[0.0, 1.0, 2.0, 2.0, 1.0, 0.0], [0.0, 0.0, 0.0, 3.4, 3.4, 3.4]]) * CELL + 0.1 * CELL
    torn = Scene([Body(Points(x, np.full(6, CELL**2), (np.arange(6),)), SOFT)], cell=CELL)
    with pytest.raises(SceneError, match=r"body 0: its cells form 2 pieces.*smaller spacing"):
        next(simulate(torn, dt=DT, until=DT))
    with pytest.raises(StepFailed, match="2 pieces") as failure:
        step(torn, initial(torn), DT)
    assert not failure.value.retryable
    cloud = Scene([Body(Points(x, np.full(6, CELL**2)), SOFT)], cell=CELL)  # who gives no outline means what he gives
    next(simulate(cloud, dt=DT, until=DT))


def test_a_column_that_buckles_is_followed():
    """Two discs, a hundredth of a radius off their axis: past its hilltop the column gives more than is dissipated.

    The run goes on in short steps, and no step gains a hundredth of the energy that was stored.
    """
    r, cell = 1e-3, 1e-3 / 10.08
    places = ((0.0, r), (0.01 * r, 3.0 * r))
    discs = [Body(disc(place, r, spacing=0.74 * cell), NeoHookean(1e7, 0.45, 990.0)) for place in places]
    smooth = partial(Wall, friction=0.0)
    plates = [smooth((0, 0), (0, 1)), smooth((0, 4.0 * r), (0, -1), velocity=(0, -0.1))]
    states = list(simulate(Scene(discs, cell=cell, walls=plates, friction=0.5), dt=1.076e-3, until=1.076e-3))
    energy = [state.report.energy for state in states]
    assert states[-1].t == 1.076e-3
    assert max(state.v[0].max() for state in states) > 0.5, "it buckled, and fast"
    lost = np.array([e.dissipated for e in energy])
    assert np.diff(lost).min() > -1e-2 * max(e.elastic for e in energy)
