"""Contact of a body with itself, compared with separate bodies, finer grids and conservation laws.

C-rings: thickness R/4, five and ten cells across it, neo-Hookean with nu = 0.3, pressed flat between plates by
quasi-static steps. With friction 0.5 the two tips meet, corner against corner; without, the shorter arm lands on the
inner side of the longer one. References: forces of cells half as large to 3 %, and the penetration of the outline,
measured on a dense sample of splines through the boundary points (`self_contact.penetration`), below 0.02 cells.

Slotted blocks: two legs of 4 x 20 cells over slots of 1 to 4 cells, whose tips are pressed together by supports.
Reference: the same legs as two bodies, forces to 1.5 % with the slot open or closed.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from ledger import Row, numbers
from self_contact import c_ring, crushed_ring, flying_fork, penetration, slotted, standing_fork

from skmpm import Scheme, StepFailed, contact_pressure, initial, load, network, observe, save, simulate, step
from skmpm.contact import point_to_curve
from skmpm.scene import prescribed_velocities

STATIC = Scheme(inertia=False)
SMOOTH = 0.02  # [cells] deepest penetration
ROUNDED = 0.03  # of two corners that meet, rounded by a disc of 0.05 cells


def own(state):
    """Which contacts are of a body with itself."""
    return state.contacts.bodies[0] == state.contacts.bodies[1]


STEPS = {0.0: ((1 / 60, 0.95),), 0.5: ((1 / 30, 0.44),)}  # by friction: length and end [s]
CHOSEN = {  # those of the tests: long before parts touch, and so short as they do that none is repeated many times
    0.0: ((1 / 30, 0.7), (1 / 60, 0.95)),
    0.5: ((1 / 30, 4 / 30), (1 / 480, 17 / 120), (1 / 1920, 0.15), (1 / 120, 0.2), (1 / 30, 0.44)),
}


@cache
def pressed(cells, friction, chosen=False):
    """A C-ring pressed until the plates are three thicknesses apart, with friction five: its scene and states.

    Without friction its arms are closed in the last sixth only, so steps are half as long as with. With it, the tips
    slip past each other from 0.46 on, which static steps do not follow on the finer grid.
    """
    scene, states = c_ring(1.0 / cells, friction), []
    for dt, until in (CHOSEN if chosen else STEPS)[friction]:
        states += simulate(scene, dt=dt, until=until, scheme=STATIC, start=states[-1] if states else None)
    return scene, states


@cache
def error_of_ring(friction, chosen=False):
    """Largest relative difference of the lid's force to that with half the cell, in steps that touch; how many."""
    (_, states), (_, finer) = (pressed(cells, friction, chosen) for cells in (20, 40))
    (t, force), (fine_t, fine) = (np.array([(s.t, s.wall_force[1, 1]) for s in run]).T for run in (states, finer))
    closed = np.array([state.contacts.force[0, own(state)].any() for state in states])
    return float(np.abs(force / np.interp(t, fine_t, fine) - 1.0)[closed].max()), int(closed.sum())


@cache
def depth_of_ring(cells, friction, chosen=False):
    """Deepest penetration of the ring's outline in itself [cells]."""
    scene, states = pressed(cells, friction, chosen)
    return max(penetration(state.x[:, scene.outlines.point], scene.cell) for state in states)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [pytest.param(0.0, marks=pytest.mark.nightly), 0.5], ids=["smooth", "rough"])
def test_a_ring_is_pressed_flat(friction):
    """Without friction the tip of an arm slides on the side of the other, with friction two tips meet.

    Flatter rings are too stiff with five cells across their folds, by 6 % where the plates are 0.6 R apart.
    """
    error, steps = error_of_ring(friction, chosen=True)
    assert steps >= 10
    assert error < 0.03
    assert max(depth_of_ring(cells, friction, chosen=True) for cells in (20, 40)) < SMOOTH


@cache
def forces_on_legs(slot, friction):
    """Forces on the supports of the tips, of one slotted body and of two (2, steps), and which steps touch."""
    force, closed = [], []
    for divided in (False, True):
        states = list(simulate(slotted(slot, friction, divided=divided), dt=1 / 20, until=1.0, scheme=STATIC))
        force.append([state.support_force[1, 0] for state in states])
        closed.append([(state.contacts.force[0] > 0.0).any() for state in states])
    return np.array(force), np.array(closed)


@pytest.mark.parametrize("friction", [0.0, 0.5])
@pytest.mark.parametrize("slot", [8, 3, 2])
def test_legs_of_a_slotted_block_touch_as_two_bodies_do(slot, friction):
    """Slots of 4, 1.5 and 1 cells, with sides on lines of the grid, closed by a quarter more than their width."""
    force, closed = forces_on_legs(slot, friction)
    assert (closed[0] == closed[1]).all()
    assert 4 <= closed[0].sum() <= 6
    np.testing.assert_allclose(*force, rtol=0.015)
    assert force[0, -1] / force[0, 13] > 20.0 * 20 / 14


@pytest.mark.parametrize("slot", [2, 3])
def test_legs_attract_each_other_as_two_bodies_do(slot):
    """In range of cohesion across the slot: c times its depth of 20 cells, of two legs c times their 23 cells.

    The end of the slot, a corner that opens, belongs to no contact, so half a segment is missing. Half of it was
    taken for the other side's.
    """
    for divided, depth in ((False, 20.0 - 0.25), (True, 23.0)):
        scene = replace(slotted(slot, divided=divided), cohesion=3.0, cohesion_range=0.6 * slot)
        state = initial(scene, scheme=STATIC)
        grid = state.grids.assembly.grid
        found = point_to_curve(scene, state, grid, 1e-6)(np.zeros(2 * grid.nodes))
        assert found.tensile_strength.sum() == pytest.approx(3.0 * depth, rel=1e-9)


def test_a_hole_closes():
    """The inner boundary of a ring between two rigid discs touches itself along a width that grows.

    Its deepest penetration is 0.021 cells where it closes at R/h = 16, 0.015 at 20.
    """
    scene = crushed_ring(1.0 / 16.0)
    states = list(simulate(scene, dt=1 / 40, until=1.0, scheme=STATIC))
    count = [int((state.contacts.force[0, own(state)] > 0.0).sum()) for state in states]
    assert count[25] == 0
    assert count[-1] > 6
    point = scene.outlines.point
    inner = np.hypot(*scene.initial_positions[:, point]) < 0.8
    loop = np.flatnonzero(inner & (scene.outlines.body == 0))
    assert max(penetration(state.x[:, point[loop]], scene.cell) for state in states) < ROUNDED


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_prongs_that_meet_keep_momentum_and_gain_no_energy(friction):
    """Momentum of the body to round-off; energy of backward Euler decreases in every step."""
    scene = flying_fork(friction)
    start = initial(scene)
    states = [start, *simulate(scene, dt=0.02, until=1.6)]
    touching = [bool((state.contacts.force[0] > 0.0).any()) for state in states]
    assert sum(touching) > 20
    momentum = np.array([state.v @ state.mass for state in states])
    np.testing.assert_allclose(momentum, np.tile(momentum[0], (len(states), 1)), rtol=1e-10)
    energy = np.array([state.report.energy.kinetic + state.report.energy.elastic for state in states])
    assert np.diff(energy).max() < 0.0
    point = scene.outlines.point
    assert max(penetration(state.x[:, point], scene.cell) for state in states) < ROUNDED


def test_forces_of_self_contact_have_no_resultant_and_follow_from_the_gap():
    """H^T r has neither sum nor moment about the nodes' positions; the normal rows of H are d gap / d w / dt."""
    scene, dt = flying_fork(0.5), 0.02
    state = next(state for state in simulate(scene, dt=dt, until=1.6) if (state.contacts.force[0] > 0.0).sum() > 1)
    grid = state.derived.assembly.grid
    linearise = point_to_curve(scene, state, grid, dt, 1.0, prescribed_velocities(scene, state.t, dt))
    w = np.zeros(2 * grid.nodes)
    found = linearise(w)
    assert found.size > 2
    assert (found.bodies == 0).all()
    r = np.random.default_rng(0).random(2 * found.size)
    nodal = (found.H.T @ r).reshape(-1, 2).T
    x = grid.position + state.displacement.reshape(-1, 2).T
    assert np.abs(nodal.sum(axis=1)).max() < 1e-12
    moment = x[0] * nodal[1] - x[1] * nodal[0]
    friction_times_gap = r[1::2] * found.gap
    assert moment.sum() == pytest.approx(friction_times_gap.sum(), abs=1e-10)
    direction = np.random.default_rng(1).standard_normal(w.size)
    small = 1e-6
    ahead, behind = (linearise(sign * small * direction) for sign in (1.0, -1.0))
    np.testing.assert_array_equal(ahead.key, found.key)
    rate = (ahead.gap - behind.gap) / (2.0 * small * dt)
    np.testing.assert_allclose(found.H[::2] @ direction, rate, atol=1e-6 * np.abs(rate).max())


def test_a_restart_in_self_contact_is_exact(tmp_path):
    """Four steps at once, or two, a checkpoint, and two more: the same bits."""
    scene = slotted(8, 0.5)
    states = list(simulate(scene, dt=1 / 20, until=1.0, scheme=STATIC))
    touching = next(k for k, state in enumerate(states) if own(state).any() and state.contacts.force[0].any())
    save(tmp_path / "state.h5", states[touching])
    state = load(tmp_path / "state.h5")
    for expected in states[touching + 1 : touching + 3]:
        state = step(scene, state, 1 / 20, scheme=STATIC)
        for name in ("x", "v", "F", "stress"):
            np.testing.assert_array_equal(getattr(state, name), getattr(expected, name))
        np.testing.assert_array_equal(state.contacts.force, expected.contacts.force)


def test_a_body_is_no_neighbour_of_itself():
    """The coordination number counts other bodies and walls only, the contact length both sides of the slot."""
    scene = slotted(8)
    *_, state = simulate(scene, dt=1 / 20, until=1.0, scheme=STATIC)
    seen = observe(scene, state)
    assert (state.contacts.force[0] > 0.0).sum() >= 4
    assert seen.bodies.coordination[0] == 0.0
    left = scene.initial_positions[0, state.contacts.point] < 6.0
    assert min(left.sum(), (~left).sum()) <= 1  # one leg gives the points, the other its corner at most
    x = state.contacts.x[1, state.contacts.force[0] > 0.0]
    length = seen.bodies.contact_surface[0] * np.pi * seen.bodies.diameter[0]
    assert length == pytest.approx(2.0 * np.ptp(x), abs=2.0)
    total = state.contacts.force[0].sum()
    np.testing.assert_allclose(seen.bodies.stress[:, :, 0], 0.0, atol=1e-6 * total)
    assert network(scene, state).size == 0


def test_the_pressure_of_a_body_on_itself_acts_on_both_of_its_parts():
    """The two legs bear opposite resultants, that of the contacts each, and the body none."""
    scene = slotted(8)
    *_, state = simulate(scene, dt=1 / 20, until=1.0, scheme=STATIC)
    found = contact_pressure(scene, state, 0)
    on_left = scene.initial_positions[0, found.point] < 6.0
    left, right = ((found.traction * found.length)[:, chosen].sum(axis=1) for chosen in (on_left, ~on_left))
    sizes = np.array([np.abs(left[0]), np.abs(right[0])])
    np.testing.assert_allclose(sizes, state.contacts.force[0].sum(), rtol=1e-3)
    assert left[0] < 0.0 < right[0]
    np.testing.assert_allclose(found.force, 0.0, atol=1e-9 * sizes[0])


def test_regridding_that_would_join_parts_in_contact_is_refused():
    """With anchor = 0 the prongs share nodes of the grid before they touch; they would stick together."""
    with pytest.raises(
        StepFailed, match=r"body 0: parts of it that approach each other share nodes.*anchor = 0; use a larger"
    ):
        list(simulate(flying_fork(0.0), dt=0.02, until=1.6, scheme=Scheme(anchor=0.0)))


def test_a_body_stands_whatever_its_parts_do_to_each_other():
    """A fork on a floor without inertia, whose prongs press on each other: the floor bears its weight."""
    scene = standing_fork()
    weight = (scene.initial_volumes * 1000.0).sum()
    *_, state = simulate(scene, dt=0.125, until=1.0, scheme=STATIC)
    assert state.contacts.force[0, own(state)].sum() > 1000.0
    np.testing.assert_allclose(state.wall_force[0], (0.0, -weight), atol=1e-4 * weight)


def rows():
    slots = [
        max(float(np.abs(np.divide(*forces_on_legs(slot, friction)[0]) - 1.0).max()) for friction in (0.0, 0.5))
        for slot in (8, 3, 2)
    ]
    rings = [error_of_ring(friction)[0] for friction in (0.0, 0.5)]
    depth = [max(depth_of_ring(cells, friction) for cells in (20, 40)) for friction in (0.0, 0.5)]
    ring, legs = (
        "C-ring of thickness R/4 pressed flat until its arms touch, friction 0, 0.5",
        "two legs over a slot of 4, 1.5, 1 cells, pressed together: force, friction 0 and 0.5",
    )
    pressed_flat, as_two = "test_a_ring_is_pressed_flat", "test_legs_of_a_slotted_block_touch_as_two_bodies_do"
    return [
        Row(f"{ring}: force", "half the cell", "R/h = 20", numbers(rings), "-", "3 %: met", pressed_flat),
        Row(
            f"{ring}: penetration",
            "splines through the boundary points",
            "R/h = 20, 40",
            f"{numbers(depth)} cells",
            "-",
            "0.02 cells: met; 0.029 where two tips are pressed flatter, which a disc of 0.05 cells rounds",
            pressed_flat,
        ),
        Row(legs, "two bodies", "1/4 of a leg", numbers(slots), "-", "1.5 %: met", as_two),
    ]


def figures(folder):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    fig, axes = plt.subplots(2, 3, figsize=(8.5, 4.4), layout="constrained")
    for row, friction in zip(axes, (0.0, 0.5), strict=True):
        scene, states = pressed(20, friction)
        for ax, share in zip(row, (0.3, 0.65, 1.0), strict=True):
            state = states[round(share * (len(states) - 1))]
            ax.fill(*state.x[:, scene.outlines.point], facecolor="C0", edgecolor="black", alpha=0.6, lw=0.5)
            ax.plot(*state.contacts.x[:, state.contacts.force[0] > 0.0], ".", color="black", ms=3)
            for height in state.walls[:, 1]:
                ax.axhline(height, color="black", lw=0.8)
            ax.set(aspect="equal", xlim=(-1.1, 1.9), xticks=[], yticks=[])
    fig.savefig(folder / "self_contact.png", dpi=80)
    plt.close(fig)
    return {
        "self_contact.png": "C-rings pressed flat: without friction (above) a tip slides on the inner side of the"
        " other arm; with friction 0.5 (below) two tips meet. Dots: loaded contacts."
    }
