"""Materials: stress and tangent are derivatives, the laws are those of the books, the frame change is consistent.

Derivatives are taken by the complex step f'(x) = Im f(x + i s) / s, exact to round-off (Squire & Trapp, SIAM Rev. 40
(1998) 110): the tolerances are those of rounding, 1e-11 of the largest entry.
"""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skmpm import MooneyRivlin, Ogden, Yeoh, check_material
from skmpm.material import Anchored, LinearElastic, NeoHookean, determinant, dilatation, product
from skmpm.material.invariants import half_angles
from skmpm.material.response import curvature

SEED = st.integers(0, 2**32 - 1)
NU = st.floats(0.0, 0.49)
E = 1e7
STEP = 1e-30
LAWS = [LinearElastic, NeoHookean]
RUBBERS = [
    NeoHookean(E, 0.45, 990.0),
    MooneyRivlin(1.1e6, 0.6e6, 2e7, 990.0),
    Yeoh(1.7e6, -0.1e6, 0.05e6, 2e7, 990.0),
    Ogden((6.3e6, 0.012e6, -0.1e6), (1.3, 5.0, -2.0), 2e7, 990.0),  # Ogden's rubber, times ten
]
NAMES = [type(rubber).__name__ for rubber in RUBBERS]
N = 8


def cauchy(solid, F, *anchor):
    seen = Anchored(solid, *anchor)
    return seen.cauchy(F, seen.stress(F))


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
    seen = Anchored(solid, *(random_gradients(rng), random_stress(rng)) if regridded_state else (None, None))
    P, C = np.zeros((2, 2, N)), np.zeros((2, 2, 2, 2, N))
    for i, j in np.ndindex(2, 2):
        moved = F.astype(complex)
        moved[i, j] += 1j * STEP
        P[i, j] = seen.energy(moved).imag / STEP
        C[:, :, i, j] = seen.stress(moved).imag / STEP
    assert_close(seen.stress(F), P, 1e-11)
    assert_close(seen.tangent(F), C, 1e-11)
    H = C.reshape(4, 4, N)
    assert_close(H.swapaxes(0, 1), H, 1e-11)


@pytest.mark.parametrize("law", LAWS)
@given(seed=SEED, nu=NU)
def test_finite_differences_of_the_energy_agree_with_the_stress(law, seed, nu):
    """The same without complex numbers: central differences, error of order step^2 = 1e-10."""
    rng, solid = np.random.default_rng(seed), law(E, nu, 990.0)
    F, d, step = random_gradients(rng), rng.normal(size=(2, 2, N)), 1e-5
    slope = (solid.energy(F + step * d) - solid.energy(F - step * d)) / (2 * step)
    power = np.einsum("ijp,ijp->p", solid.stress(F), d)
    scale = E / (1 - 2 * nu)
    assert np.abs(slope - power).max() < 1e-6 * scale


# The neo-Hookean law.


@given(SEED, NU, st.booleans())
def test_neo_hookean_is_objective(seed, nu, regridded_state):
    rng, solid = np.random.default_rng(seed), NeoHookean(E, nu, 990.0)
    F, R = random_gradients(rng), rotations(rng.uniform(0, 7, N))
    G = random_gradients(rng) if regridded_state else None
    seen = Anchored(solid, G)
    turned, scale = product(R, F), np.abs(seen.stress(F)).max() + E
    assert np.abs(seen.energy(turned) - seen.energy(F)).max() < 1e-12 * (scale + seen.energy(F).max())
    assert np.abs(seen.stress(turned) - product(R, seen.stress(F))).max() < 1e-12 * scale
    sigma = product(product(R, cauchy(solid, F, G)), transpose(R))
    assert np.abs(cauchy(solid, turned, G) - sigma).max() < 1e-12 * (np.abs(sigma).max() + E)
    rotated = np.einsum("iap,jbp,aIbJp->iIjJp", R, R, seen.tangent(F))
    assert_close(seen.tangent(turned), rotated, 1e-11)


@given(SEED, NU)
def test_neo_hookean_is_isotropic(seed, nu):
    rng, solid = np.random.default_rng(seed), NeoHookean(E, nu, 990.0)
    F, R = random_gradients(rng), rotations(rng.uniform(0, 7, N))
    assert_close(cauchy(solid, product(F, R)), cauchy(solid, F), 1e-11)


@given(st.floats(-10.0, 10.0), NU)
def test_a_rotated_neo_hookean_body_has_no_stress_and_no_energy(angle, nu):
    solid, R = NeoHookean(E, nu, 990.0), rotations(np.array([angle]))
    scale = E / (1 - 2 * nu)
    for anchor in (None, rotations(np.array([1.0]))):
        assert np.abs(Anchored(solid, anchor).energy(R)).max() < 1e-14 * scale
        assert np.abs(Anchored(solid, anchor).stress(R)).max() < 1e-14 * scale
        assert np.abs(cauchy(solid, R, anchor)).max() < 1e-14 * scale


def test_neo_hookean_closed_forms_of_simple_shear_and_of_uniform_expansion():
    solid, gamma, stretch = NeoHookean(E, 0.3, 990.0), 0.4, 1.7
    lam, mu = solid.lame
    shear = np.array([[1.0, gamma], [0.0, 1.0]])[:, :, None]
    expected = mu * np.array([[gamma**2, gamma], [gamma, 0.0]])[:, :, None]
    np.testing.assert_allclose(cauchy(solid, shear), expected, rtol=1e-12, atol=1e-9 * mu)
    assert solid.energy(shear)[0] == pytest.approx(0.5 * mu * gamma**2, rel=1e-12)
    J = stretch**2
    pressure = (mu * (J - 1) + lam * np.log(J)) / J
    np.testing.assert_allclose(
        cauchy(solid, stretch * np.eye(2)[:, :, None])[:, :, 0], pressure * np.eye(2), rtol=1e-12, atol=1e-9 * mu
    )


def test_inside_out_costs_infinite_energy_and_raises_no_floating_error():
    solid = NeoHookean(E, 0.3, 990.0)
    F = np.stack([np.diag(d) for d in ([1.0, -1.0], [0.0, 1.0], [0.0, 0.0], [-1.0, -2.0], [1.0, 1.0])], axis=-1)
    for anchor in (None, np.repeat(np.array([[1.2, 0.1], [0.0, 0.9]])[:, :, None], 5, axis=2)):
        W = Anchored(solid, anchor).energy(F)
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
    assert_close(cauchy(solid, F), expected, 1e-12)
    assert_close(solid.energy(F), 0.5 * np.einsum("ip,ip->p", strain, s), 1e-12)
    already = random_stress(rng)
    assert_close(Anchored(solid, random_gradients(rng), already).stress(F), expected + already, 1e-12)
    assert_close(
        Anchored(solid, None, already).energy(F), 0.5 * np.sum(strain * s, 0) + np.sum(already * H, (0, 1)), 1e-11
    )


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
    for answer in (lambda law, F: law.stress(F), cauchy):
        error = [np.abs(answer(neo, one + s * H) - answer(hooke, one + s * H)).max() for s in sizes]
        assert 90 < error[0] / error[1] < 111
    assert_close(neo.tangent(one), hooke.tangent(one), 1e-12)
    assert neo.lame == hooke.lame
    assert hooke.linear and not hasattr(neo, "linear")


@given(SEED, NU)
def test_tangent_in_the_frame_of_the_anchor(seed, nu):
    rng, solid = np.random.default_rng(seed), NeoHookean(E, nu, 990.0)
    F, G = random_gradients(rng, 40), random_gradients(rng, 40)
    C = np.einsum("iKjLp,IKp,JLp->iIjJp", solid.tangent(product(F, G)) / determinant(G), G, G)
    assert_close(Anchored(solid, G).tangent(F), C, 1e-12)


def test_the_tangent_of_a_linear_material_is_positive_semi_definite():
    assert lowest_eigenvalue(LinearElastic(E, 0.45, 990.0).tangent(np.zeros((2, 2, 1)))).min() > -1e-12 * E


# The frame of the anchor.


@given(SEED, NU)
def test_energy_per_anchor_volume_is_the_total_energy_over_the_anchors_volume_ratio(seed, nu):
    rng, solid = np.random.default_rng(seed), NeoHookean(E, nu, 990.0)
    F, G = random_gradients(rng), random_gradients(rng)
    assert_close(Anchored(solid, G).energy(F) * determinant(G), solid.energy(product(F, G)), 1e-12)
    assert_close(cauchy(solid, F, G), cauchy(solid, product(F, G)), 1e-12)


@given(SEED, NU)
def test_anchoring_anew_multiplies_the_anchors_and_changes_nothing_else(seed, nu):
    rng, solid = np.random.default_rng(seed), NeoHookean(E, nu, 990.0)
    F, G, first = (random_gradients(rng, strain=0.5) for _ in range(3))
    # first, then G, then F: seen from the first anchor and from the second.
    early, late = (product(F, G), first), (F, product(G, first))
    ratio = determinant(G)
    before, after = ((Anchored(solid, G).energy(F), Anchored(solid, G).stress(F)) for F, G in (early, late))
    assert_close(after[0], before[0] / ratio, 1e-11)
    assert_close(after[1], product(before[1], transpose(G)) / ratio, 1e-11)
    assert_close(cauchy(solid, *late), cauchy(solid, *early), 1e-11)


@given(SEED, NU)
def test_cauchy_stress_is_the_nominal_stress_pushed_forward(seed, nu):
    rng, solid = np.random.default_rng(seed), NeoHookean(E, nu, 990.0)
    F = random_gradients(rng)
    for G in (None, random_gradients(rng)):
        sigma = product(Anchored(solid, G).stress(F), transpose(F)) / determinant(F)
        assert np.abs(cauchy(solid, F, G) - sigma).max() <= 1e-11 * (np.abs(sigma).max() + E)
        assert np.abs(sigma - transpose(sigma)).max() <= 1e-11 * (np.abs(sigma).max() + E)


# Mean dilatation.


def own_dilatation(law, F):
    now, rest = dilatation.volumes(law, F)
    return now / rest


@pytest.mark.parametrize("regridded_state", [False, True], ids=["undeformed anchor", "deformed anchor"])
@pytest.mark.parametrize("solid", [*RUBBERS, LinearElastic(E, 0.3, 990.0)], ids=[*NAMES, "LinearElastic"])
@given(seed=SEED)
def test_given_its_own_dilatation_a_point_answers_as_if_it_was_given_none(solid, regridded_state, seed):
    """Energy; by the chain rule with theta(F) the stress and the tangent."""
    rng = np.random.default_rng(seed)
    F = random_gradients(rng, strain=0.4)
    law = Anchored(
        solid, *(random_gradients(rng, strain=0.4), random_stress(rng)) if regridded_state else (None, None)
    )
    theta, slope = own_dilatation(law, F), dilatation.volume_slope(law, F).reshape(4, -1) / law.rest(N)
    assert_close(dilatation.energy(law, F, theta), law.energy(F), 1e-11)
    by_F, by_theta = dilatation.slopes(law, F, theta)
    assert_close(by_F.reshape(4, -1) + by_theta * slope, law.stress(F).reshape(4, -1), 1e-11)
    C, mixed, bulk = dilatation.tangents(law, F, theta, by_theta / law.rest(N))
    coupled = mixed[:, None] * slope
    whole = C + coupled + coupled.swapaxes(0, 1) + bulk * slope[:, None] * slope
    assert_close(whole.reshape(2, 2, 2, 2, -1), np.array(law.tangent(F)), 1e-11)


@pytest.mark.parametrize("regridded_state", [False, True], ids=["undeformed anchor", "deformed anchor"])
@pytest.mark.parametrize("solid", [*RUBBERS, LinearElastic(E, 0.3, 990.0)], ids=[*NAMES, "LinearElastic"])
@given(seed=SEED)
def test_slopes_and_curvatures_at_a_given_dilatation_are_derivatives(solid, regridded_state, seed):
    rng = np.random.default_rng(seed)
    F = random_gradients(rng, strain=0.4)
    law = Anchored(
        solid, *(random_gradients(rng, strain=0.4), random_stress(rng)) if regridded_state else (None, None)
    )
    theta = rng.uniform(0.6, 1.6, N) if not law.linear else rng.uniform(-0.3, 0.3, N)
    P, C, slope, mixed = (np.zeros((4, N)), np.zeros((4, 4, N)), np.zeros((4, N)), np.zeros((4, N)))
    curved = np.zeros((4, 4, N))
    for k, (i, j) in enumerate(np.ndindex(2, 2)):
        moved = F.astype(complex)
        moved[i, j] += 1j * STEP
        P[k] = dilatation.energy(law, moved, theta).imag / STEP
        by_F, by_theta = dilatation.slopes(law, moved, theta)
        C[:, k], mixed[k] = by_F.reshape(4, -1).imag / STEP, by_theta.imag / STEP
        slope[k] = dilatation.volumes(law, moved)[0].imag / STEP
        curved[:, k] = dilatation.volume_slope(law, moved).reshape(4, -1).imag / STEP
    grown = theta + 1j * STEP
    by_F, by_theta = dilatation.slopes(law, F, theta)
    tension = rng.normal(size=N) * solid.lame[1]
    exact, tense = (dilatation.curvatures(law, F, theta, one) for one in (np.zeros(N), tension))
    assert_close(tense[0] - exact[0], tension * curved, 1e-11)
    for found, expected in zip(curvature(law, F, theta, tension) or (), tense, strict=False):
        assert_close(found, expected, 1e-11)
    size = np.abs(C).max()
    assert_close(dilatation.volume_slope(law, F).reshape(4, -1), slope, 1e-12)
    assert_close(by_F.reshape(4, -1), P, 1e-11)
    assert_close(by_theta, dilatation.energy(law, F, grown).imag / STEP, 1e-11)
    assert np.abs(exact[0] - C).max() <= 1e-11 * size
    assert np.abs(exact[1] - mixed).max() <= 1e-11 * size
    assert np.abs(exact[1] - dilatation.slopes(law, F, grown)[0].reshape(4, -1).imag / STEP).max() <= 1e-11 * size
    assert np.abs(exact[2] - dilatation.slopes(law, F, grown)[1].imag / STEP).max() <= 1e-11 * size


@given(SEED)
def test_mean_dilatation_of_a_linear_material_takes_lambda_only(seed):
    """At small strain the stress is 2 mu eps + lambda theta I, exactly for the linear law."""
    rng, size = np.random.default_rng(seed), 1e-6
    H, theta = size * rng.uniform(-1.0, 1.0, (2, 2, N)), size * rng.uniform(-1.0, 1.0, N)
    F, strain = np.eye(2)[:, :, None] + H, (H + transpose(H)) / 2
    for solid in (LinearElastic(E, 0.45, 990.0), *RUBBERS):
        lam, mu = solid.lame
        law = Anchored(solid)
        by_F, by_theta = dilatation.slopes(law, F, theta if law.linear else 1.0 + theta)
        tolerance = (1e-9 if law.linear else 20 * size) * lam * size
        assert np.abs(by_F - 2 * mu * strain).max() <= tolerance
        assert np.abs(by_theta - lam * theta).max() <= tolerance


def test_the_energy_of_tiny_strains_is_not_lost_in_round_off():
    """W -> 1/2 eps : C : eps; at strains of 1e-7 the terms of the definition are 1e14 times larger than W."""
    law, strain = NeoHookean(E=10e6, nu=0.45, density=990.0), 1e-7 * np.array([[0.3, 0.5], [0.5, -1.1]])
    lam, mu = law.lame
    wanted = 0.5 * lam * np.trace(strain) ** 2 + mu * np.sum(strain**2)
    assert law.energy((np.eye(2) + strain)[:, :, None])[0] == pytest.approx(wanted, rel=1e-6)


# Rubber.


@pytest.mark.parametrize("solid", RUBBERS, ids=NAMES)
@given(SEED)
def test_rubber_is_isotropic_and_its_energy_of_tiny_strains_is_that_of_hooke(solid, seed):
    rng = np.random.default_rng(seed)
    F, R = random_gradients(rng), rotations(rng.uniform(0, 7, N))
    assert_close(cauchy(solid, product(F, R)), cauchy(solid, F), 1e-11)
    (lam, mu), strain = solid.lame, 1e-7 * np.array([[0.3, 0.5], [0.5, -1.1]])
    wanted = 0.5 * lam * np.trace(strain) ** 2 + mu * np.sum(strain**2)
    assert solid.energy((np.eye(2) + strain)[:, :, None])[0] == pytest.approx(wanted, rel=1e-6)
    assert pytest.approx(mu * (3 * lam + 2 * mu) / (lam + mu)) == solid.E and solid.nu == pytest.approx(
        lam / (2 * (lam + mu))
    )


def three_dimensional(solid, stretch):
    """W of the principal stretches stretch (3, n), as the books write it."""
    J = stretch.prod(axis=0)
    b, U = stretch * J ** (-1 / 3), 0.25 * (J**2 - 1 - 2 * np.log(J))
    first, second = (b**2).sum(axis=0) - 3, (b**-2.0).sum(axis=0) - 3
    if isinstance(solid, MooneyRivlin):
        return solid.c10 * first + solid.c01 * second + solid.bulk * U
    if isinstance(solid, Yeoh):
        return solid.c10 * first + solid.c20 * first**2 + solid.c30 * first**3 + solid.bulk * U
    terms = zip(solid.mu, solid.alpha, strict=True)
    return sum(m / a * ((b**a).sum(axis=0) - 3) for m, a in terms) + solid.bulk * U


@pytest.mark.parametrize("solid", RUBBERS[1:], ids=NAMES[1:])
@given(SEED)
def test_rubber_is_that_of_the_books_in_three_dimensions(solid, seed):
    """Energy, both stresses in the plane and the one across it: derivatives by stretches."""
    rng = np.random.default_rng(seed)
    stretch = np.exp(rng.uniform(-0.7, 0.7, size=(3, N)))
    stretch[2], stretch[1, 0] = 1.0, stretch[0, 0]  # one pair of equal stretches
    F = np.zeros((2, 2, N))
    F[0, 0], F[1, 1] = stretch[:2]
    scale = E * np.exp(4)
    assert np.abs(solid.energy(F) - three_dimensional(solid, stretch)).max() <= 1e-14 * scale
    slope = [three_dimensional(solid, stretch + 1j * STEP * np.eye(3)[k][:, None]).imag / STEP for k in range(3)]
    P = solid.stress(F)
    assert max(np.abs(P[k, k] - slope[k]).max() for k in (0, 1)) <= 1e-13 * scale
    assert np.abs(P[0, 1]).max() == np.abs(P[1, 0]).max() == 0.0
    assert np.abs(solid.stress_zz(F) - slope[2] / (stretch[0] * stretch[1])).max() <= 1e-13 * scale


def test_ogden_holds_the_others_as_special_cases():
    F = random_gradients(np.random.default_rng(3))
    for ogden, other in (
        (Ogden((2e6,), (2.0,), 2e7, 1.0), Yeoh(1e6, 0.0, 0.0, 2e7, 1.0)),
        (Ogden((2e6, -1e6), (2.0, -2.0), 2e7, 1.0), MooneyRivlin(1e6, 0.5e6, 2e7, 1.0)),
    ):
        assert ogden.lame == pytest.approx(other.lame)
        for answer in ("energy", "stress", "tangent", "stress_zz"):
            assert_close(getattr(ogden, answer)(F), getattr(other, answer)(F), 1e-12)
    with pytest.raises(ValueError, match="as many of both, no alpha zero"):
        Ogden((1e6, 2e6), (2.0,), 2e7, 1.0)


@pytest.mark.parametrize("solid", [*RUBBERS, LinearElastic(E, 0.3, 1.0)], ids=[*NAMES, "LinearElastic"])
def test_materials_can_be_pickled_and_pass_their_check(solid):
    assert pickle.loads(pickle.dumps(solid)) == solid
    text = check_material(solid)
    assert text.startswith(type(solid).__name__) and "complex step" in text
    assert ("exempt" in text) == (type(solid) is LinearElastic)


@pytest.mark.parametrize("strain", [1e-3, 1e-5, 1e-7])
def test_energies_of_small_strains_are_not_lost_in_round_off(strain):
    """At F and at a mean dilatation, against long double: sums of terms near one in another order lose them."""
    rng, solid = np.random.default_rng(0), NeoHookean(1e7, 0.45, 990.0)
    F, theta = np.eye(2)[:, :, None] + strain * rng.normal(size=(2, 2, 50)), 1.0 + strain * rng.normal(size=50)
    lam, mu = solid.lame
    long, mean = F.astype(np.longdouble), theta.astype(np.longdouble)

    def volume(F):
        return F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]

    def resisted(J):
        return J - 1.0 - np.log1p(J - 1.0)

    def energy(F):
        shear = (F[0, 0] - F[1, 1]) ** 2 + (F[0, 1] + F[1, 0]) ** 2
        return 0.5 * mu * shear + mu * resisted(volume(F)) + 0.5 * lam * np.log1p(volume(F) - 1.0) ** 2

    bar = np.sqrt(mean / volume(long)) * long
    at_mean = energy(bar) + mu * (resisted(volume(long)) - resisted(mean))
    for found, exact in ((solid.energy(F), energy(long)), (dilatation.energy(Anchored(solid), F, theta), at_mean)):
        assert np.abs(found - exact).max() < 1e-13 / strain * np.abs(exact).max()


@pytest.mark.parametrize("order", [0.5, 4.0, 15.0, 30.0, 75.0])
def test_functions_of_the_ratio_of_stretches_are_exact_at_any_order(order):
    """T - 1 = 2 sinh(order arsinh((z / 2)^1/2))^2, near z = 0 and beyond; T' and T'' by its differential equation."""
    z = np.geomspace(1e-9, 1.0, 400)
    t0, t1, t2 = half_angles(order, z)
    np.testing.assert_allclose(t0, 2.0 * np.sinh(order * np.arcsinh(np.sqrt(z / 2.0))) ** 2, rtol=1e-12)
    angle = 2.0 * np.arcsinh(np.sqrt(z / 2.0))
    np.testing.assert_allclose(t1, order * np.sinh(order * angle) / np.sinh(angle), rtol=1e-12)
    np.testing.assert_allclose(z * (2.0 + z) * t2 + (1.0 + z) * t1, order**2 * (1.0 + t0), rtol=1e-12)


def test_any_memory_layout_and_whole_numbers_give_the_same():
    """They gave what was in memory before, and numbers cut to whole ones."""
    F = np.eye(2)[:, :, None] + 0.1 * np.random.default_rng(0).uniform(-1.0, 1.0, (2, 2, 5))
    transposed = np.ascontiguousarray(F.swapaxes(0, 1)).swapaxes(0, 1)
    law = NeoHookean(1e6, 0.3, 1000.0)
    for other in (transposed, np.asfortranarray(F), np.repeat(F, 2, axis=2)[:, :, ::2]):
        for of in (law.energy, law.stress, law.tangent):
            np.testing.assert_array_equal(of(other), of(F))
    whole = np.array([[2, 0], [0, 1]])[:, :, None]
    for of in (law.energy, law.stress, law.tangent):
        np.testing.assert_array_equal(of(whole), of(whole.astype(float)))
