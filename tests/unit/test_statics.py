"""Static steps: neutral rigid-body modes, steps that do not depend on their length, what stays where it is."""

import logging
from functools import cache

import meshio
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
    Scheme,
    StepFailed,
    Support,
    Wall,
    box,
    disc,
    from_mesh,
    load,
    save,
)
from skmpm.simulation import simulate
from skmpm.step.algorithm import step
from skmpm.step.initial_state import initial
from skmpm.step.scene_forces import equilibrium_depends_on_dt

R, H, E = 1.0, 0.2, 1e6
GEL, LINEAR = NeoHookean(E, 0.3, 1000.0), LinearElastic(E, 0.3, 1000.0)
STATIC = Scheme(inertia=False)
OFFSETS = [(x, y) for x in (0.0, 0.1, 0.25) for y in (0.0, 0.1, 0.25)]  # on the grid [cells]
UP, G = np.array([0.0, 1.0]), 10.0  # [m/s2]: 3 % of strain


# Neutral rigid-body modes.


def stack(x, y, law, velocity=-0.02):
    """Two boxes on each other between smooth plates."""
    at = H * np.array([x, y])
    bodies = [Body(box(at + s * UP, (1.0, 1.0), spacing=0.75 * H), law) for s in (0.0, 1.0)]
    return Scene(bodies, cell=H, walls=[Wall(at, (0, 1)), Wall(at + 2.0 * UP, (0, -1), velocity=(0.0, velocity))])


@cache
def pressed(x, y, law, tol, dt=1.0):
    scene = stack(x, y, law, -0.02 / dt)
    scheme = Scheme(inertia=False, newton_tol=tol)
    return scene, initial(scene), step(scene, initial(scene, scheme=scheme), dt, scheme=scheme)


@pytest.mark.parametrize("tol", [1e-3, 1e-8])
@pytest.mark.parametrize("law", [LINEAR, GEL], ids=["linear", "finite"])
@pytest.mark.parametrize(("x", "y"), OFFSETS)
def test_boxes_between_smooth_plates_do_not_drift(x, y, law, tol):
    """One per cent of strain; with springs alone 25 of these 36 steps failed, bodies drifted by up to 170 cells.

    Outside check: the plates bear opposite forces, to ten times Newton's tolerance or 2e-6; E* strain within 3 %; no
    box moves sideways by more than half a cell, since unstable equilibria may be found off the centre.
    """
    _, start, state = pressed(x, y, law, tol)
    force = state.wall_force[:, 1]
    assert abs(force.sum()) < max(10.0 * tol, 2e-6) * force[1]
    assert force[1] == pytest.approx(0.01 * E / (1.0 - 0.3**2), rel=0.03)
    sideways = [(state.x - start.x)[0, state.body == b].mean() for b in (0, 1)]
    assert np.abs(sideways).max() < 0.5 * H
    assert state.report.newton <= (10 if tol == 1e-3 else 30)


@pytest.mark.parametrize(
    ("x", "y", "spacing", "law"),
    [
        (0.0, 0.0, 7, LINEAR),
        (0.25, 0.1, 8, LINEAR),
        (0.013, 0.07, 8, LINEAR),
        (0.0, 0.0, 5, GEL),
        (0.25, 0.4, 7, GEL),
    ],
)
def test_boxes_are_held_where_contacts_soften(x, y, spacing, law):
    """Six steps of 0.5 % of strain; boxes slid by four cells in one, or were pushed on by normals kept from before.

    Outside check: the plates bear opposite forces; boxes stay within half a cell of the middle.
    """
    at = H * np.array([x, y])
    bodies = [Body(box(at + np.array((-R, s)), (2 * R, 2 * R), spacing=R / spacing), law) for s in (0.0, 2 * R)]
    walls = [Wall(at, (0, 1)), Wall(at + 4 * R * UP, (0, -1), velocity=(0.0, -0.005 * 4 * R))]
    scene = Scene(bodies, cell=H, walls=walls)
    states = list(simulate(scene, dt=1.0, until=6.0, scheme=STATIC))
    assert sum(state.report.retries for state in states) == 0
    for state in states[1:]:
        force = state.wall_force[:, 1]
        assert abs(force.sum()) < 0.01 * force[1]
        moved = [(state.x - states[0].x)[0, state.body == b].mean() for b in (0, 1)]
        assert np.abs(moved).max() < 0.5 * H
    if law is LINEAR:
        assert force[1] == pytest.approx(0.03 * 2 * R * E / (1.0 - 0.3**2), rel=0.05)


@pytest.mark.parametrize(("x", "y"), [(0.1, 0.0), (0.25, 0.1)])
def test_the_metric_does_not_depend_on_the_time_step(x, y):
    (_, _, one), (_, _, other) = pressed(x, y, GEL, 1e-8), pressed(x, y, GEL, 1e-8, dt=1e-3)
    assert np.abs(one.x - other.x).max() < 1e-7 * R
    assert np.abs(one.wall_force - other.wall_force).max() < 1e-6 * np.abs(one.wall_force).max()


def test_an_unloaded_body_is_free_of_stress_and_takes_few_iterations(caplog):
    """Three steps of loading, one of unloading, three without load: no step fails or takes over ten iterations."""
    for law in (LINEAR, GEL):
        for points in (box((0.03, 0.0), (1.0, 1.0), spacing=0.75 * H), disc((0.5, 0.5), 0.5, spacing=0.075)):
            lid = Wall((0, 1), (0, -1), velocity=lambda t: (0.0, -0.02 if t < 3.0 else 0.1))
            scene = Scene([Body(points, law)], cell=H, walls=[Wall((0, 0), (0, 1)), lid])
            with caplog.at_level(logging.WARNING, logger="skmpm"):
                states = list(simulate(scene, dt=1.0, until=7.0, scheme=STATIC, warn=False))
            pressed, left = (np.abs(states[k].wall_force).max() for k in (2, -1))
            assert left < 1e-12 * pressed, "it lies on the floor, without weight"
            assert np.abs(states[-1].stress).max() < 1e-4 * np.abs(states[2].stress).max()
            assert max(state.report.newton for state in states) <= 10
    assert not caplog.messages


# Steps that do not depend on dt.


@pytest.mark.parametrize("law", ["constant", "function of time", "moving support"])
def test_a_step_that_does_not_depend_on_dt_is_not_retried(law):
    """A soft box under a load that inverts points: with constant loads ten retries would be the same problem."""
    force = {"constant": (0.0, -3.0 * E)}.get(law, lambda t: (0.0, -3.0 * E))
    base = Support(lambda x: x[1] < 1e-9, velocity=(0.0, -1e-9 if law == "moving support" else 0.0))
    load = Load(lambda x: x[1] > 1.0 - 1e-9, force if law != "moving support" else (0.0, -3.0 * E))
    scene = Scene([Body(box((0, 0), (1.0, 1.0), spacing=0.75 * H), GEL)], cell=H, supports=[base], loads=[load])
    with pytest.raises(StepFailed) as failed:
        list(simulate(scene, dt=1.0, until=1.0, scheme=Scheme(inertia=False, max_newton=6)))
    same = law == "constant"
    assert failed.value.retryable != same
    assert ("given up after" in str(failed.value)) != same
    assert ("apply loads in steps" in str(failed.value)) == same


@pytest.mark.parametrize("law", [LINEAR, GEL])
def test_where_a_smaller_dt_changes_nothing_none_is_advised(law):
    """The error of a linear law names the cure of its own."""
    base, load = Support(lambda x: x[1] < 1e-9), Load(lambda x: x[1] > 1.0 - 1e-9, (0.0, -3.0 * E))
    scene = Scene([Body(box((0, 0), (1.0, 1.0), spacing=0.75 * H), law)], cell=H, supports=[base], loads=[load])
    with pytest.raises(StepFailed) as failed:
        list(simulate(scene, dt=1.0, until=1.0, scheme=Scheme(inertia=False, max_newton=6), warn=False))
    assert "use a smaller dt" not in str(failed.value)
    assert ("use NeoHookean" in str(failed.value)) == (law is LINEAR)
    assert failed.value.remedy in str(failed.value)


LOADINGS = ["constant", "function of time", "moving wall elsewhere", "viscosity"]


@pytest.mark.parametrize("loading", LOADINGS)
def test_a_body_without_equilibrium_is_retried_only_if_the_step_depends_on_dt(loading):
    """A box on a steep smooth floor."""
    gravity = G * np.array([0.3, -1.0])
    walls = [Wall((0, 0), (0, 1))]
    if loading == "moving wall elsewhere":
        walls.append(Wall((0, 5), (0, -1), velocity=(0.0, -1e-3)))
    gel = NeoHookean(E, 0.3, 1000.0, viscosity=E if loading == "viscosity" else 0.0)
    pull = (lambda X, t: gravity[:, None] + 0.0 * X) if loading == "function of time" else gravity
    scene = Scene([Body(box((0.03, 0.0), (1.0, 1.0), spacing=0.75 * H), gel)], cell=H, walls=walls, gravity=pull)
    with pytest.raises(StepFailed, match="no equilibrium was found: it slides") as failed:
        step(scene, initial(scene, scheme=STATIC), 1.0, scheme=STATIC)
    assert failed.value.retryable == (loading != "constant")


@pytest.mark.parametrize("drive", ["force", "pressure"])
def test_a_step_depends_on_dt_where_a_function_of_time_drives_a_wall(drive):
    block = Body(box((0, 0), (1.0, 1.0), spacing=0.75 * H), GEL)
    for value, depends in ((2.0, False), (lambda t: 2.0 + t, True)):
        walls = [Wall((0, 0), (0, 1)), Wall((0, 1), (0, -1), **{drive: value})]
        assert equilibrium_depends_on_dt(Scene([block], cell=H, walls=walls)) == depends


@pytest.mark.parametrize(("shear", "depends"), [(0.0, False), (0.1, True)])
def test_a_step_depends_on_dt_where_a_box_is_sheared(shear, depends):
    """Not by nan, the component of the rate that a stress determines."""
    nan, rate = np.nan, [[0.0, shear], [0.0, np.nan]]
    pressed_down = Periodic(2.0, 2.0, rate=rate, stress=[[nan, nan], [nan, -1.0]])
    scene = Scene([Body(disc((0, 0), 0.5, spacing=0.75 * H), GEL)], cell=H, periodic=pressed_down)
    assert equilibrium_depends_on_dt(scene) == depends


def test_a_viscous_step_under_a_constant_load_is_retried():
    """Resistance 2 eta / dt: the step that inverts points at dt = 1 s succeeds with shorter ones, after retries."""
    base, load = Support(lambda x: x[1] < 1e-9), Load(lambda x: x[1] > 1.0 - 1e-9, (0.0, -3.0 * E))
    points, scheme = box((0, 0), (1.0, 1.0), spacing=0.75 * H), Scheme(inertia=False, max_newton=6)
    bodies = [Body(points, NeoHookean(E, 0.3, 1000.0, viscosity=viscosity)) for viscosity in (0.0, 10.0 * E)]
    elastic, viscous = (Scene([body], cell=H, supports=[base], loads=[load]) for body in bodies)
    with pytest.raises(StepFailed) as failed:
        step(viscous, initial(viscous, scheme=scheme), 100.0, scheme=scheme)
    assert failed.value.retryable
    state = next(simulate(viscous, dt=100.0, until=100.0, scheme=scheme))
    assert state.report.retries > 0
    with pytest.raises(StepFailed) as failed:
        next(simulate(elastic, dt=100.0, until=100.0, scheme=scheme))
    assert not failed.value.retryable


def test_a_free_body_under_loads_without_a_resultant_stays_where_it_is():
    """A ring under pressure from inside: the nodes that hold it in the iteration stayed, and its centre moved."""
    angle = 2.0 * np.pi * np.arange(48) / 48
    x = np.concatenate([r * np.array([np.cos(angle), np.sin(angle)]) for r in np.linspace(1.0, 2.0, 6)], axis=1)
    quads = [
        (i + j, i + 48 + j, i + 48 + (j + 1) % 48, i + (j + 1) % 48) for i in range(0, 240, 48) for j in range(48)
    ]
    ring = from_mesh(meshio.Mesh(1e-3 * x.T, [("quad", quads)]))
    inside = Pressure(lambda x: np.hypot(*x) < 1.02e-3, lambda t: 2e3 * t)
    scene = Scene([Body(ring, NeoHookean(1e6, 0.3, 1000.0))], cell=0.2e-3, loads=[inside])
    *_, state = simulate(scene, until=1.0, dt=0.5, scheme=Scheme(inertia=False))
    moved = state.x - ring.x
    assert np.hypot(*moved).max() > 2e-6
    assert np.abs(moved @ state.mass).max() < 1e-12 * state.mass.sum()


@pytest.mark.parametrize("held", [0.125, 1.0])
def test_a_step_in_which_nothing_moves_changes_nothing(held):
    """A rigid disc, pressed on a block and turned, is held: the step's normals were 0.05 rad off those of the disc.

    The force along the block changed by 12 % and the energy by a tenth; both depended on the length of the step.
    """
    points = disc((0.0, 2 * R), R, spacing=R / 7)
    block = Body(box((-2 * R, 0.0), (4 * R, R), spacing=R / 7), GEL)

    def scene(motion):
        foot = Support(lambda x: x[1] < 1e-9)
        return Scene([block, Body(points, Rigid(1.0), motion=motion)], cell=R / 5, supports=[foot], friction=0.9)

    def pressing(t):
        return (0.0, -0.15 * R * np.pi * np.sin(np.pi * t), -1.2 if t > 0.25 else 0.0)

    *_, before = simulate(scene(pressing), until=0.5, dt=1 / 16, scheme=STATIC)
    after = step(scene((0.0, 0.0, 0.0)), before, held, scheme=STATIC)
    assert after.report.newton == 1  # it does not begin with the motion of the last step
    assert after.report.energy.elastic == pytest.approx(before.report.energy.elastic, rel=2e-3)
    assert after.body_force[:, 1] == pytest.approx(before.body_force[:, 1], rel=5e-3)
    pressed = after.contacts.force[0] > 0.0
    centre = after.x[:, after.body == 1].mean(axis=1)
    radial = (after.contacts.x - centre[:, None])[:, pressed] / R
    across = radial[0] * after.contacts.normal[1, pressed] - radial[1] * after.contacts.normal[0, pressed]
    assert np.abs(across).max() < 0.01


def test_a_run_that_goes_on_from_a_file_is_the_same_bit_for_bit(tmp_path):
    """Two discs with friction and a finite anchor, pressed on a floor by a wall that a force drives."""
    discs = [Body(disc((x, R), R, spacing=0.7 * H), GEL) for x in (0.0, 2.01 * R)]
    lid = Wall((0.0, 2.0 * R), (0.0, -1.0), force=lambda t: 2e4 * t)
    scene = Scene(discs, cell=H, walls=[Wall((0, 0), (0, 1)), lid], friction=0.4)
    scheme = Scheme(inertia=False, anchor=0.02)
    *_, whole = simulate(scene, dt=0.25, until=1.0, scheme=scheme, warn=False)
    *_, half = simulate(scene, dt=0.25, until=0.5, scheme=scheme, warn=False)
    save(tmp_path / "half.npz", half)
    *_, after = simulate(scene, dt=0.25, until=1.0, scheme=scheme, start=load(tmp_path / "half.npz"), warn=False)
    for name in ("x", "F", "stress", "wall_force"):
        np.testing.assert_array_equal(getattr(after, name), getattr(whole, name))
    assert not np.array_equal(whole.x_anchor, scene.initial_positions)
    assert whole.wall_force[1, 1] == pytest.approx(2e4, rel=1e-3)
