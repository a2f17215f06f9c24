"""Contacts merged to pairs of bodies, with known values."""

from dataclasses import replace

import numpy as np
import pytest

import skmpm
from skmpm import Body, LinearElastic, Points, Rigid, Scene, SceneError, Scheme, Wall, disc, initial, network, observe
from skmpm.observe.contact_network import without_rattlers
from skmpm.scene import Contacts

SOFT = LinearElastic(1e6, 0.3, 1000.0)


def row(n=3, *, material=SOFT, friction=0.0, floor=0.0):
    """Unit discs in a row on a floor, each touching the next."""
    bodies = [Body(disc((2.0 * i, 1.0), 1.0, spacing=np.pi / 16), material) for i in range(n)]
    return Scene(bodies, cell=0.4, friction=friction, walls=[Wall((0, 0), (0, 1), friction=floor)])


def with_contacts(scene, bodies, x, normal, force, gap=None):
    """The initial state with these contacts, given contact by contact."""
    k = len(bodies)
    gap = np.zeros(k) if gap is None else np.asarray(gap)
    point = np.array([scene.outlines.point[0] if b[0] == 0 else scene.offsets[b[0]] for b in bodies])
    contacts = Contacts(
        np.array(bodies).T,
        np.array(x, dtype=float).T,
        np.array(normal, dtype=float).T,
        np.array(force, dtype=float).T,
        gap,
        np.arange(k),
        point,
        np.zeros((2, k)),
    )
    return replace(initial(scene), contacts=contacts)


def touch(scene, force=(1.0, 0.0)):
    """The initial state with the same force (n, t) at every closed contact."""
    state = initial(scene)
    closed = state.contacts.gap < 1e-9
    return replace(state, contacts=replace(state.contacts, force=np.array(force)[:, None] * closed))


def test_contacts_of_a_pair_become_one_with_their_resultant():
    """Two contacts at 0.2 rad to each other: the normal is that of the sum of the normal forces."""
    a = 0.2
    n = np.array([[-1.0, 0.0], [-np.cos(a), np.sin(a)]])
    force = [(3.0, 0.5), (1.0, -0.1)]
    scene = row(2, friction=0.5)
    state = with_contacts(scene, [(0, 1), (0, 1)], [(1.0, 1.0), (1.0, 1.4)], n, force)
    found = network(scene, state)
    total = 3.0 * n[0] + n[1]
    np.testing.assert_array_equal(found.bodies, [[0], [1]])
    np.testing.assert_allclose(found.normal[:, 0], total / np.hypot(*total), rtol=1e-14)
    tangent = np.stack([-n[:, 1], n[:, 0]], axis=1)
    np.testing.assert_allclose(found.force_xy[:, 0], total + 0.5 * tangent[0] - 0.1 * tangent[1], rtol=1e-14)
    np.testing.assert_allclose(found.centre[:, 0], [1.0, 1.1], rtol=1e-14)
    np.testing.assert_allclose(found.branch[:, 0], [-2.0, 0.0], atol=1e-12)
    assert found.mobilised_friction[0] == pytest.approx(0.4 / (0.5 * 4.0))
    assert found.contacts[0] == 2
    assert found.size == 1


def test_open_contacts_of_a_pair_do_not_count():
    """Contact detection reaches beyond the contact: its points without force change nothing."""
    scene, n = row(2), [-1.0, 0.0]
    state = with_contacts(
        scene, 2 * [(0, 1)], [(1.0, 1.0), (1.0, 1.8)], 2 * [n], [(3.0, 0.0), (0.0, 0.0)], [0.0, 0.04]
    )
    found = network(scene, state)
    assert found.contacts[0] == 1
    np.testing.assert_allclose(found.centre[:, 0], [1.0, 1.0], rtol=1e-14)


def test_a_contact_at_a_point_of_the_second_body_counts_with_the_same_components():
    """Contact (1, 0) has the opposite normal, so the same force components as (0, 1)."""
    scene, n = row(2, friction=0.5), np.array([-1.0, 0.0])
    one = network(scene, with_contacts(scene, [(0, 1)], [(1.0, 1.0)], [n], [(4.0, 0.6)]))
    two = network(scene, with_contacts(scene, [(0, 1), (1, 0)], 2 * [(1.0, 1.0)], [n, -n], [(3.0, 0.5), (1.0, 0.1)]))
    for name in ("bodies", "normal", "force", "force_xy", "centre", "branch", "mobilised_friction"):
        np.testing.assert_allclose(getattr(two, name), getattr(one, name), rtol=1e-14, atol=1e-15)


def test_forces_act_on_the_first_body_and_balance_the_wall_forces():
    """Quasi-static discs under gravity: the pairs with the floor carry the weight."""
    scene = replace(row(1, floor=0.5), gravity=(0.0, -9.81))
    scheme = Scheme(inertia=False)
    state = skmpm.step(scene, initial(scene, scheme=scheme), 1.0, scheme=scheme)
    found = network(scene, state)
    np.testing.assert_array_equal(found.bodies, [[0], [-1]])
    np.testing.assert_allclose(found.force_xy[:, 0], -state.wall_force[0], rtol=1e-9, atol=1e-9)
    assert found.force[0, 0] == pytest.approx(9.81 * state.mass.sum(), rel=1e-3)
    assert found.friction[0] == 0.5


def test_pairs_are_those_that_observe_counts_and_measures():
    """Ends of pairs per body are its coordination; contact lengths of its pairs add up to its contact surface."""
    scene = row(4)
    state = touch(scene)
    found, seen = network(scene, state), observe(scene, state)
    ends = found.bodies.ravel()
    count = np.bincount(ends[ends >= 0], minlength=4)
    length = np.bincount(ends[ends >= 0], np.tile(found.length, 2)[ends >= 0], 4)
    np.testing.assert_array_equal(count, seen.bodies.coordination)
    np.testing.assert_array_equal(count, [2, 3, 3, 2])
    np.testing.assert_allclose(length, seen.bodies.contact_surface * np.pi * seen.bodies.diameter, rtol=1e-12)
    assert (found.length > 0.1).all()
    np.testing.assert_array_equal(found.bodies, [[0, 0, 1, 1, 2, 2, 3], [1, -1, 2, -1, 3, -1, -1]])


def test_rattlers_are_removed_one_after_the_other():
    """A row on a smooth floor unravels from its ends; with friction two contacts hold a disc."""
    smooth, rough = row(4), row(4, floor=0.5)
    seen = observe(smooth, touch(smooth))
    assert seen.coordination == 2.5 and np.isnan(seen.coordination_without_rattlers)
    seen = observe(rough, touch(rough))
    assert seen.coordination_without_rattlers == 2.5


def test_a_neighbour_of_a_rattler_keeps_its_other_contacts():
    """Three bodies in a triangle on two walls, and a fourth that leans on the first."""
    pairs = np.array([[0, 0, 1, 0, 1, 2, 2, 0], [1, 2, 2, -1, -1, -1, -2, 3]])
    free = np.ones(4, dtype=bool)
    held = np.array([1, 1, 1, 0], dtype=bool)
    np.testing.assert_array_equal(without_rattlers(pairs, np.zeros(8), free), [3, 3, 4, np.nan])
    np.testing.assert_array_equal(without_rattlers(pairs, np.zeros(8), held), [4, 3, 4, 1])
    unravelled = without_rattlers(pairs[:, 1:], np.zeros(7), free)  # from body 1
    np.testing.assert_array_equal(unravelled, np.full(4, np.nan))


def test_forces_on_branches_are_the_stress_of_observe():
    """Love and Weber: -sum f (x) branch, in a closed box."""
    open_scene = row(3)
    walls = [*open_scene.walls, Wall((-1, 0), (1, 0)), Wall((5, 0), (-1, 0)), Wall((0, 2), (0, -1))]
    scene = replace(open_scene, walls=walls)
    state = touch(scene, (2.0, 0.3))
    found = network(scene, state)
    stress = -found.force_xy @ found.branch.T / (6.0 * 2.0)
    np.testing.assert_allclose(stress, observe(scene, state).stress, rtol=1e-12, atol=1e-12)
    assert np.abs(stress[0, 1]) > 0.01


def test_branches_end_at_the_contact_of_a_rigid_body():
    scene = row(2, material=SOFT)
    scene = replace(
        scene, bodies=[scene.bodies[0], Body(scene.bodies[1].points, Rigid(1000.0), motion=(0.0, 0.0, 0.0))]
    )
    found = network(scene, touch(scene))
    pair = np.flatnonzero((found.bodies == [[0], [1]]).all(axis=0))
    np.testing.assert_allclose(found.branch[:, pair[0]], [-1.0, 0.0], atol=1e-12)


def test_fabric():
    """A row has n (x) n = xx between discs and yy on the floor; trace one."""
    scene = row(3)
    np.testing.assert_allclose(network(scene, touch(scene)).fabric, np.diag([2 / 5, 3 / 5]), atol=1e-12)
    apart = Scene([Body(disc((0, 0), 1.0, spacing=0.3), SOFT)], cell=0.4)
    assert np.isnan(network(apart, initial(apart)).fabric).all()


def test_friction_is_that_of_the_pair():
    scene = row(2, friction=0.25, floor=0.5)
    found = network(scene, touch(scene, (2.0, 0.1)))
    np.testing.assert_array_equal(found.friction, [0.25, 0.5, 0.5])
    np.testing.assert_allclose(found.mobilised_friction, [0.2, 0.1, 0.1], rtol=1e-12)
    smooth = row(2, floor=0.5)
    np.testing.assert_array_equal(np.isnan(network(smooth, touch(smooth)).mobilised_friction), [True, False, False])


def test_before_the_first_step_pairs_are_those_with_closed_gaps():
    scene = row(2)
    found = network(scene, initial(scene))
    assert found.size == 3
    assert not found.force.any()
    np.testing.assert_allclose(np.hypot(*found.normal), 1.0, rtol=1e-12)
    # An open contact of the same pair does not move its centre.
    no_force = 2 * [(0.0, 0.0)]
    state = with_contacts(scene, 2 * [(0, 1)], [(1.0, 1.0), (1.0, 1.8)], 2 * [[-1.0, 0.0]], no_force, [0.0, 0.04])
    np.testing.assert_allclose(network(scene, state).centre[:, 0], [1.0, 1.0], rtol=1e-14)


def test_contacts_at_grid_nodes_are_pairs_without_a_length():
    scene = row(2)
    state = initial(scene, scheme=Scheme.nezamabadi2017())
    force = np.repeat([[1.0], [0.0]], state.contacts.gap.size, axis=1)
    found = network(scene, replace(state, contacts=replace(state.contacts, force=force)))
    np.testing.assert_array_equal(found.bodies, [[0, 0, 1], [1, -1, -1]])
    assert np.isnan(found.length).all()


def test_bodies_that_do_not_touch_have_no_network():
    scene = Scene([Body(disc((0, 0), 1.0, spacing=0.3), SOFT)], cell=0.4)
    found = network(scene, initial(scene))
    assert found.size == 0
    assert found.normal.shape == found.branch.shape == found.force_xy.shape == (2, 0)


def test_the_table_has_one_column_per_component():
    scene = row(3)
    found = network(scene, touch(scene))
    table = found.table()
    assert all(column.shape == (found.size,) for column in table.values())
    np.testing.assert_array_equal(table["normal_force"], found.force[0])
    np.testing.assert_array_equal(table["centre_y"], found.centre[1])
    np.testing.assert_array_equal(table["force_x"], found.force_xy[0])


def test_a_state_of_another_scene_is_refused():
    with pytest.raises(SceneError, match="network"):
        network(row(3), initial(row(2)))


def test_points_without_outline_do_not_matter_to_other_pairs():
    """Rigid bodies without outline are possible with shared-grid contact only."""
    scene = row(2)
    bare = replace(scene, bodies=[replace(b, points=Points(b.points.x, b.points.volume)) for b in scene.bodies])
    assert network(bare, initial(bare, scheme=Scheme.nezamabadi2017())).size == 0


def test_the_force_distribution_is_a_density_of_forces_over_their_mean():
    rng = np.random.default_rng(0)
    force = np.stack([np.append(rng.exponential(3.0, 200_000), -1.0), np.zeros(200_001)])
    one = network(row(), touch(row()))
    many = replace(one, force=force)
    f, density = many.force_distribution(bins=60)
    assert density.sum() * 0.1 == pytest.approx(np.mean(force[0, :-1] / force[0, :-1].mean() < 6.0), abs=1e-12)
    assert density[f < 3.0] == pytest.approx(np.exp(-f[f < 3.0]), abs=0.03)
    assert np.isnan(replace(one, force=np.zeros((2, 1))).force_distribution()[1]).all()


@pytest.mark.parametrize(
    ("options", "match"),
    [({"bins": 0}, "bins = 0; give a whole"), ({"largest": np.nan}, "largest = nan; give a multiple")],
)
def test_the_force_distribution_refuses_bins_that_are_none(options, match):
    with pytest.raises(SceneError, match="force_distribution: " + match):
        network(row(), touch(row())).force_distribution(**options)
