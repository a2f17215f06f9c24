"""Large deflections and strains, quasi-static: cantilevers, a column under its own weight, a bar pulled to 3 times.

The problems and their references are in `large_deflection.py`, the rows and figures in `large_deflection_rows.py`.
"""

import numpy as np
import pytest
from large_deflection import (
    AMPLE_K,
    LOADS,
    ample,
    ample_fem,
    column,
    elastica,
    off_elastica,
    slender,
    stretched,
)
from large_deflection_figures import draw_bar, draw_beams, draw_column
from large_deflection_rows import rows_of_bar, rows_of_beams, rows_of_column
from ledger import rate

from skmpm import linear

SOLVERS = {"banded": linear.banded, "amg": linear.amg}
TABLE = {  # (deflection, shortening) over L, tip angle [degrees]
    1: (0.30172, 0.05643, 26.43),
    2: (0.49346, 0.16064, 44.79),
    5: (0.71379, 0.38763, 69.64),
    10: (0.81061, 0.55500, 81.95),
}
HEIGHTS = 1.0 / np.array([8, 16, 32])


@pytest.mark.parametrize("k", LOADS)
def test_the_elastica_is_that_of_the_literature(k):
    """Our integration of it against tabulated values, to their last digit."""
    y, x, angle = elastica(k)
    assert (y, x, np.degrees(angle)) == pytest.approx(TABLE[k], rel=2e-4)


def test_a_slender_cantilever_follows_the_elastica():
    """L/d = 40, eight cells over the depth, k = 1, 2, 5, 10: deflection, shortening, angle within 1.5 % (asked).

    Measured 0.4 %; at this slenderness stretching and shear of the beam are below 0.1 %.
    """
    assert np.abs(off_elastica(8)).max() <= 0.015


def test_bending_converges_at_second_order():
    """Two, four, eight cells over the depth at k = 1: Q1 locks in bending, by about 16 % / across^2."""
    error = [-off_elastica(across)[0] for across in (2, 4, 8)]
    assert min(rate((1 / 2, 1 / 4, 1 / 8), e) for e in np.array(error).T) >= 1.8


def test_solvers_agree_on_the_slender_cantilever():
    """At k = 1 in one step, to what Newton's tolerance leaves of so soft a structure."""
    one, other = (slender(4, k=1, steps=1, linear=solver)[0] for solver in SOLVERS.values())
    assert np.abs(one / other - 1.0).max() <= 1e-4


def test_the_ample_beam():
    """Length 10, depth 1, k = 9.6 in 50 steps, 6 x 6 points per cell, six cells over the depth: within 1.5 %.

    The reference is quadratic finite elements: a beam this thick deflects 1.85 % more than the elastica, by shear.
    """
    fem = ample_fem(2)
    assert np.abs(ample(6)[-1] / fem - 1.0).max() <= 0.015
    thick = fem / elastica(AMPLE_K) - 1.0
    assert 0.015 < thick[0] < 0.022 and np.abs(thick[1:]).max() < 0.01


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
def test_the_column_anchored_once(solver):
    """A column pressed to an eighth at its foot by its own weight; heights / 8, 16, 32; goal: a rate of 1.8.

    Missed for the stress at the points, rate 1: a Q1 column has one stress in a cell, its mean, which is exact.
    Reached for the stress recovered from the nodes.
    """
    points, recovered = zip(*(column(n, 2, solver=solver)[0] for n in (8, 16, 32)), strict=True)
    assert rate(HEIGHTS, points) == pytest.approx(1.0, abs=0.02)
    assert points[-1] == pytest.approx(1.0 / 4.0 / 32.0, rel=1e-3)  # exact means: points lie h/4 from the middles
    assert rate(HEIGHTS, recovered) >= 1.8


def test_the_column_anchored_at_every_step_stalls_without_fitted_weights():
    """Points that weigh their volumes leave cells with too many or too few: the error stays at 4 % or more."""
    error = [column(n, 2, anchor=0.0, moment_fitting=False)[0][0] for n in (8, 16, 32)]
    assert min(error) > 0.04
    assert rate(HEIGHTS, error) < 0.2


def test_the_column_anchored_at_every_step_converges_with_fitted_weights():
    """Cells are crossed all the way down; the error at the points falls from 1.5 % to 0.15 %."""
    error = [column(n, 2, anchor=0.0)[0][0] for n in (8, 16, 32)]
    assert rate(HEIGHTS, error) >= 1.3
    assert error[-1] < 0.003


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
def test_a_bar_pulled_to_three_times_its_length(solver):
    """Anchored anew at every half of a strain, 4 x 4 points per cell: the force within 2 % (asked) all the way."""
    (_, force, exact), anew = stretched(4, 0.5, solver=solver)
    assert anew >= 2
    assert np.abs(force / exact - 1.0).max() <= 0.02


def rows():
    return rows_of_beams() + rows_of_column() + rows_of_bar()


def figures(folder):
    draw_beams(folder / "large_deflection_beams.png")
    draw_column(folder / "large_deflection_column.png")
    draw_bar(folder / "large_deflection_bar.png")
    return {
        "large_deflection_beams.png": "Cantilevers under a dead end load. Left, centre lines of the slender one"
        " (L/d = 40, eight cells over the depth) and the elastica (black); right, errors of its tip over the number"
        " of cells across the depth.",
        "large_deflection_column.png": "A column under its own weight: stress at the points, 32 cells, and errors"
        " over h. Anchored at every step with volumes as weights (plain) the error stalls.",
        "large_deflection_bar.png": "A bar pulled to three times its length: force over the closed form, by how often"
        " the body grids are rebuilt and with how many points per cell.",
    }
