"""Moment fitting: weights reproduce the given moments if the points resolve them, and places do otherwise."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skmpm import Body, LinearElastic, Points, Scene, Scheme, contact, disc, initial
from skmpm.grid import build_grids
from skmpm.grid.moment_fitting import MAX_WEIGHT, MIN_WEIGHT, fitted_places, fitted_weights
from skmpm.material import determinant
from skmpm.outline import outlines
from skmpm.outline.cells import cell_moments


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


@given(seed=st.integers(0, 1000), spacing=st.floats(0.3, 1.5))
def test_places_have_the_centroid_of_the_material_in_every_cell(seed, spacing):
    p, grid, wanted = cloud(seed, spacing)
    weight = fitted_weights(grid, p.volume, wanted)
    places = fitted_places(grid, weight, wanted)
    total = np.bincount(grid.cell_of_point, weight, grid.cells)
    mean = np.stack([np.bincount(grid.cell_of_point, weight * xi, grid.cells) for xi in places]) / total
    kept = total > 2.0 * grid.cell**2 * wanted[0]  # slivers, whose points keep a part of their volume
    assert np.abs(mean - wanted[1:] / wanted[0])[:, ~kept].max() < 1e-9
    assert kept.sum() < 0.1 * grid.cells
    assert np.array_equal(places[:, kept[grid.cell_of_point]], grid.local[:, kept[grid.cell_of_point]])


def test_areas_of_deformed_cells_are_exact_with_a_single_row_of_points():
    """Reference: the shoelace formula, for cells whose nodes are moved at random by up to a fifth of a side."""
    x = np.array([[0.3, 0.8, 1.3, 1.8], [0.1, 0.1, 0.9, 0.9]])
    grid = build_grids(x, np.zeros(4, int), 1.0, 1)
    full = np.repeat([[1.0], [0.5], [0.5]], grid.cells, axis=1)
    weight = fitted_weights(grid, np.full(4, 0.5), full)
    grid = replace(grid, quadrature=fitted_places(grid, weight, full))
    u = np.random.default_rng(0).uniform(-0.2, 0.2, 2 * grid.nodes)
    J = determinant(grid.strain_at_points(u) + np.eye(2)[:, :, None])
    a, b = (grid.position + u.reshape(-1, 2).T)[:, grid.nodes_of_cell]
    area = 0.5 * (a * np.roll(b, -1, axis=0) - b * np.roll(a, -1, axis=0)).sum(axis=0)
    assert np.bincount(grid.cell_of_point, weight * J) == pytest.approx(area, rel=1e-12)
    at_points = determinant(grid.gradient_at_points(u) + np.eye(2)[:, :, None])
    assert np.abs(np.bincount(grid.cell_of_point, weight * at_points) - area).max() > 0.01


def test_a_good_rule_stays_as_it_is():
    g = np.arange(8) / 2 + 0.25
    x = np.stack([np.repeat(g, 8), np.tile(g, 8)])
    grid = build_grids(x, np.zeros(64, int), 1.0, 1)
    full = np.repeat([[1.0], [0.5], [0.5]], grid.cells, axis=1)
    weight = fitted_weights(grid, np.full(64, 0.25), full)
    assert np.allclose(weight, 0.25, rtol=1e-12)
    assert np.allclose(fitted_places(grid, weight, full), grid.local, atol=1e-12)


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
    state = initial(scene, scheme=scheme)
    weight, grid = state.weight, state.derived.assembly.grid
    assert np.array_equal(grid.quadrature[:, round_.size :], grid.local[:, round_.size :])
    assert np.array_equal(weight[round_.size :], bare.volume)
    assert not np.allclose(weight[: round_.size], round_.volume, rtol=0.01)
