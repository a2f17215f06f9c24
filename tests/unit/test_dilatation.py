"""Mean dilatation: derivatives of the energy, frame indifference, and dependence on the mean of cells only.

Derivatives by the complex step where the code allows it, else by central differences.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import skmpm
from skmpm import MooneyRivlin, Ogden
from skmpm.grid import build_grids, forms
from skmpm.grid.assembly import prepare
from skmpm.material import Anchored, LinearElastic, NeoHookean, determinant, dilatation, product, response
from skmpm.scene import mises, stress_zz
from skmpm.step.bulk import Bulk

SEED = st.integers(0, 2**32 - 1)
CELL = 0.2
SOFT, LINEAR = NeoHookean(2e6, 0.49, 1200.0), LinearElastic(1e7, 0.45, 990.0)
OGDEN, MOONEY = Ogden((6e5, 1.2e3, -1e4), (1.3, 5.0, -2.0), 2e7, 1e3), MooneyRivlin(1e5, 5e4, 4e6, 1e3)
MIXES = {"soft": [SOFT, SOFT], "linear": [LINEAR, LINEAR], "mixed": [SOFT, LINEAR], "rubber": [OGDEN, MOONEY]}
ALL, NONE, FIRST = (True, True), (), (True, False)  # which of two materials are averaged


def random_gradients(rng, n, size=0.2):
    return np.eye(2)[:, :, None] + rng.uniform(-size, size, size=(2, 2, n))


def random_bulk(seed, mix="mixed", regridded_state=True, averaged=ALL, points=20, ghost=0.01):
    """Two bodies on top of each other, with cells of one and of many points."""
    rng = np.random.default_rng(seed)
    body = rng.permutation(np.repeat([0, 1], points))
    x = CELL * rng.uniform(0.0, 3.0, size=(2, body.size))
    volume = rng.uniform(0.02, 0.3, body.size) * CELL**2
    grid = build_grids(x, body, CELL, 2)
    assembly = prepare(grid, volume, 1e3 * volume, np.full(grid.cells, ghost * 1e6))
    materials = [(m, np.flatnonzero(body == b)) for b, m in enumerate(MIXES[mix])]
    stress = 1e5 * rng.normal(size=(2, 2, body.size))
    F_anchor = random_gradients(rng, body.size) if regridded_state else None
    bulk = Bulk(assembly, materials, F_anchor, stress + stress.swapaxes(0, 1) if regridded_state else None, averaged)
    return rng, bulk, 0.03 * CELL * rng.normal(size=2 * assembly.grid.nodes)


def dense(bulk, data):
    return bulk.assembly.matrix(data, 1.0).toarray() - np.diag(bulk.assembly.mass)


def assert_close(actual, expected, tol):
    assert actual.shape == expected.shape
    assert np.abs(actual - expected).max() <= tol * np.abs(expected).max()


@pytest.mark.parametrize("regridded_state", [False, True], ids=["undeformed anchor", "deformed anchor"])
@pytest.mark.parametrize("averaged", [ALL, FIRST, FIRST[::-1]], ids=["all", "first", "second"])
@pytest.mark.parametrize("mix", MIXES)
@settings(max_examples=10)
@given(seed=SEED)
def test_force_is_the_derivative_of_the_energy_and_stiffness_that_of_the_force(mix, averaged, regridded_state, seed):
    """Central differences of step 1e-6 cells: errors of 1e-10 by curvature, 1e-9 by cancellation."""
    rng, bulk, U = random_bulk(seed, mix, regridded_state, averaged)
    d, step = rng.normal(size=U.size), 1e-6 * CELL
    ahead, behind = (bulk.at(U + s * step * d) for s in (1, -1))
    at = bulk.at(U)
    slope = (bulk.energy(ahead) - bulk.energy(behind)) / (2 * step)
    assert slope == pytest.approx(bulk.force(at) @ d, rel=1e-6, abs=1e-6 * np.abs(bulk.force(at) * d).sum())
    change = (bulk.force(ahead) - bulk.force(behind)) / (2 * step)
    K = dense(bulk, bulk.stiffness(at))
    assert_close(K @ d, change, 1e-6)
    assert_close(K, K.T, 1e-12)


def configuration(bulk, U, F, mean):
    """A configuration without a compiled pass, whose F and dilatation do not follow from its displacement."""
    at = bulk.at(U)
    vars(at).update(F=F, dilatation=mean, responses=(None, None))  # as if they had been evaluated
    return at


@pytest.mark.parametrize("averaged", [NONE, ALL, FIRST], ids=["none", "all", "first"])
@pytest.mark.parametrize("mix", ["soft", "linear", "mixed"])
@settings(max_examples=10)
@given(seed=SEED, regridded_state=st.booleans())
def test_the_compiled_pass_is_what_the_functions_of_any_material_give(mix, averaged, seed, regridded_state):
    _, bulk, U = random_bulk(seed, mix, regridded_state, averaged)
    one = bulk.at(U)
    other = configuration(bulk, U, one.F, one.dilatation)
    assert all(found is not None for found in one.responses)
    size = sum(m.lame[0] + 2.0 * m.lame[1] for m, _ in bulk.materials)
    assert bulk.energy(one) == pytest.approx(bulk.energy(other), rel=1e-12, abs=1e-15 * size * CELL**2)
    assert np.abs(bulk.stress(one) - bulk.stress(other)).max() <= 1e-13 * size
    assert_close(bulk.force(one), bulk.force(other), 1e-12)
    inside_out = bulk.at(-1.5 * bulk.assembly.grid.position.T.ravel() * np.array([1.0, 0.0])[np.arange(U.size) % 2])
    assert np.isinf(bulk.energy(inside_out)) == (mix != "linear")


def test_materials_of_another_class_have_no_compiled_pass():
    class Stiffer(NeoHookean):
        def energy(self, F):
            return 2.0 * super().energy(F)

    _, bulk, U = random_bulk(0, "rubber")
    assert bulk.at(U).responses == (None, None)
    assert response(Anchored(Stiffer(1e6, 0.3, 1e3)), random_gradients(np.random.default_rng(0), 3), None) is None


@given(SEED)
def test_fast_stiffness_equals_the_mixed_form(seed):
    rng, bulk, _ = random_bulk(seed, ghost=0.0)
    fast, n = bulk.assembly, bulk.assembly.volume.size
    slope, mixed, rest = rng.normal(size=(2, 2, n)), rng.normal(size=(2, 2, n)), rng.uniform(0.5, 2.0, n)
    bulk_modulus = rng.normal(size=n)
    basis = fast.grid.basis(fast.volume)
    expected = forms.mean_dilatation_stiffness(basis, slope, mixed, bulk_modulus, rest).toarray()
    added = fast.mean_dilatation_stiffness(slope.reshape(4, n), mixed.reshape(4, n), bulk_modulus, rest)
    nothing = np.zeros((2, 2, 2, 2, n))
    assert_close(dense(bulk, fast.stiffness(nothing, (slice(None), added))), expected, 1e-12)


@given(SEED)
def test_mean_dilatation_is_the_ratio_of_the_cells_volumes(seed):
    rng, bulk, U = random_bulk(seed, "soft")
    at, volume = bulk.at(U), bulk.assembly.volume
    total = determinant(product(at.F, bulk.F_anchor))
    initial = volume / determinant(bulk.F_anchor)
    for c in rng.integers(0, bulk.assembly.grid.cells, 3):
        own = bulk.assembly.grid.cell_of_point == c
        assert at.dilatation[own] == pytest.approx((initial * total)[own].sum() / initial[own].sum(), rel=1e-12)


@pytest.mark.parametrize("mix", ["soft", "linear"])
def test_a_uniform_deformation_is_as_it_was(mix):
    """Energy, force, Cauchy stress: where all points share a dilatation its mean says nothing new."""
    _, plain, _ = random_bulk(1, mix, regridded_state=False, averaged=NONE)
    _, mean, _ = random_bulk(1, mix, regridded_state=False)
    U = (plain.assembly.grid.position.T @ np.array([[0.1, 0.05], [-0.02, -0.08]])).ravel()
    for ask in (lambda b: np.array([b.energy(b.at(U))]), lambda b: b.force(b.at(U)), lambda b: b.cauchy(b.at(U))):
        assert_close(ask(mean), ask(plain), 1e-10)


def test_regridding_in_the_same_cells_changes_nothing():
    """Energy, force and stiffness seen from the deformed body grid are those seen from the first, up to the frame."""
    rng, first, _ = random_bulk(2, "soft", regridded_state=False, ghost=0.0)
    grid, n = first.assembly.grid, first.assembly.volume.size
    G = np.array([[1.2, 0.1], [-0.05, 0.9]])
    # The same cells, stretched: gradients of the new body grid are those of the old one times G^-1.
    U = 0.03 * CELL * rng.normal(size=2 * grid.nodes)
    H = grid.gradient_at_points(U)
    end = np.eye(2)[:, :, None] + H
    F_anchor = np.repeat(G[:, :, None], n, axis=2)
    anew = Bulk(
        prepare(grid, np.linalg.det(G) * first.assembly.volume, first.assembly.volume, np.zeros(grid.cells)),
        first.materials,
        F_anchor,
        None,
        ALL,
    )
    relative = product(end, np.repeat(np.linalg.inv(G)[:, :, None], n, axis=2))
    early, late = (
        configuration(
            bulk,
            U,
            F,
            bulk._cell_means(np.concatenate([dilatation.volumes(g.law, g.part(F)) for g in bulk.groups], -1)),
        )
        for bulk, F in ((first, end), (anew, relative))
    )
    assert_close(late.dilatation, early.dilatation, 1e-12)
    assert anew.energy(late) == pytest.approx(first.energy(early), rel=1e-11)
    P = np.einsum("ijp,kj->ikp", anew.stress(late), np.linalg.inv(G)) * np.linalg.det(G)
    assert_close(P, first.stress(early), 1e-11)
    assert_close(anew.cauchy(late), first.cauchy(early), 1e-11)


@pytest.mark.parametrize("mix", ["soft", "mixed"])
def test_bodies_of_another_material_are_as_without_bit_for_bit(mix):
    """And those averaged as where all are: forces, stresses, and blocks of the stiffness."""
    (_, none, U), (_, both, _), (_, first, _) = (random_bulk(4, mix, averaged=a) for a in (NONE, ALL, FIRST))
    own = first.assembly.grid.node_body == 0
    at_node, at_point = np.repeat(own, 2), np.isin(np.arange(40), first.materials[0][1])
    block = own[first.assembly.indices]
    for ask, mask in (
        (lambda b: b.force(b.at(U)), at_node),
        (lambda b: b.cauchy(b.at(U)), at_point),
        (lambda b: np.moveaxis(b.stiffness(b.at(U)), 0, -1), block),
    ):
        assert np.array_equal(ask(first)[..., ~mask], ask(none)[..., ~mask])
        assert np.array_equal(ask(first)[..., mask], ask(both)[..., mask])
        assert not np.array_equal(ask(both), ask(none))


@pytest.mark.parametrize("mix", ["soft", "mixed", "rubber"])
def test_bodies_of_another_material_pay_nothing(mix, monkeypatch):
    """Nothing of mean dilatations is asked of points or cells of theirs."""
    _, bulk, U = random_bulk(5, mix, averaged=FIRST)
    asked = []
    for name in ("volumes", "with_tension", "volume_slope", "slopes", "tangents"):
        original = getattr(dilatation, name)
        monkeypatch.setattr(
            dilatation,
            name,
            lambda law, F, *rest, _f=original, **options: asked.append(F.shape[-1]) or _f(law, F, *rest, **options),
        )
    sums, original = [], type(bulk.assembly).mean_dilatation
    monkeypatch.setattr(type(bulk.assembly), "mean_dilatation", lambda *a: sums.append(a[1].shape[1]) or original(*a))
    at = bulk.at(U)
    assert bulk.force(at).shape == U.shape
    _, added = bulk.tangents(at)
    assert set(asked) == set(sums) == {20}
    assert len(added[1]) == np.sum(bulk.assembly.grid.cell_body == 0) < bulk.assembly.grid.cells


def test_off_nothing_of_it_is_computed(monkeypatch):
    _, bulk, U = random_bulk(3, averaged=NONE)
    for name in ("mean_dilatation", "mean_dilatation_stiffness"):
        monkeypatch.setattr(type(bulk.assembly), name, None)
    at = bulk.at(U)
    assert at.dilatation is None
    assert np.isfinite(bulk.energy(at)) and np.isfinite(bulk.force(at)).all()
    assert np.isfinite(bulk.stiffness(at)).all()


def test_the_stress_out_of_the_plane_has_the_averaged_pressure():
    """A squeezed disc of nu = 0.49: nu (xx + yy) at small strain; with the J of its points 7 times as much."""
    law = skmpm.NeoHookean(E=1e6, nu=0.49, density=1000.0)
    body = skmpm.Body(skmpm.disc((0.0, 1.0), 1.0, spacing=0.15), law)
    walls = [skmpm.Wall((0, 0), (0, 1)), skmpm.Wall((0, 2.0), (0, -1), velocity=(0.0, -0.02))]
    scene = skmpm.Scene([body], cell=0.2, walls=walls)
    *_, state = skmpm.simulate(scene, dt=0.5, until=1.0, scheme=skmpm.Scheme(inertia=False))
    zz, expected = stress_zz(scene, state), 0.49 * (state.stress[0, 0] + state.stress[1, 1])
    assert np.sqrt(np.mean((zz - expected) ** 2)) < 0.2 * np.sqrt(np.mean(expected**2))
    assert mises(state.stress, zz).max() == pytest.approx(mises(state.stress, expected).max(), rel=0.05)
