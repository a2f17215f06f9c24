"""Pressures of fluids that follow contact: fronts and leaks by closed forms, balance, what is refused and unused."""

from dataclasses import replace

import numpy as np
import pytest
from test_only_what_is_required import Calls

import skmpm

R, E, NU = 1e-3, 1e6, 0.45
CELL = R / 12
STATIC = skmpm.Scheme(inertia=False)


def o_ring(value, **options):
    """A solid disc that two plates press in the first second, held in its middle; fluid to its left."""
    gel = skmpm.NeoHookean(E, NU, 1000.0)
    body = skmpm.Body(skmpm.disc((0.0, 0.0), R, spacing=0.6 * CELL), gel)
    speed = 0.05 * R
    plates = [
        skmpm.Wall((0, -R), (0, 1), velocity=lambda t: (0.0, speed if t < 1.0 else 0.0)),
        skmpm.Wall((0, R), (0, -1), velocity=lambda t: (0.0, -speed if t < 1.0 else 0.0)),
    ]
    fluid = skmpm.Pressure(lambda x: x[0] < -0.8 * R, value, penetrates=True)
    middle = skmpm.Support(lambda x: np.hypot(*x) < 0.15 * R)
    return skmpm.Scene([body], cell=CELL, walls=plates, loads=[fluid], supports=[middle], **options)


def ramp(t):
    """Zero while the plates move, then rising to 0.3 MPa a second later, and falling as fast."""
    return 3e5 * max(0.0, 1.0 - abs(t - 2.0))


@pytest.fixture(scope="module")
def sealed():
    """The scene of the O-ring and its states from the end of the plates' motion on."""
    scene = o_ring(ramp)
    states = skmpm.simulate(scene, dt=0.05, until=1.45, scheme=STATIC, warn=False)
    return scene, [state for state in states if state.t > 0.99]


def fronts(scene, state):
    """The wetted points farthest to the right at the upper and the lower plate, (2, 2)."""
    (points,) = skmpm.wetted(scene, state)
    x = state.x[:, points]
    return np.stack([x[:, np.argmax(np.where(side, x[0], -np.inf))] for side in (x[1] > 0.0, x[1] < 0.0)], axis=1)


def test_the_front_lies_where_the_pressure_of_hertz_falls_below_that_of_the_fluid(sealed):
    """While the fluid is so weak that it hardly deforms the disc; to the spacing of boundary points and 0.1 a."""
    scene, states = sealed
    k = next(k for k, state in enumerate(states) if state.t > 1.04)
    state, after = states[k : k + 2]
    p, peak = ramp(state.t), skmpm.contact_pressure(scene, state, 0).pressure.max()
    half_width = 2.0 * R * peak * (1.0 - NU**2) / E
    expected = -half_width * np.sqrt(1.0 - (p / peak) ** 2)
    np.testing.assert_allclose(fronts(scene, after)[0], expected, atol=0.6 * CELL + 0.1 * half_width)


def test_the_fluid_pushes_with_its_pressure_times_the_height_of_its_fronts(sealed):
    """The support bears it alone, as contacts without friction push up and down."""
    scene, states = sealed
    for state in states[2:]:
        top, bottom = fronts(scene, state)[1]
        assert state.support_force[0, 0] == pytest.approx(ramp(state.t) * (top - bottom), rel=0.01)


def test_a_seal_holds_up_to_the_peak_of_its_contact_pressure_and_leaks_above(sealed):
    """With inertia from there: a seal that gives way has no equilibrium near."""
    scene, states = sealed
    peak = skmpm.contact_pressure(scene, states[-1], 0).pressure.max()
    assert ramp(states[-1].t) < peak and fronts(scene, states[-1])[0].max() < 0.25 * R
    damped = skmpm.Body(scene.bodies[0].points, skmpm.NeoHookean(E, NU, 1000.0, viscosity=1e3))
    soft = replace(scene, bodies=[damped])
    start = skmpm.at_rest(soft, skmpm.continued(scene, states[-1], soft))
    for leaking in skmpm.simulate(soft, until=2.0, start=start, warn=False):
        if fronts(soft, leaking)[0].min() > 0.9 * R:
            break
    assert 0.85 * peak < ramp(leaking.t) < 1.15 * peak


def test_fluid_leaves_contacts_that_close(sealed):
    scene, states = sealed
    falling = skmpm.Pressure(scene.loads[0].where, lambda t: 1e5 * (1.7 - t), penetrates=True)
    lower = skmpm.Scene(scene.bodies, cell=CELL, walls=scene.walls, loads=[falling], supports=scene.supports)
    state = states[-1]
    before = fronts(scene, state)[0]
    state = skmpm.run(
        lower, dt=0.05, until=1.6, start=skmpm.continued(scene, state, lower), scheme=STATIC, warn=False
    )
    assert (fronts(lower, state)[0] < before - 0.1 * R).all()


@pytest.mark.parametrize(("share", "tight"), [(0.95, True), (1.1, False)])
def test_a_block_that_the_fluid_presses_against_its_stop_seals_itself(share, tight):
    """Squeezed by a strain e it bears E' e and nu / (1 - nu) p of the fluid at its side: it leaks where that is p."""
    nu, strain = 0.3, 0.02
    limit = E / (1.0 - nu**2) * strain / (1.0 - nu / (1.0 - nu))
    block = skmpm.Body(skmpm.box((0, 0), (2 * R, R), spacing=R / 16), skmpm.LinearElastic(E, nu, 1000.0))
    plates = [
        skmpm.Wall((0, 0), (0, 1)),
        skmpm.Wall((0, R), (0, -1), velocity=lambda t: (0.0, -strain * R if t < 1.0 else 0.0)),
        skmpm.Wall((2 * R, 0), (-1, 0)),
    ]
    fluid = skmpm.Pressure(
        lambda x: x[0] < 1e-9, lambda t: share * limit * min(max(t - 1.0, 0.0), 1.0), penetrates=True
    )
    scene = skmpm.Scene([block], cell=R / 8, walls=plates, loads=[fluid])
    state = skmpm.run(scene, dt=0.1, until=2.3, scheme=STATIC, warn=False)
    reached = state.x[0, skmpm.wetted(scene, state)[0]].max() / (2 * R)
    assert (reached < 0.1) if tight else (reached > 0.9)


def test_no_fluid_passes_what_a_support_holds():
    """A block that is glued along its foot: the fluid to its left wets its left side and top, and the other side."""
    block = skmpm.Body(skmpm.box((0, 0), (2 * R, R), spacing=R / 8), skmpm.LinearElastic(E, NU, 1000.0))
    fluid = skmpm.Pressure(lambda x: x[0] < 1e-9, 1e4, penetrates=True)
    glued = skmpm.Scene([block], cell=R / 4, loads=[fluid], supports=[skmpm.Support(lambda x: x[1] < 1e-9)])
    state = skmpm.run(glued, dt=0.1, until=0.2, scheme=STATIC, warn=False)
    (points,) = skmpm.wetted(glued, state)
    x, y = block.points.x[:, block.points.outline[0]]
    free = (y > 1e-9) | (x < 1e-9) | (x > 2 * R - 1e-9)  # up to the ends of the foot
    assert sorted(points.tolist()) == sorted(block.points.outline[0][free].tolist())


def test_a_restart_is_exact(sealed):
    scene, states = sealed
    (again,) = skmpm.simulate(scene, dt=0.05, until=states[3].t, start=states[2], scheme=STATIC, warn=False)
    assert np.array_equal(again.x, states[3].x)


def test_a_pressure_that_stays_asks_for_no_pressure_of_contacts():
    body = skmpm.Body(skmpm.disc((0.0, 0.0), R, spacing=R / 5), skmpm.NeoHookean(E, NU, 1000.0))
    scene = skmpm.Scene([body], cell=R / 3, loads=[skmpm.Pressure(lambda x: x[0] < 0.0, 1e3)])
    with Calls() as calls:
        state = skmpm.run(scene, dt=1e-5, until=2e-5, warn=False)
    assert calls.named("contact_pressure") == 0
    (points,) = skmpm.wetted(scene, state)
    assert points.size and (body.points.x[0, points] < 0.0).all()


def test_what_cannot_be_is_refused():
    with pytest.raises(skmpm.SceneError, match="load 0: penetrates = 'yes'; use True or False"):
        scene = o_ring(1e3)
        skmpm.Scene(scene.bodies, cell=CELL, loads=[skmpm.Pressure(scene.loads[0].where, 1e3, penetrates="yes")])
    scene = o_ring(1e3)
    with pytest.raises(skmpm.SceneError, match="contacts act at grid nodes"):
        skmpm.run(scene, dt=0.05, until=0.2, scheme=skmpm.Scheme.nezamabadi2017(), warn=False)


def test_the_free_side_is_pressed_up_to_its_corners_and_nothing_changes_at_a_constant_pressure():
    """A tight block bears the fluid on its stop; what is wet stays as it is from step to step."""
    block = skmpm.Body(skmpm.box((0, 0), (2 * R, R), spacing=R / 16), skmpm.NeoHookean(E, 0.3, 1000.0))
    plates = [
        skmpm.Wall((0, 0), (0, 1)),
        skmpm.Wall((0, R), (0, -1), velocity=lambda t: (0.0, -0.02 * R if t < 1.0 else 0.0)),
        skmpm.Wall((2 * R, 0), (-1, 0)),
    ]
    value = 0.9 * E / (1 - 0.3**2) * 0.02 / (1 - 0.3 / 0.7)
    fluid = skmpm.Pressure(lambda x: x[0] < 1e-9, lambda t: value * min(max(t - 1.0, 0.0), 1.0), penetrates=True)
    scene = skmpm.Scene([block], cell=R / 8, walls=plates, loads=[fluid])
    states = list(skmpm.simulate(scene, dt=0.2, until=4.0, scheme=STATIC, warn=False))
    left = min(state.wall_force[2, 0] for state in states if state.t > 2.5)
    height = states[-1].walls[1, 1]
    assert left == pytest.approx(value * height, rel=2e-3)
    wet = [state.wetted for state in states if state.t > 2.5]
    assert all(np.array_equal(wet[0], each) for each in wet)


def test_suction_enters_no_contact():
    scene = o_ring(lambda t: -1e3 * t)
    with pytest.raises(skmpm.SceneError, match=r"pressure 0: a fluid that penetrates has -50 Pa at t = 0.05 s"):
        skmpm.run(scene, dt=0.05, until=0.2, scheme=STATIC, warn=False)


def test_the_first_step_of_a_ramp_has_the_fluid():
    """On open boundaries, which no contact closes: the force on what holds the block is the pressure of the end."""
    block = skmpm.Body(skmpm.box((0, 0), (2 * R, R), spacing=R / 8), skmpm.NeoHookean(E, 0.3, 1000.0))
    held = [skmpm.Support(lambda x: x[0] > 2 * R - 1e-9)]
    fluid = skmpm.Pressure(lambda x: x[0] < 1e-9, lambda t: 1e4 * t, penetrates=True)
    scene = skmpm.Scene([block], cell=R / 4, loads=[fluid], supports=held)
    state = skmpm.run(scene, dt=0.1, until=0.1, scheme=STATIC, warn=False)
    assert state.support_force[0, 0] == pytest.approx(1e3 * R, rel=1e-2)


def test_a_state_with_other_pressures_is_refused(sealed):
    scene, states = sealed
    other = skmpm.Scene(
        scene.bodies, cell=CELL, walls=scene.walls, loads=[*scene.loads, *scene.loads], supports=scene.supports
    )
    with pytest.raises(skmpm.SceneError, match=r"wetted: the state has 1 pressures on .* segments, the scene 2"):
        skmpm.wetted(other, states[-1])
