"""Bodies of two materials against closed forms and finite elements: laminates, discs with a round or a square core.

Interfaces on grid lines cost nothing: laminates are exact to round-off, and the error of a disc with a square core is
below that of Q1 elements on a mesh that fits it. Through cells an interface is smeared over one of them, since the
gradient of a cell's displacement has no jump: the error is of first order in h.
"""

import numpy as np
import pytest
from composite import HEIGHT, STROKE, WIDTH, RoundCore, SquareCore, laminate, pull
from ledger import rate

from skmpm.material import LinearElastic, NeoHookean

SOFT, STIFF = LinearElastic(1e6, 0.3, 1000.0), LinearElastic(1e7, 0.2, 2000.0)
SIZES = (1 / 5, 1 / 10, 1 / 20)  # h over the radius
OFFSETS = ((0.0, 0.0), (0.3, 0.7), (0.62, 0.18))  # of the grid, in cells


def series(materials):
    """Force of layers on each other in uniaxial strain: lambda + 2 mu in series [N/m]."""
    return WIDTH * STROKE / sum(HEIGHT / 2 / (m.lame[0] + 2 * m.lame[1]) for m in materials)


def parallel(materials):
    """Force of layers side by side, whose Poisson's ratio is zero: moduli in parallel [N/m]."""
    return STROKE / HEIGHT * sum(WIDTH / 2 * m.E for m in materials)


@pytest.mark.parametrize("cell", [1 / 8, 1 / 16])
def test_layers_in_series_on_grid_lines_are_exact(cell):
    """Force and stress to 1e-10, the tolerance of Newton's method."""
    force, state = pull(laminate(1, (SOFT, STIFF), cell=cell))
    assert force == pytest.approx(series((SOFT, STIFF)), rel=1e-10)
    np.testing.assert_allclose(state.stress[1, 1], force / WIDTH, rtol=1e-10)


@pytest.mark.parametrize("ratio", [1e2, 1e4, 1e6])
def test_layers_of_very_different_stiffness_are_exact(ratio):
    """Force to the conditioning of the matrix, 1e-12 times the ratio of the moduli."""
    materials = (SOFT, LinearElastic(1e6 * ratio, 0.2, 2000.0))
    assert pull(laminate(1, materials))[0] == pytest.approx(series(materials), rel=max(1e-10, 1e-12 * ratio))


@pytest.mark.parametrize("cell", [1 / 8, 1 / 16])
def test_layers_in_parallel_on_grid_lines_are_exact(cell):
    """Force to 1e-10, and in each layer its own stress E eps."""
    materials = (LinearElastic(1e6, 0.0, 1000.0), LinearElastic(1e7, 0.0, 2000.0))
    scene = laminate(0, materials, cell=cell)
    force, state = pull(scene)
    assert force == pytest.approx(parallel(materials), rel=1e-10)
    modulus = np.where(scene.bodies[0].points.group == "first", 1e6, 1e7)
    np.testing.assert_allclose(state.stress[1, 1], modulus * STROKE / HEIGHT, rtol=1e-10)


@pytest.mark.parametrize("axis", [0, 1])
def test_an_interface_inside_cells_is_smeared_over_one_of_them(axis):
    """At any position in the cells the force is within 5 % at 8 cells a layer and 2.5 % at 16 (first order)."""
    materials = (LinearElastic(1e6, 0.0, 1000.0), LinearElastic(1e7, 0.0, 2000.0))
    exact = (parallel, series)[axis](materials)
    for cell, limit in ((1 / 8, 0.05), (1 / 16, 0.025)):
        errors = [pull(laminate(axis, materials, cell=cell, shift=s * cell))[0] / exact - 1 for s in (0.25, 0.5, 0.8)]
        assert np.abs(errors).max() < limit


def test_nearly_incompressible_layers_keep_their_own_mean_dilatation():
    """One layer with, one without mean dilatation, and both: the same law of series, at strains of 5e-5."""
    for materials in (
        (NeoHookean(1e6, 0.49, 1000.0), NeoHookean(1e7, 0.3, 1000.0)),
        (NeoHookean(1e6, 0.49, 1000.0), LinearElastic(1e7, 0.45, 1000.0)),
    ):
        force, _ = pull(laminate(1, materials))
        assert force == pytest.approx(series(materials), rel=1e-4)


@pytest.mark.parametrize("ratio", [10.0, 0.1])
def test_a_disc_with_a_round_core_under_pressure(ratio):
    """Lame's solution, displacement at three offsets of the grid: of first order, 5 % at R/h = 10 (core of 5 h)."""
    problem = RoundCore(LinearElastic(1e6 * ratio, 0.3, 1000.0), SOFT)
    error = [np.mean([problem.error(h, offset) for offset in OFFSETS]) for h in SIZES]
    assert rate(SIZES, error) > 0.9
    assert error[1] < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [10.0, 100.0])
def test_a_disc_with_a_square_core_against_finite_elements(ratio):
    """Q2 elements as reference; the interface lies on grid lines: below the error of Q1 elements, of second order."""
    problem = SquareCore(LinearElastic(1e6 * ratio, 0.3, 1000.0), SOFT)
    sizes = (1 / 4, 1 / 8, 1 / 16)
    error = [problem.error_of_points(h) for h in sizes]
    assert (np.array(error) < [problem.error_of_finite_elements(h) for h in sizes]).all()
    assert rate(sizes, error) > 1.5
