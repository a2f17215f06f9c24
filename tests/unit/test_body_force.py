"""Contact forces and moments on bodies, against balances of momentum and statics."""

import numpy as np
import pytest

from skmpm import Body, NeoHookean, Rigid, Scene, Scheme, Wall, box, disc, initial, simulate

R = 1e-2
GEL = NeoHookean(1e6, 0.3, 1000.0)


def test_forces_and_moments_are_the_rates_of_momentum():
    """Three discs that collide with friction: momentum of each body, angular momentum about its centre."""
    places = [((0.0, 0.0), (1.0, 0.3)), ((2.05 * R, 0.3 * R), (-1.0, 0.0)), ((1.0 * R, 2.0 * R), (0.0, -0.5))]
    bodies = [Body(disc(x, R, spacing=R / 6), GEL, velocity=v) for x, v in places]
    scene, dt = Scene(bodies, cell=R / 4, friction=0.5), 1e-4
    before = initial(scene)
    for state in simulate(scene, dt=dt, until=30 * dt):
        after = state
        momentum = [np.stack([np.bincount(s.body, s.mass * v) for v in s.v]) for s in (before, after)]
        np.testing.assert_allclose(after.body_force, (momentum[1] - momentum[0]) / dt, atol=1e-6 * 1e3)
        before = after
    force, moment = np.zeros((2, 3)), np.zeros(3)
    for state in simulate(scene, dt=dt, until=30 * dt):
        force, moment = force + dt * state.body_force, moment + dt * state.body_moment
    assert np.abs(force.sum(axis=1)).max() < 1e-12 * np.abs(force).max()
    spin = np.zeros(3)
    for b in range(3):
        own = state.body == b
        x, v, m = state.x[:, own], state.v[:, own], state.mass[own]
        arm = x - np.average(x, axis=1, weights=m)[:, None]
        spin[b] = np.sum(m * (arm[0] * v[1] - arm[1] * v[0]))
    assert np.abs(moment).max() > 1e-4
    assert spin == pytest.approx(moment, rel=0.05, abs=0.02 * np.abs(moment).max())  # points: without their C


def test_a_rigid_body_has_the_force_that_presses_on_it():
    """A soft disc between a lid and a rigid block that is not centred below: the moment is force times distance."""
    block = Body(box((-2 * R, -R), (3 * R, R), spacing=R / 4), Rigid(1000.0), motion=(0.0, 0.0, 0.0))
    scene = Scene([block, Body(disc((0.0, R), R, spacing=R / 7), GEL)], cell=R / 5,
                  walls=[Wall((0.0, 2 * R), (0.0, -1.0), force=50.0)])  # fmt: skip
    *_, state = simulate(scene, dt=1.0, until=2.0, scheme=Scheme(inertia=False))
    assert state.body_force == pytest.approx(np.array([[0.0, 0.0], [-50.0, 0.0]]), abs=0.1)
    assert state.body_moment[0] == pytest.approx(-50.0 * 0.5 * R, rel=0.01)  # its centre is at x = -R / 2


def test_without_contacts_there_is_none():
    scene = Scene([Body(disc((3 * i * R, 0.0), R, spacing=R / 4), GEL) for i in range(2)], cell=R / 3)
    state = initial(scene)
    assert not state.body_force.any() and not state.body_moment.any() and state.body_force.shape == (2, 2)
