"""Every parameter at the ends and in the middle of its range: a right result or one clear error.

Problem: the scenes of docs/studies/stability.md, the squeeze with 3 discs at R/h = 2 and a faster lid. Reference and
tolerances: the limits of `checks.py`, which are stated on that page. The full sweeps are run by `sweeps.py`.
"""

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from checks import Watch, examine
from geometry import crossings, loops_of
from maps import draw, failures, made, summary, table
from scenes import Parameters, collision, crush, squeeze
from settings import SWEEPS, Setting
from sweeps import case_of, limited, measure

import skmpm

SMALL = {"bodies": 3, "cells": 2.0, "steps": 20, "closing": 0.1}
LONG = 60  # [s] of the processor: no run may take it
CLEAR = {"right", "StepFailed", "SceneError"}


def quick(parameter, label, name):
    """The case of a setting, the squeeze made small where the setting does not say how large it is."""
    setting = next(s for s in SWEEPS[parameter] if s.label == label)
    if name == "squeeze":
        setting = replace(setting, parameters={**SMALL, **setting.parameters})
    return case_of(name, setting)


def must_be_right(parameter, labels, scenes=("fall", "collision", "squeeze")):
    return [
        pytest.param(parameter, label, name, id=f"{parameter} {label} {name}") for label in labels for name in scenes
    ]


RIGHT = [
    *must_be_right("dt", ("0.001", "1", "32")),
    *must_be_right("nu", ("0", "0.499 mean dilatation")),
    *must_be_right("nu", ("-0.9",), ("fall", "collision")),
    *must_be_right("stiffness", ("100",), ("fall", "collision")),
    *must_be_right("stiffness", ("1e+08",), ("fall",)),
    *must_be_right("density", ("100", "1e+08"), ("fall", "collision")),
    *must_be_right("friction", ("0", "0.1", "1"), ("collision",)),
    *must_be_right("friction", ("0", "0.1"), ("squeeze",)),
    *must_be_right("friction", ("100",), ("collision",)),
    *must_be_right("closing", ("1e-06", "0.001", "0.1")),
    *must_be_right("points", ("1", "9")),
    *must_be_right("cells", ("1.5", "8"), ("fall", "collision")),
    *must_be_right("offset", ("centre on a node", "1e-15 off a node", "1e6 cells away", "boxes on the grid")),
    *must_be_right("fraction", ("0.75", "1"), ("squeeze",)),
    *must_be_right("bodies", ("1", "3", "12 points")),
]
CLEAR_END = [
    *must_be_right("dt", ("1000",)),
    *must_be_right("nu", ("0.49999",)),
    *must_be_right("nu", ("-0.9",), ("squeeze",)),
    *must_be_right("stiffness", ("100",), ("squeeze",)),
    *must_be_right("stiffness", ("1e+08",), ("collision",)),
    *must_be_right("friction", ("100",), ("squeeze",)),
    *must_be_right("closing", ("1",)),
    *must_be_right("points", ("0.5",)),
    *must_be_right("fraction", ("1.1",), ("squeeze",)),
]


@pytest.mark.parametrize(("parameter", "label", "name"), RIGHT)
def test_a_setting_is_right(parameter, label, name):
    outcome = limited(quick(parameter, label, name), LONG)
    assert outcome.kind == "right", (outcome.violations, outcome.message)


@pytest.mark.slow
@pytest.mark.parametrize(("parameter", "label", "name"), CLEAR_END)
def test_an_extreme_setting_is_right_or_ends_in_a_clear_error(parameter, label, name):
    """With its time and a remedy, and the last good state in hand: `checks.Watch.failed`."""
    outcome = limited(quick(parameter, label, name), LONG)
    assert outcome.kind in CLEAR, outcome.violations


def test_a_crushed_disc_does_not_fold_over_itself():
    """A soft one under a stiff one, in good steps; then every scene may be watched for it (`Watch._places`)."""
    case, crossed = quick("stiffness", "100", "squeeze"), 0
    with suppress(skmpm.StepFailed):
        for state in skmpm.simulate(case.scene, dt=case.dt, until=case.until, scheme=case.scheme):
            crossed += sum(crossings(loops_of(case.scene, state, b)) for b in range(len(case.scene.bodies)))
    assert not crossed


def test_a_body_between_walls_that_close_to_nothing_ends_clearly():
    """Not in NaN, and not in a body behind the walls."""
    outcome = examine(crush(Parameters(cells=2.0, closing=0.2)))
    assert outcome.kind == "StepFailed", outcome.violations
    assert outcome.state.t > 0.0 and np.isfinite(outcome.state.x).all()


def test_bodies_of_one_point_need_nodes_to_share():
    """They have no outline: the message says what to use."""
    outcome = examine(quick("bodies", "points by outlines", "collision"))
    assert outcome.kind == "SceneError" and "shared_grid" in outcome.message


def tampered(state, **changes):
    """The state after a change that a wrong code could have made."""
    return replace(state, **{name: change(getattr(state, name)) for name, change in changes.items()})


def set_at(array, index, value):
    array = array.copy()
    array[index] = value
    return array


WRONG = {
    "finite": {"stress": lambda a: set_at(a, (0, 0, 0), np.nan)},
    "1 - J": {"F": lambda a: set_at(a, (0, slice(None), 0), -a[0, :, 0])},
    "momentum": {"v": lambda a: a * (1.0 + 1e-6)},
    "energy gained": {"v": lambda a: 1.5 * a},
    "residual": {"report": lambda r: replace(r, residual=1e-4)},
    "overlap": {"report": lambda r: replace(r, overlap=0.011)},
    "pull": {"contacts": lambda c: replace(c, force=set_at(c.force, (0, np.argmin(c.force[0])), -1.0))},
    "outside the cone": {"contacts": lambda c: replace(c, force=c.force * [[1.0], [5.0]])},
    "loaded gap": {"contacts": lambda c: replace(c, gap=c.gap + 1e-5)},
    "behind a wall": {"x": lambda a: a - 1e-4},
    "inner points in other bodies": {"x": lambda a: np.roll(a, 40, axis=1)},
    "dissipation undone": {"report": lambda r: replace(r, energy=replace(r.energy, dissipated=-1.0))},
    "external": {"report": lambda r: replace(r, energy=replace(r.energy, external=2.0 * r.energy.external))},
}


@pytest.fixture(scope="module")
def two_states():
    """A squeeze in full swing."""
    case = squeeze(Parameters(**SMALL))
    *_, old, new = skmpm.simulate(case.scene, dt=case.dt, until=case.until, scheme=case.scheme)
    return case, old, new


@pytest.mark.parametrize("name", WRONG)
def test_the_checks_see_what_is_wrong(two_states, name):
    """Each of them finds one tampered state, and nothing in the true one."""
    case, old, new = two_states
    for state, seen in ((new, False), (tampered(new, **WRONG[name]), True)):
        watch = Watch(case)
        watch.begin(old)
        watch.start = old.report.energy.kinetic + old.report.energy.elastic
        watch.external, watch.largest = old.report.energy.external, old.report.energy.external
        watch.start -= watch.external + old.report.energy.push_out
        watch.see(state)
        assert (name in watch.found) == seen, watch.found


def test_one_map_and_the_page_are_drawn_from_what_is_measured(tmp_path):
    """Of two settings, one of which cannot be right."""
    settings = [Setting("1", {"closing": 0.1}), Setting("points", {"shape": "point", "outlined": True})]
    rows = [
        {key: str(value) for key, value in measure(name, setting).items()}
        for setting in settings
        for name in ("fall", "collision")
    ]
    kinds = [row["kind"] for row in rows]
    assert kinds[:2] == ["right", "right"] and kinds[3] == "SceneError"
    assert float(rows[0]["error"]) < 0.02
    assert draw("closing", rows, tmp_path).stat().st_size > 5000
    lines = summary({"closing": rows})
    assert lines[1][1:8] == ("1", "points", "3", "0", "1", "0", "0") and len(lines[0]) == len(lines[1])
    assert "| 1 | points | 3 | 0 | 1 | 0 | 0 |" in table(lines)[2]
    head, failed = failures({"closing": rows})
    assert failed[head.index("outcome")] == "SceneError" and "outline" in failed[head.index("message")]
    assert "4 runs" in made({"closing": rows}) and f"All with skmpm {skmpm.__version__}, source" in made(
        {"closing": rows}
    )
    assert "**Warning: several versions**" in made({"closing": [*rows, rows[0] | {"library": ""}]})


def test_the_collision_is_one():
    """The discs meet in the first steps, rub, and part again: what the sweeps compare has happened."""
    case, pushed = collision(Parameters()), np.zeros(2)
    for state in skmpm.simulate(case.scene, dt=case.dt, until=case.until):
        pushed = np.maximum(pushed, np.abs(state.contacts.force).max(axis=1, initial=0.0))
    assert pushed.min() > 1.0 and not state.contacts.force.any()
