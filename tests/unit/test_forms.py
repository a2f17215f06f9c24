"""The weak forms against closed forms, each other, and the elasticity forms of scikit-fem."""

import logging

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skfem import CellBasis, ElementQuad1, ElementVector, MeshQuad
from skfem.models.elasticity import lame_parameters, linear_elasticity

from skmpm.grid import forms
from skmpm.material import LinearElastic, NeoHookean

SEED = st.integers(0, 2**32 - 1)
SIZE = 0.3


def rectangle(nx=4, ny=3, size=SIZE):
    return MeshQuad.init_tensor(size * np.arange(nx + 1), size * np.arange(ny + 1))


def plain_basis(mesh=None):
    return CellBasis(rectangle() if mesh is None else mesh, ElementVector(ElementQuad1()))


def nodal(mesh, function):
    """A vector field at the nodes as a vector of unknowns."""
    return np.asarray(function(*mesh.p), dtype=float).T.ravel()


def interior_facets(mesh):
    return np.flatnonzero(mesh.f2t[1] >= 0)


def assert_close(actual, expected, tol=1e-12):
    assert actual.shape == expected.shape
    assert abs(actual - expected).max() <= tol * abs(expected).max()


def test_assemblies_are_not_told_to_a_root_logger(caplog):
    """scikit-fem tells of each at level INFO, which a caller may ask the root logger for."""
    caplog.set_level(logging.INFO)
    forms.mass.assemble(plain_basis(), rho=7.0)
    assert not caplog.records


# Bulk forms.


def test_stiffness_with_hookes_tangent_is_scikit_fems_linear_elasticity():
    basis = plain_basis()
    C = LinearElastic(3.0, 0.3, 1.0).tangent(np.zeros((2, 2, 1)))[..., None]
    theirs = linear_elasticity(*lame_parameters(3.0, 0.3)).assemble(basis)
    assert_close(forms.stiffness.assemble(basis, C=C).toarray(), theirs.toarray())


def test_mass_adds_up_to_the_mass_of_the_domain_in_each_direction():
    basis = plain_basis()
    M = forms.mass.assemble(basis, rho=7.0).toarray()
    one = nodal(basis.mesh, lambda x, y: (1 + 0 * x, 0 * x))
    assert one @ M @ one == pytest.approx(7.0 * 12 * SIZE**2, rel=1e-13)
    assert np.linalg.eigvalsh(M).min() > 0
    assert np.abs(M[0::2, 1::2]).max() == 0  # directions do not couple


def test_momentum_of_a_nodal_field_is_the_mass_matrix_times_it():
    basis = plain_basis()
    rho = np.random.default_rng(0).uniform(1, 2, size=basis.dx.shape)
    field = np.random.default_rng(1).normal(size=basis.N)
    P = forms.momentum.assemble(basis, rho=rho, velocity=np.asarray(basis.interpolate(field)))
    assert_close(P, forms.mass.assemble(basis, rho=rho) @ field)


def test_internal_force_of_a_uniform_stress_is_its_traction_on_the_boundary():
    basis = plain_basis()
    P = np.array([[2.0, -1.0], [0.5, 3.0]])
    f = forms.internal_force.assemble(basis, P=P[:, :, None, None]).reshape(-1, 2)
    x, y = basis.mesh.p
    inside = (x > 0) & (x < x.max()) & (y > 0) & (y < y.max())
    assert np.abs(f[inside]).max() < 1e-14
    right = f[np.isclose(x, x.max()) & (y > 0) & (y < y.max())]
    np.testing.assert_allclose(right, np.tile(SIZE * P @ [1, 0], (len(right), 1)), rtol=1e-12)
    top = f[np.isclose(y, y.max()) & (x > 0) & (x < x.max())]
    np.testing.assert_allclose(top, np.tile(SIZE * P @ [0, 1], (len(top), 1)), rtol=1e-12)


@given(SEED)
def test_stiffness_is_the_derivative_of_the_internal_force(seed):
    basis, rng, solid = plain_basis(rectangle(2, 2)), np.random.default_rng(seed), NeoHookean(3.0, 0.4, 1.0)
    u, d = rng.normal(scale=0.03 * SIZE, size=(2, basis.N))
    shape = basis.interpolate(u).grad.shape

    def gradient(field):
        return basis.interpolate(field).grad.reshape(2, 2, -1)

    F = np.eye(2)[:, :, None] + gradient(u)
    step = 1e-30j  # complex step: no cancellation
    P = solid.stress(F + step * gradient(d)).imag / 1e-30
    df = forms.internal_force.assemble(basis, P=P.reshape(shape))
    C = solid.tangent(F).reshape(2, 2, *shape)
    assert_close(forms.stiffness.assemble(basis, C=C) @ d, df)


# Ghost penalty.


def test_ghost_penalty_is_zero_for_one_bilinear_field_over_all_cells_and_for_nothing_else():
    mesh = rectangle()
    G = forms.ghost_matrix(mesh, interior_facets(mesh), SIZE).toarray()
    assert_close(G, G.T)
    linear = [lambda x, y: (1 + 0 * x, 0 * x), lambda x, y: (x, 0 * x), lambda x, y: (y, 0 * x)]
    linear += [lambda x, y, f=f: f(x, y)[::-1] for f in linear]
    for field in linear:
        assert np.abs(G @ nodal(mesh, field)).max() < 1e-13
    eigenvalues = np.linalg.eigvalsh(G)
    # x y as well: its normal derivatives are continuous across all facets.
    assert np.abs(G @ nodal(mesh, lambda x, y: (x * y, 0 * x))).max() < 1e-13
    assert eigenvalues[:8].max() < 1e-13 and eigenvalues[8] > 1e-3


@pytest.mark.parametrize("axis", [0, 1])
def test_ghost_penalty_of_a_kink_is_h_squared_times_its_jump_squared_per_facet(axis):
    mesh, slope = rectangle(), 2.5
    line = 2 * SIZE
    field = nodal(mesh, lambda x, y: (slope * np.maximum((x, y)[axis] - line, 0.0), 0 * x))
    G = forms.ghost_matrix(mesh, interior_facets(mesh), SIZE)
    facets = 3 if axis == 0 else 4
    assert field @ G @ field == pytest.approx(facets * SIZE**2 * slope**2, rel=1e-12)


def test_ghost_penalty_acts_on_the_chosen_facets_only():
    mesh = rectangle(5, 1)
    facet = interior_facets(mesh)[:1]
    G = forms.ghost_matrix(mesh, facet, SIZE)
    cells = mesh.f2t[:, facet[0]]
    entries = G.tocoo()
    touched = np.unique(entries.row[np.abs(entries.data) > 1e-14] // 2)
    assert np.array_equal(touched, np.unique(mesh.t[:, cells]))


# Reference matrices.


def test_reference_ghost_sees_only_jumps_of_the_slope():
    # Second difference across the facet, weighted by the mass matrix of linear functions along it.
    second, along = np.array([1.0, -2.0, 1.0]), np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0
    assert_close(forms.reference_ghost(), np.kron(along, np.outer(second, second)))


def test_reference_gradient_gives_the_gradients_anywhere_in_the_unit_cell():
    X = np.random.default_rng(0).uniform(size=(2, 7))
    expected = np.stack([ElementQuad1().lbasis(X, i)[1] for i in range(4)], axis=1)
    monomials = np.stack([np.ones(7), *X])
    assert_close(np.einsum("mIa,mp->Iap", forms.reference_gradient(), monomials), expected)


# Mean dilatation.


@given(SEED)
def test_mean_dilatation_resists_nothing_but_a_change_of_the_cells_areas(seed):
    """On the whole grid with a modulus of 1 it stores sum (change of area)^2 / area, exactly."""
    rng, mesh = np.random.default_rng(seed), rectangle()
    basis = CellBasis(mesh, ElementVector(ElementQuad1()), quadrature=(np.array([[0.5], [0.5]]), np.ones(1)))
    n = mesh.nelements
    slope, one = np.repeat(np.eye(2)[:, :, None], n, axis=2), np.ones(n)
    K = forms.mean_dilatation_stiffness(basis, slope, 0.0 * slope, one, one)
    u = rng.normal(size=basis.N)
    corners = u.reshape(-1, 2).T[:, mesh.t]  # (2, 4, cells); to first order an area grows by the flux through edges
    x = mesh.p[:, mesh.t]
    y, move = np.roll(x, -1, axis=1) - x, corners + np.roll(corners, -1, axis=1)
    flux = 0.5 * (y[1] * move[0] - y[0] * move[1]).sum(axis=0)
    assert u @ K @ u == pytest.approx((flux**2 / SIZE**2).sum(), rel=1e-11)
    turn = nodal(mesh, lambda x, y: (-y, x))
    assert np.abs(K @ turn).max() < 1e-12
    # With dilatation coupled to F by the same slope: twice sum (change of area)^2 / area more.
    coupled = forms.mean_dilatation_stiffness(basis, slope, slope, one, one)
    assert u @ coupled @ u == pytest.approx(3.0 * (u @ K @ u), rel=1e-11)
