"""Suggested resolutions: what they depend on, and that the laws they come from hold on the runs of the study."""

import csv
from pathlib import Path

import numpy as np
import pytest

from skmpm.material import LinearElastic, NeoHookean, Rigid
from skmpm.points import box, disc
from skmpm.scene import Body, Scene, Wall
from skmpm.simulate.suggest import LAWS, kind, suggest

SOFT, R = NeoHookean(1e5, 0.3, 1000.0), 0.1
WAVE = float(np.sqrt((SOFT.lame[0] + 2.0 * SOFT.lame[1]) / SOFT.density))
FLOOR, LID = Wall((0, 0), (0, 1)), Wall((0, 2), (0, -1), velocity=(0, -0.5))
RESULTS = Path(__file__).parents[2] / "docs" / "tradeoff" / "results.csv"


def discs(count, *, radius=R, cell=0.05, spacing=0.03, material=SOFT, walls=(), **motion):
    bodies = [
        Body(disc((3.0 * radius * i, radius), radius, spacing=spacing), material, **motion) for i in range(count)
    ]
    return Scene(bodies, cell=cell, walls=walls)


def test_kinds_follow_from_what_touches_and_moves():
    assert kind(discs(1)) == "bending"
    assert kind(discs(2)) == kind(discs(1, walls=[FLOOR, LID])) == kind(discs(9, walls=[FLOOR])) == "pressing"
    assert kind(discs(2, velocity=(1.0, 0.0))) == kind(discs(1, walls=[FLOOR], spin=1.0)) == "impact"
    assert kind(discs(6, walls=[FLOOR, LID])) == "packing"
    pushed = Body(box((-1, -1), (3, 0.5), spacing=0.1), Rigid(1.0), velocity=(0, 1))
    assert kind(Scene([*discs(6).bodies, pushed], cell=0.05)) == "packing"
    assert kind(Scene([*discs(5).bodies, pushed], cell=0.05)) == "pressing"


@pytest.mark.parametrize("scene", [discs(1), discs(2), discs(2, spin=1.0), discs(7, walls=[LID])], ids=LAWS)
def test_the_law_promises_what_was_asked_and_less_error_is_finer(scene):
    """And nothing is wasted: the law's error is what was asked; steps times cell^2.5 grow with every digit."""
    laws, before = LAWS[kind(scene)], np.inf
    for error in (0.2, 0.1, 0.05, 0.02, 0.01):
        cell, spacing, dt = suggest(scene, error=error)
        (law,) = (law for law in laws if np.isclose(law.spacing, spacing / cell))
        speed = 0.5 if kind(scene) == "packing" else WAVE
        assert law(R / cell, dt * speed / R) == pytest.approx(error, rel=1e-6)
        assert dt * cell**2.5 < before
        before = dt * cell**2.5


def test_own_cell_and_points_do_not_matter():
    """Radii by points of another spacing: the same to 1 %."""
    fine = suggest(discs(2, cell=0.01, spacing=0.005), error=0.05)
    np.testing.assert_allclose(suggest(discs(2), error=0.05), fine, rtol=0.01)


def test_lengths_scale_with_bodies_and_times_with_waves():
    """Twice as large: cells and steps twice; four times as stiff: steps half as long; lids twice as fast: half."""
    cell, spacing, dt = suggest(discs(2), error=0.05)
    large = suggest(discs(2, radius=2 * R, cell=0.1, spacing=0.06), error=0.05)
    np.testing.assert_allclose(large, (2 * cell, 2 * spacing, 2 * dt))
    stiff = suggest(discs(2, material=NeoHookean(4e5, 0.3, 1000.0)), error=0.05)
    np.testing.assert_allclose(stiff, (cell, spacing, 0.5 * dt))
    fast = Wall((0, 2), (0, -1), velocity=(0, -1.0))
    slow, fast = (suggest(discs(8, walls=[FLOOR, wall]), error=0.05) for wall in (LID, fast))
    np.testing.assert_allclose(fast, (*slow[:2], 0.5 * slow[2]))


def test_a_creeping_wall_does_not_lengthen_the_steps_of_a_collision():
    """Bodies that move at t = 0 need steps that resolve waves, whatever else is driven."""
    creeping = Wall((0, 2), (0, -1), velocity=(0, -1e-6))
    alone, beside = (suggest(discs(2, spin=1.0, walls=walls), error=0.05) for walls in ([FLOOR], [FLOOR, creeping]))
    assert beside == alone


def test_the_smallest_body_and_the_stiffest_decide():
    """A bar's size is that of its depth: twice its radius of gyration across, depth / sqrt(3)."""
    small, large = discs(1, radius=R / 2, spacing=0.015).bodies[0], Body(box((1, 0), (1, 1), spacing=0.1), SOFT)
    both = Scene([small, large], cell=0.05)
    np.testing.assert_allclose(suggest(both, error=0.1)[0], 0.5 * suggest(discs(2), error=0.1)[0], rtol=0.01)
    bar = Scene([Body(box((0, 0), (3.0, 0.2), spacing=0.02), LinearElastic(1e5, 0.3, 1000.0))], cell=0.05)
    assert suggest(bar, error=0.05)[0] / suggest(discs(1), error=0.05)[0] == pytest.approx(
        0.2 / np.sqrt(3) / R, rel=0.01
    )
    hard = Body(disc((1, 0), R, spacing=0.03), NeoHookean(4e5, 0.3, 1000.0))
    dt = suggest(Scene([*discs(1).bodies, hard], cell=0.05), error=0.05)[2]
    assert dt == pytest.approx(0.5 * suggest(discs(2), error=0.05)[2])


@pytest.mark.parametrize("error", [0.0, -0.1, 1e-5, 0.5, 1.0, np.nan])
def test_errors_that_were_not_measured_are_refused(error):
    with pytest.raises(ValueError, match=r"suggest: error = .*; use one between 0\.00.* and 0\.25"):
        suggest(discs(1), error=error)


@pytest.mark.parametrize(
    ("name", "scene", "factor"), [("bending", "cantilever", 2 / 3**0.5), ("pressing", "hertz", 1)]
)
def test_laws_hold_on_the_runs_of_the_study(name, scene, factor):
    """Every run that differs in R/h only, of docs/tradeoff/results.csv: within a factor of two of the law."""
    (law,) = LAWS[name]
    with RESULTS.open() as file:
        runs = [row for row in csv.DictReader(file) if row["scene"] == scene and "law" in row["why"].split()]
    runs = [row for row in runs if abs(float(row["spacing"]) - law.spacing) < 1e-9]
    assert len(runs) >= 6
    for row in runs:
        assert 0.5 < float(row["error largest"]) / law(factor * float(row["cells"]), 0.0) < 2.0, row["cells"]
