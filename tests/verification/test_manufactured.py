"""Manufactured solutions: the errors fall with h and dt at the order of the method.

Three motions that fill the terms of the balance of momentum, `manufactured.py`: a bar, a square whose sides slide,
a ring that shears (the generalised vortex). Errors are relative L2 norms over the material points. Unless said
otherwise theta = 1/2. The order in space is measured with time steps too short to matter, that in time against a far
shorter step on the same grid, where the error of space drops out.
"""

import numpy as np
import pytest
from ledger import rate
from manufactured import imbalance, vortex
from manufactured_figures import draw_space, draw_time
from manufactured_rates import (
    CUT,
    PROBLEMS,
    in_space,
    in_time,
    orders,
    rows_in_space,
    rows_in_time,
    rows_of_loss,
)

from skmpm import linear

SOLVERS = {"banded": linear.banded, "amg": linear.amg}


def places(count=40):
    """Positions inside the square and inside the ring, drawn at random."""
    random = np.random.default_rng(0)
    R, angle = random.uniform(0.76, 1.24, count), random.uniform(0.0, 2 * np.pi, count)
    inside = random.uniform(0.0, 1.0, (2, count))
    return {"bar": inside, "square": inside, "vortex": R * np.stack([np.cos(angle), np.sin(angle)])}


@pytest.mark.parametrize("name", PROBLEMS)
def test_the_body_force_balances_the_motion(name):
    """With P(F) of the library rho a - Div P - rho b = 0, by differences in long double: to 1e-10 of the force.

    That is what the eighth-order differences leave; a wrong sign of one term leaves 1e-4 and more.
    """
    for share in (0.1, 0.6, 1.0):
        assert imbalance(PROBLEMS[name], places()[name], share * PROBLEMS[name].until) <= 1e-10


def test_the_sign_printed_elsewhere_does_not_balance():
    """The generalised vortex with + R (alpha')^2 in b_T, as one finds it printed."""
    assert imbalance(vortex(sign=1.0), places()["vortex"], 0.02) > 1e-3


@pytest.mark.parametrize(
    ("name", "cells", "solver"),
    [("bar", (8, 16, 32), "banded"), ("square", (8, 16), "banded"), ("square", (8, 16), "amg")],
)
def test_second_order_in_space_on_aligned_grids(name, cells, solver):
    """Two points per cell and direction: displacement and velocity at a rate of 1.8 at least."""
    displacement, velocity = orders(1.0 / np.array(cells), in_space(name, cells, 2, 64, solver=SOLVERS[solver]))
    assert displacement >= 1.8
    assert velocity >= 1.8


@pytest.mark.parametrize(
    ("name", "offset", "cells", "solver"),
    [
        ("square", CUT, (8, 16), "banded"),
        ("square", CUT, (8, 16), "amg"),
        ("vortex", (0.0, 0.0), (16, 32), "banded"),
    ],
)
def test_order_in_space_with_cut_cells(name, offset, cells, solver):
    """The square 0.3 and 0.45 cells off the grid, and the ring: three points per cell, at a rate of 1.5 at least."""
    found = in_space(name, cells, 3, 32, offset=offset, solver=SOLVERS[solver])
    displacement, velocity = orders(1.0 / np.array(cells), found)
    assert displacement >= 1.5
    assert velocity >= 1.5


@pytest.mark.parametrize(("per_cell", "offset", "reached"), [(4, (0.9, 0.15), 1.5), (3, (0.5, 0.5), 1.0)])
def test_order_where_the_grid_cuts_worst(per_cell, offset, reached):
    """The worst of twelve offsets: goal 1.5, reached with four points per cell, missed with three: 1.1 here.

    There the points lie on the grid lines, towards one corner of each cell: weights linear in the position that had
    the cell's moments would be negative, and are cut.
    """
    displacement, _ = orders((1 / 8, 1 / 16), in_space("square", (8, 16), per_cell, 32, offset=offset))
    assert displacement >= reached


def test_points_that_weigh_their_volumes_are_of_first_order_with_cut_cells():
    """What fitted weights are for: without them the imbalance of a uniform stress does not fall with h."""
    plain, fitted = (in_space("square", (16, 32), 3, 32, offset=CUT, fitted=f)[:, 0] for f in (False, True))
    assert plain[1] >= 5.0 * fitted[1]
    assert rate((1 / 16, 1 / 32), plain) < 1.2


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
def test_second_order_in_time_by_the_midpoint_rule(solver):
    """The bar at h = 1/16 in 8 to 32 steps: 2 to within 0.1, displacement and velocity."""
    steps = (8, 16, 32)
    found = in_time("bar", steps, 0.5, finest=256, solver=solver)[:, 0]
    assert orders(1.0 / np.array(steps), found) == pytest.approx([2.0, 2.0], abs=0.1)


def test_first_order_in_time_by_backward_euler():
    """The bar at h = 1/16 in 32 to 128 steps: 1 to within 0.1, displacement and velocity."""
    steps = (32, 64, 128)
    found = in_time("bar", steps, 1.0, finest=256)[:, 0]
    assert orders(1.0 / np.array(steps), found) == pytest.approx([1.0, 1.0], abs=0.1)


@pytest.mark.parametrize(("theta", "steps"), [(0.5, (8, 16, 32)), (1.0, (32, 64, 128))])
def test_order_in_time_of_the_square(theta, steps):
    """As for the bar."""
    found = in_time("square", steps, theta, finest=256)[:, 0]
    assert orders(1.0 / np.array(steps), found) == pytest.approx([1.0 / theta] * 2, abs=0.1)


def rows():
    return rows_in_space() + rows_in_time() + rows_of_loss()


def figures(folder):
    draw_space(folder / "manufactured_space.png")
    draw_time(folder / "manufactured_time.png")
    return {
        "manufactured_space.png": "Manufactured solutions: error of the displacement over the cell size. Left, the"
        " unit square: aligned with the grid, and at twelve offsets from it with three and four points per cell and"
        " direction. Right, the ring of the generalised vortex, with fitted weights and with volumes as weights.",
        "manufactured_time.png": "Manufactured solutions: error over the time step at h = 1/16, against 1,024 steps"
        " on the same grid (symbols) and against the exact motion (thin lines), where the error of space stays.",
    }
