"""The unbalanced force ratio: free fall, rest, acceleration by known forces."""

import numpy as np
import pytest

from skmpm.material import NeoHookean, Rigid
from skmpm.points import disc
from skmpm.scene import Body, Load, Periodic, Scene, Support, Wall
from skmpm.scheme import Scheme
from skmpm.simulation import simulate
from skmpm.step.algorithm import step
from skmpm.step.initial_state import initial

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
    """A disc on another one: the mean force is 1.5 weights, and 2e-6 of it accelerates one, Newton's tolerance."""
    resting = scene(R, 3.0 * R, walls=[FLOOR], friction=0.5, gravity=(0.0, -9.81))
    *_, state = simulate(resting, until=0.05, scheme=Scheme(newton_tol=1e-6))
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


def test_a_free_rigid_body_that_falls_is_out_of_balance_as_an_elastic_one_is():
    """Beside a disc that rests on a floor: its weight over the one force."""
    found = []
    for material in (Rigid(990.0), GEL):
        rests = Body(disc((0.0, R), R, spacing=0.74 * CELL), GEL)
        falls = Scene(
            [rests, Body(disc((9.0 * R, 5.0 * R), R, spacing=0.74 * CELL), material)],
            cell=CELL, walls=[FLOOR], gravity=(0.0, -9.81),
        )  # fmt: skip
        *_, state = simulate(falls, dt=1e-4, until=5e-3)
        found.append(state.report.unbalanced)
    assert found[0] == pytest.approx(found[1], rel=1e-3)
    assert found[0] > 0.5


def test_a_pair_that_touches_across_a_periodic_box_on_both_sides_has_two_forces():
    """They cancelled, and two discs squeezed in a box were a thousand times out of balance."""
    bodies = [Body(disc((x, R), R, spacing=0.74 * CELL), GEL) for x in (R, 3.0 * R)]
    box = Periodic(4.0 * R, 2.0 * R, rate=((-10.0, 0.0), (0.0, 0.0)))
    squeezed = Scene(bodies, cell=CELL, periodic=box, friction=0.5)
    *_, state = simulate(squeezed, dt=1e-4, until=2e-3, scheme=Scheme(inertia=False))
    assert state.contacts.force[0].sum() > 0.0
    assert state.report.unbalanced < 1e-2


@pytest.mark.parametrize("theta", [1.0, 0.5])
def test_two_discs_that_collide_are_out_of_balance_by_the_force_between_them(theta):
    """Impacts, at the end of steps of the midpoint rule, are left out of resultants and of the mean force."""
    places = [(0.0, 1.0), (2.05 * R, -1.0)]
    bodies = [Body(disc((0.0, y), R, spacing=0.74 * CELL), GEL, velocity=(0.0, v)) for y, v in places]
    states = simulate(Scene(bodies, cell=CELL), dt=1e-6, until=1e-4, scheme=Scheme(theta=theta))
    found = [state.report.unbalanced for state in states if state.contacts.force[0].any()]
    assert len(found) > 20
    assert found == pytest.approx([1.0] * len(found), rel=1e-3)
