"""Materials: stress and tangent are derivatives, the laws are those of the books, the frame change is consistent.

Derivatives are taken by the complex step f'(x) = Im f(x + i s) / s, exact to round-off (Squire & Trapp, SIAM Rev. 40
(1998) 110): the tolerances are those of rounding, 1e-11 of the largest entry.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skmpm.material import LinearElastic, NeoHookean, determinant, hessian, product, projected_hessian

SEED = st.integers(0, 2**32 - 1)
NU = st.floats(0.0, 0.49)
E = 1e7
STEP = 1e-30
LAWS = [LinearElastic, NeoHookean]
N = 8


def rotations(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def random_gradients(rng, n=N, strain=0.8):
    """R1 diag(e^a, e^b) R2: every deformation gradient with logarithmic strains up to `strain`."""
    stretch = np.zeros((2, 2, n))
    stretch[0, 0], stretch[1, 1] = np.exp(rng.uniform(-strain, strain, size=(2, n)))
    return product(product(rotations(rng.uniform(0, 7, n)), stretch), rotations(rng.uniform(0, 7, n)))


def random_stress(rng, n=N):
    s = rng.normal(size=(2, 2, n)) * E
    return s + s.swapaxes(0, 1)


def transpose(A):
    return A.swapaxes(0, 1)


def clipped(C):
    """The nearest positive semi-definite tangent, eigenvalue by eigenvalue."""
    values, vectors = np.linalg.eigh(C.reshape(4, 4, -1).transpose(2, 0, 1))
    H = np.einsum("pij,pj,pkj->ikp", vectors, np.maximum(values, 0.0), vectors)
    return H.reshape(C.shape)


def lowest_eigenvalue(C):
    return np.linalg.eigvalsh(C.reshape(4, 4, -1).transpose(2, 0, 1))[:, 0]


def assert_close(actual, expected, tol):
    assert actual.shape == expected.shape
    assert np.abs(actual - expected).max() <= tol * np.abs(expected).max()


# Derivatives, with and without an anchor.


@pytest.mark.parametrize("regridded_state", [False, True], ids=["undeformed anchor", "deformed anchor"])
@pytest.mark.parametrize("law", LAWS)
@given(seed=SEED, nu=NU)
def test_stress_is_the_derivative_of_the_energy_and_the_tangent_that_of_the_stress(law, regridded_state, seed, nu):
    rng, solid = np.random.default_rng(seed), law(E, nu, 990.0)
    F = random_gradients(rng)
    anchor = (random_gradients(rng), random_stress(rng)) if regridded_state else (None, None)
    P, C = np.zeros((2, 2, N)), np.zeros((2, 2, 2, 2, N))
    for i, j in np.ndindex(2, 2):
        moved = F.astype(complex)
        moved[i, j] += 1j * STEP
        P[i, j] = solid.energy(moved, *anchor).imag / STEP
        C[:, :, i, j] = solid.stress(moved, *anchor).imag / STEP
    assert_close(solid.stress(F, *anchor), P, 1e-11)
    assert_close(solid.tangent(F, *anchor), C, 1e-11)
    H = C.reshape(4, 4, N)
    assert_close(H.swapaxes(0, 1), H, 1e-11)


@pytest.mark.parametrize("law", LAWS)
@given(seed=SEED, nu=NU)
def test_finite_differences_of_the_energy_agree_with_the_stress(law, seed, nu):
    """The same without complex numbers: central differences, error of order step^2 = 1e-10."""
    rng, solid = np.random.default_rng(seed), law(E, nu, 990.0)
    F, d, step = random_gradients(rng), rng.normal(size=(2, 2, N)), 1e-5
    slope = (solid.energy(F + step * d, None, None) - solid.energy(F - step * d, None, None)) / (2 * step)
    power = np.einsum("ijp,ijp->p", solid.stress(F, None, None), d)
    scale = E / (1 - 2 * nu)
    assert np.abs(slope - power).max() < 1e-6 * scale


# The neo-Hookean law.


@given(SEED, NU, st.booleans())
def test_neo_hookean_is_objective(seed, nu, regridded_state):
    rng, solid = np.random.default_rng(seed), NeoHookean(E, nu, 990.0)
    F, R = random_gradients(rng), rotations(rng.uniform(0, 7, N))
    G = random_gradients(rng) if regridded_state else None
    turned, scale = product(R, F), np.abs(solid.stress(F, G)).max() + E
    assert np.abs(solid.energy(turned, G) - solid.energy(F, G)).max() < 1e-12 * (scale + solid.energy(F, G).max())
    assert np.abs(solid.stress(turned, G) - product(R, solid.stress(F, G))).max() < 1e-12 * scale
    sigma = product(product(R, solid.cauchy(F, G)), transpose(R))
    assert np.abs(solid.cauchy(turned, G) - sigma).max() < 1e-12 * (np.abs(sigma).max() + E)
    rotated = np.einsum("iap,jbp,aIbJp->iIjJp", R, R, solid.tangent(F, G))
    assert_close(solid.tangent(turned, G), rotated, 1e-11)


@given(SEED, NU)
def test_neo_hookean_is_isotropic(seed, nu):
    rng, solid = np.random.default_rng(seed), NeoHookean(E, nu, 990.0)
    F, R = random_gradients(rng), rotations(rng.uniform(0, 7, N))
    assert_close(solid.cauchy(product(F, R)), solid.cauchy(F), 1e-11)


@given(st.floats(-10.0, 10.0), NU)
def test_a_rotated_neo_hookean_body_has_no_stress_and_no_energy(angle, nu):
    solid, R = NeoHookean(E, nu, 990.0), rotations(np.array([angle]))
    scale = E / (1 - 2 * nu)
    for anchor in (None, rotations(np.array([1.0]))):
        assert np.abs(solid.energy(R, anchor)).max() < 1e-14 * scale
        assert np.abs(solid.stress(R, anchor)).max() < 1e-14 * scale
        assert np.abs(solid.cauchy(R, anchor)).max() < 1e-14 * scale


def test_neo_hookean_closed_forms_of_simple_shear_and_of_uniform_expansion():
    solid, gamma, stretch = NeoHookean(E, 0.3, 990.0), 0.4, 1.7
    lam, mu = solid.lame
    shear = np.array([[1.0, gamma], [0.0, 1.0]])[:, :, None]
    expected = mu * np.array([[gamma**2, gamma], [gamma, 0.0]])[:, :, None]
    np.testing.assert_allclose(solid.cauchy(shear), expected, rtol=1e-12, atol=1e-9 * mu)
    assert solid.energy(shear)[0] == pytest.approx(0.5 * mu * gamma**2, rel=1e-12)
    J = stretch**2
    pressure = (mu * (J - 1) + lam * np.log(J)) / J
    np.testing.assert_allclose(
        solid.cauchy(stretch * np.eye(2)[:, :, None])[:, :, 0], pressure * np.eye(2), rtol=1e-12, atol=1e-9 * mu
    )


def test_inside_out_costs_infinite_energy_and_raises_no_floating_error():
    solid = NeoHookean(E, 0.3, 990.0)
    F = np.stack([np.diag(d) for d in ([1.0, -1.0], [0.0, 1.0], [0.0, 0.0], [-1.0, -2.0], [1.0, 1.0])], axis=-1)
    for anchor in (None, np.repeat(np.array([[1.2, 0.1], [0.0, 0.9]])[:, :, None], 5, axis=2)):
        W = solid.energy(F, anchor)
        assert np.array_equal(np.isinf(W), [True, True, True, False, False])
        assert not np.isnan(W).any() and W[:3].min() > 0


@given(SEED, NU)
def test_energy_is_positive_and_grows_without_bound_towards_zero_volume(seed, nu):
    solid, rng = NeoHookean(E, nu, 990.0), np.random.default_rng(seed)
    assert solid.energy(random_gradients(rng)).min() > -1e-9 * E
    flat = np.zeros((2, 2, 4))
    flat[0, 0], flat[1, 1] = 1.0, [1e-1, 1e-4, 1e-8, 1e-16]
    assert (np.diff(solid.energy(flat)) > 0).all()


# Small strain.


@given(SEED, NU)
def test_linear_elastic_is_hookes_law_in_plane_strain(seed, nu):
    rng, solid = np.random.default_rng(seed), LinearElastic(E, nu, 990.0)
    H = rng.normal(size=(2, 2, N))
    strain = np.stack([H[0, 0], H[1, 1], H[0, 1] + H[1, 0]])
    D = np.array([[1 - nu, nu, 0], [nu, 1 - nu, 0], [0, 0, 0.5 - nu]]) * E / ((1 + nu) * (1 - 2 * nu))
    s = D @ strain
    expected = np.array([[s[0], s[2]], [s[2], s[1]]])
    F = np.eye(2)[:, :, None] + H
    assert_close(solid.stress(F), expected, 1e-12)
    assert_close(solid.cauchy(F), expected, 1e-12)
    assert_close(solid.energy(F), 0.5 * np.einsum("ip,ip->p", strain, s), 1e-12)
    already = random_stress(rng)
    assert_close(solid.stress(F, random_gradients(rng), already), expected + already, 1e-12)
    assert_close(solid.energy(F, None, already), 0.5 * np.sum(strain * s, 0) + np.sum(already * H, (0, 1)), 1e-11)


@pytest.mark.parametrize("angle", [0.05, 0.2])
def test_linear_elastic_sees_the_false_strain_it_documents_when_it_turns(angle):
    solid = LinearElastic(E, 0.3, 990.0)
    lam, mu = solid.lame
    stress = solid.stress(rotations(np.array([angle])))[:, :, 0]
    false = -(angle**2) / 2  # cos(angle) - 1 to the fourth order
    np.testing.assert_allclose(stress, 2 * (lam + mu) * false * np.eye(2), rtol=angle**2 / 10, atol=1e-9 * E)


@given(SEED, NU)
def test_neo_hookean_tends_to_linear_elastic_with_the_square_of_the_strain(seed, nu):
    rng = np.random.default_rng(seed)
    H, one = rng.normal(size=(2, 2, N)), np.eye(2)[:, :, None]
    H = (H + H.swapaxes(0, 1)) / 2  # a rotation is where they differ to first order
    hooke, neo = LinearElastic(E, nu, 990.0), NeoHookean(E, nu, 990.0)
    sizes = (1e-3, 1e-4)
    for answer in ("stress", "cauchy"):
        error = [np.abs(getattr(neo, answer)(one + s * H) - getattr(hooke, answer)(one + s * H)).max() for s in sizes]
        assert 90 < error[0] / error[1] < 111
    assert_close(neo.tangent(one), hooke.tangent(one), 1e-12)
    assert neo.lame == hooke.lame
    assert hooke.linear and not neo.linear


# The projected tangent.


def compressed_gradients(seed, strain=2.5):
    """Strong compression and shear, where the exact tangent is indefinite, among milder ones."""
    rng = np.random.default_rng(seed)
    return random_gradients(rng, 40, strain) * rng.uniform(0.1, 1.5, 40)


@given(SEED, NU)
def test_projected_tangent_is_the_exact_one_with_negative_eigenvalues_clipped(seed, nu):
    solid, F = NeoHookean(E, nu, 990.0), compressed_gradients(seed)
    C, projected = solid.tangent(F), solid.tangent(F, projected=True)
    error = np.abs(projected - clipped(C)).max(axis=(0, 1, 2, 3))
    assert (error <= 1e-11 * np.abs(C).max(axis=(0, 1, 2, 3))).all()  # each point on its own scale


@given(SEED, NU)
def test_projected_tangent_is_exact_where_that_is_already_semi_definite(seed, nu):
    solid, F = NeoHookean(E, nu, 990.0), compressed_gradients(seed, 1.0)
    C, projected = solid.tangent(F), solid.tangent(F, projected=True)
    scale = np.abs(C).max(axis=(0, 1, 2, 3))
    good = lowest_eigenvalue(C) > -1e-14 * scale
    assert (np.abs(C - projected)[..., good] <= 1e-12 * scale[good]).all()
    assert (np.abs(C - projected).max(axis=(0, 1, 2, 3)) > 0)[lowest_eigenvalue(C) < -1e-9 * scale].all()


def test_the_trial_gradients_include_definite_and_indefinite_tangents():
    lowest = lowest_eigenvalue(NeoHookean(E, 0.3, 990.0).tangent(compressed_gradients(0, 1.0)))
    assert np.count_nonzero(lowest < -1e-3 * E) > 5 and np.count_nonzero(lowest > 1e-3 * E) > 5


@pytest.mark.parametrize("scale", [1.0, 0.3, 1e-3, 4.0])
def test_projection_where_eigenvalues_coincide(scale):
    """A multiple of a rotation has no preferred axis: the case of the zero division."""
    F = scale * rotations(np.array([0.0, 0.3, np.pi / 2, 2.0]))
    for nu in (0.0, 0.3, 0.49):
        solid = NeoHookean(E, nu, 990.0)
        C = solid.tangent(F)
        assert np.abs(solid.tangent(F, projected=True) - clipped(C)).max() <= 1e-12 * np.abs(C).max()


@given(SEED)
def test_the_projection_is_that_of_clipping_for_any_energy_of_the_volume(seed):
    """Not only the neo-Hookean one, for which some of the eigenvectors are never wanted."""
    rng, F = np.random.default_rng(seed), compressed_gradients(seed, 1.0)
    mu, slope, curvature = 1.0, *rng.normal(scale=3.0, size=(2, 40))
    H = hessian(F, mu, slope, curvature)
    error = np.abs(projected_hessian(F, mu, slope, curvature) - clipped(H)).max(axis=(0, 1, 2, 3))
    assert (error <= 1e-11 * np.abs(H).max(axis=(0, 1, 2, 3))).all()


@given(SEED, NU)
def test_projected_tangent_stays_semi_definite_in_the_frame_of_the_anchor(seed, nu):
    rng, solid = np.random.default_rng(seed), NeoHookean(E, nu, 990.0)
    F, G = compressed_gradients(seed), random_gradients(rng, 40)
    C = solid.tangent(F, G, None, projected=True)
    assert (lowest_eigenvalue(C) >= -1e-12 * np.abs(C).max(axis=(0, 1, 2, 3))).all()
    flat = solid.tangent(product(F, G), projected=True) / determinant(G)
    assert_close(C, np.einsum("iKjLp,IKp,JLp->iIjJp", flat, G, G), 1e-12)


def test_the_tangent_of_a_linear_material_is_its_own_projection():
    solid, F = LinearElastic(E, 0.45, 990.0), random_gradients(np.random.default_rng(0))
    assert np.array_equal(solid.tangent(F), solid.tangent(F, projected=True))
    assert lowest_eigenvalue(solid.tangent(F)).min() > -1e-12 * E


# The frame of the anchor.


@given(SEED, NU)
def test_energy_per_anchor_volume_is_the_total_energy_over_the_anchors_volume_ratio(seed, nu):
    rng, solid = np.random.default_rng(seed), NeoHookean(E, nu, 990.0)
    F, G = random_gradients(rng), random_gradients(rng)
    assert_close(solid.energy(F, G) * determinant(G), solid.energy(product(F, G)), 1e-12)
    assert_close(solid.cauchy(F, G), solid.cauchy(product(F, G)), 1e-12)


@given(SEED, NU)
def test_anchoring_anew_multiplies_the_anchors_and_changes_nothing_else(seed, nu):
    rng, solid = np.random.default_rng(seed), NeoHookean(E, nu, 990.0)
    F, G, first = (random_gradients(rng, strain=0.5) for _ in range(3))
    # first, then G, then F: seen from the first anchor and from the second.
    early, late = (product(F, G), first), (F, product(G, first))
    ratio = determinant(G)
    assert_close(solid.energy(*late), solid.energy(*early) / ratio, 1e-11)
    assert_close(solid.stress(*late), product(solid.stress(*early), transpose(G)) / ratio, 1e-11)
    assert_close(solid.cauchy(*late), solid.cauchy(*early), 1e-11)


@given(SEED, NU)
def test_cauchy_stress_is_the_nominal_stress_pushed_forward(seed, nu):
    rng, solid = np.random.default_rng(seed), NeoHookean(E, nu, 990.0)
    F = random_gradients(rng)
    for G in (None, random_gradients(rng)):
        sigma = product(solid.stress(F, G), transpose(F)) / determinant(F)
        assert np.abs(solid.cauchy(F, G) - sigma).max() <= 1e-11 * (np.abs(sigma).max() + E)
        assert np.abs(sigma - transpose(sigma)).max() <= 1e-11 * (np.abs(sigma).max() + E)


# Mean dilatation.


def own_dilatation(solid, F, anchor):
    now, rest = solid.volumes(F, *anchor)
    return now / rest


@pytest.mark.parametrize("regridded_state", [False, True], ids=["undeformed anchor", "deformed anchor"])
@pytest.mark.parametrize("law", LAWS)
@given(seed=SEED, nu=NU)
def test_told_its_own_dilatation_a_point_answers_as_if_it_was_told_nothing(law, regridded_state, seed, nu):
    """The tangent, which takes a dilatation as given, lacks the bulk tangent along the slope of the volume."""
    rng, solid = np.random.default_rng(seed), law(E, nu, 990.0)
    F = random_gradients(rng)
    anchor = (random_gradients(rng), random_stress(rng)) if regridded_state else (None, None)
    theta = own_dilatation(solid, F, anchor)
    for answer in ("energy", "stress", "cauchy"):
        assert_close(getattr(solid, answer)(F, *anchor, theta), getattr(solid, answer)(F, *anchor), 1e-11)
    slope, (_, rest) = solid.volume_slope(F, *anchor), solid.volumes(F, *anchor)
    bulk = solid.bulk_tangent(F, *anchor, theta) / rest * np.einsum("ijp,klp->ijklp", slope, slope)
    assert_close(solid.tangent(F, *anchor, theta) + bulk, solid.tangent(F, *anchor), 1e-11)


@pytest.mark.parametrize("law", LAWS)
@given(seed=SEED, nu=NU)
def test_the_volume_slope_is_the_derivative_of_the_volume_and_the_bulk_tangent_that_of_the_energy(law, seed, nu):
    rng, solid = np.random.default_rng(seed), law(E, nu, 990.0)
    F, anchor = random_gradients(rng), (random_gradients(rng), random_stress(rng))
    slope = np.zeros((2, 2, N))
    for i, j in np.ndindex(2, 2):
        moved = F.astype(complex)
        moved[i, j] += 1j * STEP
        slope[i, j] = solid.volumes(moved, *anchor)[0].imag / STEP
    assert_close(solid.volume_slope(F, *anchor), slope, 1e-12)
    theta, step = rng.uniform(0.5, 2.0, N), 1e-4
    rest = solid.volumes(F, *anchor)[1]
    low, mid, high = (solid.energy(F, *anchor, theta + s) / rest for s in (-step, 0.0, step))
    curvature, scale = (high - 2 * mid + low) / step**2, np.abs(mid).max() + solid.lame[0]
    assert np.abs(solid.bulk_tangent(F, *anchor, theta) - curvature).max() < 1e-6 * scale + 100 * step**2 * scale


@given(SEED, NU)
def test_projected_tangent_at_a_given_dilatation_is_the_exact_one_clipped(seed, nu):
    rng, solid, F = np.random.default_rng(seed), NeoHookean(E, nu, 990.0), compressed_gradients(seed)
    theta = rng.uniform(0.3, 3.0, 40)
    C, projected = (solid.tangent(F, None, None, theta, projected=p) for p in (False, True))
    error = np.abs(projected - clipped(C)).max(axis=(0, 1, 2, 3))
    assert (error <= 1e-11 * np.abs(C).max(axis=(0, 1, 2, 3))).all()


def test_the_energy_of_tiny_strains_is_not_lost_in_round_off():
    """W -> 1/2 eps : C : eps; at strains of 1e-7 the terms of the definition are 1e14 times larger than W."""
    law, strain = NeoHookean(E=10e6, nu=0.45, density=990.0), 1e-7 * np.array([[0.3, 0.5], [0.5, -1.1]])
    lam, mu = law.lame
    wanted = 0.5 * lam * np.trace(strain) ** 2 + mu * np.sum(strain**2)
    assert law.energy((np.eye(2) + strain)[:, :, None])[0] == pytest.approx(wanted, rel=1e-6)
