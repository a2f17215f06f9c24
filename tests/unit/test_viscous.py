"""Kelvin and Voigt's viscosity: a potential with its derivatives, objective, in any frame; the energy budget."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skmpm import (
    Body,
    NeoHookean,
    Scene,
    SceneError,
    Scheme,
    Wall,
    disc,
    initial,
    load,
    save,
    simulate,
    step,
)
from skmpm.material import LinearElastic, Viscous, determinant, inverse, product
from skmpm.step.acceptance import check_step
from skmpm.step.errors import StepRejected
from skmpm.step.terms import Budget

SEED = st.integers(0, 2**32 - 1)
STEP, N, ETA, DT = 1e-30, 8, 3.0, 0.25
RESISTANCE = 2.0 * ETA / DT
R = 1e-3


def rotations(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def gradients(rng, strain=0.4):
    stretch = np.zeros((2, 2, N))
    stretch[0, 0], stretch[1, 1] = np.exp(rng.uniform(-strain, strain, size=(2, N)))
    return product(product(rotations(rng.uniform(0, 7, N)), stretch), rotations(rng.uniform(0, 7, N)))


def close(found, expected, tol):
    assert np.abs(found - expected).max() <= tol * np.abs(expected).max()


@pytest.mark.parametrize("linear", [False, True])
@given(SEED)
def test_stress_and_tangent_are_derivatives_of_the_potential(linear, seed):
    rng = np.random.default_rng(seed)
    F, law = gradients(rng), Viscous(RESISTANCE, gradients(rng), linear)
    P, C = np.zeros((2, 2, N)), np.zeros((2, 2, 2, 2, N))
    for i, j in np.ndindex(2, 2):
        moved = F.astype(complex)
        moved[i, j] += 1j * STEP
        P[i, j], C[:, :, i, j] = law.energy(moved).imag / STEP, law.stress(moved).imag / STEP
    close(law.stress(F), P, 1e-12)
    close(law.tangent(F), C, 1e-12)


@given(SEED)
def test_the_potential_is_that_of_the_rate_of_strain_and_knows_no_rotation_of_its_ends(seed):
    """Psi = eta / dt J_n tr[(C_n^-1 (E_1 - E_n))^2] from any reference; rotations do not show."""
    rng = np.random.default_rng(seed)
    start, F, turn = gradients(rng), gradients(rng), rotations(rng.uniform(0, 7, N))
    strain = [0.5 * product(G.swapaxes(0, 1), G) for G in (start, F)]
    rate = product(inverse(2.0 * strain[0]), strain[1] - strain[0])
    expected = ETA / DT * determinant(start) * np.einsum("ijp,jip->p", rate, rate)
    law = Viscous(RESISTANCE, start, False)
    close(law.energy(F), expected, 1e-11)
    close(Viscous(RESISTANCE, start, False).energy(product(turn, F)), expected, 1e-11)
    close(Viscous(RESISTANCE, product(turn, start), False).energy(F), expected, 1e-11)
    anchor = gradients(rng)  # another reference configuration: per volume of it
    other = Viscous(RESISTANCE, product(start, inverse(anchor)), False).energy(product(F, inverse(anchor)))
    close(other * determinant(anchor), expected, 1e-11)
    assert np.abs(law.energy(product(turn, start))).max() <= 1e-13 * ETA / DT * determinant(start).max()


@pytest.mark.parametrize("linear", [False, True])
def test_the_stress_of_a_slow_step_is_twice_viscosity_times_the_rate_of_deformation(linear):
    """Cauchy stress to first order in the step, at a deformed state (an undeformed one, linear)."""
    rng = np.random.default_rng(0)
    start = np.repeat(np.eye(2)[:, :, None], N, axis=2) if linear else gradients(rng)
    L, errors = rng.normal(size=(2, 2, N)), []
    for dt in (1e-4, 1e-5):
        F = product(np.eye(2)[:, :, None] + dt * L, start)
        P = Viscous(2.0 * ETA / dt, start, linear).stress(F)
        sigma = P if linear else product(P, F.swapaxes(0, 1)) / determinant(F)
        errors.append(np.abs(sigma - ETA * (L + L.swapaxes(0, 1))).max())
    assert errors[0] < 1e-2
    assert linear or errors[1] == pytest.approx(0.1 * errors[0], rel=0.1)


@pytest.mark.parametrize("e", [0.014, 0.0036])
def test_the_error_of_the_stress_is_of_first_order_in_the_strain_of_a_step(e):
    """2.5 e in uniaxial strain; of simple shear normal stresses eta rate e and twice that (`own_material.md`)."""

    def cauchy(F):
        return product(Viscous(RESISTANCE, np.eye(2)[:, :, None], linear=False).stress(F), F.swapaxes(0, 1))[..., 0]

    pressed, sheared = np.eye(2)[:, :, None], np.eye(2)[:, :, None]
    pressed[1, 1], sheared[0, 1] = 1.0 - e, e
    exact = -2.0 * ETA * e / (DT * (1.0 - e))  # by the rate of deformation at the end
    assert cauchy(pressed)[1, 1] / (1.0 - e) / exact - 1.0 == pytest.approx(-2.5 * e, rel=0.02)
    shear = ETA * e / DT
    assert cauchy(sheared) == pytest.approx(shear * np.array([[2.0 * e, 1.0], [1.0, e]]), rel=2.0 * e)


def squeezed(material, **options):
    walls = [Wall((0, 2 * R), (0, -1), velocity=(0, -1.0)), Wall((0, 0), (0, 1))]
    return Scene([Body(disc((0.0, R), R, spacing=R / 8), material, **options)], cell=R / 4, walls=walls)


@pytest.mark.parametrize("law", [LinearElastic, NeoHookean])
@pytest.mark.parametrize("scheme", [Scheme(), Scheme(theta=0.5), Scheme(anchor=0.0)], ids=["1", "1/2", "anchor 0"])
def test_energies_add_up_and_viscosity_never_gives_any(law, scheme):
    """The sum kinetic + elastic + viscous + dissipated - external - push-out - relaid is constant; viscous rises."""
    material = law(1e6, 0.45, 1000.0, viscosity=5.0)
    energy = [s.report.energy for s in simulate(squeezed(material), dt=5e-6, until=1e-4, scheme=scheme)]
    total = [
        e.kinetic + e.elastic + e.viscous + e.dissipated - e.external - e.push_out - e.regridding for e in energy
    ]
    assert np.ptp(total) <= 1e-12 * energy[-1].external
    assert (np.diff([0.0] + [e.viscous for e in energy]) > 0.0).all()
    assert energy[-1].viscous > 0.05 * energy[-1].external
    *_, plain = simulate(squeezed(law(1e6, 0.45, 1000.0)), dt=5e-6, until=1e-5)
    assert plain.report.energy.viscous == 0.0


def test_a_run_goes_on_from_a_file_to_the_bit(tmp_path):
    """After every third of twenty steps; what a state keeps beside what is saved must not show."""
    scene = squeezed(NeoHookean(1e6, 0.3, 1000.0, viscosity=50.0))
    dt = 5e-5
    states = [initial(scene)]
    for _ in range(20):
        states.append(step(scene, states[-1], dt))
    for k in range(0, 18, 3):
        save(tmp_path / "state", states[k])
        again, same = load(tmp_path / "state"), states[k + 2]
        for _ in range(2):
            again = step(scene, again, dt)
        for name in ("x", "F", "stress", "nodal_velocity"):
            assert np.array_equal(getattr(again, name), getattr(same, name)), name


def test_what_viscosity_takes_does_not_hide_a_gain_of_energy():
    """In a step that keeps its energy although viscosity dissipates some, that came from nothing."""
    scene = squeezed(NeoHookean(1e6, 0.3, 1000.0, viscosity=5.0))
    *_, state = simulate(scene, dt=5e-6, until=1e-5)
    budget = Budget(elastic=np.array([1.0, 0.95]), viscous=0.05)
    assert check_step(scene, Scheme(), state, state, budget) == 0.0
    with pytest.raises(StepRejected, match="the bodies gain energy without work"):
        check_step(scene, Scheme(), state, state, replace(budget, elastic=np.array([1.0, 1.0])))


@pytest.mark.parametrize("law", [LinearElastic, NeoHookean])
def test_without_inertia_viscosity_makes_the_force_depend_on_the_rate(law):
    """Twice the rate, twice the viscous part of the force on a wall; on the way the same elastic one."""
    scheme, found = Scheme(inertia=False, newton_tol=1e-6), {}
    for eta, dt in ((0.0, 1e-5), (5.0, 1e-5), (10.0, 2e-5)):
        scene = squeezed(law(1e6, 0.3, 1000.0, viscosity=eta))
        scene = replace(scene, walls=[replace(scene.walls[0], velocity=(0, -1e-5 / dt)), scene.walls[1]])
        *_, state = simulate(scene, dt=dt, until=10 * dt, scheme=scheme)
        found[eta] = state.wall_force[0, 1]
    assert found[10.0] == pytest.approx(found[5.0], rel=1e-6)  # eta times rate is the same
    assert found[5.0] > 1.05 * found[0.0]


def test_a_viscosity_that_is_negative_or_not_finite_is_refused():
    for wrong in (-1.0, np.nan, np.inf):
        with pytest.raises(SceneError, match=r"body 0: material is .*viscosity = .*; give one in Pa s, zero or more"):
            squeezed(NeoHookean(1e6, 0.3, 1000.0, viscosity=wrong))
