"""Right values that are known and not reached: each a strict xfail that names the issue which replaces what fails.

Chosen steps resolve waves for ever in scenes at rest, and damp swings. Reference: the block on a spring with Coulomb
friction, whose half swings shorten by 2 mu m g / k.
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
    initial,
    simulate,
)

FLOOR = Wall((0, 0), (0, 1))
GRAVITY = (0.0, -9.81)
STEPS = pytest.mark.xfail(strict=True, reason="issue 59: the length of steps by an error instead of kinds of scenes")


def last(scene, until, most, **options):
    """The last of at most so many states."""
    *_, state = islice(simulate(scene, until=until, warn=False, **options), most)
    return state


@STEPS
def test_cards_at_rest_take_a_handful_of_steps():
    """Nothing acts on two cards that lie on each other: 400,000 steps for 0.2 s, 89 with gravity."""
    gel, thickness = NeoHookean(1e7, 0.3, density=1000.0), 1e-3
    cards = [Body(box((0, i * thickness), (0.03, thickness), spacing=0.17e-3), gel) for i in (0, 1)]
    assert last(Scene(cards, cell=0.25e-3, walls=[FLOOR]), 0.2, 20).t == pytest.approx(0.2)


@STEPS
def test_a_block_that_is_launched_flat_takes_some_hundred_steps():
    """At 6 m/s with friction 0.5 it goes on for 1.22 s; 30,000 steps."""
    gel = NeoHookean(1e6, 0.3, density=100.0)
    block = Body(box((0, 0), (0.1, 0.1), spacing=0.01), gel, velocity=(6.0, 0.0))
    scene = Scene([block], cell=0.014, walls=[FLOOR], friction=0.5, gravity=GRAVITY)
    assert last(scene, 1.5, 60).t > 0.1


@STEPS
def test_cards_that_lean_on_each_other_take_some_tens_of_steps():
    """They stand, with 1.1 of the friction that they need; 60,000 steps for 0.1 s."""
    angle, length, thickness = np.radians(25.0), 0.1, 4e-3
    card, gel = (
        capsule((0, 0), length - thickness, thickness / 2, spacing=0.7e-3),
        NeoHookean(1e7, 0.3, density=700.0),
    )
    middle = 0.5 * (length - thickness) * np.array([np.sin(angle), np.cos(angle)]) + thickness / 2 + 1e-6
    cards = [Body(card.placed((s * middle[0], middle[1]), np.pi / 2 + s * angle), gel) for s in (-1, 1)]
    scene = Scene(cards, cell=1e-3, walls=[FLOOR], friction=0.55 * np.tan(angle), gravity=GRAVITY)
    assert last(scene, 0.1, 40).t > 0.01


@STEPS
def test_half_swings_on_a_spring_shorten_by_friction_alone():
    """From 50 mm by 4.905 mm each: the first ends at -45.1 mm after pi sqrt(m / k) = 0.157 s; damped at -39.7."""
    k, amplitude = 400.0, 0.05
    block = Body(box((0, 0), (0.1, 0.1), spacing=0.01), NeoHookean(1e6, 0.3, density=100.0))
    spring = Spring(lambda x: x[0] > -1, (k, 0.0), rest=(-amplitude, 0.0))
    scene = Scene([block], cell=0.014, walls=[FLOOR], friction=0.1, gravity=GRAVITY, springs=[spring])
    start = initial(scene).x[0].mean() - amplitude
    lowest = min(state.x[0].mean() - start for state in simulate(scene, until=0.18, warn=False))
    assert lowest == pytest.approx(-45.1e-3, abs=1e-3)
