"""Free rigid bodies: their motion by forces, contacts with all others, what they cost unused, what is refused."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_only_what_is_required import Calls

import skmpm
from skmpm.step.rigid_bodies import rigid_state

R, G = 1e-3, 9.81
GEL = skmpm.NeoHookean(E=1e6, nu=0.45, density=990.0)
RIGID = skmpm.Rigid(2000.0)
STATIC = skmpm.Scheme(inertia=False)
FLOOR = skmpm.Wall((0.0, 0.0), (0.0, 1.0))
FAR = skmpm.Body(skmpm.disc((-20.0 * R, R), R, spacing=R / 6), GEL)  # a scene needs a deformable body


def scene(bodies, **options):
    settings = {"cell": R / 4, "walls": [FLOOR], "friction": 0.5, "gravity": (0.0, -G)} | options
    return skmpm.Scene(bodies, **settings)


def centre(state, b):
    own = state.body == b
    return np.average(state.x[:, own], axis=1, weights=state.mass[own])


@pytest.mark.parametrize(("degrees", "mu"), [(0.5, 0.5), (30.0, 0.5), (30.0, 0.1)])
def test_a_disc_rolls_or_slides_down_a_slope(degrees, mu):
    """2/3 g sin where friction holds it, g (sin - mu cos) and a spin of 2 mu g cos / R where not, to 1e-3."""
    angle, until = np.deg2rad(degrees), 0.02
    disc = skmpm.Body(skmpm.disc((0.0, R), R, spacing=R / 8), RIGID)
    slope = scene([disc, FAR], friction=mu, gravity=(G * np.sin(angle), -G * np.cos(angle)))
    *_, state = skmpm.simulate(slope, dt=1e-4, until=until)
    v = rigid_state(slope, state).velocity[:, 0]
    if mu > np.tan(angle) / 3.0:
        speed, spin = 2.0 / 3.0 * G * np.sin(angle) * until, None
    else:
        speed, spin = G * (np.sin(angle) - mu * np.cos(angle)) * until, 2.0 * mu * G * np.cos(angle) * until
    assert v[0] == pytest.approx(speed, rel=1e-3)
    radius = rigid_state(slope, state).radius[0]
    assert -v[2] * R / radius == pytest.approx(speed if spin is None else spin, rel=2e-3)


def test_without_inertia_a_rigid_body_stays_where_a_wall_leaves_it():
    """It flew on at the speed of the wall, or at its initial velocity, for ever."""
    pushes = skmpm.Wall((-R, 0), (1, 0), velocity=lambda t: (0.1 * (t < 5e-4), 0.0))
    disc, bead = (
        skmpm.Body(skmpm.disc((x, y), R, spacing=R / 6), RIGID, velocity=v, spin=spin)
        for x, y, v, spin in ((0.0, R, (0.0, 0.0), 0.0), (5.0 * R, R, (1.0, 0.5), 100.0))
    )
    soft = replace(FAR, points=FAR.points.placed((20.0 * R, R)))
    pushed = scene([disc, bead, soft], walls=[pushes], gravity=(0.0, 0.0))
    assert "ignores the initial velocities" in str(
        skmpm.preflight(replace(pushed, bodies=pushed.bodies[1:]), scheme=STATIC)
    )
    *_, state = skmpm.simulate(pushed, dt=1e-4, until=1.5e-3, scheme=STATIC)
    assert centre(state, 0) == pytest.approx([0.05 * R, R], abs=1e-6 * R)
    assert centre(state, 1) == pytest.approx([5.0 * R, R], abs=1e-12)


def test_a_free_flight_is_exact_in_backward_euler():
    """A spinning box in gravity: v = v0 + g t, constant spin, the path of backward Euler, and no contact."""
    box = skmpm.Body(skmpm.box((5 * R, 5 * R), (R, 2 * R), spacing=R / 6), RIGID, velocity=(0.3, 0.2), spin=50.0)
    flight, dt, steps = scene([FAR, box]), 1e-4, 50
    start = skmpm.initial(flight)
    *_, state = skmpm.simulate(flight, dt=dt, until=steps * dt)
    moved = centre(state, 1) - centre(start, 1)
    fall = -G * dt**2 * steps * (steps + 1) / 2.0
    assert moved == pytest.approx([0.3 * steps * dt, 0.2 * steps * dt + fall], rel=1e-12)
    own, angle = start.body == 1, 50.0 * steps * dt
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    arms = turn @ (start.x[:, own] - centre(start, 1)[:, None])
    assert state.x[:, own] == pytest.approx(arms + centre(state, 1)[:, None], abs=1e-12)
    v, fallen = rigid_state(flight, state), -G * steps * dt
    assert v.velocity[:, 0] == pytest.approx([0.3, 0.2 + fallen, 50.0 * v.radius[0]], rel=1e-9)


def test_a_collision_keeps_momentum():
    """A rigid disc hits a soft one off centre: momentum is kept to 1e-6, and energy does not grow."""
    soft = skmpm.Body(skmpm.disc((0.0, 0.0), R, spacing=R / 8), GEL)
    hard = skmpm.Body(skmpm.disc((2.02 * R, 0.7 * R), R, spacing=R / 8), RIGID, velocity=(-1.0, 0.0), spin=100.0)
    pair = skmpm.Scene([soft, hard], cell=R / 5, friction=0.4)
    first = skmpm.initial(pair)

    before, states = first.v @ first.mass, list(skmpm.simulate(pair, dt=5e-6, until=6e-4))
    assert max(state.contacts.force[0].max(initial=0.0) for state in states) > 1.0
    for state in states[::10]:
        assert np.abs(state.v @ state.mass - before).max() < 1e-6 * np.abs(before).max()
    energy = states[-1].report.energy
    assert energy.kinetic + energy.elastic < first.report.energy.kinetic
    assert energy.dissipated >= 0.0


@pytest.mark.parametrize("theta", [1.0, 0.5])
def test_an_impact_is_inelastic_with_any_theta(theta):
    """A disc, of 50 corners, thrown at a floor, which it hits in the middle of a step, slides on without a rebound.

    Friction takes mu times the normal impulse, which spins the disc by 2 mu v_n / R.
    """
    mu, v = 0.3, (2.0, -1.0)
    disc = skmpm.Body(skmpm.disc((0.0, 1.05 * R), R, spacing=R / 8), RIGID, velocity=v)
    thrown = scene([disc, FAR], friction=mu, gravity=(0.0, 0.0))
    *_, state = skmpm.simulate(thrown, dt=1.1e-5, until=1e-4, scheme=skmpm.Scheme(theta=theta))
    found = rigid_state(thrown, state)
    assert found.velocity[:2, 0] == pytest.approx([v[0] + mu * v[1], 0.0], abs=3e-3)
    assert found.velocity[2, 0] / found.radius[0] == pytest.approx(2.0 * mu * v[1] / R, rel=0.02)
    energy, mass = state.report.energy, state.mass[state.body == 0].sum()
    kinetic = 0.5 * (mass * (found.velocity[:, 0] ** 2).sum())
    assert energy.kinetic == pytest.approx(kinetic, rel=1e-9)
    assert energy.dissipated == pytest.approx(0.5 * mass * (v[0] ** 2 + v[1] ** 2) - kinetic, rel=1e-7)


@pytest.mark.parametrize("scheme", [skmpm.Scheme(), STATIC], ids=["dynamic", "static"])
def test_a_block_rests_on_a_soft_one(scheme):
    """The contact force is its weight; it sinks by what the soft one gives way: less than a hundredth of a cell."""
    soft = skmpm.Body(skmpm.box((-2 * R, 0.0), (4 * R, 2 * R), spacing=R / 6), GEL)
    block = skmpm.Body(skmpm.box((-R, 2 * R), (2 * R, 2 * R), spacing=R / 6), RIGID)
    pair = scene([soft, block])
    dt, until = (2e-4, 2e-2) if scheme.inertia else (0.1, 0.2)
    *_, state = skmpm.simulate(pair, dt=dt, until=until, scheme=scheme)
    weight = RIGID.density * 4 * R**2 * G
    assert state.body_force[1, 1] == pytest.approx(weight, rel=2e-3)
    assert abs(centre(state, 1)[1] - 3 * R) < 0.01 * pair.cell
    assert state.wall_force[0, 1] == pytest.approx(-weight - GEL.density * 8 * R**2 * G, rel=5e-3)


def test_rigid_blocks_stand_on_each_other():
    """Contacts between rigid bodies alone, more of them than their motions: a stack of three does not move."""
    blocks = [skmpm.Body(skmpm.box((-R, 2 * R * k), (2 * R, 2 * R), spacing=R / 6), RIGID) for k in range(3)]
    stack = scene([*blocks, FAR])
    *_, state = skmpm.simulate(stack, dt=1e-4, until=5e-3)
    for k in range(3):
        assert centre(state, k) == pytest.approx([0.0, (2 * k + 1) * R], abs=1e-6 * R)
    assert state.body_force[1, :3] == pytest.approx(np.full(3, RIGID.density * 4 * R**2 * G), rel=1e-6)


@pytest.mark.parametrize("scheme", [skmpm.Scheme(), STATIC], ids=["dynamic", "static"])
def test_supports_elsewhere_do_not_hold_them(scheme):
    """A grain on the floor and on a rigid block beside a soft disc that is held; a soft disc is held on a grain."""
    held = skmpm.Body(skmpm.disc((-20.0 * R, R), R, spacing=R / 6), GEL)
    low, high = (skmpm.Body(skmpm.disc((0.0, y * R), R, spacing=R / 8), RIGID) for y in (1.0, 3.0))
    supports = [skmpm.Support(lambda x: (x[0] < -10.0 * R) & (x[1] > R))]
    beside = scene([held, low, high], supports=supports, friction=0.0)
    *_, state = skmpm.simulate(beside, dt=1e-4, until=1e-3, scheme=scheme)
    weight = 2.0 * RIGID.density * state.volume[state.body == 1].sum() * G
    assert state.wall_force[0, 1] == pytest.approx(-weight, rel=1e-6)


def test_a_rigid_disc_rests_between_two_others_by_friction():
    """A pile of three: without friction the lower ones would part; the upper one stays where geometry puts it."""
    places = ((-1.01, 1.0), (1.01, 1.0), (0.0, 1.0 + np.sqrt(4.0 - 1.01**2)))
    pile = scene([*(skmpm.Body(skmpm.disc((x * R, y * R), R, spacing=R / 8), RIGID) for x, y in places), FAR])
    *_, state = skmpm.simulate(pile, dt=1e-4, until=2e-2)
    assert centre(state, 2) == pytest.approx([0.0, places[2][1] * R], abs=2e-3 * R)


def test_restart_is_exact():
    bodies = [
        skmpm.Body(skmpm.disc((0.0, R), R, spacing=R / 6), GEL),
        skmpm.Body(skmpm.disc((0.3 * R, 3.1 * R), R, spacing=R / 6), RIGID, spin=20.0),
    ]
    falling = scene(bodies)
    states = list(skmpm.simulate(falling, dt=1e-4, until=6e-3))
    *_, again = skmpm.simulate(falling, dt=1e-4, until=6e-3, start=states[30])
    assert np.array_equal(states[-1].x, again.x) and np.array_equal(states[-1].v, again.v)


def test_scenes_without_free_bodies_do_not_know_them():
    """No unknown is made, and none of their functions is called."""
    with Calls() as calls:
        list(skmpm.simulate(scene([FAR]), dt=1e-4, until=3e-4))
    names = ("rigid_state", "FreeBodies.in_step", "FreeBodies.rows")
    assert [calls.named(name) for name in names] == [0] * len(names)


def test_observables_count_free_bodies_as_grains():
    """Their branches begin at their centres, so that the stress of a mixture is that of all contacts."""
    bodies = [
        skmpm.Body(skmpm.disc((0.0, R), R, spacing=R / 6), GEL),
        skmpm.Body(skmpm.disc((0.0, 3 * R), R, spacing=R / 6), RIGID),
    ]
    walls = [FLOOR, skmpm.Wall((0.0, 4 * R), (0.0, -1.0), velocity=(0.0, -0.1)),
             skmpm.Wall((-R, 0.0), (1.0, 0.0)), skmpm.Wall((R, 0.0), (-1.0, 0.0))]  # fmt: skip
    pressed = scene(bodies, walls=walls, friction=0.0, gravity=(0.0, 0.0))
    *_, state = skmpm.simulate(pressed, dt=5e-5, until=1e-3)
    found = skmpm.observe(pressed, state)
    pull = state.wall_force[1, 1]
    assert found.bodies.counted.all()
    assert found.stress[1, 1] == pytest.approx(-pull * (4 * R - 1e-4) / (2 * R * (4 * R - 1e-4)), rel=0.02)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"velocity": lambda x: x}, "body 0: velocity is a function, of a Rigid body; give its velocity at t = 0"),
        ({"velocity": (np.nan, 0.0)}, "body 0: velocity.*two finite numbers"),
        ({"spin": np.inf}, "body 0: spin = inf"),
        ({"spin": 1.0, "motion": (0, 0, 0)}, "body 0: spin = 1.0 and motion; give one of them"),
    ],
)
def test_bad_input_is_refused(options, message):
    with pytest.raises(skmpm.SceneError, match=message):
        scene([skmpm.Body(skmpm.disc((0.0, R), R, spacing=R / 6), RIGID, **options), FAR])


def test_contact_at_shared_nodes_is_refused():
    bodies = [skmpm.Body(skmpm.disc((0.0, R), R, spacing=R / 6), RIGID), FAR]
    message = "initial: body 0 is a free rigid body, which contact = shared_grid cannot; use Scheme"
    with pytest.raises(skmpm.SceneError, match=re.escape(message)):
        skmpm.initial(scene(bodies), scheme=skmpm.Scheme.nezamabadi2017())


def test_a_load_beside_the_centre_swings_a_rigid_body():
    """Along the solution of I a'' = F L cos a, with the energy of the midpoint rule, and the centre by F / m."""
    until, force = 0.05, 0.03
    disc = skmpm.disc((0.0, 0.0), R, spacing=R / 10)

    def at_its_side(x):
        return (np.abs(x[0] - R) < R / 10) & (np.abs(x[1]) < R / 8)

    load = skmpm.Load(at_its_side, (0.0, force))
    swing = scene([FAR, skmpm.Body(disc, RIGID)], gravity=(0.0, 0.0), walls=[], loads=[load])
    loaded = swing.loaded[0]
    *_, state = skmpm.simulate(swing, dt=2.5e-4, until=until, scheme=skmpm.Scheme(theta=0.5))
    start, end = (rigid_state(swing, each) for each in (skmpm.initial(swing), state))
    inertia = start.mass[0] * start.radius[0] ** 2
    x, y = swing.initial_positions[:, loaded.points] @ loaded.share - start.centre[:, 0]
    arm, angle = np.hypot(x, y), np.arctan2(y, x)
    exact = solve_ivp(lambda t, a: (a[1], force * arm * np.cos(a[0]) / inertia), (0, until), (angle, 0.0), rtol=1e-9)
    last, spin = exact.y[:, -1]
    x, y = state.x[:, loaded.points] @ loaded.share - end.centre[:, 0]
    assert np.arctan2(y, x) == pytest.approx(np.arctan2(np.sin(last), np.cos(last)), abs=1e-3)
    assert end.velocity[2, 0] / end.radius[0] == pytest.approx(spin, rel=1e-3)
    assert end.centre[1, 0] - start.centre[1, 0] == pytest.approx(force / start.mass[0] * until**2 / 2)
    assert state.report.energy.external == pytest.approx(state.report.energy.kinetic, rel=1e-4)


@pytest.mark.parametrize("offset", [0.1, 0.25])
def test_a_punch_is_pressed_on_in_the_line_of_its_load(offset):
    """Without inertia: the forces of contact balance the load and its moment, though the punch tilts."""
    pad = skmpm.Body(skmpm.box((-8 * R, -8 * R), (16 * R, 8 * R), spacing=0.7 * R), GEL)
    punch = skmpm.Body(skmpm.box((-6 * R, 0.0), (12 * R, 3 * R), spacing=0.5 * R), RIGID)
    load = skmpm.Load(lambda x: (x[1] > 2.8 * R) & (np.abs(x[0] - 8 * R * offset) < R), lambda t: (0.0, -400.0 * t))
    floor = skmpm.Wall((0.0, -8 * R), (0.0, 1.0))
    pressed = scene([pad, punch], cell=R, walls=[floor], friction=0.3, gravity=(0.0, 0.0), loads=[load])
    *_, state = skmpm.simulate(pressed, dt=0.125, until=1.0, scheme=replace(STATIC, newton_tol=1e-5))
    contacts, loaded = state.contacts, pressed.loaded[0]
    on_punch = np.where(contacts.bodies[0] == 1, 1.0, -1.0) * (contacts.bodies == 1).any(axis=0)
    fx, fy = contacts.vectors * on_punch
    at = state.x[:, loaded.points] @ loaded.share
    arm = contacts.x - at[:, None]
    assert [fx.sum(), fy.sum()] == pytest.approx([0.0, 400.0], abs=0.02)
    assert abs(arm[0] @ fy - arm[1] @ fx) < 1e-3 * 400.0 * R


def test_a_load_is_divided_among_rigid_and_deformable_bodies_by_volume():
    discs = [skmpm.Body(skmpm.disc((3 * k * R, R), R, spacing=R / 8), m) for k, m in enumerate((GEL, RIGID))]
    held = skmpm.Body(skmpm.disc((6 * R, R), R, spacing=R / 8), RIGID, motion=(0.0, 0.0, 0.0))
    pushed = scene([*discs, held], gravity=(0.0, 0.0), walls=[], loads=[skmpm.Load(lambda x: x[1] > R, (2.0, 0.0))])
    state = skmpm.step(pushed, skmpm.initial(pushed), 1e-6)
    momenta = [state.mass[state.body == b] @ state.v[0, state.body == b] for b in range(3)]
    assert momenta == pytest.approx([1e-6, 1e-6, 0.0], rel=1e-6)
    with pytest.raises(skmpm.SceneError, match="load 0: where is true at no point of a body that forces move"):
        scene([*discs, held], loads=[skmpm.Load(lambda x: x[0] > 4.5 * R, (2.0, 0.0))])
