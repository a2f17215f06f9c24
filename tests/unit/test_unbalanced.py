"""The unbalanced force ratio: free fall, rest, acceleration by known forces."""

import numpy as np
import pytest

from skmpm.material import NeoHookean
from skmpm.points import disc
from skmpm.scene import Body, Load, Scene, Support, Wall
from skmpm.simulate import initial, simulate, step

R, CELL = 1e-3, 2e-4
GEL = NeoHookean(10e6, 0.45, 990.0)
FLOOR = Wall((0, 0), (0, 1), friction=0.5)


def scene(*heights, **options):
    return Scene([Body(disc((0.0, y), R, spacing=0.74 * CELL), GEL) for y in heights], cell=CELL, **options)


def test_without_forces_it_is_zero_and_in_free_fall_infinite():
    still, falling = scene(R), scene(R, gravity=(0.0, -9.81))
    assert step(still, initial(still), 1e-5).report.unbalanced == 0.0
    assert step(falling, initial(falling), 1e-5).report.unbalanced == np.inf


def test_at_rest_it_vanishes():
    """A disc on another one: the mean force is 1.5 weights, and 1e-6 of it accelerates one."""
    resting = scene(R, 3.0 * R, walls=[FLOOR], friction=0.5, gravity=(0.0, -9.81))
    *_, state = simulate(resting, until=0.05)
    assert state.report.unbalanced < 1e-5


def test_two_discs_that_one_load_accelerates():
    """A load F on one of two equal discs accelerates both by F / 2 m, and their contact bears F / 2."""
    pushed = scene(R, 3.0 * R, loads=[Load(lambda x: x[1] < 2.0 * R, (0.0, 2.0))])
    states = list(simulate(pushed, dt=2e-5, until=2e-3))
    late = [s.report.unbalanced for s in states[len(states) // 2 :]]
    assert np.mean(late) == pytest.approx(1.0, rel=0.05)


def test_bodies_with_supports_are_left_out():
    held = scene(R, supports=[Support(lambda x: x[1] < 0.3 * R)], gravity=(0.0, -9.81))
    assert step(held, initial(held), 1e-5).report.unbalanced == 0.0
