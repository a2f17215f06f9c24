"""Rigid bodies at contacts: their work, how discs roll on held ones, and spins in shared-grid contact."""

import numpy as np
import pytest

from skmpm.material import NeoHookean, Rigid
from skmpm.points import box, disc
from skmpm.scene import Body, Scene, Support, Wall
from skmpm.scheme import Scheme
from skmpm.simulation import simulate
from skmpm.step.initial_state import initial


def test_gravity_does_work_on_them_at_both_ends_of_quasi_static_steps():
    """A rigid block sinks into a soft one while gravity grows: by hand, the weights at both ends of each step."""
    soft = Body(box((0.0, 0.0), (2e-2, 2e-2), spacing=2.5e-3), NeoHookean(1e5, 0.3, 1000.0))
    rigid = Body(box((0.0, 2e-2), (2e-2, 1e-2), spacing=2.5e-3), Rigid(5000.0))

    def gravity(x, t):
        return np.stack([0.0 * x[0], -100.0 * t + 0.0 * x[1]])

    scene = Scene([soft, rigid], cell=5e-3, walls=[Wall((0.0, 0.0), (0.0, 1.0))], gravity=gravity, friction=0.5)
    last, work = initial(scene, scheme=Scheme(inertia=False)), 0.0
    for state in simulate(scene, dt=0.25, until=1.0, scheme=Scheme(inertia=False)):
        work -= float(100.0 * 0.5 * (state.t + last.t) * state.mass @ (state.x[1] - last.x[1]))
        last = state
    assert state.report.energy.external == pytest.approx(work, rel=1e-6)
    assert state.report.energy.dissipated > -1e-3 * work


@pytest.mark.parametrize("inertia", [True, False])
def test_a_held_disc_that_turns_in_place_without_friction_does_no_work(inertia):
    """Its points move along chords, whose normal part was counted."""
    block = Body(box((-3e-2, 0.0), (6e-2, 2e-2), spacing=4e-3), NeoHookean(1e6, 0.3, 1000.0))
    disc_ = disc((0.0, 4e-2), 2e-2, spacing=4e-3)

    def motion(t):
        return (0.0, -0.01 if t < 0.02 else 0.0, 0.0 if t < 0.03 else 20.0)

    turning = Body(points=disc_, material=Rigid(1000.0), motion=motion)
    scene = Scene([block, turning], cell=6e-3, supports=[Support(lambda x: x[1] < 1e-9)], friction=0.0)
    states = list(simulate(scene, dt=2e-3, until=0.06, scheme=Scheme(inertia=inertia)))
    before = next(s for s in states if s.t > 0.029)
    assert states[-1].body_force[1, 1] > 100.0
    done = states[-1].report.energy.external - before.report.energy.external
    assert abs(done) < 1e-3 * before.report.energy.external


@pytest.mark.parametrize("spacing", [5e-3, 3e-3])
def test_a_rigid_disc_rolls_on_a_held_plate_whatever_its_points(spacing):
    """On a finer plate, which gave the contact points, it stood on its chords."""
    R, slope = 0.02, np.radians(2.0)
    gravity = 9.81 * np.array([np.sin(slope), -np.cos(slope)])
    far = Body(box((1.0, 0.0), (R, R), spacing=4e-3), NeoHookean(1e6, 0.3, 1000.0))
    plate = Body(box((-0.05, -0.02), (0.2, 0.02), spacing=spacing), Rigid(1000.0), motion=(0.0, 0.0, 0.0))
    rolls = Body(disc((7e-4, R), R, spacing=4e-3), Rigid(1000.0))
    held = Support(lambda x: x[0] > 0.9)
    scene = Scene([far, rolls, plate], cell=5e-3, friction=0.5, gravity=gravity, supports=[held])
    *_, state = simulate(scene, dt=2e-3, until=0.2)
    own = state.body == 1
    speed = np.average(state.v[0, own], weights=state.mass[own])
    assert speed == pytest.approx(2.0 / 3.0 * gravity[0] * state.t, rel=5e-3)


def test_a_roller_drags_what_it_presses_in_shared_grid_contact_too():
    """It spins in place on a block with friction 0.5; its spin was ignored: a drag of 0.004 of the normal force."""
    block = Body(box((-0.03, 0.0), (0.06, 0.02), spacing=3e-3), NeoHookean(1e6, 0.3, 1000.0))
    roller = Body(disc((0.0, 0.044), 0.02, spacing=3e-3), Rigid(1000.0), motion=(0.0, -0.05, 20.0))
    held = [Support(lambda x: x[1] < 1e-9)]
    scene = Scene([block, roller], cell=4e-3, supports=held, friction=0.5)
    *_, state = simulate(scene, dt=2e-4, until=6e-3, scheme=Scheme.nezamabadi2017())
    force = state.body_force[:, 1]
    assert force[1] > 0.0
    assert force[0] < -0.3 * force[1]
