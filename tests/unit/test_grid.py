"""Body grids: numbering, mapping and interpolation against direct computation and standard scikit-fem."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skfem import CellBasis, ElementQuad1, ElementVector, MeshQuad
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity
from skfem.quadrature import get_quadrature

from skmpm.grid import CORNERS, build_grids, forms, numbered
from skmpm.grid.building import TABLE_RATIO
from skmpm.material import LinearElastic

CELL = 0.25  # a power of two: positions on grid lines are exact
SEED = st.integers(0, 2**32 - 1)


def random_points(seed, bodies=4, points=40):
    """Points of several bodies on top of each other, in random order."""
    rng = np.random.default_rng(seed)
    body = rng.permutation(np.repeat(np.arange(bodies), points))
    extent = rng.uniform(0.3, 6.0, size=(2, bodies)) * CELL
    corner = rng.uniform(-3.0, 3.0, size=(2, bodies)) * CELL
    return corner[:, body] + extent[:, body] * rng.uniform(size=(2, body.size)), body


def random_sheets(seed, bodies=4, points=40):
    x, body = random_points(seed, bodies, points)
    return x, body, build_grids(x, body, CELL, bodies)


def gauss_points(shapes, corners):
    """The 2 x 2 Gauss points of full rectangles of cells, one rectangle per body: x, volume, body."""
    X, W = get_quadrature(ElementQuad1().refdom, 3)
    x, volume, body = [], [], []
    for b, (shape, corner) in enumerate(zip(shapes, corners, strict=True)):
        cells = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij")).reshape(2, -1)
        cells += np.reshape(corner, (2, 1))
        x.append(CELL * (cells[:, :, None] + X[:, None, :]).reshape(2, -1))
        volume.append(np.tile(CELL**2 * W, cells.shape[1]))
        body.append(np.full(volume[-1].size, b))
    return np.concatenate(x, axis=1), np.concatenate(volume), np.concatenate(body)


def assert_close(actual, expected, tol=1e-12):
    """Largest difference as a share of the largest entry."""
    assert actual.shape == expected.shape
    assert abs(actual - expected).max() <= tol * abs(expected).max()


def plain_matrices(basis, rho, E, nu):
    """Mass and stiffness as any scikit-fem user would write them."""
    return (
        forms.BilinearForm(lambda u, v, w: rho * dot(u, v)).assemble(basis),
        linear_elasticity(*lame_parameters(E, nu)).assemble(basis),
    )


def our_matrices(basis, rho, E, nu):
    C = LinearElastic(E, nu, rho).tangent(np.zeros((2, 2, 1)))[..., None]
    return forms.mass.assemble(basis, rho=rho), forms.stiffness.assemble(basis, C=C)


# Points at the Gauss points of full cells: MPM is FEM.


def test_at_gauss_points_mass_and_stiffness_are_those_of_scikit_fem_on_its_own_mesh():
    x, volume, body = gauss_points([(5, 3)], [(-2, 7)])
    grid = build_grids(x, body, CELL, 1)
    mesh = MeshQuad.init_tensor(CELL * np.arange(-2, 4), CELL * np.arange(7, 11))
    # Numbers of our nodes in the mesh that scikit-fem numbered.
    distance = np.abs(mesh.p[:, :, None] - grid.position[:, None, :]).max(axis=0)
    node = distance.argmin(axis=0)
    assert distance.min(axis=0).max() < 1e-14 and np.unique(node).size == mesh.nvertices == grid.nodes
    dof = (2 * node[:, None] + np.arange(2)).ravel()
    plain = CellBasis(mesh, ElementVector(ElementQuad1()))
    for ours, theirs in zip(
        our_matrices(grid.basis(volume), 990.0, 1e7, 0.45), plain_matrices(plain, 990.0, 1e7, 0.45), strict=True
    ):
        assert_close(ours.toarray(), theirs.toarray()[np.ix_(dof, dof)])


def test_at_gauss_points_the_point_basis_equals_the_plain_basis_for_several_bodies():
    x, volume, body = gauss_points([(4, 3), (2, 6), (1, 1)], [(0, 0), (1, 1), (-5, 2)])
    grid = build_grids(x, body, CELL, 3)
    standard = CellBasis(grid.mesh, ElementVector(ElementQuad1()))  # scikit-fem's own rule
    for ours, theirs in zip(
        our_matrices(grid.basis(volume), 990.0, 1e7, 0.3), plain_matrices(standard, 990.0, 1e7, 0.3), strict=True
    ):
        assert_close(ours.toarray(), theirs.toarray())


def test_the_quadrature_of_the_point_basis_is_the_points_and_their_volumes():
    x, _, grid = random_sheets(1)
    volume = np.random.default_rng(0).uniform(0.1, 1.0, x.shape[1])
    basis = grid.basis(volume)
    assert_close(basis.dx[:, 0], volume)
    assert_close(np.asarray(basis.default_parameters()["x"])[:, :, 0], x)


# Numbering.


@given(SEED)
def test_bodies_share_no_node_and_cells_have_their_four_corners_in_order(seed):
    _, body, grid = random_sheets(seed)
    assert np.array_equal(grid.cell_body[grid.cell_of_point], body)
    assert np.array_equal(grid.node_body[grid.nodes_of_cell], np.broadcast_to(grid.cell_body, (4, grid.cells)))
    corners = grid.cell_index[:, None, :] + CORNERS[:, :, None]
    assert np.array_equal(grid.node_index[:, grid.nodes_of_cell], corners)
    reference = ElementQuad1().doflocs.T
    assert np.array_equal(reference, CORNERS)


@given(SEED)
def test_pairs_of_body_and_cell_or_node_are_numbered_once_and_none_is_empty(seed):
    x, body, grid = random_sheets(seed)
    for index, owner in ((grid.cell_index, grid.cell_body), (grid.node_index, grid.node_body)):
        assert np.unique(np.vstack([index, owner]), axis=1).shape[1] == owner.size
    expected = np.unique(np.vstack([np.floor(x / CELL), body]), axis=1)
    assert expected.shape[1] == grid.cells == np.unique(grid.cell_of_point).size
    assert np.array_equal(np.unique(grid.nodes_of_cell), np.arange(grid.nodes))


@given(st.lists(st.integers(0, 19), max_size=12), st.integers(20, 400))
def test_keys_are_numbered_in_ascending_order_by_table_and_by_sorting(keys, size):
    """Python's own sorted set is the reference; sizes lie on both sides of the change from table to sorting."""
    key = np.array(keys, dtype=np.int64)
    number, where = numbered(key, size)
    distinct = sorted(set(keys))
    assert [distinct[n] for n in number] == keys
    assert key[where].tolist() == distinct
    assert TABLE_RATIO * 12 < 400


@given(SEED)
def test_assembled_matrices_are_block_diagonal(seed):
    x, _, grid = random_sheets(seed, bodies=3, points=15)
    M = forms.mass.assemble(grid.basis(np.ones(x.shape[1])), rho=1.0).tocoo()
    owner = np.searchsorted(grid.blocks, np.arange(2 * grid.nodes), side="right") - 1
    assert grid.blocks[0] == 0 and grid.blocks[-1] == 2 * grid.nodes
    assert np.array_equal(owner, np.repeat(grid.node_body, 2))
    assert np.array_equal(owner[M.row], owner[M.col])


@pytest.mark.parametrize("shape", [(3, 50), (50, 3)])
def test_numbering_runs_along_the_shorter_side(shape):
    x, _, body = gauss_points([shape, shape], [(0, 0), (200, -80)])
    grid = build_grids(x, body, CELL, 2)
    # Four nodes along the short side: a cell spans one row and one node.
    assert np.ptp(grid.nodes_of_cell, axis=0).max() == 4 + 1


# Points on grid lines and corners, far bodies, translations, empty bodies.


@pytest.mark.parametrize("direction", [(1, 1), (-1, 1), (-1, -1), (1, -1)])
def test_inward_decides_the_cell_of_a_point_on_a_corner(direction):
    x = np.array([[2.0], [-3.0]]) * CELL
    inward = np.array(direction)[:, None] / np.sqrt(2.0)
    grid = build_grids(x, np.array([0]), CELL, 1, inward)
    expected = np.array([[2], [-3]]) + np.minimum(np.array(direction)[:, None], 0)
    assert np.array_equal(grid.cell_index, expected)
    assert np.array_equal(grid.local[:, 0], expected[:, 0] != [2, -3])


def test_points_on_grid_lines_without_inward_belong_to_the_upper_cell():
    x = np.array([[0.0, 0.5, -1.0], [0.5, 0.0, -1.0]]) * CELL
    grid = build_grids(x, np.zeros(3, int), CELL, 1)
    cells = grid.cell_index[:, grid.cell_of_point]
    assert np.array_equal(cells, [[0, 0, -1], [0, 0, -1]])
    assert np.array_equal(grid.local, [[0.0, 0.5, 0.0], [0.5, 0.0, 0.0]])


def test_a_square_with_its_boundary_on_grid_lines_occupies_only_its_own_cells():
    s = np.linspace(0.0, 3.0, 13) * CELL
    x = np.stack(np.meshgrid(s, s)).reshape(2, -1)
    inward = 1.5 * CELL - x
    length = np.hypot(*inward)
    inward = np.divide(inward, length, out=np.zeros_like(x), where=length > 0)
    body = np.zeros(x.shape[1], int)
    assert build_grids(x, body, CELL, 1, inward).cells == 9
    assert build_grids(x, body, CELL, 1).cells == 16  # what `inward` is for


@given(SEED)
def test_inward_does_not_move_points_inside_cells(seed):
    x, body, plain = random_sheets(seed)
    angle = np.random.default_rng(seed).uniform(0, 2 * np.pi, body.size)
    leaning = build_grids(x, body, CELL, 4, np.stack([np.cos(angle), np.sin(angle)]))
    assert np.array_equal(leaning.local, plain.local)
    assert np.array_equal(leaning.nodes_of_cell, plain.nodes_of_cell)


@given(SEED, st.integers(-(10**6), 10**6), st.integers(-(10**6), 10**6))
def test_translation_by_whole_cells_keeps_numbering_and_local_coordinates(seed, i, j):
    x, body, here = random_sheets(seed)
    x = np.round(x / CELL * 2**20) / 2**20 * CELL  # so that the translation itself is exact
    shift = np.array([[i], [j]])
    here, there = build_grids(x, body, CELL, 4), build_grids(x + CELL * shift, body, CELL, 4)
    for name in ("cell_of_point", "local", "nodes_of_cell", "cell_body", "node_body"):
        assert np.array_equal(getattr(here, name), getattr(there, name)), name
    assert np.array_equal(here.cell_index + shift, there.cell_index)
    assert np.array_equal(here.node_index + shift, there.node_index)


def test_bodies_a_million_cells_apart_have_the_same_local_coordinates_and_no_cells_between():
    cell = 0.1  # not exact in binary: 1e6 cells away the rounding of x is 1e-10 of a cell
    x = np.random.default_rng(3).uniform(0.0, 5 * cell, size=(2, 60))
    far = x + cell * np.array([[1e6], [-1e6]])
    grid = build_grids(np.hstack([x, far]), np.repeat([0, 1], 60), cell, 2)
    assert np.abs(grid.local[:, :60] - grid.local[:, 60:]).max() < 1e-9
    assert grid.cells == 2 * np.count_nonzero(grid.cell_body == 0) <= 50


@given(SEED)
def test_points_lie_where_their_cell_and_local_coordinates_say(seed):
    x, _, grid = random_sheets(seed)
    assert grid.local.min() >= 0.0 and grid.local.max() <= 1.0
    assert_close(CELL * (grid.cell_index[:, grid.cell_of_point] + grid.local), x, 1e-14)


def test_a_body_without_points_has_no_nodes_and_a_body_of_one_point_has_four():
    x = np.array([[0.1, 0.7], [0.2, -0.4]]) * CELL
    grid = build_grids(x, np.array([1, 3]), CELL, 5)
    assert grid.blocks.tolist() == [0, 0, 8, 8, 16, 16]
    assert (grid.cells, grid.nodes) == (2, 8)
    assert np.isfinite(grid.rigid_motions).all()
    assert forms.mass.assemble(grid.basis(np.ones(2)), rho=1.0).sum() == pytest.approx(4.0)


def test_no_points_make_empty_grids():
    grid = build_grids(np.zeros((2, 0)), np.zeros(0, int), CELL, 2)
    assert (grid.cells, grid.nodes) == (0, 0)
    assert grid.blocks.tolist() == [0, 0, 0]
    assert grid.interpolation.shape == (0, 0) and grid.rigid_motions.shape == (0, 3)


# Interpolation.


@given(SEED)
def test_linear_fields_and_their_gradients_are_reproduced_exactly(seed):
    x, _, grid = random_sheets(seed)
    rng = np.random.default_rng(seed)
    a, G = rng.normal(size=(2, 1)), rng.normal(size=(2, 2))
    field = (a + G @ grid.position).T.ravel()
    assert_close(grid.at_points(field), a + G @ x, 1e-13)
    assert_close(grid.gradient_at_points(field), np.repeat(G[:, :, None], x.shape[1], axis=2), 1e-12)


@given(SEED)
def test_shape_functions_and_gradients_are_those_of_scikit_fem(seed):
    x, _, grid = random_sheets(seed, bodies=2)
    field = np.random.default_rng(seed).normal(size=2 * grid.nodes)
    theirs = grid.basis(np.ones(x.shape[1])).interpolate(field)
    assert_close(grid.at_points(field), np.asarray(theirs)[:, :, 0], 1e-13)
    assert_close(grid.gradient_at_points(field), theirs.grad[:, :, :, 0], 1e-12)
    assert_close(grid.interpolation.sum(axis=1), np.ones(x.shape[1]), 1e-14)


@given(SEED)
def test_an_affine_field_of_points_has_its_angular_momentum_at_the_nodes_and_no_momentum(seed):
    """The sum of N (X - x) is zero, that of N (X - x) (X - x)' is diagonal, xi (1 - xi) h^2."""
    _, _, grid = random_sheets(seed)
    rng, xi = np.random.default_rng(seed), grid.local
    mass, C = rng.uniform(0.5, 2.0, xi.shape[1]), rng.normal(size=(2, 2, xi.shape[1]))
    momentum = grid.affine_momentum(mass, np.zeros_like(xi), C).reshape(-1, 2)
    assert np.abs(momentum.sum(axis=0)).max() < 1e-12 * CELL * np.abs(C).sum()
    second = CELL**2 * xi * (1.0 - xi)
    expected = np.einsum("p,ijp,jp->ij", mass, C, second)
    assert_close(momentum.T @ grid.position.T, expected, 1e-11 * max(1.0, np.abs(expected).max()))


@given(SEED)
def test_rigid_motions_store_no_energy_and_turn_each_body_about_its_own_centre(seed):
    x, body, grid = random_sheets(seed, bodies=3)
    R = grid.rigid_motions
    K = our_matrices(grid.basis(np.full(x.shape[1], CELL**2)), 1.0, 1.0, 0.3)[1]
    assert np.abs(K @ R).max() < 1e-12
    for b in np.unique(body):
        own = R[grid.blocks[b] : grid.blocks[b + 1]]
        assert np.linalg.matrix_rank(own) == 3
        assert np.abs(own[0::2, 2].mean()) < 1e-12 and np.abs(own[1::2, 2].mean()) < 1e-12


# The mapping, and what scikit-fem is made to remember.


def test_moments_of_an_impulse_are_those_about_the_centres_of_mass():
    _, _, grid = random_sheets(3)
    rng = np.random.default_rng(1)
    mass, x, impulse = (
        rng.uniform(size=grid.nodes),
        rng.normal(size=(grid.nodes, 2)),
        rng.normal(size=(grid.nodes, 2)),
    )
    arms, (moment, inertia, total) = grid.moments(x, mass, impulse)
    for b in range(grid.bodies):
        own = grid.node_body == b
        arm = x[own] - np.average(x[own], axis=0, weights=mass[own])
        assert_close(arms[own], arm)
        assert moment[b] == pytest.approx(
            np.cross(np.c_[arm, 0 * arm[:, 0]], np.c_[impulse[own], 0 * arm[:, 0]])[:, 2].sum()
        )
        assert inertia[b] == pytest.approx(mass[own] @ (arm**2).sum(axis=1))
        assert total[b] == pytest.approx(mass[own].sum())


def test_rigid_motions_are_found_once_and_cannot_be_changed():
    _, _, grid = random_sheets(3)
    assert grid.rigid_motions is grid.rigid_motions
    with pytest.raises(ValueError, match="read-only"):
        grid.rigid_motions[0] = 1.0
