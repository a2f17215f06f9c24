"""Moment fitting: weights reproduce the given moments if the points resolve them, and stay positive otherwise."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skmpm import Body, LinearElastic, Points, Scene, Scheme, contact, disc, initial
from skmpm.grid import build_grids
from skmpm.moment_fitting import MAX_WEIGHT, MIN_WEIGHT, fitted_weights
from skmpm.outline import cell_moments, outlines


def cloud(seed, spacing, h=0.25):
    """A disc at a random place: (points, body grids, moments of its cells)."""
    rng = np.random.default_rng(seed)
    p = disc(rng.random(2), 1.0, spacing=spacing * h)
    grid = build_grids(p.x, np.zeros(p.size, int), h, 1)
    boundary = outlines([p.outline], [0])
    return p, grid, cell_moments(boundary, p.x[:, boundary.point], h, grid.cell_index, grid.cell_body)[:3]


def moments_of(grid, weight):
    w = weight / grid.cell**2
    return np.stack([np.bincount(grid.cell_of_point, w * f, grid.cells) for f in (1.0, *grid.local)])


@given(seed=st.integers(0, 1000))
def test_cells_with_many_points_get_their_moments(seed):
    p, grid, wanted = cloud(seed, 0.2)
    got = moments_of(grid, fitted_weights(grid, p.volume, wanted))
    full = wanted[0] > 1 - 1e-12
    assert full.sum() > 20
    assert np.abs(got - wanted)[:, full].max() < 1e-12
    worst = np.abs(got - wanted).max(axis=0)
    assert np.mean(worst < 1e-10) > 0.75
    before = np.abs(moments_of(grid, p.volume) - wanted).max(axis=0)
    assert worst.sum() < 0.2 * before.sum()


@given(seed=st.integers(0, 1000), spacing=st.floats(0.3, 1.5))
def test_weights_stay_positive_and_near_the_volumes(seed, spacing):
    p, grid, wanted = cloud(seed, spacing)
    factor = fitted_weights(grid, p.volume, wanted) / p.volume
    assert factor.min() >= MIN_WEIGHT - 1e-12
    mean = np.bincount(grid.cell_of_point, factor * p.volume, grid.cells)
    mean /= np.bincount(grid.cell_of_point, p.volume, grid.cells)
    assert mean.max() <= MAX_WEIGHT + 1e-12


def test_a_good_rule_stays_as_it_is():
    g = np.arange(8) / 2 + 0.25
    x = np.stack([np.repeat(g, 8), np.tile(g, 8)])
    grid = build_grids(x, np.zeros(64, int), 1.0, 1)
    full = np.repeat([[1.0], [0.5], [0.5]], grid.cells, axis=1)
    assert np.allclose(fitted_weights(grid, np.full(64, 0.25), full), 0.25, rtol=1e-12)


def test_one_point_in_a_cell_takes_its_area():
    grid = build_grids(np.array([[0.2], [0.3]]), np.zeros(1, int), 1.0, 1)
    assert fitted_weights(grid, np.array([0.5]), np.array([[0.6], [0.3], [0.3]])) == pytest.approx(0.6)


def test_the_scheme_decides():
    body = Body(disc((0.1, 0.2), 1.0, spacing=0.1), LinearElastic(1.0, 0.3, 1.0))
    scene = Scene([body], cell=0.25)
    by_volume, by_moments = (initial(scene, scheme=Scheme(moment_fitting=f)).derived.assembly for f in (False, True))
    assert np.array_equal(by_volume.volume, body.points.volume)
    assert not np.allclose(by_moments.volume, body.points.volume, rtol=0.01)
    assert np.array_equal(by_volume.mass, by_moments.mass)
    assert not Scheme.nezamabadi2017().moment_fitting


def test_bodies_without_outline_keep_their_volumes():
    round_ = disc((0.1, 0.2), 1.0, spacing=0.1)
    bare = Points(round_.x + 3.0, round_.volume)
    scene = Scene([Body(p, LinearElastic(1.0, 0.3, 1.0)) for p in (round_, bare)], cell=0.25)
    scheme = Scheme(anchor=0.0, contact=contact.shared_grid)  # the only one for bodies without outline
    weight = initial(scene, scheme=scheme).weight
    assert np.array_equal(weight[round_.size :], bare.volume)
    assert not np.allclose(weight[: round_.size], round_.volume, rtol=0.01)
