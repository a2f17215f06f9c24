"""Supports, loads and quasi-static steps: points, forces, energy, and the errors of invalid input."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from skmpm import (
    Body,
    LinearElastic,
    Load,
    NeoHookean,
    Rigid,
    Scene,
    SceneError,
    Scheme,
    StepFailed,
    Support,
    Wall,
    box,
    initial,
    linear,
    simulate,
    step,
)

STATIC = Scheme(inertia=False)
SOFT = NeoHookean(1e5, 0.3, 1000.0)
STIFF = LinearElastic(1e5, 0.3, 1000.0)


def left(x):
    return x[0] < 1e-9


def right(x):
    return x[0] > 2.0 - 1e-9


def everywhere(x):
    return np.ones(x.shape[1], dtype=bool)


def bar(material=STIFF, cell=0.25, offset=0.0, **scene):
    body = Body(box((0, offset), (2, 1), spacing=0.125), material)
    return Scene([body], cell=cell, **scene)


def on(scene, where):
    return where(scene.initial_positions)


@pytest.mark.parametrize("offset", [0.0, 0.1])
def test_supported_points_move_as_prescribed_and_free_components_do_not(offset):
    scene = bar(SOFT, offset=offset, supports=[Support(left), Support(right, velocity=lambda t: (0.1 * t, None))])
    for state in simulate(scene, dt=0.5, until=2.0, scheme=STATIC):
        moved = state.x - scene.initial_positions
        assert np.abs(moved[:, on(scene, left)]).max() <= 1e-12
        assert np.abs(moved[0, on(scene, right)] - 0.05 * state.t**2).max() <= 1e-12
    assert np.abs(moved[1, on(scene, right)]).max() > 1e-3  # it contracts


@pytest.mark.parametrize("offset", [0.0, 0.037])
def test_held_areas_cost_as_much_as_their_edges(monkeypatch, offset):
    """Half of a block is held: twice as fine, four times the points, constraints solved at once grow twofold.

    Its points move as prescribed, and so do nodes inside; the other half is carried along.
    """
    supports, largest = import_module("skmpm.grid.supports"), []
    original = supports._pivoted

    def counted(gram, right, unknowns):
        largest[-1] = max(largest[-1], unknowns.size)
        return original(gram, right, unknowns)

    monkeypatch.setattr(supports, "_pivoted", counted)
    for finer in (1, 2):
        largest.append(0)
        body = Body(box((offset, 0.0), (4, 4), spacing=0.1 / finer), SOFT)
        scene = Scene([body], cell=0.2 / finer, supports=[Support(lambda x: x[1] > 2.0, velocity=(0.01, 0.02))])
        after = step(scene, initial(scene, scheme=STATIC), 1.0, scheme=STATIC)
        moved = after.x - scene.initial_positions
        held = scene.initial_positions[1] > 2.0
        assert np.abs(moved[:, held] - [[0.01], [0.02]]).max() < 1e-12
        assert np.abs(moved - [[0.01], [0.02]]).max() < 1e-6
    assert largest[0] < largest[1] < 2.2 * largest[0]


@pytest.mark.parametrize("material", [STIFF, SOFT])
@pytest.mark.parametrize("solver", [linear.banded, linear.amg])
def test_supports_carry_the_loads(material, solver):
    scene = bar(
        material, offset=0.07, supports=[Support(left)], loads=[Load(right, (30.0, -20.0))], gravity=(0, -0.1)
    )
    scheme = replace(STATIC, linear=solver, newton_tol=1e-6)
    state = step(scene, initial(scene, scheme=scheme), 1.0, scheme=scheme)
    assert state.support_force[0] == pytest.approx([30.0, -20.0 - 0.1 * 2000.0], rel=1e-5)
    x = state.x - state.x[:, [np.argmin(scene.initial_positions[0])]]
    assert np.abs(x[:, on(scene, right)]).max() > 1e-3


def test_a_moving_support_puts_in_its_work():
    """The mean of the forces at both ends of a quasi-static step: of second order in the step."""
    scene = bar(SOFT, supports=[Support(left), Support(right, velocity=lambda t: (0.001 * t, 0))])
    missing = []
    for dt in (2.5, 1.25):
        *_, state = simulate(scene, dt=dt, until=20.0, scheme=replace(STATIC, newton_tol=1e-9))
        energy = state.report.energy
        missing.append(energy.external - energy.elastic)
        assert energy.kinetic == 0.0
    assert abs(missing[0]) < 0.01 * energy.elastic
    assert missing[1] == pytest.approx(0.25 * missing[0], rel=0.05)


@pytest.mark.parametrize("by", ["wall", "support", "load", "rigid body"])
def test_an_elastic_press_and_release_dissipates_nothing(by):
    """20 steps there and back, without friction: what is counted as lost is 1e-3 of what was exchanged, at most."""
    there = 0.1

    def lid(t):
        return (0.0, -there if t < 0.5 else there)

    def top(x):
        return x[1] > 1.0 - 1e-9

    floor = {"supports": [Support(lambda x: x[1] < 1e-9, velocity=(None, 0.0)), Support(left, velocity=(0.0, None))]}
    bodies = [Body(box((0, 0), (2, 1), spacing=0.125), SOFT)]
    if by == "wall":
        scene = Scene(bodies, cell=0.25, walls=[Wall((0, 1), (0, -1), velocity=lid)], **floor)
    elif by == "support":
        floor["supports"] = [*floor["supports"], Support(top, velocity=lambda t: (None, lid(t)[1]))]
        scene = Scene(bodies, cell=0.25, **floor)
    elif by == "load":
        force = Load(top, lambda t: (0.0, -4e4 * min(t, 1.0 - t)))
        scene = Scene(bodies, cell=0.25, loads=[force], **floor)
    else:
        bodies.append(Body(box((-0.1, 1), (2.3, 0.5), spacing=0.125), Rigid(1000.0), motion=lambda t: (*lid(t), 0.0)))
        scene = Scene(bodies, cell=0.25, **floor)
    energies = [s.report.energy for s in simulate(scene, dt=0.05, until=1.0, scheme=STATIC)]
    exchanged = max(e.elastic for e in energies)
    assert exchanged > 10.0
    assert max(abs(e.dissipated) for e in energies) < 1e-2 * exchanged
    assert abs(energies[-1].dissipated) < 1e-3 * exchanged
    assert energies[-1].elastic < 1e-3 * exchanged


def test_a_dynamic_step_moves_supports_too():
    scene = bar(SOFT, supports=[Support(left, velocity=(1.0, 0.0))])
    for scheme in (Scheme(), Scheme(theta=0.5)):
        state = initial(scene, scheme=scheme)
        momentum = 0.0
        for _ in range(5):
            state = step(scene, state, 1e-4, scheme=scheme)
            momentum -= 1e-4 * state.support_force[0, 0]
            # The sudden motion costs an impulse, and is over: velocities at the support no longer alternate.
            assert state.report.energy.kinetic == pytest.approx(62.5, rel=1e-6)
        held = on(scene, left)
        assert (state.x - scene.initial_positions)[0, held] == pytest.approx(5e-4, rel=1e-9)
        assert state.v[0] @ state.mass == pytest.approx(momentum, rel=1e-9)


def test_loads_are_distributed_by_boundary_length_or_volume():
    boundary = bar(loads=[Load(right, (8.0, 0.0))]).loaded[0]
    scene = bar(loads=[Load(everywhere, (8.0, 0.0))])
    volume = scene.loaded[0]
    assert boundary.share.sum() == pytest.approx(1.0)
    y = scene.initial_positions[1, boundary.points]
    assert y @ boundary.share == pytest.approx(0.5)
    assert boundary.share[np.isin(y, (0.0, 1.0))] == pytest.approx(1 / 24)  # half of two thirds of 1/8
    assert volume.share == pytest.approx(scene.initial_volumes / 2.0)
    single = bar(loads=[Load(lambda x: right(x) & (x[1] == 0.0), (1.0, 0.0))]).loaded[0]
    assert single.share.tolist() == [1.0]


def test_a_load_everywhere_is_gravity():
    supports = [Support(left)]
    pulled = bar(SOFT, supports=supports, loads=[Load(everywhere, (0.0, -300.0))])
    heavy = bar(SOFT, supports=supports, gravity=(0.0, -0.15))
    a, b = (step(scene, initial(scene), 0.1, scheme=STATIC) for scene in (pulled, heavy))
    assert np.abs(a.x - b.x).max() <= 1e-9


def test_a_floating_body_needs_no_support_where_its_loads_balance():
    pull = [Load(left, (-50.0, 0.0)), Load(right, (50.0, 0.0))]
    scene, tight = bar(loads=pull, offset=0.03), replace(STATIC, newton_tol=1e-9)
    state = step(scene, initial(scene, scheme=tight), 1.0, scheme=tight)
    assert state.report.imbalance < 1e-9
    # Plane strain: E / (1 - nu^2) along, nu / (1 - nu) across.
    strain = 50.0 / 1e5 * (1 - 0.3**2)
    moved = state.x - scene.initial_positions
    stretch = moved[0, on(scene, right)].mean() - moved[0, on(scene, left)].mean()
    assert stretch == pytest.approx(2 * strain, rel=1e-2)


def test_a_floating_body_whose_loads_do_not_balance_fails_clearly():
    scene = bar(loads=[Load(right, (1.0, 0.0))])
    with pytest.raises(StepFailed, match="body 0: no equilibrium was found: it falls"):
        step(scene, initial(scene, scheme=STATIC), 1.0, scheme=STATIC)


def test_a_quasi_static_linear_step_is_one_factorisation_and_one_solve():
    scene = bar(supports=[Support(left)], loads=[Load(right, (0.0, -1.0))])
    report = step(scene, initial(scene, scheme=STATIC), 1.0, scheme=STATIC).report
    assert (report.newton, report.factorisations) == (1, 1)


def test_a_scene_without_supports_eliminates_nothing(monkeypatch):
    def never(*arguments):
        raise AssertionError("eliminated")

    monkeypatch.setattr(import_module("skmpm.step.derived"), "eliminate", never)
    scene = bar()
    step(scene, initial(scene), 1e-4)
    with pytest.raises(AssertionError, match="eliminated"):
        initial(bar(supports=[Support(left)]))


def test_contact_and_supports_together():
    # The floor touches only what is held: it neither pushes nor hinders.
    walls = [Wall((0, 1.0), (0, -1), velocity=(0, -0.02)), Wall((0, 0), (0, 1), friction=0.5)]
    scene = bar(SOFT, supports=[Support(lambda x: x[1] < 1e-9)], walls=walls)
    *_, state = simulate(scene, dt=1.0, until=3.0, scheme=STATIC)
    assert state.wall_force[0, 1] > 100.0
    assert state.support_force[0] == pytest.approx(-state.wall_force[0], rel=1e-4, abs=1e-2)
    assert not state.wall_force[1].any()
    assert state.x[1].max() <= 1.0 - 0.06 + 1e-6


def test_re_anchoring_keeps_the_supports():
    supports = [Support(left), Support(right, velocity=(0.05, None))]
    states = []
    for anchor in (0.1, np.inf):
        scheme = Scheme(inertia=False, anchor=anchor)
        *_, state = simulate(bar(SOFT, supports=supports), dt=0.5, until=8.0, scheme=scheme)
        states.append(state)
    regridded, once = states
    assert not np.array_equal(regridded.x_anchor, once.x_anchor)
    assert regridded.x[0].max() == pytest.approx(2.4, rel=1e-9)
    assert regridded.support_force[1, 0] == pytest.approx(once.support_force[1, 0], rel=0.02)


BAD = {
    "nowhere": ({"supports": [Support(lambda x: x[0] < -1)]}, "support 0: where is true at no point"),
    "no function": ({"supports": [Support((0, 0))]}, r"support 0: where: expected a function .* got \(0, 0\)"),
    "numbers": ({"loads": [Load(lambda x: x[0], (1, 0))]}, "load 0: where returned float64"),
    "and": ({"supports": [Support(lambda x: x[0] < 1 and x[1] < 1)]}, "support 0: where failed .*; use &, "),
    "no velocity": ({"supports": [Support(left, velocity=None)]}, r"support 0: velocity = None; give two components"),
    "three": ({"supports": [Support(left, velocity=(0, None, 0))]}, "give two components"),
    "nan": ({"supports": [Support(left, velocity=(np.nan, 0))]}, "support 0: velocity = .*give two components"),
    "no force": ({"loads": [Load(right, lambda t: (t, None))]}, "load 0: force at t = 0"),
    "twice": ({"supports": [Support(left), Support(everywhere)]}, "supports 0 and 1 both hold the x component"),
    "no support": ({"supports": [left]}, "support 0 is a function; use skmpm.Support"),
    "no load": ({"loads": [left]}, "load 0 is a function; use skmpm.Load"),
    "no list": ({"supports": Support(left)}, "supports: expected a list, got a Support"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_supports_and_loads_are_named(case):
    scene, message = BAD[case]
    with pytest.raises(SceneError, match=message):
        bar(**scene)


def test_rigid_bodies_have_no_supports():
    slab = Body(box((0, -0.5), (2, 0.25), spacing=0.125), Rigid(1000.0), motion=(0.0, 0.0, 0.0))
    body = Body(box((0, 0), (2, 1), spacing=0.125), SOFT)
    with pytest.raises(SceneError, match="at no point of a deformable body"):
        Scene([slab, body], cell=0.25, supports=[Support(lambda x: x[1] < -0.3)])


def test_a_component_is_free_always_or_never():
    scene = bar(SOFT, supports=[Support(left, velocity=lambda t: (0, 0) if t < 1 else (0, None))])
    state = step(scene, initial(scene), 1.0, scheme=STATIC)
    with pytest.raises(SceneError, match=r"support 0: velocity at t = 1\.5 s .*free always or never"):
        step(scene, state, 1.0, scheme=STATIC)


def test_supports_that_turn_the_body_inside_out_fail_clearly():
    scene = bar(SOFT, supports=[Support(left), Support(right, velocity=(-3.0, 0.0))])
    with pytest.raises(StepFailed, match=r"inverted \(det F <= 0\); use a smaller dt"):
        step(scene, initial(scene), 1.0, scheme=STATIC)


def test_quasi_static_steps_need_theta_one():
    with pytest.raises(ValueError, match=r"theta = 0\.5 without inertia"):
        Scheme(theta=0.5, inertia=False)


# --- supports in contact


def held_box(velocity, **options):
    """A box on a rough floor; its left face is held along the floor, and free to slide up and down."""
    body = Body(box((0.013, 0.0), (1, 1), spacing=0.07), NeoHookean(1e6, 0.3, 1000.0), velocity=(velocity or 0.0, 0))
    support = Support(lambda x: x[0] < 0.013 + 1e-9, velocity=(velocity, None))
    floor = Wall((0, 0), (0, 1), friction=0.3)
    return Scene([body], cell=0.1, walls=[floor], supports=[support], gravity=(0, -9.81), **options)


def test_contact_forces_act_where_a_support_prescribes_sliding():
    """One held boundary point that does not respond along the floor once switched off all contact forces."""
    scene, weight = held_box(0.0), 9810.0
    states = list(simulate(scene, dt=2e-3, until=0.2))
    assert min(s.x[1].min() for s in states) > -1e-6
    assert np.mean([s.wall_force[0, 1] for s in states]) == pytest.approx(-weight, rel=0.1)
    for s in states[5:]:
        assert s.report.residual < 1e-5
        assert abs(s.wall_force[0, 0]) <= 0.3 * abs(s.wall_force[0, 1]) * (1 + 1e-9)


@pytest.mark.parametrize("velocity", [0.05, -0.05])
def test_a_dragged_box_pulls_its_support_by_its_friction(velocity):
    """Coulomb's law in steady sliding: 0.3 of the weight, whichever way, the held points' own friction included."""
    *_, state = simulate(held_box(velocity), dt=2e-2, until=1.0)
    assert state.support_force[0, 0] == pytest.approx(-np.sign(velocity) * 0.3 * 9810.0, rel=1e-4)
    assert state.wall_force[0] == pytest.approx([np.sign(velocity) * 0.3 * 9810.0, -9810.0], rel=1e-4)


def test_a_support_that_drives_its_points_into_a_wall_fails_clearly():
    """At 0.1 m/s they are a hundredth of a cell deep after 0.01 s."""
    body = Body(box((0.013, 0.0), (1, 1), spacing=0.07), SOFT)
    support = Support(lambda x: x[1] < 1e-9, velocity=(0.0, -0.1))
    scene = Scene([body], cell=0.1, walls=[Wall((0, 0), (0, 1), friction=0.3)], supports=[support])
    with pytest.raises(
        StepFailed, match=r"body 0 and wall 0: they press .* supports hold both; give these points no Support"
    ) as failed:
        list(simulate(scene, dt=1e-3, until=0.1))
    assert failed.value.state.t == pytest.approx(0.01, abs=2e-3)


def test_a_support_that_prescribes_nothing_is_refused():
    with pytest.raises(SceneError, match=r"support 0: velocity = \(None, None\) prescribes nothing"):
        bar(supports=[Support(left, velocity=(None, None))])


def test_without_inertia_a_body_that_nothing_drives_stays_at_rest():
    """A block flew on at the speed of the lid that had left it, and one with an initial velocity for ever."""

    def lid(t):
        return (0.0, -0.05 if t < 0.5 else 0.05)

    body = Body(box((0, 0), (1, 1), spacing=0.125), SOFT, velocity=(0.1, 0.0))
    scene = Scene([body], cell=0.25, walls=[Wall((0, 0), (0, 1)), Wall((0, 1), (0, -1), velocity=lid)])
    states = list(simulate(scene, dt=0.1, until=3.0, scheme=STATIC))
    after = [s for s in states if s.t > 1.25]
    assert np.ptp([s.x for s in after], axis=0).max() < 1e-9
    assert abs(after[-1].x[1].min()) < 1e-2
    assert abs(after[-1].x[0].mean() - 0.5) < 1e-2
