"""Equilibrium of bodies that only contacts hold: limits from the statics of rigid bodies, and what falls.

Bodies are so stiff that gravity strains them by 1e-4: limits are those of rigid bodies to a per cent or two.
"""

import re
from dataclasses import replace

import numpy as np
import pytest

from skmpm import (
    Body,
    Load,
    NeoHookean,
    Periodic,
    Rigid,
    Scene,
    Scheme,
    Spring,
    StepFailed,
    Support,
    Wall,
    box,
    disc,
    initial,
    observe,
    simulate,
    step,
)

E, R, H = 1e6, 1.0, 0.2
GEL, STIFF, STATIC = (NeoHookean(E, 0.3, 1000.0), NeoHookean(1e8, 0.3, 1000.0), Scheme(inertia=False))
G, HOLD = 10.0, {True: 1.05, False: 0.95}  # [m/s2]; of the limit


def solved(scene):
    """The state after one step."""
    return step(scene, initial(scene, scheme=STATIC), 1.0, scheme=STATIC)


def on_slope(points, tangent, friction, material=GEL):
    """A body on a floor, with gravity inclined by arctan(tangent)."""
    walls, angle = [Wall((0, 0), (0, 1), friction=friction)], np.arctan(tangent)
    gravity = G * np.array([np.sin(angle), -np.cos(angle)])
    return Scene([Body(points, material)], cell=H, walls=walls, gravity=gravity)


def refused(scene, message):
    """The message with which a step fails; it matches, and shorter steps would not help."""
    with pytest.raises(StepFailed, match=message) as failed:
        solved(scene)
    assert "% of the forces on it are out of balance" in str(failed.value)
    assert not failed.value.retryable
    return str(failed.value)


# Limits of rigid bodies.


@pytest.mark.parametrize("holds", HOLD)
@pytest.mark.parametrize("angle", [0.1, 0.5, 0.9])
def test_a_block_on_an_incline_slides_where_friction_is_less_than_the_slope(angle, holds):
    slope = np.tan(angle)
    scene = on_slope(box((0.03, 0.0), (2.0, 0.8), spacing=0.75 * H), slope, HOLD[holds] * slope, STIFF)
    if holds:
        state = solved(scene)
        weight = np.asarray(scene.gravity) * state.mass.sum()
        assert state.wall_force[0] == pytest.approx(weight, abs=2e-3 * np.hypot(*weight))
        assert np.abs(state.x - initial(scene).x).max() < 0.05 * H
    else:
        refused(scene, r"body 0: no equilibrium was found: it slides on wall 0 .* or friction")


@pytest.mark.parametrize("holds", HOLD)
@pytest.mark.parametrize("angle", [0.3, 0.6])
def test_a_tall_block_topples_where_its_centre_is_beyond_its_corner(angle, holds):
    """Width over height less than the slope, whatever the friction: it turns about its lower corner, downhill."""
    width = HOLD[holds] * 2.0 * np.tan(angle)
    scene = on_slope(box((0.0, 0.0), (width, 2.0), spacing=0.75 * H), np.tan(angle), 100.0, STIFF)
    if holds:
        state = solved(scene)
        assert np.hypot(*state.wall_force[0]) == pytest.approx(G * state.mass.sum(), rel=2e-3)
    else:
        message = refused(scene, r"body 0: .* topples on wall 0 at \(.*, 0\) m(?!.* friction)")
        assert float(re.search(r"\(([\d.]+), 0\)", message)[1]) == pytest.approx(width, abs=0.01 * H)


@pytest.mark.parametrize("tangent", [0.02, 0.6])
def test_a_disc_has_no_equilibrium_on_any_slope_and_rolls(tangent):
    """However gentle: soft ones stand on the chords that their boundary points make."""
    refused(on_slope(disc((0.1, R), R, spacing=0.75 * H), tangent, 10.0, STIFF), "body 0: .* rolls on wall 0")


def test_a_disc_less_than_a_cell_above_a_floor_comes_into_contact():
    state = solved(on_slope(disc((0.451, R + 0.4 * H), R, spacing=0.75 * H), 0.0, 0.5, STIFF))
    assert state.wall_force[0, 1] == pytest.approx(-G * state.mass.sum(), rel=2e-3)
    assert state.report.newton <= 15


@pytest.mark.parametrize(("cells", "lands"), [(4.0, True), (8.0, False)])
def test_a_body_falls_by_up_to_six_cells(cells, lands):
    """A small disc above a floor; a tenth of a cell in each solve, so that contact is found on the way."""
    scene = on_slope(disc((0.451, 0.3 + cells * H), 0.3, spacing=0.75 * H), 0.0, 0.5, STIFF)
    if not lands:
        refused(scene, "body 0: .* falls, by 6(.1)? cells in (6|7)[0-9] solves")
    else:
        state = solved(scene)
        assert state.wall_force[0, 1] == pytest.approx(-G * state.mass.sum(), rel=2e-3)
        assert 35 <= state.report.solves <= 55


def test_a_body_falls_no_farther_beside_one_that_turns_as_prescribed():
    """Farther by what the rim of that moves. Rates of its cosine and sine [1/s] once counted as speeds."""
    scene = on_slope(disc((0.451, 0.3 + 8.0 * H), 0.3, spacing=0.75 * H), 0.0, 0.5, STIFF)
    hub = Body(disc((5.05, 2.0), 0.3, spacing=0.75 * H), STIFF)
    turned = Support(lambda x: x[0] > 4.0, rotation=lambda t: 0.5 * t)
    with pytest.raises(StepFailed, match=r"body 0: .* falls, by (6\.[5-9]\d*|7) cells"):
        solved(replace(scene, bodies=[*scene.bodies, hub], supports=[turned]))


@pytest.mark.parametrize("holds", HOLD)
@pytest.mark.parametrize("angle", [0.7, 1.1])
def test_a_ladder_on_a_smooth_wall_needs_friction_of_half_the_cotangent(angle, holds):
    """Of a thin one: here the lever arms are those of the corners that touch."""
    ladder = box((-3.0, -0.3), (6.0, 0.6), spacing=0.7 * H).placed((0, 0), angle)
    (left, low), (right, _) = ladder.x.min(axis=1), ladder.x.max(axis=1)
    foot, head = (ladder.x[:, np.argmin(ladder.x[1])], ladder.x[:, np.argmax(ladder.x[0])])
    needed = -foot[0] / (head[1] - low)
    walls = [Wall((left, low), (0, 1), friction=HOLD[holds] * needed), Wall((right, 0), (-1, 0))]
    scene = Scene([Body(ladder, STIFF)], cell=H, walls=walls, gravity=(0.0, -G))
    if holds:
        weight = 1000.0 * G * 6.0 * 0.6
        assert np.abs(solved(scene).wall_force) == pytest.approx(
            weight * np.array([[needed, 1.0], [needed, 0.0]]), abs=0.02 * weight
        )
    else:
        refused(scene, "body 0: no equilibrium was found")


@pytest.mark.parametrize("seed", range(12))
def test_stacks_drawn_at_random_stand_where_every_centre_is_above_an_edge(seed):
    """Three boxes of random widths and offsets: what lies on a box has its centre over their common edge, or topples.

    Stacks within 4 % of a width of their limit are drawn anew.
    """
    rng = np.random.default_rng(seed)
    margin = 0.0
    while abs(margin) < 0.04:
        width = rng.uniform(0.8, 1.6, 3)
        left = np.cumsum(rng.uniform(-0.5, 0.5, 3) * [0.0, 1.0, 1.0]) - 0.5 * width
        margins = []
        for k in (1, 2):
            centre = np.average(left[k:] + 0.5 * width[k:], weights=width[k:])
            ends = max(left[k - 1 : k + 1]), min((left + width)[k - 1 : k + 1])
            margins.append(min(centre - ends[0], ends[1] - centre))
        margin = min(margins)
    bodies = [
        Body(box((x, k), (w, 1.0), spacing=0.7 * H), STIFF) for k, (x, w) in enumerate(zip(left, width, strict=True))
    ]
    scene = Scene(bodies, cell=H, walls=[Wall((0, 0), (0, 1), friction=0.6)], friction=0.6, gravity=(0.0, -G))
    if margin > 0.0:
        state = solved(scene)
        assert state.wall_force[0, 1] == pytest.approx(-G * state.mass.sum(), rel=2e-3)
    else:
        refused(scene, r"body [12]: no equilibrium was found: it topples on body")


@pytest.mark.parametrize("spacing", [pytest.param(0.66, marks=pytest.mark.nightly), 0.74])
@pytest.mark.parametrize("holds", HOLD)
def test_a_pile_of_three_discs_stands_and_falls_at_its_limit(spacing, holds):
    """Three discs, the upper on the others: friction of at least tan 15 degrees at both contacts holds it."""
    places = [(0.0, 1.0), (2.0, 1.0), (1.0, 1.0 + np.sqrt(3.0))]
    bodies = [Body(disc(x, R, spacing=spacing * H), NeoHookean(1e7, 0.3, 1000.0)) for x in places]
    friction = HOLD[holds] * np.tan(np.deg2rad(15.0))
    scene = Scene(bodies, cell=H, walls=[Wall((0, 0), (0, 1))], friction=friction, gravity=(0.0, -1.0))
    if holds:
        assert solved(scene).wall_force[0, 1] == pytest.approx(-3.0 * np.pi * 1000.0, rel=5e-3)
    else:
        refused(scene, "no equilibrium was found")


@pytest.mark.parametrize("gap", [1.0, 3.0])
def test_smooth_discs_part_until_walls_hold_them(gap):
    """One disc on two, which part by a gap [cells] up to walls: each bears half of its weight times a tangent."""
    aside = R + gap * H
    places = [(-R, R), (R, R), (0.0, R + np.sqrt(3.0) * R)]
    bodies = [Body(disc(x, R, spacing=0.7 * H), STIFF) for x in places]
    walls = [Wall((0, 0), (0, 1)), Wall((-aside - R, 0), (1, 0)), Wall((aside + R, 0), (-1, 0))]
    state = solved(Scene(bodies, cell=H, walls=walls, gravity=(0.0, -1.0)))
    weight, angle = state.mass[state.body == 2].sum(), np.arcsin(0.5 * aside / R)
    np.testing.assert_allclose(-state.wall_force[1:, 0] * (1, -1), 0.5 * weight * np.tan(angle), rtol=5e-3)
    assert state.report.solves > gap / 0.2


@pytest.mark.parametrize(("modulus", "friction"), [(1e7, 0.55), (3e7, 0.6), (1e7, 0.4)])
def test_a_heap_of_six_discs_stands_on_friction(modulus, friction):
    """Three, two and one: limit analysis of rigid discs needs 0.434 (linear programme of their 8 contacts)."""
    r, rise = 0.05, np.sqrt(3.0)
    places = [r * np.array((2 * i + k, 1.0 + rise * k)) for k in range(3) for i in range(3 - k)]
    bodies = [Body(disc(x, r, spacing=r / 8), NeoHookean(modulus, 0.3, 1000.0)) for x in places]
    scene = Scene(bodies, cell=r / 6, walls=[Wall((0, 0), (0, 1))], friction=friction, gravity=(0.0, -G))
    if friction < 0.434:
        refused(scene, r"body [0-5]: no equilibrium was found: it (rolls|slides) on .* or friction, or use inertia")
    else:
        state = solved(scene)
        assert state.wall_force[0, 1] == pytest.approx(-G * state.mass.sum(), rel=1e-3)
        assert np.abs(state.x - initial(scene).x).max() < 0.05 * scene.cell


@pytest.mark.parametrize("n", [3.2, 12.8])
def test_a_beam_pushes_the_rigid_discs_that_bear_it_apart(n):
    """By the slope of its lower face over them, in parts of the reaction; where cells are small that is 0.052."""
    h, half, depth = R / n, 4.0, 1.0
    beam = Body(box((-half, 2 * R), (2 * half, depth), spacing=0.5 * h), GEL)
    discs = [Body(disc((x, R), R, spacing=0.5 * h), Rigid(1000.0), motion=(0, 0, 0)) for x in (-3.0, 3.0)]
    top = Spring(lambda x: (abs(x[0]) < 0.3) & (x[1] > 2 * R + depth - 1e-9), (1e3, 0.0))
    load = Load(lambda x: (abs(x[0]) < 0.3) & (x[1] > 2 * R + depth - 1e-9), lambda t: (0.0, -2e3 * t))
    scene = Scene([beam, *discs], cell=h, loads=[load], springs=[top])
    *_, state = simulate(scene, dt=0.25, until=1.0, scheme=STATIC, warn=False)
    force = np.abs(state.body_force[:, 1:])
    if n > 10:
        expected = pytest.approx(0.052, abs=0.005)
    else:  # without an indentation that is wider than a cell
        x, y = state.x[:, (state.body == 0) & (scene.initial_positions[1] < 2 * R + 1e-9)]
        along = np.argsort(x)
        slope = np.interp([-3.0, 3.0], x[along], np.gradient(y[along], x[along]))
        expected = pytest.approx(np.abs(slope), rel=0.03)
    assert force[0] / force[1] == expected


def test_boxes_between_smooth_plates_bear_what_plane_strain_says():
    """Two boxes, 0.5 % of strain a step: 44.726 N/m, a uniform state; drifting ones bore 0.35 % less."""
    r = 1e-3
    boxes = [Body(box((-r, y), (2 * r, 2 * r), spacing=r / 8), GEL) for y in (0.0, 2 * r)]
    lid = Wall((0, 4 * r), (0, -1), velocity=(0, -0.02 * r))
    scene = Scene(boxes, cell=0.2e-3, walls=[Wall((0, 0), (0, 1)), lid])
    *_, state = simulate(scene, dt=1.0, until=4.0, scheme=STATIC, warn=False)
    assert state.wall_force[1, 1] == pytest.approx(44.726, rel=1e-3)


def test_a_lattice_of_discs_with_friction_rolls_to_no_chord():
    """Four discs, strained by 4 % and sheared in a periodic box: they turned by .1 rad, to and fro between steps."""
    bodies = [Body(disc((1.0 + 2 * i, 1.0 + 2 * j), R, spacing=0.25), GEL) for i in (0, 1) for j in (0, 1)]
    strained = Periodic(4.0, 4.0, rate=((-0.02, 0.01), (0.0, -0.02)))
    scene = Scene(bodies, cell=0.34, periodic=strained, friction=0.5)
    states = list(simulate(scene, dt=0.1, until=2.0, scheme=STATIC, warn=False))
    assert sum(state.report.retries for state in states) == 0
    assert sum(state.report.newton for state in states) < 150
    rotations = []
    for state in states:
        x = state.x - scene.initial_positions
        arm = scene.initial_positions - (np.floor(scene.initial_positions / 2.0) * 2.0 + 1.0)
        spin = (arm[0] * x[1] - arm[1] * x[0]) / (arm**2).sum(axis=0)
        rotations.append([np.median(spin[state.body == b]) for b in range(4)])
    assert np.abs(np.diff(rotations, axis=0)).max() < 0.02
    stress = observe(scene, states[-1]).stress
    assert stress[0, 0] == pytest.approx(-19.6e3, rel=0.01)  # as with boundary points alone


# What is refused, in words.


BOXES = [Body(box((s, y), (w, 1.0), spacing=0.75 * H), GEL) for s, y, w in ((0.0, 0.0, 2.0), (0.3, 1.0, 1.0))]
UNBALANCED = {
    r"body 0: .* slides on wall 0 at .* or friction": on_slope(
        box((0.03, 0.0), (1.0, 1.0), spacing=0.75 * H), 0.02, 0.0
    ),
    r"body 0: .* slides on wall 0": on_slope(box((0.0, 0.0), (2.0, 1.0), spacing=0.66 * H), 0.35, 0.3),
    r"body 0: .* topples on wall 0 at \(0.8, 0\) m": on_slope(
        box((0.0, 0.0), (0.8, 2.0), spacing=0.75 * H), 0.5, 2.0
    ),
    r"body 0: .* slides on wall 0 .*friction": on_slope(disc((0.1, R), R, spacing=0.75 * H), 0.3, 0.05),
    r"body 0: .* falls": Scene([Body(disc((0.1, 3.0), R, spacing=0.75 * H), GEL)], cell=H, gravity=(0.0, -G)),
    r"body 1: .* slides on body 0": Scene(
        BOXES, cell=H, walls=[Wall((0, 0), (0, 1), friction=0.5)], friction=0.1, gravity=(2.0, -10.0)
    ),
}


@pytest.mark.parametrize("message", UNBALANCED)
def test_bodies_without_equilibrium_are_named_with_their_motion(message):
    refused(UNBALANCED[message], message)


def test_a_body_under_an_unbalanced_load_accelerates():
    end = Load(lambda x: x[0] > 2.0 - 1e-9, (1.0, 0.0))
    refused(Scene([Body(box((0, 0.03), (2.0, 1.0), spacing=0.125), GEL)], cell=0.25, loads=[end]), "body 0")


def test_a_support_that_lets_a_body_slide_counts_as_far_as_it_stops_it():
    """A box on rollers that stop it from falling has an equilibrium; one that they only guide falls."""
    points = box((0.0, 0.0), (1.0, 1.0), spacing=0.75 * H)

    def rolling(velocity):
        held = Support(lambda x: x[1] > 1.0 - 1e-9, velocity=velocity)
        return Scene(
            [Body(points, GEL)], cell=H, walls=[Wall((5.0, 0.0), (-1, 0))], supports=[held], gravity=(0.0, -G)
        )

    state = solved(rolling((None, 0.0)))
    assert state.support_force[0, 1] == pytest.approx(-G * state.mass.sum(), rel=1e-3)
    refused(rolling((0.0, None)), "body 0: no equilibrium was found: it falls")
