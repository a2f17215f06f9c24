"""Vectorised assembly against the scikit-fem forms that define it, and the facets of the ghost penalty."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from skmpm.grid import build_grids, forms
from skmpm.grid.assembly import POOR_FILLING, ghost_facets, prepare
from skmpm.material import Anchored, LinearElastic, NeoHookean

CELL = 0.2
SEED = st.integers(0, 2**32 - 1)
MATERIALS = [LinearElastic(1e7, 0.45, 990.0), NeoHookean(2e6, 0.3, 1200.0)]


def random_assembly(seed, bodies=3, points=25, ghost=0.0):
    """Bodies of random points on top of each other, shuffled, with cells of every filling."""
    rng = np.random.default_rng(seed)
    body = rng.permutation(np.repeat(np.arange(bodies), points))
    extent = rng.uniform(0.5, 5.0, size=(2, bodies)) * CELL
    x = rng.uniform(-2.0, 2.0, size=(2, bodies))[:, body] * CELL + extent[:, body] * rng.uniform(size=(2, body.size))
    volume = rng.uniform(0.02, 0.5, body.size) * CELL**2
    mass = rng.uniform(900.0, 1100.0, body.size) * volume
    grid = build_grids(x, body, CELL, bodies)
    modulus = ghost * rng.uniform(1e5, 1e7, bodies)
    fast = prepare(grid, volume, mass, modulus[grid.cell_body])
    return rng, body, grid, volume, mass, modulus, fast


def random_gradients(rng, n, size=0.25):
    """Deformation gradients with J > 0."""
    return np.eye(2)[:, :, None] + rng.uniform(-size, size, size=(2, 2, n))


def of_bodies(body, name, F, F_anchor=None):
    """What each body's own material says at its points; bodies alternate between the two laws."""
    answers = [getattr(Anchored(m, F_anchor), name)(F) for m in MATERIALS]
    return np.where(body % 2 == 0, answers[0], answers[1])


def mesh_facets(grid, volume):
    """Interior facets of scikit-fem's mesh beside a poorly filled cell, and the body of each."""
    fill = np.zeros(grid.cells)
    np.add.at(fill, grid.cell_of_point, volume / grid.cell**2)
    first, second = grid.mesh.f2t
    poor = (second >= 0) & (np.minimum(fill[first], fill[second]) < POOR_FILLING)
    return np.flatnonzero(poor), grid.cell_body[first[poor]]


def ghost_by_forms(grid, volume, modulus):
    facets, owner = mesh_facets(grid, volume)
    size = 2 * grid.nodes
    matrix = np.zeros((size, size))
    for b in np.unique(owner):
        matrix += modulus[b] * forms.ghost_matrix(grid.mesh, facets[owner == b], grid.cell).toarray()
    return matrix


def assert_close(actual, expected, tol=1e-12):
    assert actual.shape == expected.shape
    assert abs(actual - expected).max() <= tol * abs(expected).max()


# Against the forms.


@given(SEED, st.booleans())
def test_stiffness_of_mixed_bodies_equals_the_form(seed, regridded_state):
    rng, body, grid, volume, _, _, fast = random_assembly(seed)
    F = random_gradients(rng, body.size)
    F_anchor = random_gradients(rng, body.size) if regridded_state else None
    C = of_bodies(body, "tangent", F, F_anchor)
    expected = forms.stiffness.assemble(grid.basis(volume), C=C[..., None])
    K = fast.matrix(fast.stiffness(C), 1.0).toarray() - np.diag(fast.mass)
    assert_close(K, expected.toarray())


@given(SEED)
def test_stiffness_of_any_symmetric_tangent_equals_the_form(seed):
    rng, body, grid, volume, *_ = random_assembly(seed, bodies=2, points=10)
    C = rng.normal(size=(4, 4, body.size))
    C = (C + C.swapaxes(0, 1)).reshape(2, 2, 2, 2, -1)
    expected = forms.stiffness.assemble(grid.basis(volume), C=C[..., None])
    massless = prepare(grid, volume, np.zeros(body.size), np.zeros(grid.cells))
    assert_close(massless.matrix(massless.stiffness(C), 1.0).toarray(), expected.toarray())


@given(SEED)
def test_the_pattern_is_that_of_cells_and_ghost_facets_with_ascending_columns(seed):
    """SciPy sums the same pairs of nodes, from the cells and from the facets of scikit-fem's mesh, and sorts them."""
    _, _, grid, volume, _, _, fast = random_assembly(seed, ghost=0.01)
    facets = grid.mesh.f2t[:, mesh_facets(grid, volume)[0]]
    pairs = [(a, b) for cell in grid.nodes_of_cell.T for a in cell for b in cell]
    for lower, upper in facets.T:
        nodes = set(grid.nodes_of_cell[:, lower]) | set(grid.nodes_of_cell[:, upper])
        pairs += [(a, b) for a in nodes for b in nodes]
    expected = sp.coo_array((np.ones(len(pairs)), np.array(pairs).T), shape=(grid.nodes, grid.nodes)).tocsr()
    assert np.array_equal(fast.indptr, expected.indptr)
    assert np.array_equal(fast.indices, expected.sorted_indices().indices)
    A = fast.matrix(fast.stiffness(np.zeros((2, 2, 2, 2, volume.size))), 1.0)
    assert A.blocksize == (2, 2) and A.shape == (2 * grid.nodes,) * 2


@given(SEED, st.booleans())
def test_internal_force_equals_the_form(seed, regridded_state):
    rng, body, grid, volume, _, _, fast = random_assembly(seed)
    F = random_gradients(rng, body.size)
    F_anchor = random_gradients(rng, body.size) if regridded_state else None
    P = of_bodies(body, "stress", F, F_anchor)
    assert_close(fast.internal_force(P), forms.internal_force.assemble(grid.basis(volume), P=P[..., None]))


@given(SEED)
def test_lumped_mass_is_the_row_sum_of_the_consistent_mass(seed):
    _, body, grid, volume, mass, _, fast = random_assembly(seed)
    M = forms.mass.assemble(grid.basis(volume), rho=(mass / volume)[:, None])
    assert_close(fast.mass, np.asarray(M.sum(axis=1)).ravel())
    for b in np.unique(body):
        own = fast.mass[grid.blocks[b] : grid.blocks[b + 1] : 2]
        assert own.sum() == pytest.approx(mass[body == b].sum(), rel=1e-13)


@settings(max_examples=25)
@given(SEED)
def test_ghost_stiffness_equals_the_facet_form_on_the_disconnected_mesh(seed):
    rng, body, grid, volume, _, modulus, fast = random_assembly(seed, ghost=0.01)
    expected = ghost_by_forms(grid, volume, modulus)
    field = rng.normal(size=2 * grid.nodes)
    assert_close(np.kron(fast.ghost.toarray(), np.eye(2)), expected)
    assert_close(fast.ghost_force(field), expected @ field)
    K = fast.stiffness(np.zeros((2, 2, 2, 2, body.size)))
    assert_close(fast.matrix(K, 1.0).toarray() - np.diag(fast.mass), expected, 1e-11)


@settings(max_examples=25)
@given(SEED, st.floats(1e-8, 1e2))
def test_system_matrix_is_mass_plus_factor_times_stiffness_and_ghost(seed, factor):
    rng, body, grid, volume, mass, modulus, fast = random_assembly(seed, ghost=0.01)
    C = of_bodies(body, "tangent", random_gradients(rng, body.size))
    values, vectors = np.linalg.eigh(np.moveaxis(C.reshape(4, 4, -1), -1, 0))
    C = np.einsum("pij,pj,pkj->ikp", vectors, np.maximum(values, 0.0), vectors).reshape(C.shape)
    K = forms.stiffness.assemble(grid.basis(volume), C=C[..., None]).toarray()
    K += ghost_by_forms(grid, volume, modulus)
    data = fast.stiffness(C)
    matrix = fast.matrix(data, factor)
    assert np.shares_memory(matrix.data, data)  # not in memory twice
    A = matrix.toarray()
    assert_close(A, np.diag(np.repeat(grid.interpolation.T @ mass, 2)) + factor * K)
    assert_close(A, A.T)
    assert np.linalg.eigvalsh(A / np.sqrt(np.outer(A.diagonal(), A.diagonal()))).min() > 0


def test_stiffness_is_the_derivative_of_the_internal_force_in_every_unknown():
    rng, _, grid, _, _, _, fast = random_assembly(4, bodies=2, points=12)
    u = 0.02 * CELL * rng.normal(size=2 * grid.nodes)
    solid = MATERIALS[1]
    F = np.eye(2)[:, :, None] + grid.gradient_at_points(u)
    K = fast.matrix(fast.stiffness(solid.tangent(F)), 1.0).toarray() - np.diag(fast.mass)
    for k, column in enumerate(K.T):
        d = np.zeros(u.size)
        d[k] = 1.0
        P = solid.stress(F + 1e-30j * grid.gradient_at_points(d)).imag / 1e-30
        assert_close(fast.internal_force(P), column, 1e-11)


# The ghost penalty.


@given(SEED)
def test_ghost_penalty_is_zero_for_linear_fields_and_never_negative(seed):
    rng, _, grid, _, _, _, fast = random_assembly(seed, ghost=0.01)
    a, G = rng.normal(size=(2, 1)), rng.normal(size=(2, 2))
    field = (a + G @ grid.position).T.ravel()
    assert np.abs(fast.ghost_force(field)).max() <= 1e-13 * abs(fast.ghost).max() * np.abs(field).max()
    ghost = fast.ghost.toarray()
    assert np.linalg.eigvalsh(ghost).min() >= -1e-13 * ghost.max()


@given(SEED, st.floats(0.5, 100.0))
def test_ghost_facets_are_inside_bodies_beside_poorly_filled_cells_and_all_of_those(seed, factor):
    _, _, grid, volume, *_ = random_assembly(seed)
    volume = factor * volume
    nodes, cells = ghost_facets(grid, volume)
    owner = grid.cell_body[cells[0]]
    assert np.array_equal(owner, grid.cell_body[cells[1]])
    facets, expected_owner = mesh_facets(grid, volume)
    ends = np.sort(nodes[[1, 4]], axis=0)  # the facet itself; the other four nodes are beside it
    expected = np.sort(grid.mesh.facets[:, facets], axis=0)
    order, expected_order = np.lexsort(ends), np.lexsort(expected)
    assert np.array_equal(ends[:, order], expected[:, expected_order])
    assert np.array_equal(owner[order], expected_owner[expected_order])


@pytest.mark.parametrize("shift", [0, -(10**6), 10**12])
def test_ghost_facets_surround_the_one_cell_that_is_filled_less_than_the_threshold(shift):
    index = np.stack(np.meshgrid(np.arange(4), np.arange(3))).reshape(2, -1)
    x = np.hstack([index, index + shift]) + 0.5
    volume = np.where((x[0] == 1.5) & (x[1] == 1.5), 0.59, 0.6)
    body = np.repeat([0, 1], 12)
    grid = build_grids(x, body, 1.0, 2)
    nodes, cells = ghost_facets(grid, volume)
    owner = grid.cell_body[cells[0]]
    assert np.array_equal(np.unique(owner), [0] if shift else [0, 1])
    assert np.count_nonzero(owner == 0) == 4
    middle = grid.nodes_of_cell[:, (grid.cell_index == 1).all(axis=0) & (grid.cell_body == 0)]
    assert np.isin(nodes[[1, 4]][:, owner == 0], middle).all()


def test_full_cells_and_a_zero_modulus_have_no_ghost_penalty():
    x = np.stack(np.meshgrid(np.arange(4), np.arange(3))).reshape(2, -1) + 0.5
    body, one = np.zeros(12, int), np.ones(12)
    grid = build_grids(x, body, 1.0, 1)
    full = prepare(grid, one, one, np.ones(grid.cells))
    off = prepare(grid, 0.1 * one, one, np.zeros(grid.cells))
    on = prepare(grid, 0.1 * one, one, np.ones(grid.cells))
    assert full.ghost.dtype == np.float64
    assert not full.ghost.data.any() and not off.ghost.data.any()
    assert on.ghost.data.any()
    assert full.indices.size == off.indices.size < on.indices.size  # nor its wider pattern


# Corner cases.


def test_a_point_on_a_grid_line_leaves_no_node_without_mass():
    x = np.array([[0.5, 1.0], [1.0, 2.0]])
    grid, mass = build_grids(x, np.zeros(2, int), 1.0, 1), np.array([2.0, 3.0])
    fast = prepare(grid, np.ones(2), mass, np.ones(grid.cells))
    M = fast.mass
    assert M.min() > 0.0
    assert M[0::2].sum() == pytest.approx(5.0, rel=1e-11)
    assert fast.lumped[0::2].sum() == pytest.approx(5.0, rel=1e-15)


def test_bodies_of_one_point_and_of_none_are_assembled():
    grid = build_grids(np.array([[0.3], [0.4]]), np.array([1]), 1.0, 3)
    fast = prepare(grid, np.array([0.2]), np.array([5.0]), np.ones(grid.cells))
    C = MATERIALS[0].tangent(np.eye(2)[:, :, None])
    A = fast.matrix(fast.stiffness(C), 1.0)
    expected = forms.stiffness.assemble(grid.basis(fast.volume), C=C[..., None]).toarray() + np.diag(fast.mass)
    assert_close(A.toarray(), expected)
