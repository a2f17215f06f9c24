"""Chosen steps follow slow motion in few steps, and swings without damping them.

Steps that resolved waves wherever nothing but loads or gravity moves bodies took 30,000 to 400,000; where waves were
not resolved, swings were damped. Reference: the block on a spring with Coulomb friction, whose half swings shorten by
2 mu m g / k.
"""

from itertools import islice

import numpy as np
import pytest

from skmpm import (
    Body,
    NeoHookean,
    Scene,
    Spring,
    Wall,
    box,
    capsule,
    disc,
    initial,
    simulate,
)

FLOOR = Wall((0, 0), (0, 1))
GRAVITY = (0.0, -9.81)


def last(scene, until, most, **options):
    """The last of at most so many states."""
    *_, state = islice(simulate(scene, until=until, warn=False, **options), most)
    return state


def test_cards_at_rest_take_a_handful_of_steps():
    """Nothing acts on two cards that lie on each other."""
    gel, thickness = NeoHookean(1e7, 0.3, density=1000.0), 1e-3
    cards = [Body(box((0, i * thickness), (0.03, thickness), spacing=0.17e-3), gel) for i in (0, 1)]
    for gravity in ((0.0, 0.0), GRAVITY):
        assert last(Scene(cards, cell=0.25e-3, walls=[FLOOR], gravity=gravity), 0.2, 20).t == pytest.approx(0.2)


def test_a_block_that_is_launched_flat_takes_some_hundred_steps():
    """At 6 m/s with friction 0.5 it slides v^2 / 2 mu g."""
    gel = NeoHookean(1e6, 0.3, density=100.0)
    block = Body(box((0, 0), (0.1, 0.1), spacing=0.01), gel, velocity=(6.0, 0.0))
    scene = Scene([block], cell=0.014, walls=[FLOOR], friction=0.5, gravity=GRAVITY)
    state = last(scene, 1.5, 500)
    assert state.t == pytest.approx(1.5)
    assert state.x[0].mean() - 0.05 == pytest.approx(6.0**2 / (2.0 * 0.5 * 9.81), rel=5e-3)


def test_cards_that_lean_on_each_other_settle_in_some_hundred_steps():
    """They stand, with 1.1 of the friction that they need, and bend under their weight; 6,000 steps for 0.01 s."""
    angle, length, thickness = np.radians(25.0), 0.1, 4e-3
    card, gel = (
        capsule((0, 0), length - thickness, thickness / 2, spacing=0.7e-3),
        NeoHookean(1e7, 0.3, density=700.0),
    )
    middle = 0.5 * (length - thickness) * np.array([np.sin(angle), np.cos(angle)]) + thickness / 2 + 1e-6
    cards = [Body(card.placed((s * middle[0], middle[1]), np.pi / 2 + s * angle), gel) for s in (-1, 1)]
    scene = Scene(cards, cell=1e-3, walls=[FLOOR], friction=0.55 * np.tan(angle), gravity=GRAVITY)
    assert last(scene, 0.01, 300).t == pytest.approx(0.01)


def test_half_swings_on_a_spring_shorten_by_friction_alone():
    """From 50 mm by 4.905 mm each, in pi sqrt(m / k) = 0.157 s; backward Euler takes 1.4 % more in each.

    Steps of a seventh of a cell damp them to 39.7 and 28.2 mm.
    """
    k, amplitude = 400.0, 0.05
    block = Body(box((0, 0), (0.1, 0.1), spacing=0.01), NeoHookean(1e6, 0.3, density=100.0))
    spring = Spring(lambda x: x[0] > -1, (k, 0.0), rest=(-amplitude, 0.0))
    scene = Scene([block], cell=0.014, walls=[FLOOR], friction=0.1, gravity=GRAVITY, springs=[spring])
    start = initial(scene).x[0].mean() - amplitude
    x = [state.x[0].mean() - start for state in simulate(scene, until=0.35, warn=False)]
    assert min(x) == pytest.approx(-45.1e-3, rel=0.02)
    assert max(x[int(np.argmin(x)) :]) == pytest.approx(40.2e-3, rel=0.04)


def test_a_free_spin_keeps_its_speed():
    """Over a radian, to 0.5 %: the points' velocities turn with it, which backward Euler damps."""
    gel = NeoHookean(1e6, 0.3, density=1000.0)
    state = last(Scene([Body(disc((0, 0), 1.0, spacing=0.1), gel, spin=1.0)], cell=0.2), 1.0, 500)
    assert state.t == pytest.approx(1.0)
    x, v = state.x, state.v
    assert state.mass @ (x[0] * v[1] - x[1] * v[0]) / (state.mass @ (x**2).sum(axis=0)) == pytest.approx(
        1.0, rel=5e-3
    )
