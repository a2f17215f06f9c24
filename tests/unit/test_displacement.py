"""Supports with a given displacement: exact at the ends of steps of any length, and what is refused."""

import re

import numpy as np
import pytest

import skmpm

L = 1e-3
GEL = skmpm.NeoHookean(E=1e6, nu=0.3, density=1000.0)
BAR = skmpm.box((0.0, 0.0), (4 * L, L), spacing=L / 4)
PERIOD = 1e-3


def stretched(displacement, **support):
    """A bar held at its left end, its right end on a support."""
    ends = [
        skmpm.Support(lambda x: x[0] < 1e-9),
        skmpm.Support(lambda x: x[0] > 4 * L - 1e-9, displacement=displacement, **support),
    ]
    return skmpm.Scene([skmpm.Body(BAR, GEL)], cell=L / 2, supports=ends)


def sine(t):
    return (0.2 * L * np.sin(2.0 * np.pi * t / PERIOD), None)


@pytest.mark.parametrize("inertia", [True, False])
@pytest.mark.parametrize("dt", [1.7e-4, 0.3e-4])
def test_displacement_holds_at_the_ends_of_steps(dt, inertia):
    """Also of the last, shorter one; with a velocity taken at the middles, long steps miss it by 4 %."""
    scene = stretched(sine)
    right = scene.supported[1].points
    for state in skmpm.simulate(scene, dt=dt, until=0.4 * PERIOD, scheme=skmpm.Scheme(inertia=inertia)):
        moved = state.x[0, right] - scene.initial_positions[0, right]
        assert moved == pytest.approx(np.full(right.size, sine(state.t)[0]), abs=1e-12 * L)


def test_chosen_steps_follow_the_displacement():
    """Nothing driven moves farther than 0.14 cells in a step, as for velocities."""
    scene, last = stretched(sine), 0.0
    right = scene.supported[1].points[0]
    for state in skmpm.simulate(scene, until=0.3 * PERIOD, scheme=skmpm.Scheme(inertia=False)):
        moved = state.x[0, right] - scene.initial_positions[0, right]
        assert moved == pytest.approx(sine(state.t)[0], abs=1e-12 * L)
        assert abs(moved - last) < 0.15 * scene.cell
        last = moved


def test_a_linear_displacement_is_a_velocity():
    """The two give the same stresses, to round-off."""
    speed, dt, ends = 0.5, 1e-5, []
    moving = skmpm.Support(lambda x: x[0] > 4 * L - 1e-9, velocity=(speed, None))
    given = stretched(lambda t: (speed * t, None))
    for supports in (given.supports, [given.supports[0], moving]):
        scene = skmpm.Scene(given.bodies, cell=given.cell, supports=supports)
        *_, end = skmpm.simulate(scene, dt=dt, until=20 * dt)
        ends.append(end)
    assert ends[0].stress == pytest.approx(ends[1].stress, abs=1e-9 * np.abs(ends[1].stress).max())


@pytest.mark.parametrize(
    ("displacement", "support", "message"),
    [
        ((1e-4, 0.0), {}, "support 1: displacement = (0.0001, 0.0); give a function of time"),
        (lambda t: (1e-4 + t, 0.0), {}, "displacement at t = 0 is [0.0001 0.    ]; give the displacement since then"),
        (lambda t: (t, 0.0), {"velocity": (1.0, 0.0)}, "velocity = (1.0, 0.0) and displacement; give one of them"),
        (lambda t: (t, 0.0), {"velocity": (None, 0.0)}, "velocity = (None, 0.0) and displacement"),
        (lambda t: (None, None), {}, "support 1: displacement = (None, None) prescribes nothing"),
        (lambda t: t, {}, "support 1: displacement = 0.0; give two components"),
    ],
)
def test_wrong_displacement_is_refused(displacement, support, message):
    with pytest.raises(skmpm.SceneError, match=re.escape(message)):
        stretched(displacement, **support)


def test_displacement_that_is_not_finite_is_refused_when_it_comes():
    scene = stretched(lambda t: (t if t < 5e-5 else np.nan, None))
    with pytest.raises(skmpm.SceneError, match=r"support 1: displacement = \(nan, None\)"):
        list(skmpm.simulate(scene, dt=1e-5, until=1e-4))
