"""Velocity transfer: rigid motions, linear and angular momentum, and the form that defines it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skmpm.grid import build_grids, forms
from skmpm.grid.assembly import prepare
from skmpm.grid.transfer import nodal_velocity, to_nodes, to_points

CELL = 0.3
SEED = st.integers(0, 2**32 - 1)


def random_assembly(seed, bodies=3, points=30):
    """Bodies of random points on top of each other: (rng, x, body, mass, assembly)."""
    rng = np.random.default_rng(seed)
    body = rng.permutation(np.repeat(np.arange(bodies), points))
    x = CELL * (rng.uniform(-2, 2, (2, bodies))[:, body] + 4 * rng.uniform(size=(2, body.size)))
    volume = rng.uniform(0.05, 0.2, body.size) * CELL**2
    mass = rng.uniform(500.0, 2000.0, body.size) * volume
    grid = build_grids(x, body, CELL, bodies)
    return rng, x, body, mass, prepare(grid, volume, mass, np.zeros(grid.cells))


def affine(rng, kind):
    """A velocity v + G x: (v (2, 1), G (2, 2))."""
    v, omega = rng.normal(size=(2, 1)), rng.normal()
    spin = omega * np.array([[0.0, -1.0], [1.0, 0.0]])
    return {
        "translation": (v, np.zeros((2, 2))),
        "rotation": (v, spin),
        "any affine field": (v, rng.normal(size=(2, 2))),
    }[kind]


def at_nodes(grid, v, G):
    return (v + G @ grid.position).T.ravel()


def everywhere(G, n):
    return np.repeat(G[:, :, None], n, axis=2)


def nodal_momentum(assembly, nodal):
    return (assembly.mass * nodal).reshape(-1, 2).T


def cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def angular_momentum(grid, x, mass, v, C):
    """About the origin, with what the affine field adds: m D C, D the second moments of the shape functions.

    Jiang et al., ACM ToG 34 (2015), eq. 12; for bilinear functions D = diag(h^2 xi (1 - xi)).
    """
    D = CELL**2 * grid.local * (1 - grid.local)
    return mass * (cross(x, v) + C[1, 0] * D[0] - C[0, 1] * D[1])


# To the nodes.


@given(SEED)
def test_nodal_velocity_is_the_momentum_form_over_the_lumped_mass(seed):
    rng, x, _, mass, assembly = random_assembly(seed)
    v = rng.normal(size=x.shape)
    basis = assembly.grid.basis(assembly.volume)
    P = forms.momentum.assemble(basis, rho=(mass / assembly.volume)[:, None], velocity=v[..., None])
    nodal = to_nodes(assembly, mass, v, np.zeros((2, 2, mass.size)))
    assert np.abs(nodal - P / assembly.mass).max() < 1e-12


@given(SEED)
def test_known_velocities_are_kept_where_points_have_them(seed):
    """Bit for bit; those of bodies of which one entry of v or of C is another are transferred."""
    rng, _, body, mass, assembly = random_assembly(seed)
    known, grid = rng.normal(size=assembly.mass.size), assembly.grid
    v, C = to_points(grid, known)
    assert np.array_equal(nodal_velocity(assembly, mass, v, C, known=known), known)
    moved, turned, p = v.copy(), C.copy(), rng.integers(mass.size)
    moved[1, p] += 1e-12
    turned[0, 1, p] += 1e-12
    own = np.repeat(grid.node_body == body[p], 2)
    for at in ((moved, C), (v, turned)):
        found, transferred = nodal_velocity(assembly, mass, *at, known=known), to_nodes(assembly, mass, *at)
        assert np.array_equal(found, np.where(own, transferred, known))
        assert not np.array_equal(found, known)
    for at in ((v, np.zeros_like(C)), (0.5 * v, 0.5 * C)):
        assert np.array_equal(nodal_velocity(assembly, mass, *at, known=known), to_nodes(assembly, mass, *at))
    assert np.array_equal(nodal_velocity(assembly, mass, v, C, known=np.zeros(0)), to_nodes(assembly, mass, v, C))


@given(SEED)
def test_the_affine_part_is_that_of_its_definition_point_by_point(seed):
    rng, x, _, mass, assembly = random_assembly(seed, points=5)
    grid = assembly.grid
    v, C = rng.normal(size=x.shape), rng.normal(size=(2, 2, mass.size))
    P = np.zeros((grid.nodes, 2))
    for p in range(mass.size):
        for k, node in enumerate(grid.nodes_of_cell[:, grid.cell_of_point[p]]):
            arm = grid.position[:, node] - x[:, p]
            P[node] += mass[p] * grid.shape[k, p] * (v[:, p] + C[:, :, p] @ arm)
    nodal = to_nodes(assembly, mass, v, C)
    assert np.abs(nodal_momentum(assembly, nodal) - P.T).max() < 1e-12 * np.abs(P).max()


@given(SEED)
def test_momentum_of_every_body_is_conserved_on_the_way_to_the_nodes(seed):
    rng, x, body, mass, assembly = random_assembly(seed)
    v, C = rng.normal(size=x.shape), rng.normal(size=(2, 2, mass.size))
    P = nodal_momentum(assembly, to_nodes(assembly, mass, v, C))
    for b in np.unique(body):
        expected = (mass * v)[:, body == b].sum(axis=1)
        assert np.abs(P[:, assembly.grid.node_body == b].sum(axis=1) - expected).max() < 1e-13 * mass.sum()


@given(SEED)
def test_momentum_is_conserved_on_the_way_back(seed):
    rng, _, _, mass, assembly = random_assembly(seed)
    nodal = rng.normal(size=assembly.mass.size)
    v, _ = to_points(assembly.grid, nodal)
    assert np.abs((mass * v).sum(1) - nodal_momentum(assembly, nodal).sum(1)).max() < 1e-12 * mass.sum()


@given(SEED, st.sampled_from(["translation", "rotation", "any affine field"]))
def test_affine_fields_reach_the_nodes_exactly_with_their_gradient(seed, kind):
    rng, x, _, mass, assembly = random_assembly(seed)
    v, G = affine(rng, kind)
    nodal = to_nodes(assembly, mass, v + G @ x, everywhere(G, mass.size))
    assert np.abs(nodal - at_nodes(assembly.grid, v, G)).max() < 1e-11


# Back to the points.


@given(SEED, st.sampled_from(["translation", "rotation", "any affine field"]))
def test_points_take_affine_fields_exactly(seed, kind):
    rng, x, _, mass, assembly = random_assembly(seed)
    v0, G = affine(rng, kind)
    v, C = to_points(assembly.grid, at_nodes(assembly.grid, v0, G))
    assert np.abs(v - (v0 + G @ x)).max() < 1e-12
    assert np.abs(C - everywhere(G, mass.size)).max() < 1e-11


@given(SEED)
def test_a_translation_survives_the_round_trip(seed):
    rng, x, _, mass, assembly = random_assembly(seed)
    v = np.broadcast_to(rng.normal(size=(2, 1)), x.shape)
    new, C = to_points(assembly.grid, to_nodes(assembly, mass, v, np.zeros((2, 2, mass.size))))
    assert np.abs(new - v).max() < 1e-12 and np.abs(C).max() < 1e-11


# Angular momentum.


@given(SEED)
def test_the_angular_momentum_of_any_motion_is_kept_through_the_round_trip(seed):
    """Points to nodes, nodes to points, points to nodes: each body, with the lumped mass."""
    rng, x, body, mass, assembly = random_assembly(seed)
    grid = assembly.grid
    v, C = rng.normal(size=x.shape), rng.normal(size=(2, 2, mass.size))
    for _ in range(3):
        at_points = angular_momentum(grid, x, mass, v, C)
        nodal = to_nodes(assembly, mass, v, C)
        at_the_nodes = cross(grid.position, nodal_momentum(assembly, nodal))
        v, C = to_points(grid, nodal)
        after = angular_momentum(grid, x, mass, v, C)
        for b in np.unique(body):
            scale = 1e-12 * mass.sum() * np.abs(grid.position).max()
            expected = at_points[body == b].sum()
            assert abs(at_the_nodes[grid.node_body == b].sum() - expected) < scale
            assert abs(after[body == b].sum() - expected) < scale


@given(SEED)
def test_a_rigid_rotation_is_kept(seed):
    _, x, _, mass, assembly = random_assembly(seed, bodies=1)
    spin = np.array([[0.0, -1.0], [1.0, 0.0]])
    rigid = spin @ (x - (mass * x).sum(axis=1, keepdims=True) / mass.sum())
    v, C = rigid, everywhere(spin, mass.size)
    for _ in range(3):
        v, C = to_points(assembly.grid, to_nodes(assembly, mass, v, C))
    assert np.abs(v - rigid).max() < 1e-11 and np.abs(C - spin[:, :, None]).max() < 1e-10


# Corner cases.


def test_points_on_grid_lines_give_finite_velocities():
    x = np.array([[0.0, CELL, 0.5 * CELL], [0.0, CELL, CELL]])
    grid = build_grids(x, np.zeros(3, int), CELL, 1)
    mass = np.ones(3)
    fast = prepare(grid, 0.01 * mass, mass, np.zeros(grid.cells))
    nodal = to_nodes(fast, mass, np.ones((2, 3)), np.zeros((2, 2, 3)))
    assert np.isfinite(nodal).all() and np.abs(nodal).max() < 1 + 1e-12
    np.testing.assert_allclose(grid.at_points(nodal), 1.0, rtol=1e-11)


def test_a_body_of_one_point_keeps_its_velocity():
    grid = build_grids(np.array([[0.1], [0.2]]), np.array([0]), CELL, 1)
    mass, v = np.array([2.0]), np.array([[3.0], [-1.0]])
    nodal = to_nodes(prepare(grid, np.array([0.01]), mass, np.zeros(grid.cells)), mass, v, np.zeros((2, 2, 1)))
    new, C = to_points(grid, nodal)
    assert np.abs(new - v).max() < 1e-14 and np.abs(C).max() < 1e-12
    assert new.shape == (2, 1) and C.shape == (2, 2, 1)


def test_velocities_of_other_nodes_are_refused():
    _, _, _, _, assembly = random_assembly(0)
    with pytest.raises(ValueError, match=r"to_points: nodal has the shape \(4,\); give velocities \(\d+,\) of nodes"):
        to_points(assembly.grid, np.ones(4))
