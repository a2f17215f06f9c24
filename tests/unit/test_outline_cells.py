"""Moments of polygons over grid cells against closed forms, sums over cells, and a fine raster."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.path import Path

from skmpm.outline import area, outlines
from skmpm.outline.cells import cell_moments


def cells_over(x, cell):
    """All cells that a cloud of boundary points spans, (2, cells)."""
    low, high = np.floor(x.min(axis=1) / cell).astype(int), np.floor(x.max(axis=1) / cell).astype(int)
    grid = np.meshgrid(*(np.arange(a, b + 1) for a, b in zip(low, high, strict=True)), indexing="ij")
    return np.stack([g.ravel() for g in grid])


def polygon(seed, corners=7):
    """A star-shaped polygon and, inside it, a triangular hole."""
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, corners))
    angle = np.linspace(0, 2 * np.pi, corners, endpoint=False) + 0.3 * (angle - angle.mean()) / corners
    outer = rng.uniform(0.6, 1.6, corners) * np.stack([np.cos(angle), np.sin(angle)])
    hole = 0.3 * np.stack([np.cos([0, -2, -4]), np.sin([0, -2, -4])])
    x = np.concatenate([outer, hole], axis=1) + rng.uniform(-2, 2, (2, 1))
    return outlines([[np.arange(corners), corners + np.arange(3)]], [0]), x


@given(seed=st.integers(0, 10_000), cell=st.floats(0.1, 3.0))
def test_cells_add_up_to_the_area_and_its_moments(seed, cell):
    boundary, x = polygon(seed)
    index = cells_over(x, cell)
    m = cell_moments(boundary, x, cell, index, np.zeros(index.shape[1], int))
    assert m[0].sum() * cell**2 == pytest.approx(area(boundary, x, 1)[0], rel=1e-12)
    assert (m[0] >= -1e-12).all()
    assert (m[0] <= 1 + 1e-12).all()
    fine = cells_over(x, cell / 2)
    halves = cell_moments(boundary, x, cell / 2, fine, np.zeros(fine.shape[1], int))
    for axis in (0, 1):
        first = cell**3 * (m[1 + axis] + index[axis] * m[0]).sum()
        again = (cell / 2) ** 3 * (halves[1 + axis] + fine[axis] * halves[0]).sum()
        assert first == pytest.approx(again, abs=1e-12)


def test_moments_of_a_raster():
    boundary, x = polygon(3)
    cell = 0.7
    index = cells_over(x, cell)
    m = cell_moments(boundary, x, cell, index, np.zeros(index.shape[1], int))
    xi, eta = (g.ravel() for g in np.meshgrid(*2 * [(np.arange(200) + 0.5) / 200], indexing="ij"))
    monomials = np.stack([np.ones_like(xi), xi, eta, xi * eta, xi**2, eta**2])
    outer, hole = Path(x[:, :7].T), Path(x[:, 7:].T)
    for c in range(index.shape[1]):
        place = cell * (index[:, c, None] + np.stack([xi, eta])).T
        inside = outer.contains_points(place) & ~hole.contains_points(place)
        assert np.abs((monomials * inside).mean(axis=1) - m[:, c]).max() < 2e-3


def test_a_square_on_grid_lines_and_bodies_apart():
    square = np.array([[0.0, 2, 2, 0], [0, 0, 2, 2]])
    boundary = outlines([[np.arange(4)], [np.arange(4)]], [0, 4])
    x = np.concatenate([square, square + 0.5], axis=1)
    index = np.array([[0, 1, 0, 2, 2, 5], [0, 1, 0, 2, 0, 5]])
    m = cell_moments(boundary, x, 1.0, index, np.array([0, 0, 1, 1, 0, 1]))
    full = [1, 0.5, 0.5, 0.25, 1 / 3, 1 / 3]
    corner = [0.25, 0.25 * 0.75, 0.25 * 0.75, 0.25 * 0.75**2, 0.5 * 7 / 24, 0.5 * 7 / 24]
    assert np.allclose(m[:, :2].T, full)
    assert np.allclose(m[:, 2], corner)
    assert np.allclose(m[:, 3], [0.25, 0.0625, 0.0625, 0.015625, 1 / 48, 1 / 48])
    assert np.abs(m[:, 4:]).max() < 1e-15
