"""Contact points that slide along both outlines, as they do in static steps: second derivatives of gaps."""

import numpy as np
import pytest

from skmpm import Body, NeoHookean, Periodic, Scene, Scheme, Wall, contact, disc, initial, step
from skmpm.contact import projection
from skmpm.step.contact_stiffness import contact_stiffness

R, H = 1.0, 0.2
GEL = NeoHookean(1e6, 0.3, 1000.0)


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
    fixed = -(rows.geometry.curvature * tau**2 + 2.0 * tau * beta + rows.gap * beta**2) / (
        1.0 - rows.gap * rows.geometry.curvature
    )
    turn = rows.turning(k, rows.normal) @ rows.at_contact_points(along)
    near = [linearise(at + n * 1e-3 * along).gap for n in (-2, -1, 0, 1, 2)]
    measured = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0 @ np.array(near) / (1e-3 * dt) ** 2
    slides = rows.geometry.travel > 0.0
    assert set(rows.bodies[1, slides]) == {1, -1}
    size = np.abs(rows.geometry.travel * turn**2)[slides].max()
    assert measured[slides] == pytest.approx((fixed - rows.geometry.travel * turn**2)[slides], abs=0.03 * size)


def test_a_contact_that_slides_adds_stiffness_only_where_it_is_pressed():
    scene = Scene([Body(disc((0.0, R), R, spacing=0.66 * H), GEL)], cell=H, walls=[Wall((0, 0), (0, 1))])
    state = initial(scene)
    grid = state.derived.assembly.grid
    rows = contact.point_to_curve(scene, state, grid, 1.0, 1.0, None, False)(np.zeros(2 * grid.nodes))
    slides = np.flatnonzero(rows.geometry.travel > 0.0)
    assert slides.size == 1
    r = np.zeros(rows.size)
    assert contact_stiffness(rows, r, 1.0, 1.0) is None
    r[slides] = 2.0
    added = contact_stiffness(rows, r, 1.0, 1.0)
    assert added.size == slides.size and added.contacts.size == 0
    assert added.compliance.toarray() == pytest.approx(1.0 / (2.0 * R), rel=0.02)  # it travels by R per turn


def test_images_that_a_far_motion_brings_are_among_those_that_face_sides(monkeypatch):
    """Two discs that touch at both sides of a periodic box once it has shrunk: images come in as a step is solved."""
    evaluate, sizes = projection._on_sides, []

    def seen(near, now):
        sizes.append((near.facing.x.shape, near.start.x.shape))
        return evaluate(near, now)

    monkeypatch.setattr(projection, "_on_sides", seen)
    bodies = [Body(disc((x, 1.5), R, spacing=0.15), GEL) for x in (1.15, 3.15)]
    box = Periodic(4.3, 3.0, rate=((-0.16, 0.0), (0.0, 0.0)))
    scene, scheme = Scene(bodies, cell=H, periodic=box, friction=0.5), Scheme(inertia=False)
    step(scene, initial(scene, scheme=scheme), 0.5, scheme=scheme)
    assert len({start for _, start in sizes}) == 2
    assert all(facing == start for facing, start in sizes)


@pytest.mark.parametrize(("cells", "slide"), [(5, True), (20, False)])
def test_a_contact_that_becomes_wide_in_a_step_ends_at_boundary_points(cells, slide):
    """A disc pressed by 0.01 R in one step: half-widths of 2 segments at R/h = 20, 0.2 at 5 and a fifth of it."""
    h, depth = R / cells, 0.01 * R * (0.2 if slide else 1.0)
    walls = [Wall((0, y), (0, -np.sign(y)), velocity=(0, -np.sign(y) * depth)) for y in (R, -R)]
    scene, scheme = Scene([Body(disc((0, 0), R, spacing=0.74 * h), GEL)], cell=h, walls=walls), Scheme(inertia=False)
    state = step(scene, initial(scene, scheme=scheme), 1.0, scheme=scheme)
    contacts = state.contacts
    off = np.hypot(*(contacts.x - state.x[:, contacts.point]))[contacts.force[0] > 0.0].max()
    assert (off > 0.01 * h) == slide
    assert (state.report.solves == 1) == slide
