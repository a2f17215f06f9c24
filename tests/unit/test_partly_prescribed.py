"""Rigid bodies with some components of their motion prescribed, and others moved by forces."""

import numpy as np
import pytest

import skmpm
from skmpm import Body, Load, Rigid, Wall

R, F, MU, V = 1e-3, 2.0, 0.3, 0.5
GEL = skmpm.NeoHookean(E=1e6, nu=0.45, density=990.0)
FAR = Body(skmpm.disc((20.0 * R, R), R, spacing=R / 6), GEL)  # a scene needs a deformable body
RHO = 2000.0
IDLER = skmpm.disc((0.0, 0.0), R, spacing=R / 16)
PLATE = skmpm.box((-6.0 * R, R), (12.0 * R, R), spacing=R / 6)
STATIC = skmpm.Scheme(inertia=False, newton_tol=1e-7)


def on_plate(x):
    return x[1] > 1.01 * R


def plate_on_idler(plate=(V, None, 0.0), idler=(0.0, 0.0, None), load=F):
    bodies = [Body(IDLER, Rigid(RHO), motion=idler), Body(PLATE, Rigid(RHO), motion=plate), FAR]
    loads = [Load(lambda x: on_plate(x) & (np.abs(x[0]) < 15 * R), (0.0, -load))] if load else []
    return skmpm.Scene(bodies, cell=R / 4, friction=MU, loads=loads)


def motion_of(scene, state, b):
    """Velocity of the centre and spin, from the points."""
    own = state.body == b
    mass, x, v = state.mass[own], state.x[:, own], state.v[:, own]
    arm = x - np.average(x, axis=1, weights=mass)[:, None]
    spin = (mass * (arm[0] * v[1] - arm[1] * v[0])).sum() / (mass * (arm**2).sum(axis=0)).sum()
    return np.append(np.average(v, axis=1, weights=mass), spin)


def test_a_plate_that_is_drawn_over_an_idler_spins_it_up():
    """Its spin grows by 2 mu F / (m R), to 2 %, until its rim moves with the plate; what is given stays exact.

    The plate rides on a polygon with smooth corners, so that its force varies by some hundredths.
    """
    scene, dt = plate_on_idler(), 2e-5
    mass = RHO * IDLER.volume.sum()
    rate = 2.0 * MU * F / (mass * R)
    slides = V / R / rate
    state = skmpm.initial(scene)
    while state.t < 1.5 * slides:
        state = skmpm.step(scene, state, dt)
        idler, plate = motion_of(scene, state, 0), motion_of(scene, state, 1)
        assert idler[:2] == pytest.approx([0.0, 0.0], abs=1e-12)
        assert plate[[0, 2]] == pytest.approx([V, 0.0], abs=1e-9)
        if 0.2 * slides < state.t < 0.9 * slides:
            assert idler[2] == pytest.approx(-rate * state.t, rel=0.02)
            assert state.body_force[:, 1] == pytest.approx([-MU * F, F], rel=0.04)
    assert idler[2] == pytest.approx(-V / R, rel=5e-3)
    assert abs(plate[1]) < 1e-3 * V


def test_the_budget_of_energy_has_the_work_of_what_draws():
    """Work mu F v dt of a step is what the idler gains and friction dissipates; kinetic energy is of free parts."""
    scene, dt = plate_on_idler(), 2e-5
    *_, before = skmpm.simulate(scene, dt=dt, until=10 * dt)
    after = skmpm.step(scene, before, dt)
    one, other = before.report.energy, after.report.energy
    assert other.external - one.external == pytest.approx(MU * F * V * dt, rel=1e-2)
    spin = motion_of(scene, after, 0)[2]
    own = after.body == 0
    arm = after.x[:, own] - np.average(after.x[:, own], axis=1, weights=after.mass[own])[:, None]
    inertia = float(after.mass[own] @ (arm**2).sum(axis=0))
    assert other.kinetic == pytest.approx(0.5 * inertia * spin**2, rel=1e-3)


def test_without_inertia_a_plate_settles_until_the_block_bears_its_load():
    """Wall and plate bear the load to 1e-6, the plate keeps its angle though the load is off centre."""
    block = Body(skmpm.box((-2 * R, 0.0), (4 * R, R), spacing=R / 6), GEL)
    plate = Body(PLATE, Rigid(RHO), motion=(0.0, None, 0.0))
    load = Load(lambda x: on_plate(x) & (x[0] > 3 * R), (0.0, -F))
    scene = skmpm.Scene([block, plate], cell=R / 4, walls=[Wall((0, 0), (0, 1))], loads=[load])
    state = skmpm.step(scene, skmpm.initial(scene), 1.0, scheme=STATIC)
    assert state.wall_force[0] == pytest.approx([0.0, -F], abs=1e-5 * F)
    assert state.body_force[:, 1] == pytest.approx([0.0, F], abs=1e-5 * F)
    own = state.body == 1
    moved = state.x[:, own] - scene.initial_positions[:, own]
    assert np.ptp(moved, axis=1) == pytest.approx([0.0, 0.0], abs=1e-12)
    assert moved[1].mean() < 0.0


def test_a_component_may_be_a_function_of_time_and_a_stage_may_free_it():
    """V = t a while it is given; then the plate goes on with its velocity, and turns under a load off its centre."""
    a, dt, n = 100.0, 1e-4, 10
    moving = plate_on_idler(plate=lambda t: (a * t, 0.0, 0.0), load=0.0)
    *_, state = skmpm.simulate(moving, dt=dt, until=n * dt)
    assert motion_of(moving, state, 1)[0] == pytest.approx(a * n * dt, rel=1e-9)
    partly = plate_on_idler(plate=lambda t: (None, 0.0, 0.0), load=0.0)
    after = skmpm.step(partly, skmpm.continued(moving, state, partly), dt)
    assert motion_of(partly, after, 1)[0] == pytest.approx(a * n * dt, rel=1e-6)


def test_a_component_is_free_always_or_never():
    scene = plate_on_idler(plate=lambda t: (V, None if t < 1e-4 else 0.0, 0.0))
    with pytest.raises(skmpm.SceneError, match="free always or never"):
        list(skmpm.simulate(scene, dt=4e-5, until=4e-4))


@pytest.mark.parametrize("motion", [(V, None), (V, "x", 0.0), (V, np.inf, None), 1.0])
def test_bad_components_are_refused(motion):
    with pytest.raises(skmpm.SceneError, match="each a finite number or None"):
        plate_on_idler(plate=motion)


def test_a_rigid_plate_under_a_load_takes_as_few_steps_as_a_wall():
    """Some twenty, where every swing of it cost a hundred: losses are allowed as for what a force drives."""
    grain = Body(skmpm.disc((0.0, R), R, spacing=R / 5), GEL)
    plate = Body(skmpm.box((-2 * R, 2 * R), (4 * R, 0.6 * R), spacing=R / 5), Rigid(RHO), motion=(0.0, None, 0.0))
    load = Load(lambda x: x[1] > 2.05 * R, (0.0, -20.0))
    scene = skmpm.Scene([grain, plate], cell=R / 4, walls=[Wall((0, 0), (0, 1))], loads=[load])
    assert sum(1 for _ in skmpm.simulate(scene, until=4e-3)) < 40


def test_a_velocity_may_be_given_where_no_motion_is():
    body = Body(IDLER, Rigid(RHO), motion=(None, 0.0, 0.0), velocity=(0.2, 0.0))
    scene = skmpm.Scene([body, FAR], cell=R / 4)
    state = skmpm.step(scene, skmpm.initial(scene), 1e-4)
    assert motion_of(scene, state, 0) == pytest.approx([0.2, 0.0, 0.0], abs=1e-12)
    with pytest.raises(skmpm.SceneError, match="give one of them"):
        skmpm.Scene([Body(IDLER, Rigid(RHO), motion=(None, 0.0, 0.0), velocity=(0.2, 0.1)), FAR], cell=R / 4)


def test_a_start_from_rest_moves_on_as_prescribed():
    """The plate slides on, the idler turns no more; what turns goes on turning."""
    scene = plate_on_idler(idler=(0.0, None, 3.0), load=None)
    *_, state = skmpm.simulate(scene, dt=1e-4, until=3e-4)
    start = skmpm.at_rest(scene, state)
    assert motion_of(scene, start, 0) == pytest.approx([0.0, 0.0, 3.0], abs=1e-9)
    assert motion_of(scene, start, 1) == pytest.approx([V, 0.0, 0.0], abs=1e-12)
