"""Nodal masses of explicit steps: bounded from below, with the mass and the centre of every body."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skmpm.explicit_mass import MIN_MASS, explicit_mass
from skmpm.grid import build_grids
from skmpm.implicit.explicit import with_momentum_of_points
from skmpm.points import disc

CELL = 0.1


def grid_of(radius, seed, bodies=2):
    """Body grids of discs of that many cells at any places, and masses of their nodes."""
    centres = CELL * np.random.default_rng(seed).uniform(size=(bodies, 2))
    points = [disc(centre, radius * CELL, spacing=0.3 * CELL) for centre in centres]
    body = np.repeat(np.arange(bodies), [p.volume.size for p in points])
    grid = build_grids(np.concatenate([p.x for p in points], axis=1), body, CELL, bodies)
    return grid, grid.interpolation.T @ np.concatenate([p.volume for p in points])


def moments(grid, mass):
    """Mass, first moments and moment of inertia of the bodies, (4, bodies)."""
    x = grid.position
    return grid.sums(mass * np.stack([np.ones(grid.nodes), *x, (x**2).sum(axis=0)]))


@given(st.floats(3.0, 8.0), st.integers(0, 10_000))
def test_no_node_is_light_and_bodies_keep_their_mass_and_centre(radius, seed):
    """Masses to round-off; the moment of inertia grows by two cells squared, or four, times the added mass."""
    grid, lumped = grid_of(radius, seed)
    mass = explicit_mass(grid, lumped)
    heaviest = np.array([lumped[grid.node_body == b].max() for b in range(grid.bodies)])
    assert (mass >= MIN_MASS * heaviest[grid.node_body] * (1.0 - 1e-12)).all()
    before, after = moments(grid, lumped), moments(grid, mass)
    np.testing.assert_allclose(after[:3], before[:3], rtol=1e-11, atol=1e-11 * before[0].max() * CELL)
    added = grid.sums(np.maximum(MIN_MASS * heaviest[grid.node_body] - lumped, 0.0)[None])[0]
    more = (after[3] - before[3]) / CELL**2
    assert (more >= (2.0 - 1e-9) * added).all()
    assert (more <= (4.0 + 1e-9) * added).all()


def test_bodies_without_light_nodes_keep_their_masses():
    """Points in the middle of three by three cells: the lightest node has a sixteenth of the heaviest one."""
    x = CELL * (np.stack(np.meshgrid(np.arange(3), np.arange(3))).reshape(2, -1) + 0.5)
    grid = build_grids(x, np.zeros(9, dtype=int), CELL, 1)
    lumped = grid.interpolation.T @ np.ones(9)
    assert lumped.min() == pytest.approx(0.25 * lumped.max())
    np.testing.assert_allclose(explicit_mass(grid, lumped), lumped, rtol=1e-14)


def test_a_body_one_cell_wide_takes_mass_from_all_its_nodes():
    """A row of cells whose points lie near one side: no node has two more behind it, the mass is kept."""
    x = np.stack([CELL * (np.arange(8) + 0.5), np.full(8, 0.01 * CELL)])
    grid = build_grids(x, np.zeros(8, dtype=int), CELL, 1)
    lumped = grid.interpolation.T @ np.ones(8)
    assert lumped.min() < 0.01 * lumped.max()
    mass = explicit_mass(grid, lumped)
    assert mass.sum() == pytest.approx(lumped.sum(), rel=1e-14)
    assert mass.min() > 0.9 * MIN_MASS * mass.max()


def test_velocities_balance_momentum_and_angular_momentum_of_free_bodies():
    """Any velocities and impulses; a body that is held stays as it is."""
    grid, lumped = grid_of(5.0, 1, bodies=3)
    rng = np.random.default_rng(2)
    v0, w, impulse = rng.normal(size=(3, 2 * grid.nodes))
    x = grid.position + 0.1 * CELL * rng.normal(size=(2, grid.nodes))
    v = with_momentum_of_points(grid, x, np.repeat(lumped, 2), v0, w, impulse, np.array([1]))
    out = (np.repeat(lumped, 2) * (v - v0) - impulse).reshape(-1, 2).T
    sums = grid.sums(np.stack([*out, x[0] * out[1] - x[1] * out[0]]))
    size = grid.sums(np.abs(impulse.reshape(-1, 2).T))[0]
    assert np.abs(sums[:, [0, 2]] / size[[0, 2]]).max() < 1e-12
    held = np.repeat(grid.node_body == 1, 2)
    np.testing.assert_array_equal(v[held], w[held])
    assert np.abs(v - w)[~held].min() > 0.0
