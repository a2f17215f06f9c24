"""A nearly incompressible block confined by frictionless walls, against uniaxial strain.

The stress of a neo-Hookean block of height J over its first one is mu (J - 1/J) + lambda ln(J)/J. R/h is the side of
the block over that of a cell.
"""

import numpy as np
import pytest

from skmpm import Body, NeoHookean, Scene, StepFailed, Wall, box, simulate

SIDE, CELLS, YOUNG, SPEED = 1e-2, 8, 1e6, 1e-2


def force(nu, spacing, strain):
    """Force of the lid over the exact one at a strain, with points so many cells apart."""
    h, gel = SIDE / CELLS, NeoHookean(YOUNG, nu, 1100.0)
    body = Body(box((0.0, 0.0), (SIDE, SIDE), spacing=spacing * h), gel)
    places = ((0.0, 0.0), (0.0, 1.0)), ((0.0, 0.0), (1.0, 0.0)), ((SIDE, 0.0), (-1.0, 0.0))
    lid = Wall((0.0, SIDE), (0.0, -1.0), velocity=(0.0, -SPEED))
    scene = Scene([body], cell=h, walls=[*(Wall(*place) for place in places), lid])
    *_, state = simulate(scene, until=strain * SIDE / SPEED)
    J, (lam, mu) = 1.0 - strain, gel.lame
    stress = mu * (J - 1.0 / J) + lam * np.log(J) / J
    return -state.wall_force[3, 1] / (SIDE * stress)


@pytest.mark.parametrize(("nu", "spacing", "error"), [(0.45, 0.74, 0.006), (0.49, 0.66, 0.023), (0.499, 0.66, 0.18)])
def test_unequal_numbers_of_points_in_cells_make_it_too_soft(nu, spacing, error):
    """Points 0.66 cells apart are one row in every other cell, and constrain its volume where they lie."""
    assert force(nu, spacing, 0.01) == pytest.approx(1.0 - error, abs=0.3 * error + 0.002)


def test_points_half_a_cell_apart_are_exact():
    assert force(0.499, 0.5, 0.05) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(("nu", "spacing", "strain"), [(0.499, 0.66, 0.03), (0.45, 0.74, 0.35)])
def test_a_pressure_under_which_points_lose_the_volumes_of_their_cells_is_refused(nu, spacing, strain):
    """Force over the exact one was 0.22 and 0.54 there."""
    with pytest.raises(StepFailed, match=r"body 0: the dilatation of its points differs .* half a cell apart"):
        force(nu, spacing, strain)
