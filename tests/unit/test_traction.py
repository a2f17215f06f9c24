"""Tractions recovered from contact forces that are prescribed: resultants, moments, corners, errors."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import nnls

from skmpm import (
    Body,
    LinearElastic,
    Points,
    Rigid,
    Scene,
    SceneError,
    Scheme,
    Wall,
    box,
    contact_pressure,
    disc,
    initial,
    step,
)
from skmpm.scene import Contacts

SOFT = LinearElastic(1e6, 0.3, 1000.0)
CELL = 0.2
SEEDS = st.integers(0, 2**32 - 1)


def block(spacing=0.1, **more):
    """A block of 2 by 1 from the origin, alone."""
    return Scene([Body(box((0.0, 0.0), (2.0, 1.0), spacing=spacing), SOFT)], cell=CELL, **more)


def ring(n=64):
    """A polygon of n points on the unit circle, alone."""
    angle = 2 * np.pi * np.arange(n) / n
    x = np.array([np.cos(angle), np.sin(angle)])
    return Scene([Body(Points(x, np.full(n, np.pi / n), (np.arange(n),)), SOFT)], cell=CELL)


def loaded(scene, x, normal, force, second=-1):
    """The initial state with contacts of body 0 at x (2, k), with normal (2, k) and force (2, k) in (n, t)."""
    x, normal, force = (np.asarray(a, dtype=float).reshape(2, -1) for a in (x, normal, force))
    k = x.shape[1]
    bodies = np.stack([np.zeros(k, dtype=int), np.full(k, second)])
    point = np.full(k, scene.outlines.point[0])  # deliberately not where the contact is
    contacts = Contacts(bodies, x, normal, force, np.zeros(k), np.arange(k), point, np.zeros((2, k)))
    return replace(initial(scene), contacts=contacts)


def test_tension_is_negative_pressure_on_outward_normals():
    """Contacts pull at one half of the top and press at the other, with friction; both point away from the body."""
    scene = block()
    x = np.stack([np.linspace(0.05, 1.95, 39), np.ones(39)])
    size = np.where(x[0] < 1.0, -2.0, 3.0)
    state = loaded(scene, x, np.tile([[0.0], [-1.0]], 39), [size, np.full(39, 0.5)])
    found = contact_pressure(scene, state, 0, length=0.1)
    top = found.x[1] > 0.99
    left, right = (top & (found.x[0] > low) & (found.x[0] < low + 0.4) for low in (0.2, 1.4))
    np.testing.assert_allclose(found.normal[:, left | right], [[0.0], [1.0]] @ np.ones((1, (left | right).sum())))
    np.testing.assert_allclose(found.pressure[left], -40.0, rtol=0.05)
    np.testing.assert_allclose(found.pressure[right], 60.0, rtol=0.05)
    np.testing.assert_allclose(found.shear[left | right], -10.0, rtol=0.05)  # t = (1, 0), the boundary runs to -x


def test_errors_do_not_print_whole_bodies():
    scene = block()
    with pytest.raises(SceneError, match="give the index of a body") as error:
        contact_pressure(scene, initial(scene), scene.bodies[0])
    assert len(str(error.value)) < 200
    for swapped, message in ((initial(scene), "give a Scene"), (scene, "expected a State")):
        with pytest.raises(SceneError, match=message) as error:
            contact_pressure(swapped, scene, 0)
        assert len(str(error.value)) < 200


def moment(x, force):
    return np.sum(x[0] * force[1] - x[1] * force[0])


def even(segments):
    """The block with as many equal segments on each side, its points on the boundary only."""
    corners = np.array([[0.0, 2, 2, 0], [0.0, 0, 1, 1]])
    ends = np.roll(corners, -1, axis=1)
    x = (corners[:, :, None] + (ends - corners)[:, :, None] * np.arange(segments) / segments).reshape(2, -1)
    n = x.shape[1]
    return Scene([Body(Points(x, np.full(n, 2.0 / n), (np.arange(n),)), SOFT)], cell=CELL)


def pressed_below(scene):
    """A uniform pressure of 5 Pa and shear of -2 Pa on the bottom, in 2000 forces."""
    x, one = (np.arange(2000) + 0.5) / 1000, np.full(2000, 0.001)
    return loaded(scene, [x, 0.0 * x], [0.0 * x, np.ones(2000)], [5.0 * one, -2.0 * one])


@given(SEEDS, st.sampled_from([None, 0.0, 0.05, 0.7, 50.0]))
def test_the_resultant_is_that_of_the_contacts(seed, length):
    """Any forces anywhere on a disc or a block, for any kernel."""
    rng = np.random.default_rng(seed)
    for scene in (ring(), block()):
        c = rng.integers(scene.outlines.size, size=7)
        boundary = scene.initial_positions[:, scene.outlines.point]
        x = boundary[:, c] + rng.random(7) * (boundary[:, scene.outlines.next[c]] - boundary[:, c])
        angle = rng.uniform(0, 2 * np.pi, 7)
        n, f = np.array([np.cos(angle), np.sin(angle)]), rng.random((2, 7))
        found = contact_pressure(scene, loaded(scene, x, n, f), 0, length=length)
        total = (f[0] * n + f[1] * np.array([-n[1], n[0]])).sum(axis=1)
        np.testing.assert_allclose(found.force, total, rtol=1e-12, atol=1e-12)


@given(st.floats(0.3, 1.7), st.floats(-1, 1), st.sampled_from([None, 0.0, 0.1, 0.3]))
def test_the_moment_on_a_straight_side_is_that_of_the_contact(x, shear, length):
    """A force anywhere on the bottom farther from its corners than the kernel is wide."""
    state = loaded(block(), [[x], [0.0]], [[0.0], [1.0]], [[1.0], [shear]])
    found = contact_pressure(block(), state, 0, length=length)
    force = np.array([-shear, 1.0])
    assert moment(found.x, found.traction * found.length) == pytest.approx(
        moment([x, 0.0], force), rel=1e-12, abs=1e-12
    )
    assert (found.pressure >= -1e-12).all()


def test_a_force_at_the_side_of_a_disc_keeps_its_moment():
    """Round a curve of curvature c a tangential force T loses a moment of T c (variance of the kernel) / 2."""
    scene, L = ring(256), 0.3
    state = loaded(scene, [[1.0], [0.0]], [[-1.0], [0.0]], [[1.0], [-1.0]])
    found = contact_pressure(scene, state, 0, length=L)
    lost = 1.0 - moment(found.x, found.traction * found.length)
    assert 0.0 < lost < L**2 / 12  # of a tent of half-width L


@pytest.mark.parametrize("segments", [13, 20, 50])
@pytest.mark.parametrize("length", [None, 0.0, 0.1, 0.5, 3.0])
def test_uniform_forces_are_a_uniform_traction_up_to_the_corners(segments, length):
    """Equal spacing: pressure 5 Pa on the bottom, corners included, none on the other sides, and no error."""
    found = contact_pressure(even(segments), pressed_below(even(segments)), 0, length=length)
    bottom = found.normal[1] < -0.5
    assert bottom.sum() == segments + 1
    np.testing.assert_allclose(found.pressure[bottom], 5.0, rtol=2e-3)
    np.testing.assert_allclose(found.shear[bottom], 2.0, rtol=2e-3)
    assert not found.traction[:, ~bottom].any()
    assert found.error.max() < 0.02


def pressed_at(width, *middles):
    """Uniform pressures of 1 N/m each on parts of the bottom, in 1000 forces; points an eighth of a cell apart."""
    x = np.concatenate([middle + width * ((np.arange(1000) + 0.5) / 1000 - 0.5) for middle in middles])
    one = np.ones(x.size)
    return contact_pressure(even(80), loaded(even(80), [x, 0.0 * x], [0.0 * x, one], [0.001 * one, 0.0 * x]), 0)


@pytest.mark.parametrize("middle", [0.93, 1.0, 1.04])
@pytest.mark.parametrize("cells", [0.25, 0.5, 1.0, 1.5])
def test_the_error_reaches_the_pressure_of_contacts_too_narrow_for_the_cells(cells, middle):
    exact, found = 1.0 / (cells * CELL), pressed_at(cells * CELL, middle)
    peak = found.pressure.argmax()
    assert found.pressure[peak] < 1.1 * exact
    assert 0.999 * exact < found.pressure[peak] + found.error[peak] < 1.4 * exact
    assert not found.error[found.normal[1] > -0.5].any()


@pytest.mark.parametrize("middles", [(0.45, 1.45), (0.6, 1.2), (0.93, 1.49)])
def test_narrow_contacts_do_not_hide_each_other(middles):
    """Two of half a cell at a distance of three to five cells."""
    exact, found = 1.0 / (0.5 * CELL), pressed_at(0.5 * CELL, *middles)
    for middle in middles:
        near = np.flatnonzero((np.abs(found.x[0] - middle) < CELL) & (found.normal[1] < -0.5))
        peak = near[found.pressure[near].argmax()]
        assert found.pressure[peak] < 0.6 * exact
        assert 0.999 * exact < found.pressure[peak] + found.error[peak] < 1.4 * exact


@pytest.mark.parametrize("x", [(0.7,), (0.5, 1.4)])
@pytest.mark.parametrize("length", [None, 0.0, 0.1, 0.5])
def test_the_error_under_a_single_point_is_infinite(length, x):
    """Nothing tells how narrow the contact is; where no force is near, the error has a bound."""
    at, one = np.array(x), np.ones(len(x))
    state = loaded(block(), [at, 0.0 * one], [0.0 * one, one], [one, 0.0 * one])
    found = contact_pressure(block(), state, 0, length=length)
    away = np.where(found.normal[1] < -0.5, np.abs(found.x[0] - at[:, None]).min(axis=0), np.inf)
    assert np.isinf(found.error[away < 0.06]).all()
    assert np.isfinite(found.error[away > CELL]).all()
    assert (found.error >= 0.0).all()


@pytest.mark.parametrize("spacing", [0.05, 0.1, 0.15, 0.24])
def test_uneven_points_beside_corners_cost_nothing(spacing):
    """`box` has segments of 2/3 and 5/6 of the others beside its corners; a quarter to 1.2 cells."""
    found = contact_pressure(block(spacing), pressed_below(block(spacing)), 0)
    bottom = found.normal[1] < -0.5
    assert np.abs(found.pressure[bottom] / 5.0 - 1.0).max() < 0.003


@pytest.mark.parametrize("turn", [0.0, 0.3, 0.5])
@pytest.mark.parametrize("per_cell", [1.17, 1.41, 1.9])
def test_point_forces_that_load_the_grid_uniformly_are_a_uniform_traction(turn, per_cell):
    """Non-negative forces by least squares of the nodal forces of 1 Pa alternate and beat with the grid."""
    n, along = round(10.0 * per_cell), np.array([np.cos(turn), np.sin(turn)])
    start, across = np.array([0.03, 0.07]), np.array([-along[1], along[0]])
    corners = start[:, None] + np.stack([0.0 * along, 2.0 * along, 2.0 * along + across, across], axis=1)
    steps = np.roll(corners, -1, axis=1) - corners
    x = (corners[:, :, None] + steps[:, :, None] * np.arange(n) / n).reshape(2, -1)
    scene = Scene([Body(Points(x, np.full(4 * n, 0.5 / n), (np.arange(4 * n),)), SOFT)], cell=CELL)
    points, fine = (
        start[:, None] + 2.0 * along[:, None] * s for s in (np.arange(n + 1) / n, np.linspace(0, 1, 4001))
    )
    nodes = np.stack(np.meshgrid(np.arange(-1, 12), np.arange(-1, 12))).reshape(2, -1, 1)

    def hats(at):
        return np.prod(np.maximum(1.0 - np.abs(at[:, None] / CELL - nodes), 0.0), axis=0)

    force, missed = nnls(hats(points), hats(fine).mean(axis=1) * 2.0)
    assert missed < 0.02
    normal = np.tile(across[:, None], n + 1)
    found = contact_pressure(scene, loaded(scene, points, normal, [force, 0.0 * force]), 0)
    bottom = across @ found.normal < -0.9
    assert np.abs(found.pressure[bottom] - 1.0).max() < 0.08


def test_corners_appear_once_for_each_side():
    found = contact_pressure(block(), initial(block()), 0)
    boundary = block().outlines.size
    assert found.point.size == boundary + 4
    assert np.unique(found.side).size == 4
    assert found.length.sum() == pytest.approx(6.0)
    assert found.arc_length[-1] == pytest.approx(6.0)
    assert (np.diff(found.arc_length) >= 0.0).all()
    assert not found.pressure.any()
    expected = {(0, -1), (1, 0), (0, 1), (-1, 0)}
    assert {tuple(n) for n in np.round(found.normal.T).astype(int)} == expected
    np.testing.assert_allclose(np.hypot(*found.normal), 1.0)


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize(("angle", "bottom"), [(0.0, 1.0), (30.0, 2 / 3), (45.0, 0.5), (60.0, 1 / 3), (90.0, 0.0)])
def test_a_force_at_a_corner_acts_on_the_sides_that_face_it(angle, bottom, first):
    """At the origin the sides below and on the left share the force by the angle of the contact normal."""
    a = np.deg2rad(angle)
    state = loaded(block(), [[0.0], [0.0]], [[np.sin(a)], [np.cos(a)]], [[1.0], [0.0]])
    if not first:  # the same contact from the other body
        c = state.contacts
        state = replace(state, contacts=replace(c, bodies=np.array([[1], [0]]), normal=-c.normal))
    found = contact_pressure(block(), state, 0)
    below = np.abs(found.x[1]) < 1e-9
    lower = found.side == found.side[np.flatnonzero(below & (found.x[0] > 0.5))[0]]
    force = np.hypot(*(found.traction * found.length)[:, lower].sum(axis=1))
    assert force == pytest.approx(bottom, abs=1e-12)
    assert np.hypot(*found.force) == pytest.approx(1.0)
    assert np.abs(found.shear).max() < 1e-12 * found.pressure.max()


def test_the_two_sides_of_a_notch_carry_their_own_contacts():
    """A contact with a gap to one side of a notch is closer to the other side, which does not face it."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0.6, 1], [0.5, 0.5], [0.4, 1], [0, 1]], dtype=float).T
    ends = np.roll(corners, -1, axis=1)
    x = (corners[:, :, None] + (ends - corners)[:, :, None] * np.arange(10) / 10).reshape(2, -1)
    scene = Scene([Body(Points(x, np.full(70, 0.9 / 70), (np.arange(70),)), SOFT)], cell=CELL)
    right = np.array([-0.5, 0.1]) / np.hypot(0.5, 0.1)  # outward normal of the side from (0.6, 1) to (0.5, 0.5)
    at = np.array([0.5, 0.5]) + 0.02 * np.array([0.1, 0.5]) + 0.003 * right  # the notch is 0.004 wide there
    found = contact_pressure(scene, loaded(scene, at, -right, [1.0, 0.0]), 0)
    loaded_points = found.x[:, found.pressure > 0.0]
    assert loaded_points.shape[1] > 2
    np.testing.assert_allclose(right @ (loaded_points - [[0.5], [0.5]]), 0.0, atol=1e-12)  # all on that side
    np.testing.assert_allclose(found.force, -right, rtol=1e-12)


def test_a_contact_at_a_point_of_the_other_body_has_the_opposite_force():
    """Body 1 gives the points: body 0 is second, its force is the opposite, at the place closest to x."""
    scene = Scene([*ring().bodies, Body(disc((2.05, 0.0), 1.0, spacing=0.2), SOFT)], cell=CELL)
    state = initial(scene)
    one = Contacts(
        np.array([[1], [0]]),
        np.array([[1.05], [0.02]]),  # a gap of 0.05 from body 0
        np.array([[1.0], [0.0]]),
        np.array([[3.0], [0.5]]),
        np.array([0.05]),
        np.array([0]),
        np.array([scene.offsets[1]]),
        np.zeros((2, 1)),
    )
    state = replace(state, contacts=one)
    found = [contact_pressure(scene, state, b) for b in (0, 1)]
    np.testing.assert_allclose(found[1].force, [3.0, 0.5], rtol=1e-12)
    np.testing.assert_allclose(found[0].force, [-3.0, -0.5], rtol=1e-12)
    for one in found:
        assert one.pressure @ one.length == pytest.approx(3.0, rel=1e-9)
        assert one.shear @ one.length == pytest.approx(-0.5, rel=1e-9)
        assert np.hypot(*(one.x[:, one.pressure.argmax()] - [1.0, 0.02])) < 0.11


def test_no_force_passes_along_an_unloaded_boundary():
    """Beyond four cells and the segment at their end there is exactly nothing."""
    scene, L = ring(), 0.3
    found = contact_pressure(scene, loaded(scene, [1.0, 0.0], [-1.0, 0.0], [1.0, 0.0]), 0, length=L)
    arc = np.abs(np.arctan2(found.x[1], found.x[0]))
    assert not found.traction[:, arc > 4.0 * L + 0.1].any()
    assert (found.pressure[arc < 0.9 * L] > 0.0).all()
    assert 1.0 / L < found.pressure.max() < 1.5 / L


def test_no_force_passes_to_the_other_face_of_a_part_thinner_than_a_cell():
    """A strip of half a cell with round ends, whose outline is one smooth side."""
    r, s, angle = 0.25 * CELL, np.linspace(0.0, 2.0, 81), np.linspace(0.0, np.pi, 9)[1:-1]
    x = np.hstack([[s, -r + 0.0 * s], [2 + r * np.sin(angle), -r * np.cos(angle)]])
    x = np.hstack([x, [2.0 - s, r + 0.0 * s], [-r * np.sin(angle), r * np.cos(angle)]]) + 0.05
    n = x.shape[1]
    scene = Scene([Body(Points(x, np.full(n, 0.2 / n), (np.arange(n),)), SOFT)], cell=CELL)
    found = contact_pressure(scene, loaded(scene, [1.0, 0.05 - r], [0.0, 1.0], [1.0, 0.0]), 0)
    assert np.unique(found.side).size == 1
    upper = found.x[1] > 0.05
    assert not found.pressure[upper].any()
    np.testing.assert_allclose(found.force, [0.0, 1.0], atol=1e-12)


def test_lengths_of_zero_are_point_forces_over_tributary_lengths():
    scene = ring()
    x = scene.initial_positions[:, 5]
    found = contact_pressure(scene, loaded(scene, x, -x, [2.0, 0.0]), 0, length=0.0)
    expected = np.zeros(64)
    expected[5] = 2.0 / found.length[5]
    np.testing.assert_allclose(found.pressure, expected, rtol=1e-9)


def test_cells_longer_than_the_boundary_spread_the_force_over_it():
    found = contact_pressure(ring(), loaded(ring(), [1.0, 0.0], [-1.0, 0.0], [1.0, 0.0]), 0, length=1e3)
    np.testing.assert_allclose(np.hypot(*found.traction), 1.0 / found.length.sum(), rtol=0.005)


def test_holes_have_sides_of_their_own():
    """A plug in a ring: normals of the hole point into it, the force there is that on the plug."""
    angle = 2 * np.pi * np.arange(48) / 48
    circle = np.array([np.cos(angle), np.sin(angle)])
    x = np.hstack([2.0 * circle, circle[:, ::-1]])
    hull = Body(Points(x, np.full(96, 3 * np.pi / 96), (np.arange(48), np.arange(48, 96))), SOFT)
    scene = Scene([hull], cell=CELL)
    found = contact_pressure(scene, loaded(scene, [0.0, -1.0], [0.0, -1.0], [1.0, 0.0]), 0)
    inner = found.side == 1
    assert found.pressure[~inner].max() == 0.0
    free = inner & (found.pressure == 0.0)
    np.testing.assert_allclose(found.x[:, free] + found.normal[:, free], 0.0, atol=1e-9)
    np.testing.assert_allclose(found.force, [0.0, -1.0], atol=1e-12)


def test_a_rigid_body_has_a_traction_too():
    """A disc pressed on a rigid block: equal and opposite resultants."""
    die = Body(box((-1.0, -0.5), (2.0, 0.5), spacing=0.1), Rigid(1000.0), motion=(0.0, 0.05, 0.0))
    scene = Scene(
        [Body(disc((0.0, 1.0), 1.0, spacing=0.1), SOFT), die], cell=CELL, walls=[Wall((0, 2), (0, -1))], friction=0.3
    )
    scheme = Scheme(inertia=False)
    state = step(scene, initial(scene, scheme=scheme), 1.0, scheme=scheme)
    disc_on, die_on = (contact_pressure(scene, state, b) for b in (0, 1))
    lid = -state.wall_force[0]
    assert die_on.force[1] < -1e3
    np.testing.assert_allclose(disc_on.force + die_on.force, lid, rtol=1e-9, atol=1e-6)
    assert set(np.flatnonzero(die_on.pressure > 1.0)) <= set(np.flatnonzero(np.abs(die_on.x[1] - 0.05) < 1e-9))


BODIES = {"body = 1; give the index of a body, 0 to 0": 1, "body = -1": -1, "body = 0.0": 0.0}


@pytest.mark.parametrize("message", BODIES)
def test_a_body_that_does_not_exist_is_refused(message):
    with pytest.raises(SceneError, match=message):
        contact_pressure(block(), initial(block()), BODIES[message])


@pytest.mark.parametrize("length", [-0.1, np.nan, np.inf])
def test_a_length_that_is_none_is_refused(length):
    with pytest.raises(SceneError, match="length = "):
        contact_pressure(block(), initial(block()), 0, length=length)


def test_a_body_without_outline_is_refused():
    bare = Points(block().bodies[0].points.x, block().bodies[0].points.volume)
    scene = Scene([Body(bare, SOFT)], cell=CELL)
    with pytest.raises(SceneError, match=r"body 0 has no outline; give its Points an outline"):
        contact_pressure(scene, initial(scene, scheme=Scheme.nezamabadi2017()), 0)


def test_contacts_at_grid_nodes_are_refused():
    scene = block(walls=[Wall((0, 0), (0, 1))])
    with pytest.raises(SceneError, match=r"act at grid nodes.*point_to_curve"):
        contact_pressure(scene, initial(scene, scheme=Scheme.nezamabadi2017()), 0)


def test_a_state_of_another_scene_is_refused():
    with pytest.raises(SceneError, match="contact_pressure"):
        contact_pressure(ring(), initial(block()), 0)
