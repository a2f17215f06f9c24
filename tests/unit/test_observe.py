"""Observables of shapes and contact networks with known values."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skmpm.material import LinearElastic, NeoHookean, Rigid
from skmpm.observe import observe, pair_correlation
from skmpm.observe.regions import area_inside, contains, region, share_inside
from skmpm.outline import outlines
from skmpm.points import Points, disc
from skmpm.points import box as block
from skmpm.scene import Body, Contacts, Pressure, Scene, SceneError, Wall
from skmpm.scheme import Scheme
from skmpm.simulation import simulate
from skmpm.step.algorithm import step
from skmpm.step.initial_state import initial

SOFT = NeoHookean(1e7, 0.45, 990.0)
SEEDS = st.integers(0, 2**32 - 1)
BY_VOLUME = Scheme(moment_fitting=False)  # so that what is seen does not depend on where the grid lies


def turn(angle):
    return np.array(((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))))


def column(pair):
    return np.asarray(pair, dtype=float)[:, None]


def polygon(x, volume=None):
    """Return a body whose points are its boundary; its volume that of the polygon unless given."""
    y = np.roll(x, -1, axis=1)
    area = np.sum(x[0] * y[1] - x[1] * y[0]) / 2 if volume is None else volume
    n = x.shape[1]
    return Body(Points(x, np.full(n, area / n), (np.arange(n),)), SOFT)


def refined(corners, m):
    """Put m equal segments on each side of a polygon (2, corners)."""
    s = np.arange(m) / m
    ends = np.roll(corners, -1, axis=1)
    return (corners[:, :, None] + (ends - corners)[:, :, None] * s).reshape(2, -1)


def box(low, high, angle=0.0, centre=(0.0, 0.0)):
    """Four walls, turned by `angle` about `centre`."""
    R, c = turn(angle), np.asarray(centre)
    at = [(low, (1, 0)), (low, (0, 1)), (high, (-1, 0)), (high, (0, -1))]
    return [Wall(c + R @ (np.asarray(p, dtype=float) - c), R @ n) for p, n in at]


def pressed(state, force, wall_force=None):
    """Give the contacts forces (2, k)."""
    contacts = replace(state.contacts, force=np.broadcast_to(force, state.contacts.normal.shape).astype(float))
    return replace(state, contacts=contacts, wall_force=state.wall_force if wall_force is None else wall_force)


def scalars(o):
    return {f.name: getattr(o, f.name) for f in fields(o) if isinstance(getattr(o, f.name), float)}


# --- regions


def half_planes(corners):
    """Inward normals and points of a counter-clockwise convex polygon."""
    along = np.roll(corners, -1, axis=1) - corners
    return np.stack([-along[1], along[0]]) / np.hypot(*along), corners


def convex(rng, n=7):
    angle = np.sort(rng.uniform(0, 2 * np.pi, n))
    return column(rng.uniform(-3, 3, 2)) + np.array((np.cos(angle), 0.7 * np.sin(angle)))


def star(rng, n=12):
    angle = 2 * np.pi * (np.arange(n) + 0.8 * rng.random(n)) / n
    return rng.uniform(0.3, 1, n) * np.array((np.cos(angle), np.sin(angle)))


def shoelace(x):
    y = np.roll(x, -1, axis=1)
    return np.sum(x[0] * y[1] - x[1] * y[0]) / 2


def clipped(x, normal, point):
    """Sutherland & Hodgman, CACM 17, 1974."""
    for n, p in zip(normal.T, point.T, strict=True):
        out = []
        for a, b in zip(x.T, np.roll(x, -1, axis=1).T, strict=True):
            s, t = n @ (a - p), n @ (b - p)
            if s >= 0:
                out.append(a)
            if s * t < 0:
                out.append(a + s / (s - t) * (b - a))
        if not out:
            return np.zeros((2, 1))
        x = np.array(out).T
    return x


@given(SEEDS)
def test_region_of_a_convex_polygon_has_its_sides_and_area(seed):
    rng = np.random.default_rng(seed)
    corners = convex(rng)
    order = rng.permutation(corners.shape[1])
    normal, point = half_planes(corners)
    r = region(normal[:, order], point[:, order])
    sides = np.hypot(*(np.roll(corners, -1, axis=1) - corners))
    np.testing.assert_allclose(r.length, sides[order], atol=1e-8)
    assert r.area == pytest.approx(shoelace(corners), abs=1e-9)


def test_walls_that_do_not_bound_the_region_have_no_length():
    normal, point = half_planes(np.array([[0.0, 2, 2, 0], [0.0, 0, 1, 1]]))
    extra_normal = np.array([[0.0, 0.0, 0.6], [1.0, 1.0, 0.8]])  # beyond the floor, the floor again, a far corner
    extra_point = np.array([[0.0, 5.0, -1.0], [-1.0, 0.0, -1.0]])
    r = region(np.hstack([normal, extra_normal]), np.hstack([point, extra_point]))
    np.testing.assert_allclose(r.length, [2, 1, 2, 1, 0, 0, 0])
    assert r.area == pytest.approx(2.0)


@pytest.mark.parametrize("gap", [0.0, -1.0])
def test_region_without_area_is_none(gap):
    r = region(np.array([[0.0, 0, 1, -1], [1.0, -1, 0, 0]]), np.array([[0.0, 0, 0, 1], [0.0, gap, 0, 0]]))
    assert np.isnan(r.area)


@given(SEEDS)
def test_area_in_a_region_is_that_of_the_clipped_polygon(seed):
    rng = np.random.default_rng(seed)
    bodies = [column(rng.uniform(-1, 1, 2)) + star(rng) for _ in range(3)]
    normal, point = half_planes(0.8 * convex(rng) / 2)
    boundary = outlines([[np.arange(12)]] * 3, [0, 12, 24])
    found = area_inside(region(normal, point), boundary, np.hstack(bodies), 3)
    np.testing.assert_allclose(found, [shoelace(clipped(x, normal, point)) for x in bodies], atol=1e-12)


def test_holes_are_clipped_too():
    square = np.array([[0.0, 2, 2, 0], [0.0, 0, 2, 2]])
    hole = 1 + 0.5 * (square[:, ::-1] - 1)
    boundary = outlines([[np.arange(4), np.arange(4, 8)]], [0])
    r = region(*half_planes(np.array([[1.0, 3, 3, 1], [-1.0, -1, 3, 3]])))
    assert area_inside(r, boundary, np.hstack([square, hole]), 1)[0] == pytest.approx(1.5)


@given(SEEDS)
def test_share_of_a_segment_in_a_region_is_that_of_its_points(seed):
    rng = np.random.default_rng(seed)
    r = region(*half_planes(convex(rng) / 2))
    start, end = rng.uniform(-2, 2, (2, 2, 8))
    t = (np.arange(4000) + 0.5) / 4000
    inside = [contains(r, column(a) + column(b - a) * t).mean() for a, b in zip(start.T, end.T, strict=True)]
    np.testing.assert_allclose(share_inside(r, start, end), inside, atol=1e-3)


# --- contact surface


def flattened(R, phi, m, arc, *, shift=0):
    """Cut a disc at x = R cos(phi): the flat side, m segments long, then the arc, turned by `shift`."""
    flat = np.stack([np.full(m, R * np.cos(phi)), R * np.sin(phi) * (2 * np.arange(m) / m - 1)])
    angle = phi + (2 * np.pi - 2 * phi) * np.arange(arc) / arc
    return np.roll(np.hstack([flat, R * np.array((np.cos(angle), np.sin(angle)))]), shift, axis=1)


def flat_pair(shift=0):
    phi = np.radians(40)
    x = flattened(1.0, phi, 10, 40, shift=shift)
    other = turn(np.pi) @ x + column((2 * np.cos(phi), 0.0))
    return Scene([polygon(x, np.pi), polygon(other, np.pi)], cell=0.2)


@pytest.mark.parametrize("shift", [0, -5, 3])  # the outline may begin anywhere on the flat
def test_flat_contact_counts_with_its_length_for_both_bodies(shift):
    scene = flat_pair(shift=shift)
    o = observe(scene, initial(scene))
    chord = 2 * np.sin(np.radians(40))
    np.testing.assert_allclose(o.bodies.contact_surface, chord / (2 * np.pi), rtol=1e-12)
    assert o.contact_surface == pytest.approx(chord / (2 * np.pi))
    assert o.coordination == 1.0


def test_contact_with_a_wall_counts_once():
    phi = np.radians(40)
    x = flattened(1.0, phi, 10, 40)
    away = polygon(x - column((3.0, 0.0)), np.pi)
    scene = Scene([polygon(x, np.pi), away], cell=0.2, walls=[Wall((np.cos(phi), 0), (-1, 0))])
    o = observe(scene, initial(scene))
    np.testing.assert_allclose(o.bodies.contact_surface, [2 * np.sin(phi) / (2 * np.pi), 0.0], rtol=1e-12)
    assert o.contact_surface == pytest.approx(np.sin(phi) / (2 * np.pi))
    np.testing.assert_array_equal(o.bodies.coordination, [1, 0])


def on_flat(scene, state):
    """Return the contacts of the flat pair, in order along the flat."""
    flat = np.flatnonzero(state.contacts.gap < 1e-9)
    return flat[np.argsort(state.contacts.x[1, flat])]


@pytest.mark.parametrize("shift", [0, -5])
def test_boundary_between_loaded_contacts_is_in_contact_whatever_its_gap(shift):
    scene = flat_pair(shift=shift)
    state = initial(scene)
    k = on_flat(scene, state)
    chord, spacing = 2 * np.sin(np.radians(40)), 0.2 * np.sin(np.radians(40))
    gap, force = state.contacts.gap.copy(), np.zeros_like(state.contacts.force)
    gap[k[[4, 5]]] = 0.04  # more than 0.02 cells
    loose = replace(state, contacts=replace(state.contacts, gap=gap, force=force))
    assert observe(scene, loose).bodies.contact_surface[0] == pytest.approx((chord - 2 * spacing) / (2 * np.pi))
    force[0, k[[0, 10]]] = 1.0
    held = replace(state, contacts=replace(state.contacts, gap=gap, force=force))
    assert observe(scene, held).bodies.contact_surface[0] == pytest.approx(chord / (2 * np.pi))


def test_boundary_beyond_the_last_loaded_contact_needs_a_closed_gap():
    scene = flat_pair()
    state = initial(scene)
    k = on_flat(scene, state)
    gap, force = state.contacts.gap.copy(), np.zeros_like(state.contacts.force)
    gap[k[[0, 1, 2, 9, 10]]] = 0.04
    force[0, k[[4, 6]]] = 1.0
    o = observe(scene, replace(state, contacts=replace(state.contacts, gap=gap, force=force)))
    spacing = 0.2 * np.sin(np.radians(40))
    assert o.bodies.contact_surface[0] * 2 * np.pi == pytest.approx(6 * spacing)


def test_boundary_that_touches_two_bodies_counts_once():
    square = np.array([[0.0, 1, 1, 0], [0.0, 0, 1, 1]])
    floor = Wall((0, 0), (0, 1))
    scene = Scene([polygon(refined(square, 5))], cell=0.2, walls=[floor, floor])
    o = observe(scene, initial(scene))
    assert o.contact_surface == pytest.approx(1 / np.sqrt(4 * np.pi))
    assert o.coordination == 2.0


def test_boundary_between_loaded_contacts_is_not_in_contact_where_it_leaves():
    scene = flat_pair()
    state = initial(scene)
    k = on_flat(scene, state)
    kept = np.setdiff1d(np.arange(state.contacts.gap.size), k[[3, 4, 5]])
    c = Contacts(**{f.name: getattr(state.contacts, f.name)[..., kept] for f in fields(state.contacts)})
    state = pressed(replace(state, contacts=c), 1.0)
    few = observe(scene, state).bodies.contact_surface[0] * 2 * np.pi
    spacing = 0.2 * np.sin(np.radians(40))
    forced_beyond = np.count_nonzero(c.gap > 1e-9)
    assert forced_beyond == 0
    assert few == pytest.approx(7 * spacing)


def test_a_boundary_loaded_all_around_is_in_contact_all_around():
    angle = 2 * np.pi * np.arange(24) / 24
    circle = np.array((np.cos(angle), np.sin(angle)))
    ring = np.hstack([1.5 * circle, circle[:, ::-1]])
    hull = Body(Points(ring, np.full(48, 0.08), (np.arange(24), np.arange(24, 48))), SOFT)
    scene = Scene([polygon(circle, np.pi), hull], cell=0.2)
    state = initial(scene)
    contact = state.contacts.gap < 1e-9
    o = observe(scene, pressed(state, contact * np.array([[1.0], [0.0]])))
    assert o.bodies.contact_surface[0] * 2 * np.pi == pytest.approx(48 * np.sin(np.pi / 24))


def hexagons(side, rows, columns, m=6):
    """Tile the plane."""
    angle = np.pi / 6 + np.pi / 3 * np.arange(6)
    x = refined(side * np.array((np.cos(angle), np.sin(angle))), m)
    width = np.sqrt(3) * side
    at = [((i + j % 2 / 2) * width, 1.5 * side * j) for j in range(rows) for i in range(columns)]
    return [polygon(x + column(p)) for p in at], width


def hexagonal_box(side=1.0, rows=8, columns=7):
    bodies, width = hexagons(side, rows, columns)
    low = (-width / 2, -side)
    high = (columns * width, 1.5 * side * (rows - 1) + side)
    return Scene(bodies, cell=side / 4, walls=box(low, high))


def test_hexagonal_tiling_fills_the_plane():
    """Six neighbours; S is the perimeter over that of the disc of the same area, 1.050."""
    scene = hexagonal_box()
    o = observe(scene, initial(scene), interior=True)
    assert 4 <= o.bodies.counted.sum() < 20
    assert o.coordination == 6.0
    assert o.contact_surface == pytest.approx(6 / np.sqrt(6 * np.sqrt(3) * np.pi), rel=1e-9)
    assert o.contact_surface == pytest.approx(1.050, abs=5e-4)
    assert o.solid_fraction == pytest.approx(1.0, abs=1e-12)
    assert o.solid_fraction_nominal == pytest.approx(1.0, abs=1e-12)
    assert o.overlap == pytest.approx(0.0, abs=1e-12)
    assert np.isnan(o.pressure_walls)


def test_hydrostatic_forces_on_a_tiling_make_its_pressure_in_every_body():
    scene = hexagonal_box()
    state = initial(scene)
    c = state.contacts
    # One force in the middle of each side between two bodies: boundary point 3 of 6 segments.
    middle = (c.gap < 1e-9) & (c.bodies[1] >= 0) & (c.point % 6 == 3)
    state = pressed(state, np.stack([2.5 * middle, 0.0 * middle]))
    o = observe(scene, state, interior=True)
    own = o.bodies.counted
    np.testing.assert_allclose(
        o.bodies.stress[:, :, own], np.repeat(-2.5 * np.eye(2)[:, :, None], own.sum(), 2), atol=1e-12
    )
    np.testing.assert_allclose(o.bodies.pressure[own], 2.5)
    assert o.pressure == pytest.approx(2.5, rel=0.1)  # the region cuts the network anywhere


# --- stress


def lattice(n, R=1.0, boundary=32):
    """Pack n x n discs, each touching its neighbours and the walls at boundary points."""
    at = [((2 * i + 1) * R, (2 * j + 1) * R) for i in range(n) for j in range(n)]
    bodies = [Body(disc(p, R, spacing=2 * np.pi * R / boundary), SOFT) for p in at]
    return Scene(bodies, cell=0.5 * R, walls=box((0, 0), (2 * n * R, 2 * n * R)))


def lattice_forces(state, along_x, along_y, shear=0.0):
    """One force per touching pair: on horizontal contacts, on vertical ones, tangential."""
    c = state.contacts
    contact = c.gap < 1e-9
    horizontal = np.abs(c.normal[0]) > 0.5
    normal = contact * np.where(horizontal, along_x, along_y)
    return np.stack([normal, contact * np.where(horizontal, -shear, shear)])


@pytest.mark.parametrize("interior", [False, True])
@pytest.mark.parametrize("R", [1.0, 1e-3])
def test_stress_of_a_square_lattice(interior, R):
    scene = lattice(7, R)
    state = initial(scene)
    o = observe(scene, pressed(state, lattice_forces(state, 3.0, 1.0, 0.25)), interior=interior)
    expected = np.array([[-3.0, 0.25], [0.25, -1.0]]) / (2 * R)
    np.testing.assert_allclose(o.stress, expected, rtol=1e-9)
    np.testing.assert_allclose(o.bodies.stress * np.pi / 4, expected[:, :, None] + np.zeros(49), rtol=1e-9)
    assert o.pressure == o.pressure_contacts == pytest.approx(2.0 / (2 * R))


def test_pressure_is_a_quarter_of_solid_fraction_coordination_and_contact_stress():
    """P = (Phi Z / 4) <f . l> / <V>, an identity in two dimensions; compression is positive."""
    scene = lattice(4)
    state = initial(scene)
    o = observe(scene, pressed(state, lattice_forces(state, 1.0, 1.0)))
    branch_stress = 2.0 / np.pi  # unit force, branch 2, volume pi
    assert o.coordination == 4.0
    assert o.solid_fraction_nominal == pytest.approx(np.pi / 4)
    assert o.pressure == pytest.approx(o.solid_fraction_nominal * o.coordination / 4 * branch_stress)
    assert o.pressure > 0


def test_pressure_on_walls():
    scene = lattice(3)
    force = np.array([[-4.0, 1.0], [0.0, -2.0], [8.0, 0.0], [3.0, 6.0]])
    o = observe(scene, replace(initial(scene), wall_force=force))
    np.testing.assert_allclose(o.wall_pressure, np.array([4.0, 2.0, 8.0, 6.0]) / 6.0)
    assert o.pressure_walls == pytest.approx(5.0 / 6.0)


@pytest.mark.parametrize("speed", [1e-3, 100.0])
def test_the_pressure_of_the_points_is_that_of_stresses_whatever_the_time_of_a_quasi_static_run(speed):
    """Velocities without inertia are displacements over a time that means nothing; with it they press."""
    bodies = [Body(disc((x, 1.0), 1.0, spacing=0.15), NeoHookean(1e6, 0.3, 1000.0)) for x in (1.0, 3.0)]
    walls = [*box((0.0, 0.0), (4.0, 2.0))[:3], Wall((0.0, 2.0), (0.0, -1.0), velocity=(0.0, -speed))]
    scene = Scene(bodies, cell=0.2, walls=walls, friction=0.3)
    *_, state = simulate(scene, until=0.1 / speed, scheme=Scheme(inertia=False))
    seen, stress = observe(scene, state), -0.5 * np.trace(state.stress) @ state.weight
    assert not state.report.inertia
    assert seen.pressure_points == pytest.approx(stress / (4.0 * 1.9), rel=1e-12)
    assert seen.pressure_points == pytest.approx(seen.pressure_contacts, rel=0.03)
    assert seen.bodies.pressure_points @ np.add.reduceat(state.volume, scene.offsets[:-1]) == pytest.approx(stress)
    *_, state = simulate(scene, dt=1e-7 / speed, until=1e-7 / speed)
    assert state.report.inertia


def test_contacts_have_the_viscous_pressure_that_points_lack():
    """Without inertia a lid moves at v on a block of height H: the viscous pressure is eta v / H at small strain."""
    R, eta, v = 1e-3, 2e3, 0.05
    lid = Wall((0.0, 2 * R), (0.0, -1.0), velocity=(0.0, -v))
    body = Body(block((0, 0), (2 * R, 2 * R), spacing=R / 6), LinearElastic(1e5, 0.3, 1000.0, viscosity=eta))
    scene = Scene([body], cell=R / 3, walls=[*box((0, 0), (2 * R, 2 * R))[:3], lid])
    *_, state = simulate(scene, dt=1e-5, until=1e-4, scheme=Scheme(inertia=False))
    o, viscous = observe(scene, state), eta * v / (2 * R)
    assert o.pressure_points < 0.01 * viscous
    assert o.pressure_contacts - o.pressure_points == pytest.approx(viscous, rel=0.01)
    assert o.pressure_walls == pytest.approx(o.pressure_contacts, rel=1e-6)
    assert o.bodies.pressure - o.bodies.pressure_points == pytest.approx([viscous], rel=0.01)


def test_pressure_of_the_points():
    """Uniform stress fills its share of the box; bodies press as they move apart, not together."""
    scene = lattice(3)
    state = initial(scene, scheme=BY_VOLUME)
    stress = np.repeat(np.diag([-3.0, -1.0])[:, :, None], state.body.size, axis=2)
    v = np.stack([np.where(state.body % 2 == 0, 0.1, -0.1) + 7.0, np.full(state.body.size, -2.0)])
    successes = observe(scene, replace(state, stress=stress, v=np.full_like(v, 5.0)))
    assert successes.pressure_points == pytest.approx(2.0 * np.pi / 4)
    np.testing.assert_allclose(successes.bodies.pressure_points, 2.0)
    moving = observe(scene, replace(state, v=v))
    own_mass = 990.0 * np.pi
    speed = v[0] - v[0].mean()
    kinetic = (state.mass * speed**2).sum()
    assert kinetic == pytest.approx(own_mass * (5 * (0.1 - 0.1 / 9) ** 2 + 4 * (0.1 + 0.1 / 9) ** 2))
    assert moving.pressure_points == pytest.approx(kinetic / 36.0 / 2.0)
    np.testing.assert_allclose(moving.bodies.pressure_points, 0.0, atol=1e-9)


def test_interior_points_only():
    scene = lattice(7)
    state = initial(scene, scheme=BY_VOLUME)
    stress = -np.repeat(np.eye(2)[:, :, None], state.body.size, axis=2)
    o = observe(scene, replace(state, stress=stress), interior=True)
    inside = ((state.x >= 4) & (state.x <= 10)).all(axis=0)
    assert o.bodies.counted.sum() == 9
    assert o.pressure_points == pytest.approx(state.volume[inside].sum() / 36)
    assert o.solid_fraction_nominal == pytest.approx(np.pi / 4)


def test_contacts_points_and_walls_agree_on_the_pressure_of_a_slow_compression():
    """Virial theorem: near equilibrium all three are the mean stress.

    Four discs, walls at 0.5 m/s, c_p = 196 m/s. Tolerances: what is left of inertia, 0.2 % for contacts
    and 1 % for walls when this was written.
    """
    R, v = 1e-3, 0.5
    bodies = [Body(disc((i * R, j * R), R, spacing=0.12 * R), SOFT) for i in (1, 3) for j in (1, 3)]
    walls = [replace(w, velocity=v * np.asarray(w.normal)) for w in box((0, 0), (4 * R, 4 * R))]
    scene = Scene(bodies, cell=R / 5, walls=walls)
    *_, state = simulate(scene, dt=2e-5, until=8e-5)
    o = observe(scene, state)
    assert 8e4 < o.pressure < 1.5e5
    assert o.pressure_points == pytest.approx(o.pressure, rel=0.01)
    assert o.pressure_walls == pytest.approx(o.pressure, rel=0.03)
    np.testing.assert_allclose(o.bodies.pressure_points, o.bodies.pressure, rtol=0.02)
    assert o.coordination == 4.0
    assert o.solid_fraction_nominal == pytest.approx(np.pi / 4 / 0.98**2, rel=1e-6)
    assert o.solid_fraction < o.solid_fraction_nominal


# --- shapes


def ellipses(axes, angles, apart=3.0, n=24):
    t = 2 * np.pi * np.arange(n) / n
    x = np.array((axes[0] * np.cos(t), axes[1] * np.sin(t)))
    return Scene([polygon(turn(a) @ x + column((apart * i, 0.0))) for i, a in enumerate(angles)], cell=0.2)


@given(st.lists(st.floats(-3, 3), min_size=1, max_size=5), st.floats(1.01, 2.0))
@settings(max_examples=30)
def test_ellipses(angles, ratio):
    scene = ellipses((ratio / 2, 0.5), angles)
    o = observe(scene, initial(scene))
    assert o.aspect_ratio == pytest.approx(ratio)
    assert o.anisotropy == pytest.approx(2 * abs(np.exp(2j * np.array(angles)).mean()), abs=1e-6)
    double = np.exp(2j * o.bodies.angle)
    np.testing.assert_allclose(double, np.exp(2j * np.array(angles)), atol=1e-6)
    assert o.contact_surface == 0.0 and o.coordination == 0.0


def test_fabric_tensor():
    """A_m = 2 (G1 - G2) with the principal values of G, as the source defines it."""
    angles = np.array([0.1, 0.7, -0.4, 1.5])
    scene = ellipses((0.8, 0.5), angles)
    d = np.array((np.cos(angles), np.sin(angles)))
    low, high = np.linalg.eigvalsh(d @ d.T / 4)
    assert observe(scene, initial(scene)).anisotropy == pytest.approx(2 * (high - low))


def test_anisotropy_of_random_angles_is_noise():
    """The mean of A_m is sqrt(pi / N); its standard deviation half of that, here over 150 draws."""
    rng, n = np.random.default_rng(3), 40
    scene = ellipses((0.8, 0.5), np.zeros(n), n=12)
    state = initial(scene)
    centre = np.repeat(np.stack([3.0 * np.arange(n), np.zeros(n)]), 12, axis=1)
    found = []
    for _ in range(150):
        angle = np.repeat(rng.uniform(0, np.pi, n), 12)
        arm = state.x - centre
        turned = np.stack(
            [np.cos(angle) * arm[0] - np.sin(angle) * arm[1], np.sin(angle) * arm[0] + np.cos(angle) * arm[1]]
        )
        found.append(observe(scene, replace(state, x=centre + turned)).anisotropy)
    assert np.mean(found) == pytest.approx(np.sqrt(np.pi / n), rel=0.13)


def test_round_bodies_have_no_long_axis():
    scene = lattice(3)
    o = observe(scene, initial(scene))
    assert np.isnan(o.bodies.angle).all()
    assert o.anisotropy == 0.0
    assert o.aspect_ratio == 1.0
    t = 2 * np.pi * np.arange(5) / 5
    pentagon = Scene([polygon(np.array((np.cos(t), np.sin(t))))], cell=0.2)
    assert observe(pentagon, initial(pentagon)).aspect_ratio == 1.0


def test_squeezed_body():
    """The area follows the outline, J the deformation gradient."""
    scene = Scene([Body(disc((0, 0), 1.0, spacing=0.1), SOFT)], cell=0.2)
    state = initial(scene)
    F = np.diag([1.1, 0.8])
    squeezed = replace(
        state, x=F @ state.x, F=np.tensordot(F, state.F, 1), volume=0.88 * state.volume, weight=0.88 * state.weight
    )
    before, o = observe(scene, state).bodies, observe(scene, squeezed).bodies
    np.testing.assert_allclose(o.area, 0.88 * before.area)
    np.testing.assert_allclose(o.volume_ratio, 0.88)
    np.testing.assert_allclose(o.diameter, 2.0)
    np.testing.assert_allclose(o.aspect_ratio, 1.375, rtol=5e-3)
    np.testing.assert_allclose(np.cos(o.angle), 1.0)


def test_the_volume_ratio_of_a_nearly_incompressible_body_is_that_of_its_pressure():
    """Plane strain: 1 - J = 2 (1 + nu) (1 - 2 nu) p / E; by volumes at t = 0 it would be three times that."""
    pressure, nu = 1e-2, 0.499
    body = Body(disc((0.03, 0.05), 1.0, spacing=0.148), NeoHookean(E=1.0, nu=nu, density=1.0))
    scene, scheme = Scene([body], cell=0.2, loads=[Pressure(lambda x: x[0] == x[0], pressure)]), Scheme(inertia=False)
    state = step(scene, initial(scene, scheme=scheme), 1.0, scheme=scheme)
    strain = 2.0 * (1.0 + nu) * (1.0 - 2.0 * nu) * pressure
    assert 1.0 - observe(scene, state).bodies.volume_ratio[0] == pytest.approx(strain, rel=5e-3)


def test_overlap_of_two_squares():
    square = np.array([[0.0, 1, 1, 0], [0.0, 0, 1, 1]])
    scene = Scene([polygon(refined(square, 4) + column((1.5 * i, 0.0))) for i in range(3)], cell=0.2)
    state = initial(scene)
    moved = state.x - np.where(state.body == 1, 0.6, 0.0) * column((1.0, 0.0))
    o = observe(scene, replace(state, x=moved))
    np.testing.assert_allclose(o.bodies.overlap, [0.1, 0.1, 0.0], atol=1e-12)
    assert o.overlap == pytest.approx(0.1 / 3)


# --- walls, rigid bodies, bodies without outline


PRESSURES = {"pressure", "pressure_contacts", "pressure_points", "pressure_walls"}
VOLUMETRIC = {"solid_fraction", "solid_fraction_nominal"} | PRESSURES


@pytest.mark.parametrize("interior", [False, True])
@pytest.mark.parametrize("walls", [(), (0,), (0, 2), (0, 1, 2)])
def test_open_box_has_no_fractions_and_pressures(walls, interior):
    scene = lattice(5)
    scene = replace(scene, walls=[scene.walls[i] for i in walls])
    state = initial(scene)
    o = observe(scene, pressed(state, np.ones((2, 1))), interior=interior)
    unravels = {"coordination_without_rattlers"} if len(walls) < 2 else set()  # from its free corners
    assert {name for name, value in scalars(o).items() if np.isnan(value)} == VOLUMETRIC | unravels
    assert np.isnan(o.stress).all()
    assert np.isfinite(o.bodies.pressure).all()


def test_wall_of_finite_length_in_an_open_box_has_a_pressure():
    scene = lattice(3)
    scene = replace(scene, walls=scene.walls[:3])
    force = np.array([[-4.0, 1.0], [0.0, -3.0], [8.0, 0.0]])
    o = observe(scene, replace(initial(scene), wall_force=force))
    np.testing.assert_allclose(o.wall_pressure, [np.nan, 0.5, np.nan])


def test_interior_of_a_small_box_is_empty():
    scene = lattice(3)
    o = observe(scene, initial(scene), interior=True)
    assert not o.bodies.counted.any()
    assert all(np.isnan(value) for value in scalars(o).values())


def rigid_among_soft(shift=0.0):
    """Put a rigid plate half out of the box and a soft square in the middle of it."""
    square = refined(np.array([[0.0, 1, 1, 0], [0.0, 0, 1, 1]]), 4)
    plate = np.diag([2.0, 1.0]) @ refined(np.array([[0.0, 1, 1, 0], [0.0, 0, 1, 1]]), 8) - column((0.5 - shift, 0.5))
    rigid = Body(Points(plate, np.full(32, 2 / 32), (np.arange(32),)), Rigid(1000.0), motion=(0.0, 0.0, 0.0))
    return Scene([rigid, polygon(square + column((0.0, 0.5)))], cell=0.2, walls=box((-1, 0), (2, 3)))


def test_rigid_bodies_fill_the_box_but_are_not_measured():
    # Shifted by half a segment: of the plate's boundary points, which give the contacts, four lie under the square.
    scene = rigid_among_soft(0.125)
    state = initial(scene)
    o = observe(scene, state)
    assert o.solid_fraction == pytest.approx(2 / 9)
    assert o.solid_fraction_nominal == pytest.approx(2 / 9)
    np.testing.assert_array_equal(o.bodies.counted, [False, True])
    assert o.coordination == 1.0
    assert o.contact_surface == pytest.approx(1 / np.sqrt(4 * np.pi))


def test_rigid_bodies_press_like_walls():
    """The branch to a rigid body ends at the contact: where that body's centre is does not matter."""
    scene = rigid_among_soft()
    state = initial(scene)
    c = state.contacts
    middle = np.hypot(*(c.x - column((0.5, 0.5)))) < 1e-9
    assert middle.sum() == 1
    o = observe(scene, pressed(state, np.stack([9.0 * middle, 0.0 * middle])))
    np.testing.assert_allclose(o.stress, [[0, 0], [0, -9.0 * 0.5 / 9]], atol=1e-12)
    arm = 0.5 - o.bodies.centre[1, 0]  # its own stress is that of the force all the same
    assert arm > 0.4
    assert o.bodies.stress[1, 1, 0] == pytest.approx(-9.0 * arm / 2.0, rel=1e-9)
    assert np.isnan(o.bodies.pressure_points[0]) and np.isfinite(o.bodies.pressure_points[1])


def test_rigid_body_without_outline_fills_by_its_points():
    scene = rigid_among_soft()
    bare = [replace(b, points=Points(b.points.x, b.points.volume)) for b in scene.bodies]
    seed = Scheme.nezamabadi2017()
    mixed = replace(scene, bodies=[bare[0], scene.bodies[1]])
    o = observe(mixed, initial(mixed, scheme=seed))
    share = (scene.bodies[0].points.x[1] >= 0).mean()
    assert 0.5 < share < 0.7
    assert o.solid_fraction == pytest.approx((1 + 2 * share) / 9)
    assert o.aspect_ratio == pytest.approx(1.0)


def test_bodies_without_outline():
    scene = lattice(3)
    bare = replace(scene, bodies=[replace(b, points=Points(b.points.x, b.points.volume)) for b in scene.bodies])
    state = initial(bare, scheme=Scheme.nezamabadi2017())
    assert (state.contacts.point == -1).all() and state.contacts.point.size
    before, o = observe(bare, state), observe(bare, pressed(state, np.array([[1.0], [0.0]])))
    assert before.coordination == 0.0
    assert o.coordination >= 4.0
    assert {name for name, value in scalars(o).items() if np.isnan(value)} == {
        "solid_fraction",
        "contact_surface",
        "anisotropy",
        "aspect_ratio",
        "overlap",
    }
    assert o.solid_fraction_nominal == pytest.approx(np.pi / 4)
    assert o.pressure > 0


def test_contacts_at_grid_nodes_have_no_length():
    scene = lattice(2)
    state = initial(scene, scheme=Scheme.nezamabadi2017())
    o = observe(scene, pressed(state, np.array([[1.0], [0.0]])))
    assert np.isnan(o.contact_surface)
    assert o.solid_fraction > 0.7


def test_tiny_forces_are_none():
    scene = lattice(3)
    state = initial(scene)
    force = lattice_forces(state, 1.0, 1e-12)
    o = observe(scene, pressed(state, force))
    assert o.coordination == 2.0


# --- invariance


def random_packing(rng, angle=0.0, shift=(0.0, 0.0), order=None):
    """Spiky polygons and discs that touch each other and a box, moved as a whole.

    Forces follow the contacts' places in the box.
    """
    at = [(2.0 * i, 2.0 * j) for i in range(3) for j in range(3)]
    spikes = np.where(np.arange(16) % 4, rng.uniform(0.6, 0.9, (9, 16)), 1.0)
    t = np.pi / 8 * np.arange(16)
    shapes = [
        column(p) + spikes[k] * np.array((np.cos(t), np.sin(t))) if k % 2 else disc(p, 1.0, spacing=np.pi / 16)
        for k, p in enumerate(at)
    ]
    R, s = turn(angle), column(shift)
    bodies = []
    for shape in shapes:
        if isinstance(shape, Points):
            bodies.append(Body(replace(shape, x=R @ shape.x + s), SOFT))
        else:
            bodies.append(polygon(R @ shape + s))
    walls = [Wall(R @ w.point + s[:, 0], w.normal @ R.T) for w in box((-1, -1), (5, 5))]
    scene = Scene([bodies[i] for i in (range(9) if order is None else order)], cell=0.4, walls=walls)
    state = initial(scene, scheme=BY_VOLUME)
    place = R.T @ (state.contacts.x - s)
    force = np.stack([2 + np.sin(3 * place[0] + 5 * place[1]), np.cos(4 * place[0] - place[1])])
    place = R.T @ (state.x - s)
    v = R @ np.stack([np.sin(place[0]), np.cos(2 * place[1])])
    sigma = R @ np.array([[-2.0, 1.0], [1.0, 0.5]]) @ R.T
    state = replace(state, v=v, stress=np.repeat(sigma[:, :, None], v.shape[1], axis=2))
    return scene, pressed(state, force, (R @ np.array([[-1.0, 0, 3, 0], [0, -2.0, 0, 4]])).T)


@given(SEEDS, st.floats(-3, 3), st.tuples(st.floats(-20, 20), st.floats(-20, 20)))
@settings(max_examples=15)
def test_rigid_motion_of_everything_changes_nothing_but_directions(seed, angle, shift):
    one, other = (
        random_packing(np.random.default_rng(seed)),
        random_packing(np.random.default_rng(seed), angle, shift),
    )
    a, b = observe(*one), observe(*other)
    R = turn(angle)
    assert a.coordination == 4.0
    assert scalars(a) == pytest.approx(scalars(b), rel=1e-6, abs=1e-9)
    np.testing.assert_allclose(R @ a.stress @ R.T, b.stress, atol=1e-9)
    np.testing.assert_allclose(a.bodies.contact_surface, b.bodies.contact_surface, atol=1e-9)
    np.testing.assert_allclose(a.bodies.pressure, b.bodies.pressure, atol=1e-9)


@given(SEEDS, st.permutations(range(9)))
@settings(max_examples=15)
def test_order_of_the_bodies_does_not_matter(seed, order):
    a = observe(*random_packing(np.random.default_rng(seed)))
    b = observe(*random_packing(np.random.default_rng(seed), order=order))
    assert scalars(a) == pytest.approx(scalars(b), rel=1e-9)
    np.testing.assert_allclose(a.stress, b.stress, atol=1e-12)
    for f in fields(a.bodies):
        np.testing.assert_allclose(getattr(a.bodies, f.name)[..., order], getattr(b.bodies, f.name), atol=1e-9)


def test_a_state_of_another_scene_is_refused():
    few, more = (
        Scene([Body(disc((3.0 * i, 0.0), 1.0, spacing=0.4), SOFT) for i in range(n)], cell=0.4) for n in (1, 2)
    )
    with pytest.raises(SceneError, match=r"observe: the state has .* points, the scene .*; continue with the scene"):
        observe(few, initial(more))


def test_a_state_on_grids_of_another_cell_size_is_refused():
    coarse, fine = (Scene([Body(disc((0.0, 0.0), 1.0, spacing=0.2), SOFT)], cell=h) for h in (0.4, 0.3))
    with pytest.raises(SceneError, match=r"observe: the grids of the state have cells of 0.3 m, .* 0.4 m; continue"):
        observe(coarse, initial(fine))


def test_observing_changes_nothing():
    scene = lattice(2)
    state = pressed(initial(scene), np.ones((2, 1)))
    arrays = {f.name: getattr(state, f.name) for f in fields(state)}
    before = {name: a.copy() for name, a in arrays.items() if isinstance(a, np.ndarray)}
    observe(scene, state, interior=True)
    for name, a in before.items():
        np.testing.assert_array_equal(getattr(state, name), a)


# --- shapes, tables, order


def test_the_shape_factor_of_a_disc_and_of_a_square():
    """1 and 4/pi; the perimeter is that of the curves, to the fourth order of the spacing of boundary points."""
    round_, square = disc((0.0, 0.0), 1.0, spacing=0.1), block((3.0, 0.0), (1.0, 1.0), spacing=0.1)
    scene = Scene([Body(round_, SOFT), Body(square, SOFT)], cell=0.25)
    bodies = observe(scene, initial(scene)).bodies
    assert bodies.perimeter == pytest.approx([2.0 * np.pi, 4.0], rel=1e-4)
    assert bodies.shape_factor == pytest.approx([1.0, 4.0 / np.pi], rel=1e-4)


def test_the_deviatoric_stress_does_not_depend_on_the_axes():
    """A uniaxial stress of 2, turned by any angle: half the difference of its principal values is 1."""
    scene = lattice(2)
    bodies = observe(scene, pressed(initial(scene), np.ones((2, 1)))).bodies
    for angle in (0.0, 0.3, 1.1):
        n = np.array([np.cos(angle), np.sin(angle)])
        turned = replace(bodies, stress=np.repeat(2.0 * np.outer(n, n)[:, :, None], 4, axis=2))
        assert turned.deviatoric_stress == pytest.approx(np.ones(4))


def test_tables_have_a_column_for_every_observable():
    scene = lattice(2)
    seen = observe(scene, pressed(initial(scene), np.ones((2, 1))))
    row, columns = seen.table(), seen.bodies.table()
    assert row["coordination"] == seen.coordination and row["stress_xy"] == seen.stress[0, 1]
    assert all(isinstance(value, float) for value in row.values())
    assert {column.shape for column in columns.values()} == {(4,)}
    assert np.array_equal(columns["stress_yx"], seen.bodies.stress[1, 0]) and np.array_equal(
        columns["y"], seen.bodies.centre[1]
    )


def test_pair_correlation_of_a_square_lattice():
    """Integrals over the peaks of g are the numbers of neighbours at 1, sqrt 2, 2 and sqrt 5 lattice constants."""
    n, size = 13, 1.0
    bodies = [Body(disc((i + 0.5, j + 0.5), 0.3, spacing=0.2), SOFT) for i in range(n) for j in range(n)]
    walls = [Wall((0, 0), (0, 1)), Wall((0, 0), (1, 0)), Wall((n, n), (0, -1)), Wall((n, n), (-1, 0))]
    scene = Scene(bodies, cell=0.25, walls=walls)
    r, g = pair_correlation(scene, initial(scene), bins=48, largest=2.4)
    neighbours = g * 2.0 * np.pi * r * 0.05 / size**2  # of each ring, for a density of one per cell
    inner = (n - 2 * 2.4) ** 2 / 9**2  # area of the region over that of the nine by nine cells whose centres it has
    for distance, count in ((1.0, 4), (np.sqrt(2.0), 4), (2.0, 4), (np.sqrt(5.0), 8)):
        own = np.abs(r - distance) < 0.06
        assert neighbours[own].sum() == pytest.approx(count * inner, rel=2e-3)
    assert g[r < 0.9].max() == 0.0


def test_pair_correlation_of_random_places_is_one():
    rng = np.random.default_rng(0)
    bodies = [Body(disc((i % 30 + 0.5, i // 30 + 0.5), 0.3, spacing=0.2), SOFT) for i in range(900)]
    walls = [Wall((0, 0), (0, 1)), Wall((0, 0), (1, 0)), Wall((30, 30), (0, -1)), Wall((30, 30), (-1, 0))]
    scene = Scene(bodies, cell=0.25, walls=walls)
    state = initial(scene)
    x = np.repeat(rng.uniform(0.0, 30.0, (2, 900)), np.diff(scene.offsets), axis=1)
    _, g = pair_correlation(scene, replace(state, x=x), bins=10, largest=5.0)
    assert np.abs(g[2:] - 1.0).max() < 0.1  # 400 references with 3 neighbours per unit of area


def test_pair_correlation_is_refused_where_every_centre_is_near_a_wall():
    scene = lattice(2)
    with pytest.raises(SceneError, match=r"no centre of a body is farther than largest = .* m from all walls"):
        pair_correlation(scene, initial(scene))


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"largest": -1}, r"largest = -1; give a radius in metres above zero"),
        ({"largest": np.inf}, r"largest = inf; give a radius"),
        ({"largest": "wide"}, r"largest = 'wide'; give a radius"),
        ({"bins": 0}, r"bins = 0; give a whole number, 1 or more"),
        ({"bins": 2.5}, r"bins = 2.5; give a whole number"),
    ],
)
def test_pair_correlation_refuses_rings_that_are_none(options, match):
    scene = lattice(12)
    with pytest.raises(SceneError, match="pair_correlation: " + match):
        pair_correlation(scene, initial(scene), **options)
