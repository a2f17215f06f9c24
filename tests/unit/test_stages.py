"""Stages: what goes on, what begins, what ends."""

from dataclasses import fields, replace

import numpy as np
import pytest

from skmpm import (
    Body,
    LinearElastic,
    Load,
    NeoHookean,
    Periodic,
    Pressure,
    Rigid,
    Scene,
    SceneError,
    Scheme,
    Support,
    Wall,
    at_rest,
    box,
    continued,
    disc,
    initial,
    load,
    preflight,
    save,
    simulate,
    step,
)

R, DT = 1e-3, 2e-5
GEL = NeoHookean(1e6, 0.3, 1000.0)
FLOOR, LEFT, RIGHT = Wall((0, 0), (0, 1), friction=0.3), Wall((0, 0), (1, 0)), Wall((4 * R, 0), (-1, 0))
LID = Wall((0, 2 * R), (0, -1), velocity=(0.0, -2.0))


def pressed(walls=(FLOOR, LEFT, RIGHT, LID), **options):
    """Two discs between walls, pressed by a moving lid."""
    bodies = [Body(disc((x, R), R, spacing=R / 5), GEL) for x in (R, 3 * R)]
    return Scene(bodies, cell=R / 3.5, walls=walls, friction=0.2, **options)


@pytest.fixture(scope="module")
def run():
    """The scene and a state in which all of its six contacts bear force."""
    scene = pressed()
    *_, state = simulate(scene, dt=DT, until=8 * DT)
    assert np.unique(state.contacts.bodies[1]).tolist() == [-4, -3, -2, -1, 1]
    return scene, state


def coarser(points):
    """The same points with every other one of the outline."""
    return replace(points, outline=(points.outline[0][::2],))


def assert_same(one, other):
    for f in fields(one):
        if f.name not in ("derived", "report", "contacts", "step_control"):
            assert np.array_equal(getattr(one, f.name), getattr(other, f.name)), f.name
    for f in fields(one.contacts):
        assert np.array_equal(getattr(one.contacts, f.name), getattr(other.contacts, f.name)), f.name


def test_the_same_scene_goes_on_bit_for_bit(run):
    scene, state = run
    begun = continued(scene, state, pressed())
    assert_same(begun, state)
    assert_same(step(scene, begun, DT), step(scene, state, DT))


def test_walls_in_another_order_are_the_same_walls(run):
    """Contacts keep their forces: the first iteration begins where the last step ended."""
    scene, state = run
    order = [3, 0, 2, 1]
    other = pressed([scene.walls[i] for i in order])
    begun = continued(scene, state, other)
    assert np.array_equal(begun.walls, state.walls[order]) and np.array_equal(
        begun.wall_force, state.wall_force[order]
    )
    after, expected = step(other, begun, DT), step(scene, state, DT)
    assert after.report.newton == expected.report.newton
    np.testing.assert_allclose(after.x, expected.x, atol=1e-12 * R)
    np.testing.assert_allclose(after.wall_force, expected.wall_force[order], rtol=1e-9)
    keys = [dict(zip(s.contacts.key.tolist(), s.contacts.bodies[1].tolist(), strict=True)) for s in (begun, after)]
    shared = keys[0].keys() & keys[1].keys()
    assert len(shared) > 10 and all(keys[0][k] == keys[1][k] for k in shared)


def test_a_wall_goes_on_from_where_it_is_with_another_velocity(run):
    scene, state = run
    stopped = pressed((FLOOR, LEFT, RIGHT, replace(LID, velocity=(0.0, 0.0))))
    begun = continued(scene, state, stopped)
    assert begun.walls[3, 1] == pytest.approx(2 * R - 2.0 * 8 * DT)
    assert step(stopped, begun, DT).walls[3, 1] == begun.walls[3, 1]


def test_without_a_wall_its_contacts_are_gone(run):
    scene, state = run
    lifted = pressed((FLOOR, LEFT, RIGHT))
    begun = continued(scene, state, lifted)
    assert begun.contacts.bodies[1].min() == -3 and begun.contacts.gap.size < state.contacts.gap.size
    assert {getattr(begun.contacts, f.name).shape[-1] for f in fields(begun.contacts)} == {begun.contacts.gap.size}
    *_, after = simulate(lifted, dt=DT, until=state.t + 20 * DT, start=begun)
    assert after.x[1].max() > 2 * R - 0.5 * 2.0 * 8 * DT  # the discs are round again


def test_a_lid_that_is_added_after_pouring_presses(run):
    """Above the pile, where bodies were at the start."""
    damped = replace(GEL, viscosity=20.0)
    bodies = [Body(disc((R, y), R, spacing=R / 5), damped) for y in (R, 3.3 * R)]
    pour = Scene(bodies, cell=R / 3.5, walls=[FLOOR, LEFT, Wall((2.1 * R, 0), (-1, 0))], gravity=(0.0, -400.0))
    *_, state = simulate(pour, dt=5e-5, until=0.006)
    top = state.x[1].max()
    assert top < 4 * R
    lid = Wall((0.0, top + 0.01 * R), (0.0, -1.0), velocity=(0.0, -0.1))
    with_lid = replace(pour, walls=[*pour.walls, lid])
    with pytest.raises(SceneError, match=r"wall 3 cuts body 1.*later stage begins in skmpm.continued"):
        preflight(with_lid)
    *_, after = simulate(with_lid, until=state.t + 2e-3, start=continued(pour, state, with_lid))
    assert after.wall_force[3, 1] > 0.1 * 400.0 * state.mass.sum()
    assert after.x[1].max() < after.walls[3, 1] + 1e-3 * R


def test_supports_are_released_and_loads_added():
    """A block held at both ends by supports, loaded, then released at one end: statics of both stages."""
    solid = LinearElastic(1e6, 0.3, 1000.0)
    bar = Body(box((0.0, 0.0), (8 * R, R), spacing=R / 8), solid)
    ends = [Support(lambda x: x[0] < 0.01 * R), Support(lambda x: x[0] > 7.99 * R)]
    held = Scene([bar], cell=R / 4, supports=ends)
    scheme = Scheme(inertia=False)
    *_, state = simulate(held, dt=1.0, until=1.0, scheme=scheme)
    pulled = replace(held, supports=ends[:1], loads=[Load(lambda x: x[0] > 7.99 * R, (10.0, 0.0))])
    begun = continued(held, state, pulled)
    assert begun.support_force.shape == (1, 2)
    *_, after = simulate(pulled, dt=1.0, until=2.0, start=begun, scheme=scheme)
    assert after.support_force[0, 0] == pytest.approx(10.0, rel=1e-6)
    stretch = (after.x[0].max() - 8 * R) / (8 * R)
    assert stretch == pytest.approx(10.0 / R * (1 - 0.3**2) / 1e6, rel=0.05)  # plane strain


def test_supports_that_are_described_anew_go_on():
    """Work of supports in the first quasi-static step of a stage is that of the mean of forces at both its ends."""
    bar = Body(box((0.0, 0.0), (8 * R, R), spacing=R / 8), LinearElastic(1e6, 0.3, 1000.0))

    def scene():
        roller, pin = lambda x: x[0] < 0.01 * R, lambda x: np.hypot(*x) < 0.01 * R
        pull = Support(lambda x: x[0] > 7.99 * R, velocity=(0.1 * R, None))
        ends = [Support(roller, velocity=(0.0, None)), Support(pin, velocity=(None, 0.0)), pull]
        return Scene([bar], cell=R / 4, supports=ends)

    scheme, first, second = Scheme(inertia=False), scene(), scene()
    *_, state = simulate(first, dt=1.0, until=1.0, scheme=scheme)
    begun = continued(first, state, second)
    np.testing.assert_array_equal(begun.support_force, state.support_force)
    np.testing.assert_array_equal(
        continued(first, state, replace(second, supports=second.supports[::-1])).support_force,
        state.support_force[::-1],
    )
    *_, after = simulate(second, dt=1.0, until=2.0, start=begun, scheme=scheme)
    energy = after.report.energy
    assert energy.external - state.report.energy.external == pytest.approx(
        energy.elastic - state.report.energy.elastic, rel=1e-6
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda s: replace(s, walls=[], bodies=[*s.bodies, Body(disc((9 * R, R), R, spacing=R / 5), GEL)]),
            "continued: the new scene has 3 bodies, the old one 2",
        ),
        (lambda s: replace(s, cell=R / 3), "continued: the new scene has cell = 0.000333.*, the old one 0.000285"),
        (
            lambda s: replace(s, bodies=[s.bodies[0], Body(disc((3 * R, R), R, spacing=R / 6), GEL)]),
            "continued: body 1 of the new scene has other points",
        ),
        (
            lambda s: replace(s, bodies=[s.bodies[0], replace(s.bodies[1], points=coarser(s.bodies[1].points))]),
            "continued: body 1 of the new scene has other points",
        ),
        (
            lambda s: replace(s, bodies=[s.bodies[0], replace(s.bodies[1], material=NeoHookean(1e6, 0.3, 900.0))]),
            "continued: body 1 of the new scene has another density",
        ),
        (
            lambda s: replace(s, bodies=[s.bodies[0], replace(s.bodies[1], material=Rigid(1000.0))]),
            "continued: body 1 is Rigid in the new scene and deformable in the old one; .* begin a new run",
        ),
        (
            lambda s: replace(s, bodies=[s.bodies[0], replace(s.bodies[1], velocity=(1.0, 0.0))]),
            r"continued: body 1 of the new scene has another velocity, .* dataclasses.replace\(state, v=",
        ),
        (
            lambda s: replace(s, bodies=[s.bodies[0], replace(s.bodies[1], velocity=(5e-9, 0.0))]),
            "continued: body 1 of the new scene has another velocity",
        ),
        (
            lambda s: replace(s, bodies=[replace(s.bodies[0], spin=3.0), s.bodies[1]]),
            "continued: body 0 of the new scene has another spin",
        ),
        (
            lambda s: replace(s, walls=[*s.walls, Wall((0, R), (0, 1))]),
            r"wall 4 cuts body \d: a point lies .* m behind it; at t = 0.00016 s; move the new wall",
        ),
        (
            lambda s: replace(s, walls=[*s.walls, FLOOR]),
            "continued: walls 0 and 4 of the new scene have the point and the normal of wall 0; give each wall once",
        ),
    ],
)
def test_what_does_not_fit_is_named(run, change, message):
    scene, state = run
    with pytest.raises(SceneError, match=message):
        continued(scene, state, change(scene))


def test_a_state_of_another_scene_is_refused(run):
    other = Body(box((2 * R, 0), (R, R), spacing=R / 4), Rigid(1.0), motion=(0.0, 0.0, 0.0))
    alone = Scene([Body(disc((0, 0), R, spacing=R / 5), GEL), other], cell=R / 3)
    with pytest.raises(SceneError, match="continued: the state has"):
        continued(alone, run[1], run[0])
    with pytest.raises(SceneError, match="continued: scene = None; give a Scene"):
        continued(*run, None)


def test_a_rigid_body_does_not_become_deformable(run):
    """It raised a ValueError about shapes of arrays."""
    scene, state = run
    hard = replace(scene, bodies=[scene.bodies[0], replace(scene.bodies[1], material=Rigid(1000.0))])
    with pytest.raises(SceneError, match="body 1 is Rigid in the old scene and deformable in the new one"):
        continued(hard, initial(hard), scene)
    with pytest.raises(SceneError, match="start: body 1 of the state is Rigid, that of the scene deformable"):
        next(simulate(scene, dt=DT, until=DT, start=initial(hard)))
    with pytest.raises(SceneError, match="start: body 1 of the state is deformable, that of the scene Rigid"):
        next(simulate(hard, dt=DT, until=2 * state.t, start=state))


@pytest.mark.parametrize("duration", [8e-4, 8.0])
def test_velocities_that_a_quasi_static_stage_leaves_are_spoken_of_where_they_are_no_slow_motion(duration, caplog):
    """0.16 R in 0.8 ms and in 8 s are the same to a quasi-static stage, and 0.2 m/s to a dynamic one after it."""
    lid = replace(LID, velocity=(0.0, -0.16 * R / duration))
    scene = pressed((FLOOR, LEFT, RIGHT, lid))
    *_, state = simulate(scene, dt=duration / 8, until=duration, scheme=Scheme(inertia=False))
    still = pressed((FLOOR, LEFT, RIGHT, replace(lid, velocity=(0.0, 0.0))))
    begun = continued(scene, state, still)
    rested = at_rest(still, begun)
    for start, warned in ((begun, duration < 1.0), (rested, False)):
        caplog.clear()
        next(simulate(still, dt=DT, until=state.t + DT, start=start))
        assert [m for m in caplog.messages if "quasi-static step" in m and "from rest" in m] == caplog.messages
        assert bool(caplog.messages) == warned


def test_what_is_prescribed_does_not_count_as_left_by_statics(caplog):
    """A rigid die moves on in a start from rest, as it should; that was said to be cured by a start from rest."""
    die = Body(box((-R, R), (2 * R, R), spacing=R / 5), Rigid(8000.0), motion=(0.0, -1.0, 0.0))
    scene = Scene([Body(disc((0, 0), R, spacing=R / 5), GEL), die], cell=R / 3.5, walls=[Wall((0, -R), (0, 1))])
    *_, state = simulate(scene, dt=1e-5, until=4e-5, scheme=Scheme(inertia=False))
    for start, warned in ((state, True), (at_rest(scene, state), False)):
        caplog.clear()
        next(simulate(scene, dt=DT, until=state.t + DT, start=start))
        assert any("quasi-static step" in m for m in caplog.messages) == warned


@pytest.mark.parametrize("driven", ["wall", "stress", "rate"])
def test_a_start_from_rest_has_no_velocities_of_statics(driven):
    """Driven walls kept theirs, with the mass of all bodies, and bodies moved backwards in a box that goes on.

    Contacts are so wide that their points are the same with inertia.
    """
    nan, rate = np.nan, ((-200.0, 0.0), (0.0, 0.0 if driven == "stress" else -200.0))
    options = {
        "wall": {"walls": [FLOOR, replace(LID, velocity=(0.0, 0.0), force=lambda t: 50.0 * min(t / 1e-4, 1.0))]},
        "rate": {"periodic": Periodic(2 * R, 2 * R, rate=rate)},
        "stress": {"periodic": Periodic(2 * R, 2 * R, rate=rate, stress=((nan, nan), (nan, -1e4)))},
    }[driven]
    scene = Scene([Body(disc((R, R), R, spacing=R / 5), GEL)], cell=R / 3.5, friction=0.3, **options)
    *_, end = simulate(scene, dt=2e-5, until=1e-4, scheme=Scheme(inertia=False))
    still = scene if driven == "wall" else replace(scene, periodic=replace(scene.periodic, rate=np.zeros((2, 2))))
    moving = continued(scene, end, still)
    start = at_rest(still, moving)
    at_once, from_rest = (step(still, each, 1e-6).report.energy.kinetic for each in (moving, start))
    assert from_rest < 0.02 * at_once
    assert np.array_equal(start.x, end.x) and np.array_equal(start.F, end.F)


def test_supports_move_on_in_a_start_from_rest():
    """Their points had no velocity, and were thrown to that of the support in the first step."""
    block = Body(box((0, 0), (2 * R, 2 * R), spacing=R / 3), GEL)
    carried = Scene([block], cell=R / 1.5, supports=[Support(lambda x: x[0] > -1.0, velocity=(0.5, None))])
    *_, state = simulate(carried, dt=1e-5, until=3e-5)
    start = at_rest(carried, state)
    np.testing.assert_array_equal(start.v, np.array([[0.5], [0.0]]) + 0.0 * start.v)
    assert np.abs(step(carried, start, 1e-5).support_force[0]).max() < 1e-6


def test_a_velocity_field_that_is_described_anew_is_the_same():
    def scene():
        field = Body(disc((0, 0), R, spacing=R / 5), GEL, velocity=lambda x: 0.1 * x / R)
        return Scene([field], cell=R / 3.5)

    assert continued(scene(), initial(scene()), scene()).t == 0.0


def test_a_support_that_goes_on_keeps_its_force():
    """Quasi-static work is by the forces at both ends of a step: in two stages as in one."""
    bar = Body(box((0.0, 0.0), (8 * R, R), spacing=R / 4), GEL)
    ends = [Support(lambda x: x[0] < 0.01 * R),
            Support(lambda x: x[0] > 7.99 * R, displacement=lambda t: (0.1 * R * t, 0.0))]  # fmt: skip
    scene, scheme = Scene([bar], cell=R / 2, supports=ends), Scheme(inertia=False)
    *_, one = simulate(scene, dt=0.25, until=1.0, scheme=scheme)
    *_, first = simulate(scene, dt=0.25, until=0.5, scheme=scheme)
    *_, two = simulate(scene, dt=0.25, until=1.0, scheme=scheme, start=continued(scene, first, replace(scene)))
    assert two.report.energy == one.report.energy


def test_a_new_wall_that_cuts_a_free_rigid_body_is_refused():
    """It was pushed out at a speed that grew as the step shrank."""
    bodies = [Body(disc((x, R), R, spacing=R / 5), m) for x, m in ((R, GEL), (4 * R, Rigid(1000.0)))]
    scene = Scene(bodies, cell=R / 3.5, walls=[FLOOR])
    cut = replace(scene, walls=[FLOOR, Wall((4.9 * R, 0.0), (-1.0, 0.0))])
    with pytest.raises(SceneError, match="wall 1 cuts body 1"):
        continued(scene, step(scene, initial(scene), DT), cut)
    with pytest.raises(SceneError, match="wall 1 cuts body 1"):
        initial(cut)


def crossing():
    """Discs on two floors, far apart and in contact with each other in each group, one of them rigid; a box last."""
    places = [(x, y) for y in (R, 9 * R) for x in (R, 2.98 * R)]
    bodies = [Body(disc(place, R, spacing=R / 5), GEL) for place in places]
    bodies.insert(1, Body(disc((6 * R, R), R, spacing=R / 5), Rigid(1000.0)))
    bodies.append(Body(box((5 * R, 8 * R), (7 * R, 9 * R), spacing=R / 5), GEL, velocity=(0.1, 0.0)))
    return Scene(bodies, cell=R / 3.5, walls=[FLOOR, LEFT], friction=0.2, overlap=0.03 * R)


@pytest.mark.parametrize("from_file", [False, True])
def test_a_body_that_leaves_changes_nothing_for_those_that_it_does_not_touch(from_file, tmp_path):
    """The others go on as with it: grids, velocities, contacts and their keys are theirs, whatever their numbers."""
    scene = crossing()
    *_, state = simulate(scene, dt=DT, until=8 * DT)
    if from_file:
        save(tmp_path / "state", state)
        state = load(tmp_path / "state")
    left = [0, 1, 2, 5]  # without the two discs above
    smaller = replace(scene, bodies=[scene.bodies[b] for b in left])
    begun = continued(scene, state, smaller)
    kept = np.isin(state.body, left)
    assert begun.x.shape[1] == kept.sum() and 0 < begun.contacts.gap.size < state.contacts.gap.size
    after, expected = step(smaller, begun, DT), step(scene, state, DT)
    assert after.report.newton == expected.report.newton
    np.testing.assert_allclose(after.x, expected.x[:, kept], atol=1e-11 * R)
    np.testing.assert_allclose(after.v, expected.v[:, kept], atol=1e-8 * R / DT)
    same = np.isin(expected.contacts.bodies[0], left) & np.isin(expected.contacts.bodies[1], [-2, -1, *left])
    np.testing.assert_allclose(after.contacts.force, expected.contacts.force[:, same], atol=1e-6 * state.mass.sum())
    shared = np.isin(begun.contacts.key, after.contacts.key).sum()
    assert shared == np.isin(state.contacts.key, expected.contacts.key[same]).sum() > 4
    touching = np.isin(state.contacts.bodies[0], left) & np.isin(state.contacts.bodies[1], [-2, -1, *left])
    np.testing.assert_array_equal(begun.x[:, begun.contacts.point], state.x[:, state.contacts.point[touching]])


def test_grains_that_leave_are_named_where_they_are_none_of_the_scene(run):
    scene, state = run
    other = Body(disc((9 * R, R), R, spacing=R / 5), GEL)
    with pytest.raises(SceneError, match="body 0 of the new scene is none of the 2 bodies"):
        continued(scene, state, replace(scene, bodies=[other]))


def test_what_a_pressure_has_wetted_goes_on_with_it():
    """Also where another one comes before it, and without a body."""
    body = Body(box((0, 0), (2 * R, R), spacing=R / 4), GEL)
    other = Body(box((5 * R, 0), (2 * R, R), spacing=R / 4), GEL)
    fluid = Pressure(lambda x: x[0] < 1e-9, 1e3, penetrates=True)
    scene = Scene([other, body], cell=R / 2, loads=[fluid], supports=[Support(lambda x: x[1] < 1e-9)])
    state = step(scene, initial(scene), DT)
    later = replace(scene, bodies=[body], loads=[Pressure(lambda x: x[0] > 1.99 * R, 1e2), fluid])
    begun = continued(scene, state, later)
    assert begun.wetted.shape == (2, later.outlines.size) and not begun.wetted[0].any()
    assert begun.wetted[1].sum() == state.wetted.sum() > 0
    assert continued(scene, state, replace(scene, loads=[])).wetted.size == 0
