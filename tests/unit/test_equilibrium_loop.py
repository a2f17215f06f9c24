"""Static steps by the Newton loop of dynamic ones: figures that the present method misses, and what it refuses."""

import numpy as np
import pytest

from skmpm import (
    Body,
    Load,
    NeoHookean,
    Periodic,
    Scene,
    Scheme,
    StepFailed,
    Wall,
    box,
    contact,
    disc,
    initial,
    observe,
    simulate,
    step,
)
from skmpm.implicit.contact_stiffness import contact_stiffness

E, R, H = 1e6, 1.0, 0.2
GEL, STATIC = NeoHookean(E, 0.3, 1000.0), Scheme(inertia=False)


@pytest.fixture(autouse=True)
def loop(monkeypatch):
    monkeypatch.setenv("SKMPM_STATICS", "new")


# Contact points that slide.


def smooth(scene, grid, rng):
    """A random homogeneous motion of each body, (2 nodes,) [m/s]."""
    out = np.zeros((grid.nodes, 2))
    for b in range(len(scene.bodies)):
        own = grid.node_body == b
        x = grid.position[:, own] - grid.position[:, own].mean(axis=1, keepdims=True)
        out[own] = (rng.standard_normal((2, 2)) / R @ x).T + rng.standard_normal(2)
    return out.ravel()


@pytest.mark.parametrize("seed", range(3))
def test_the_least_gap_has_the_curvature_of_contact_points_that_slide(seed):
    """The second derivative of the gap along a motion, by differences; a fixed contact point misses a sixth of it."""
    bodies = [Body(disc(x, r, spacing=H / 2), GEL) for x, r in (((0, 0), R), ((1.80 * R, 0.3 * R), 0.8 * R))]
    scene, dt = Scene(bodies, cell=H, walls=[Wall((0, -R), (0, 1))]), 1e-2
    state, rng = initial(scene), np.random.default_rng(seed)
    grid = state.derived.assembly.grid
    linearise = contact.point_to_curve(scene, state, grid, dt, 1.0, None, False)
    at, along = 0.02 * smooth(scene, grid, rng), 0.2 * smooth(scene, grid, rng)
    rows = linearise(at)
    k = np.arange(rows.size)
    tau, beta, _ = (Z @ rows.at_contact_points(along) for Z in rows.geometric(k))
    fixed = -(rows.curvature * tau**2 + 2.0 * tau * beta + rows.gap * beta**2) / (1.0 - rows.gap * rows.curvature)
    turn = rows.turning(k, rows.normal) @ rows.at_contact_points(along)
    near = [linearise(at + n * 1e-3 * along).gap for n in (-2, -1, 0, 1, 2)]
    measured = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0 @ np.array(near) / (1e-3 * dt) ** 2
    slides = rows.travel > 0.0
    assert set(rows.bodies[1, slides]) == {1, -1}
    size = np.abs(rows.travel * turn**2)[slides].max()
    assert measured[slides] == pytest.approx((fixed - rows.travel * turn**2)[slides], abs=0.03 * size)


def test_a_contact_that_slides_adds_stiffness_only_where_it_is_pressed():
    scene = Scene([Body(disc((0.0, R), R, spacing=0.66 * H), GEL)], cell=H, walls=[Wall((0, 0), (0, 1))])
    state = initial(scene)
    grid = state.derived.assembly.grid
    rows = contact.point_to_curve(scene, state, grid, 1.0, 1.0, None, False)(np.zeros(2 * grid.nodes))
    slides = np.flatnonzero(rows.travel > 0.0)
    assert slides.size == 1
    r = np.zeros(rows.size)
    assert contact_stiffness(rows, r, 1.0, 1.0) is None
    r[slides] = 2.0
    added = contact_stiffness(rows, r, 1.0, 1.0)
    assert added.sliding.tolist() == slides.tolist() and added.contacts.size == 0
    assert added.compliance.toarray() == pytest.approx(1.0 / (2.0 * R), rel=0.02)  # it travels by R per turn


# Equilibria.


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


def test_boxes_between_smooth_plates_bear_what_plane_strain_says():
    bodies = [Body(box((0.1 * H, s), (1.0, 1.0), spacing=0.75 * H), GEL) for s in (0.0, 1.0)]
    lid = Wall((0.1 * H, 2.0), (0, -1), velocity=(0.0, -0.02))
    scene = Scene(bodies, cell=H, walls=[Wall((0.1 * H, 0), (0, 1)), lid])
    after = step(scene, initial(scene, scheme=STATIC), 1.0, scheme=STATIC)
    alone = Scene(bodies[:1], cell=H, walls=[scene.walls[0], Wall((0, 1), (0, -1), velocity=(0.0, -0.01))])
    one = step(alone, initial(alone, scheme=STATIC), 1.0, scheme=Scheme(inertia=False, newton_tol=1e-9))
    assert after.wall_force[1, 1] == pytest.approx(one.wall_force[1, 1], rel=1e-3)  # two as one, by symmetry
    assert after.report.newton <= 5


@pytest.mark.parametrize("spacing", [0.66, 0.74])
@pytest.mark.parametrize("share", [1.05, 0.95])
def test_a_pile_of_three_discs_stands_and_falls_at_its_limit(spacing, share):
    """Three discs, the upper on the others: friction of at least tan 15 degrees at both contacts holds it."""
    radius, friction = 1.0, share * np.tan(np.deg2rad(15.0))
    places = [(0.0, 1.0), (2.0, 1.0), (1.0, 1.0 + np.sqrt(3.0))]
    cell = radius / 5
    bodies = [Body(disc(x, radius, spacing=spacing * cell), NeoHookean(1e7, 0.3, 1000.0)) for x in places]
    scene = Scene(bodies, cell=cell, walls=[Wall((0, 0), (0, 1))], friction=friction, gravity=(0.0, -1.0))
    start = initial(scene, scheme=STATIC)
    if share > 1.0:
        after = step(scene, start, 1.0, scheme=STATIC)
        assert after.wall_force[0, 1] == pytest.approx(-3.0 * np.pi * 1000.0, rel=5e-3)
    else:
        with pytest.raises(StepFailed, match="there is no equilibrium"):
            step(scene, start, 1.0, scheme=STATIC)


# None.


def on_slope(points, tangent, friction):
    """A body on a floor, with gravity inclined by arctan(tangent)."""
    walls = [Wall((0, 0), (0, 1), friction=friction)]
    return Scene([Body(points, GEL)], cell=H, walls=walls, gravity=10.0 * np.array([tangent, -1.0]))


BOXES = [Body(box((s, y), (w, 1.0), spacing=0.75 * H), GEL) for s, y, w in ((0.0, 0.0, 2.0), (0.3, 1.0, 1.0))]
UNBALANCED = {
    r"body 0: .* slides on wall 0 at .* or friction": on_slope(
        box((0.03, 0.0), (1.0, 1.0), spacing=0.75 * H), 0.1, 0.0
    ),
    r"body 0: .* slides on wall 0": on_slope(box((0.0, 0.0), (2.0, 1.0), spacing=0.66 * H), 0.35, 0.3),
    r"body 0: .* topples on wall 0 at \(0.8, 0\) m": on_slope(
        box((0.0, 0.0), (0.8, 2.0), spacing=0.75 * H), 0.5, 2.0
    ),
    r"body 0: .* rolls on wall 0": on_slope(disc((0.1, R), R, spacing=0.75 * H), 0.1, 10.0),
    r"body 0: .* falls": Scene([Body(disc((0.1, 3.0), R, spacing=0.75 * H), GEL)], cell=H, gravity=(0.0, -10.0)),
    r"body 1: .* slides on body 0": Scene(
        BOXES, cell=H, walls=[Wall((0, 0), (0, 1), friction=0.5)], friction=0.1, gravity=(2.0, -10.0)
    ),
}


@pytest.mark.parametrize("message", UNBALANCED)
def test_bodies_without_equilibrium_are_named_with_their_motion(message):
    scene = UNBALANCED[message]
    with pytest.raises(StepFailed, match=message) as failed:
        step(scene, initial(scene, scheme=STATIC), 1.0, scheme=STATIC)
    assert "% of the forces on it are out of balance" in str(failed.value)
    assert not failed.value.retryable


def test_a_body_under_an_unbalanced_load_accelerates():
    end = Load(lambda x: x[0] > 2.0 - 1e-9, (1.0, 0.0))
    scene = Scene([Body(box((0, 0.03), (2.0, 1.0), spacing=0.125), GEL)], cell=0.25, loads=[end])
    with pytest.raises(StepFailed, match="body 0"):
        step(scene, initial(scene, scheme=STATIC), 1.0, scheme=STATIC)
