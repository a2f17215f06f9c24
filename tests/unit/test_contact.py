"""Contact constraints against geometry: gaps, normals and contact Jacobian, point-to-curve and shared-grid."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from skmpm import contact, coulomb
from skmpm.contact import boundary
from skmpm.contact.constraints import lookup
from skmpm.contact.projection import CORNER_DISC_DEPTH
from skmpm.material import LinearElastic, NeoHookean, Rigid
from skmpm.points import Points, box, disc
from skmpm.scene import Body, Contacts, Scene, SceneError, Wall
from skmpm.scheme import Scheme
from skmpm.simulation import simulate
from skmpm.step.algorithm import step
from skmpm.step.initial_state import initial

GEL = NeoHookean(1e6, 0.3, 1000.0)
R, CELL = 1e-3, 0.25e-3
DT = 1e-6
SEED = Scheme.nezamabadi2017()


def round_body(centre, radius=R, *, spacing=CELL / 2, material=GEL, **motion):
    return Body(disc(centre, radius, spacing=spacing), material, **motion)


def polar(length, angle):
    return length * np.array([np.cos(angle), np.sin(angle)])


def rows_of(scene, scheme=Scheme(), *, w=None, dt=DT, state=None):  # noqa: B008
    """The rows where the nodal velocities `w(body, position)` bring the bodies."""
    state = initial(scene, scheme=scheme) if state is None else state
    grid = state.derived.assembly.grid
    field = np.zeros((2, grid.nodes)) if w is None else w(grid.node_body, grid.position)
    return scheme.contact(scene, state, grid, dt)(np.ascontiguousarray(field.T).ravel()), field


def same(rows, other):
    """Sort both by place and compare."""
    ours, theirs = np.lexsort(rows.x), np.lexsort(other.x)
    for name in ("x", "normal", "gap", "friction"):
        assert np.allclose(getattr(rows, name)[..., ours], getattr(other, name)[..., theirs], rtol=0, atol=1e-12), (
            name
        )


# --- outlines


@example(angle=0.0, gap=0.0, ratio=0.75, first=False)  # a boundary point right on another
@given(angle=st.floats(0.0, 6.28), gap=st.floats(-0.2, 0.2), ratio=st.floats(0.6, 1.6), first=st.booleans())
@settings(max_examples=25)
def test_gaps_and_normals_of_two_discs_are_those_of_circles_to_the_sagitta_of_the_polygon(angle, gap, ratio, first):
    other, begin = ratio * R, 0.4 * CELL
    bodies = [round_body((0, 0)), round_body(polar(R + other + begin, angle), other)]
    scene = Scene(bodies if first else bodies[::-1], cell=CELL)
    state = initial(scene)
    closer = polar(begin - gap * CELL, angle)[:, None] * (state.body == int(first))
    state = replace(state, x=state.x - closer)
    rows, _ = rows_of(scene, state=state)
    centres = np.stack([np.zeros(2), polar(R + other + gap * CELL, angle)], axis=1)
    radii = np.array([R, other])
    if not first:
        centres, radii = centres[:, ::-1], radii[::-1]
    arm = rows.x - centres[:, rows.bodies[1]]
    distance = np.hypot(*arm)
    half = np.pi / round(2 * np.pi * radii.min() / (CELL / 2))  # angle of half a segment of the coarser polygon
    sagitta = radii.max() * half**2
    assert rows.size >= 1
    assert np.abs(rows.gap - (distance - radii[rows.bodies[1]])).max() <= sagitta
    assert rows.gap.min() == pytest.approx(gap * CELL, abs=2 * sagitta)
    assert np.abs(rows.normal - arm / distance).max() <= half / 4
    assert np.allclose(np.hypot(*rows.normal), 1.0, rtol=0, atol=1e-14)
    assert np.hypot(*(rows.x - state.x[:, rows.point])).max() <= (half + 1e-9) * radii.max()  # half a segment
    assert np.array_equal(rows.bodies[0], state.body[rows.point])


def test_gaps_are_those_of_the_end_of_the_step():
    """A body that comes to rest on another along the line of centres."""
    scene = Scene([round_body((0, 0)), round_body((2 * R + 0.4 * CELL, 0))], cell=CELL)
    there, _ = rows_of(Scene([round_body((0, 0)), round_body((2 * R, 0))], cell=CELL))
    rows, _ = rows_of(scene, w=lambda body, x: -0.4 * CELL / DT * np.outer([1, 0], body == 1))
    assert np.allclose(rows.x, there.x, rtol=0, atol=1e-15)
    assert np.allclose(rows.gap, there.gap, rtol=0, atol=1e-12 * R)


def test_normals_point_from_the_second_to_the_first_body():
    for centre in (2.02 * R, -2.02 * R):
        rows, _ = rows_of(Scene([round_body((0, 0)), round_body((centre, 0))], cell=CELL))
        sign = np.where(rows.bodies[0] == 0, -1, 1) * np.sign(centre)
        assert (rows.normal[0] * sign > 0.9).all()


def test_rigid_translation_of_either_body_is_the_relative_velocity():
    scene = Scene([round_body((0, 0)), round_body((1.9 * R, 0.7 * R))], cell=CELL, friction=0.3)
    velocity = np.array([0.3, -2.0])
    for b in (0, 1):
        rows, w = rows_of(scene, w=lambda body, x, b=b: 1e-9 * np.outer(velocity, body == b))
        w = 1e9 * w
        sign = np.where(rows.bodies[0] == b, 1.0, -1.0)
        assert np.allclose((rows.difference @ rows.base @ w.T).T, velocity[:, None] * sign, rtol=0, atol=1e-14)
        normal, sliding = (rows.H @ w.T.ravel()).reshape(-1, 2).T
        assert np.allclose(normal, sign * (velocity @ rows.normal), rtol=0, atol=1e-13)
        assert np.allclose(sliding, sign * (velocity @ rows.tangent), rtol=0, atol=1e-13)
    assert np.allclose(rows.tangent, [-rows.normal[1], rows.normal[0]])


def test_a_common_rigid_motion_is_no_relative_velocity_but_that_of_the_gap():
    """Rotation at omega moves a point across its gap g from its projection at g omega."""
    scene = Scene([round_body((0, 0)), round_body(polar(2 * R + 0.05 * CELL, 0.7), spacing=CELL / 3)], cell=CELL)
    omega = 3.0
    rows, _ = rows_of(scene)
    _, w = rows_of(scene, w=lambda body, x: np.array([[1.0], [2.0]]) + omega * np.stack([-x[1], x[0]]), dt=1e-12)
    relative = np.hypot(*(rows.difference @ rows.base @ w.T).T)
    assert rows.size >= 3
    assert (relative <= omega * np.abs(rows.gap) * (1 + 1e-9) + 1e-12).all()
    assert relative.max() > 0.5 * omega * np.abs(rows.gap).max()


@pytest.mark.parametrize("spacing", [CELL / 2, CELL / 3])
def test_who_gives_points_does_not_depend_on_the_order_of_bodies(spacing):
    bodies = [
        round_body((0, 0)),
        round_body(polar(2.01 * R, 0.4), spacing=spacing),
        round_body(polar(2.01 * R, 1.5), 0.99 * R),
        Body(box((-R, -2 * R - 0.1 * CELL), (2 * R, R), spacing=CELL / 2), GEL),
    ]
    walls = [Wall((-R, 0), (1, 0), friction=0.2), Wall((0, -2.03 * R), (0, 1))]
    reference, _ = rows_of(Scene(bodies, cell=CELL, walls=walls, friction=0.5))
    assert set(map(tuple, np.sort(reference.bodies, axis=0).T.tolist())) >= {(0, 1), (0, 2), (0, 3), (-1, 0), (-2, 3)}
    for order in ([3, 2, 1, 0], [1, 0, 3, 2], [2, 3, 0, 1]):
        rows, _ = rows_of(Scene([bodies[i] for i in order], cell=CELL, walls=walls, friction=0.5))
        same(rows, reference)


def test_the_finer_boundary_gives_the_points():
    for order in (1, -1):
        bodies = [round_body((0, 0), spacing=CELL / 4), round_body((2.02 * R, 0), spacing=CELL / 2)][::order]
        rows, _ = rows_of(Scene(bodies, cell=CELL))
        assert (rows.bodies[0] == (0 if order == 1 else 1)).all()
        assert (rows.point < bodies[0].points.size).all() == (order == 1)


@pytest.mark.parametrize(("spacings", "giver"), [((2, 2), 0), ((2, 3), 1), ((3, 2), 0)])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_mirror_image_swaps_the_roles_of_equally_fine_bodies_alone(spacings, giver, mirrored):
    """As `docs/limits.md` says; a spacing of CELL over the number."""
    sign = -1.0 if mirrored else 1.0
    places = zip((0.0, 2.02 * sign * R), spacings, strict=True)
    rows, _ = rows_of(Scene([round_body((x, 0.0), spacing=CELL / k) for x, k in places], cell=CELL))
    equal = spacings[0] == spacings[1]
    assert (rows.bodies[0] == (1 if equal and mirrored else giver)).all() and rows.size > 0


def test_gaps_to_walls_are_distances_along_their_normals():
    normal = polar(1.0, 0.9)
    start, speed = -(R + 0.1 * CELL) * normal, 0.05 * CELL / DT
    walls = [Wall((5 * R, 0), (-1, 0)), Wall(start, normal, friction=0.7, velocity=lambda t: speed * normal)]
    scene = Scene([round_body((0, 0))], cell=CELL, walls=walls)
    rows, _ = rows_of(scene)
    x = scene.bodies[0].points.x[:, rows.point]
    on_boundary = (rows.x == x).all(axis=0)
    assert rows.size >= 3 and on_boundary.sum() == rows.size - 1
    x = rows.x  # one of them, the closest point, lies between two boundary points
    assert np.array_equal(rows.bodies, [[0] * rows.size, [-2] * rows.size])
    assert np.allclose(rows.gap, normal @ x + R + 0.05 * CELL, rtol=0, atol=1e-15)  # at the end of the step
    assert np.allclose(rows.normal, normal[:, None])
    assert np.array_equal(rows.friction, [0.7] * rows.size)
    assert np.allclose(rows.prescribed, -speed * normal[:, None])
    boundary = scene.bodies[0].points.x[:, scene.bodies[0].points.outline[0]]
    assert on_boundary.sum() == np.count_nonzero(normal @ boundary + R + 0.05 * CELL < 0.25 * CELL)


def test_rigid_bodies_enter_with_their_given_velocity_and_no_unknowns():
    moving = round_body((2.02 * R, 0), material=Rigid(1.0), motion=lambda t: (-2.0 + t / DT, 1.0, 0.0))
    scene = Scene([round_body((0, 0)), moving], cell=CELL)
    rows, w = rows_of(scene, w=lambda body, x: np.ones(x.shape))
    assert (w.shape[1] == rows.base.shape[1]) and rows.size >= 1
    sign = np.where(rows.bodies[0] == 0, 1.0, -1.0)
    relative = (rows.difference @ rows.base @ w.T).T + rows.prescribed
    assert np.allclose(relative, sign * (np.array([[1.0], [1.0]]) - [[-1.5], [1.0]]), rtol=0, atol=1e-12)


def test_the_law_asks_for_no_gap_at_the_end_of_the_step():
    """Where w leads to a gap g, u_n(w) = g / dt; 0.8 of an overlap that was there at the start may stay.

    Of a step shorter than a wave takes to cross a cell, a part in proportion is removed.
    """
    scene = Scene([round_body((0, 0)), round_body((2 * R + 0.1 * CELL, 0))], cell=CELL)
    for depth in (-0.05, 0.15):
        speed = (0.1 + depth) * CELL / DT
        rows, w = rows_of(scene, w=lambda body, x, v=speed: -v * np.outer([1, 0], body == 1))
        u = rows.H @ w.T.ravel() + rows.offset
        assert np.allclose(u, rows.gap / DT, rtol=0, atol=1e-9 * speed)
    state = initial(scene)
    sunk = replace(state, x=state.x - 0.15 * CELL * np.outer([1, 0], state.body == 1))
    for dt, removed in ((CELL / scene.fastest_wave, 0.2), (0.1 * CELL / scene.fastest_wave, 0.02)):
        rows, w = rows_of(scene, state=sunk, dt=dt)
        assert rows.gap.min() == pytest.approx(-0.05 * CELL, rel=1e-6)
        assert np.allclose(rows.offset, np.where(rows.gap < 0, removed, 1.0) * rows.gap / dt)


def crowd():
    """Six discs, a box and two walls with touching neighbours, as a packing has them."""
    centres = [(0, 0), (2, 0), (4, 0), (1, 3**0.5), (3, 3**0.5), (2, 2 * 3**0.5)]
    bodies = [round_body(1.002 * R * np.array(c)) for c in centres]
    bodies.append(Body(box((5.02 * R, -R), (R, 3 * R), spacing=CELL / 2), GEL))
    walls = [Wall((0, -R), (0, 1), friction=0.2), Wall((-R, 0), (1, 0))]
    return Scene(bodies, cell=CELL, walls=walls, friction=0.5)


@pytest.mark.parametrize("scheme", [Scheme(), SEED], ids=["outlines", "shared nodes"])
def test_keys_of_contacts_are_unique_and_stay_those_of_their_contacts(scheme):
    scene = crowd()
    rows, _ = rows_of(scene, scheme)
    assert rows.size > 30
    assert np.unique(rows.key).size == rows.size
    later, _ = rows_of(scene, scheme, w=lambda body, x: np.full(x.shape, 1e-3))
    for key in np.intersect1d(rows.key, later.key):
        i, j = np.flatnonzero(rows.key == key)[0], np.flatnonzero(later.key == key)[0]
        assert rows.bodies[:, i].tolist() == later.bodies[:, j].tolist()
        assert np.hypot(*(rows.x[:, i] - later.x[:, j])) < 1e-5 * CELL


@pytest.mark.parametrize("scheme", [Scheme(), SEED], ids=["outlines", "shared nodes"])
def test_contact_forces_are_equal_and_opposite_to_round_off(scheme):
    """The impulses on the nodes of a pair's bodies are r and -r, and nothing on any other body."""
    scene = crowd()
    rows, _ = rows_of(scene, scheme)
    grid = initial(scene, scheme=scheme).derived.assembly.grid
    rng = np.random.default_rng(1)
    for i in range(rows.size):
        r = np.zeros(2 * rows.size)
        r[2 * i : 2 * i + 2] = rng.standard_normal(2)
        force = r[2 * i] * rows.normal[:, i] + r[2 * i + 1] * rows.tangent[:, i]
        nodal = (rows.H.T @ r).reshape(-1, 2)
        total = np.stack([np.bincount(grid.node_body, f, len(scene.bodies)) for f in nodal.T])
        expected = np.zeros((2, len(scene.bodies)))
        expected[:, rows.bodies[0, i]] += force
        if rows.bodies[1, i] >= 0:
            expected[:, rows.bodies[1, i]] -= force
        assert np.abs(total - expected).max() <= 1e-14 * np.abs(r).max() * 4


def test_forces_and_impulses_find_their_contacts_again():
    rows, _ = rows_of(crowd())
    rng = np.random.default_rng(2)
    force = rng.standard_normal((2, rows.size))
    shuffled = rng.permutation(rows.size)[: rows.size // 2]
    r = rows.impulses(rows.key[shuffled], force[:, shuffled], DT)
    known = np.zeros((2, rows.size))
    known[:, shuffled] = force[:, shuffled]
    assert np.allclose(rows.forces(r, DT), known, rtol=1e-14, atol=0)
    assert not rows.impulses(rows.key[:0], force[:, :0], DT).any()
    assert lookup(rows.key[shuffled], force[0, shuffled], rows.key, 7.0).tolist() == [
        force[0, i] if i in shuffled else 7.0 for i in range(rows.size)
    ]
    assert lookup(rows.key[:0], force[0, :0], rows.key, 7.0).tolist() == [7.0] * rows.size


# --- corners and notches


def test_an_iterate_that_diverges_does_not_look_for_neighbours_in_the_whole_packing(monkeypatch):
    """A step may move nothing farther than `max_motion`, so no iterate needs to look farther than that."""
    scene = crowd()
    state, margins = initial(scene), []
    found = boundary._PointToCurve.near
    monkeypatch.setattr(boundary._PointToCurve, "near", lambda self, m: (margins.append(m), found(self, m))[1])
    grid = state.derived.assembly.grid
    linearise = contact.point_to_curve(scene, state, grid, DT)
    w = np.random.default_rng(0).normal(size=2 * grid.nodes)
    for speed in (2.0, 1e3, 1e9):
        linearise(speed * scene.max_motion / DT * w)
    first, *others = margins
    assert len(others) == 3 and max(others) == others[1] == others[2] <= first + 2.0 * scene.max_motion


def turned_square(angle, corner, *, side=8 * CELL, per=CELL / 2):
    """A square whose corner nearest to the origin of its own frame is put at `corner`, its sides along the angle."""
    points = box((0, 0), (side, side), spacing=per)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return Points(turn @ points.x + np.reshape(corner, (2, 1)), points.volume, points.outline)


def test_a_contact_that_pressed_bodies_together_stays_where_outlines_wrinkle():
    """A point beside it has been pushed into the other body, as in the corner of a pore that closes.

    Without a force the contact is left to that point; one that bore force would let its point through.
    """
    lower, upper = (Body(box((0.0, y), (8 * CELL, 4 * CELL), spacing=0.4 * CELL), GEL) for y in (0.0, 4 * CELL))
    scene = Scene([lower, upper], cell=CELL)
    state = initial(scene)
    flat = rows_of(scene, state=state)[0]
    middle = np.argmin(np.hypot(*(flat.x.T - (4 * CELL, 4 * CELL)).T))
    ring = scene.outlines.point
    beside = ring[scene.outlines.next[np.flatnonzero(ring == flat.point[middle])[0]]]
    x = state.x.copy()
    x[1, beside] += 0.6 * CELL
    force = np.zeros((2, flat.gap.size))
    for pressing in (0.0, 1.0):
        force[0, middle] = pressing
        contacts = Contacts(flat.bodies, flat.x, flat.normal, force, flat.gap, flat.key, flat.point, 0.0 * flat.x)
        found = rows_of(scene, state=replace(state, x=x, contacts=contacts))[0]
        assert (flat.key[middle] in found.key) == (pressing > 0.0)


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("per", [CELL / 2, CELL / 3])
def test_the_corner_of_a_body_is_a_point_whoever_gives_the_points(order, per):
    """Between two points of the side of a square, finer or as fine; the gap is the true one."""
    face = Body(box((-4 * CELL, -8 * CELL), (8 * CELL, 8 * CELL), spacing=per), GEL)
    corner = Body(turned_square(0.6, (0.13 * CELL, 0.1 * CELL)), GEL)
    rows, _ = rows_of(Scene([face, corner][::order], cell=CELL))
    lowest = np.flatnonzero(np.hypot(*(rows.x - np.array([[0.13], [0.1]]) * CELL)) < 1e-12)
    assert lowest.size == 1
    assert rows.gap[lowest] == pytest.approx(0.1 * CELL, rel=1e-9)
    assert np.abs(np.abs(rows.normal[:, lowest].ravel()) - [0, 1]).max() < 1e-9


def test_a_corner_in_a_notch_touches_both_sides():
    """Also where it is a little behind one of them: both gaps are those of the lines."""
    L = [[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]]
    x = [np.linspace(a, b, 12, endpoint=False) for a, b in zip(L, L[1:] + L[:1], strict=True)]
    boundary = 4 * CELL * np.concatenate(x).T
    notch = Body(
        Points(boundary, np.full(boundary.shape[1], 5 * (4 * CELL) ** 2 / boundary.shape[1]), (np.arange(72),)), GEL
    )
    for shift in ((0.05, 0.1), (0.05, -0.02), (-0.01, -0.02)):
        at = 4 * CELL + CELL * np.array(shift)
        scene = Scene([notch, Body(turned_square(0.0, (4.5 * CELL, 4.5 * CELL)), GEL)], cell=CELL)
        state = initial(scene)
        state = replace(state, x=state.x - (4.5 * CELL - at)[:, None] * (state.body == 1))
        rows, _ = rows_of(scene, state=state)
        here = np.flatnonzero(np.hypot(*(rows.x - at[:, None])) < 1e-12)
        assert here.size == 2
        across = np.argsort(-np.abs(rows.normal[0, here]))
        assert np.allclose(rows.gap[here[across]], CELL * np.array(shift), rtol=0, atol=1e-9 * CELL)


def tips_at(apart):
    """The only row of two squares that stand on their corners, the upper one's at `apart` from the lower one's."""
    start = np.array([0.0, 0.2 * CELL])
    squares = [turned_square(0.25 * np.pi, start), turned_square(1.25 * np.pi, (0, 0))]
    scene = Scene([Body(s, GEL) for s in squares], cell=CELL)
    state = initial(scene)
    state = replace(state, x=state.x + (apart - start)[:, None] * (state.body == 0))
    rows, _ = rows_of(scene, state=state)
    near = np.argmin(rows.gap)
    count = np.sum(rows.gap < rows.gap[near] + 1e-9 * CELL)
    return rows.gap[near], rows.normal[:, near] * (1 if rows.bodies[0, near] == 0 else -1), count


@pytest.mark.parametrize("gap", [0.1, 0.0, -0.03])
def test_tips_that_meet_head_on_push_each_other_straight_apart(gap):
    """One contact, along the line of symmetry, wherever the tips are on it; off it the normal turns by degrees."""
    found, normal, count = tips_at(np.array([0.0, gap * CELL]))
    assert count == 1
    assert np.allclose(normal, [0, 1], rtol=0, atol=1e-9)
    assert found / CELL == pytest.approx(gap + CORNER_DISC_DEPTH * (1 - np.sqrt(0.5)), abs=1e-9)


@pytest.mark.parametrize("height", [0.05, -0.02, -0.05])
def test_the_gap_of_passing_tips_has_no_jump(height):
    """Across the wedge and over its ends, where sides take over: steps of 1e-3 cells, changes of that size."""
    at = [tips_at(CELL * np.array([x, height])) for x in np.arange(-0.12, 0.12, 1e-3)]
    gaps, normals = np.array([a[0] for a in at]) / CELL, np.array([a[1] for a in at])
    assert np.abs(np.diff(gaps)).max() < 1.5e-3
    assert np.abs(np.diff(normals, axis=0)).max() < 0.05
    assert np.allclose(normals[[0, -1]], np.array([[-1, 1], [1, 1]]) * np.sqrt(0.5), atol=0.2)


# --- shared nodes


def square(corner, size=(1.0, 1.0)):
    """A square of four points per cell of side 1/4, aligned with the grid."""
    return Body(box(corner, size, spacing=0.125), GEL)


def shared(bodies, **options):
    scene = Scene(bodies, cell=0.25, **options)
    rows, _ = rows_of(scene, SEED)
    return rows


@pytest.mark.parametrize("side", [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_normals_of_boxes_side_by_side_follow_from_the_gradients_of_their_masses(side):
    rows = shared([square((0, 0)), square(side)])
    assert rows.size == 5
    assert rows.bodies.tolist() == [[0] * 5, [1] * 5]
    assert np.allclose(rows.normal, -np.array(side)[:, None], rtol=0, atol=1e-9)
    along = np.sort(rows.x[1] if side[0] else rows.x[0])
    assert np.allclose(along, np.arange(5) / 4)
    assert not rows.gap.any()


def test_normals_of_discs_at_shared_nodes_lie_along_the_line_of_centres():
    for angle in np.arange(12) / 12 * 2 * np.pi:
        bodies = [round_body(centre, spacing=CELL / 4) for centre in ((0, 0), polar(2.02 * R, angle))]
        rows, _ = rows_of(Scene(bodies, cell=CELL / 2), SEED)
        cosine = -polar(1.0, angle) @ rows.normal
        assert rows.size >= 2
        assert np.median(cosine) > 0.95  # where a body only grazes a node, its gradient says little


def test_three_bodies_at_one_node_give_all_three_pairs():
    rows = shared([square((0, 0)), square((1, 0)), square((0.5, 1))])
    there = np.flatnonzero(np.hypot(*(rows.x - 1.0)) < 1e-9)
    assert sorted(map(tuple, rows.bodies[:, there].T.tolist())) == [(0, 1), (0, 2), (1, 2)]


def test_four_bodies_at_one_node_give_all_six_pairs():
    """Across the corner, too, where both normals are diagonal."""
    rows = shared([square(corner) for corner in ((0, 0), (1, 0), (0, 1), (1, 1))])
    there = np.flatnonzero(np.hypot(*(rows.x - 1.0)) < 1e-9)
    assert sorted(map(tuple, rows.bodies[:, there].T.tolist())) == list(combinations(range(4), 2))
    diagonal = rows.normal[:, there[(rows.bodies[:, there] == [[0], [3]]).all(axis=0)]]
    assert np.allclose(diagonal[:, 0], -np.sqrt(0.5))


@pytest.mark.parametrize(
    ("normal", "point"), [((0, 1), (0, 0)), ((0, -1), (0, 1)), ((1, 0), (0, 0)), ((-1, 0), (1, 0))]
)
def test_walls_become_slabs_of_rigid_material(normal, point):
    rows = shared([square((0, 0))], walls=[Wall((9, 0), (-1, 0)), Wall(point, normal, velocity=(3, 4), friction=0.1)])
    assert rows.bodies.tolist() == [[0] * 5, [-2] * 5]
    along = np.array(normal)[::-1] @ rows.x
    middle = np.flatnonzero(np.abs(np.abs(along) - 0.5) < 0.3)  # between the corners of the square
    assert middle.size == 3
    assert np.allclose(rows.normal[:, middle], np.array(normal)[:, None], rtol=0, atol=1e-9)
    assert np.allclose(rows.prescribed, [[-3], [-4]])
    assert np.array_equal(rows.friction, [0.1] * 5)


def test_shared_grid_contact_needs_grids_built_at_the_points():
    scene = Scene([round_body((0, 0)), round_body((2.02 * R, 0))], cell=CELL)
    state = initial(scene)
    moved = replace(state, x=state.x + 1e-6)
    with pytest.raises(SceneError, match="anchor=0"):
        contact.shared_grid(scene, moved, state.derived.assembly.grid, DT)


def test_bodies_do_not_approach_at_shared_nodes_after_a_step():
    """Velocity-Signorini: u_n >= 0 at every shared node, and a force only where u_n = 0."""
    seen = []

    def watched(*arguments):
        law = contact.shared_grid(*arguments)
        seen.append(law(None))
        return law

    watched.at_grid_nodes = True
    speed = 2.0
    scene = Scene(
        [round_body((0, 0), velocity=(speed, 0.1)), round_body((2.1 * R, 0.2 * R), velocity=(-speed, 0))],
        cell=CELL,
        walls=[Wall((0, -1.1 * R), (0, 1))],
        friction=0.3,
    )
    scheme = Scheme(anchor=0.0, contact=watched)
    state = initial(scene, scheme=scheme)
    pressed = 0
    for _ in range(5):
        state = step(scene, state, 5e-6, scheme=scheme)
        rows, w = seen[-1], state.displacement / 5e-6  # the body grids were built at the start of the step
        normal = (rows.H @ w + rows.offset)[::2]
        assert normal.min() >= -1e-5 * speed
        force = state.contacts.force
        assert (force[0] >= 0).all()
        assert np.abs(force[0] * normal).max() <= 1e-5 * speed * max(force[0].max(), 1.0)
        assert (np.abs(force[1]) <= rows.friction * force[0] * (1 + 1e-9) + 1e-12).all()
        pressed += np.count_nonzero(force[0] > 0)
    assert pressed > 5


# --- only what a scene requires


def never(*arguments, **options):
    raise AssertionError("called")


@pytest.mark.parametrize("material", [GEL, LinearElastic(1e6, 0.3, 1000.0)])
def test_a_single_body_without_walls_never_enters_the_contact_module(material, monkeypatch):
    monkeypatch.setattr(coulomb, "solve", never)
    monkeypatch.setattr(coulomb, "residual", never)
    scene = Scene([round_body((0, 0), material=material, velocity=(1, 0), spin=100.0)], cell=CELL, gravity=(0, -9.81))
    *_, state = simulate(scene, dt=1e-5, until=5e-5, scheme=Scheme(contact=never))
    assert state.contacts.gap.size == 0
    with pytest.raises(AssertionError, match="called"):
        initial(Scene([*scene.bodies, round_body((9 * R, 0))], cell=CELL), scheme=Scheme(contact=never))


def spy(monkeypatch):
    """Record the shape of W for contacts alone, that of q, and mu, of every call of `coulomb.solve`."""
    calls, solve = [], coulomb.solve

    def recorded(W, q, mu, **options):
        more = options["bilateral"].q.size if options.get("bilateral") else 0
        calls.append((tuple(size - more for size in W.shape), np.shape(q), np.array(mu)))
        return solve(W, q, mu, **options)

    monkeypatch.setattr(coulomb, "solve", recorded)
    return calls


def squeezed(friction, wall_friction):
    walls = [Wall((0, R), (0, -1), velocity=(0, -1.0), friction=wall_friction), Wall((0, -R), (0, 1))]
    return Scene([round_body((0, 0)), round_body((2 * R, 0))], cell=CELL, walls=walls, friction=friction)


def test_friction_0_leaves_no_tangential_unknown(monkeypatch):
    calls = spy(monkeypatch)
    *_, state = simulate(squeezed(0.0, 0.0), dt=5e-6, until=25e-6)
    assert len(calls) >= 5
    assert all((mu.size, mu.size) == W and q == (mu.size,) and not mu.any() for W, q, mu in calls)
    assert state.contacts.force[0].max() > 0
    assert not state.contacts.force[1].any()


def test_friction_of_one_wall_brings_tangential_rows(monkeypatch):
    calls = spy(monkeypatch)
    *_, state = simulate(squeezed(0.0, 0.4), dt=5e-6, until=25e-6)
    assert all((2 * mu.size, 2 * mu.size) == W and q == (2 * mu.size,) for W, q, mu in calls if mu.any())
    assert any(mu.any() for _, _, mu in calls)
    rough = state.contacts.bodies[1] == -1
    assert state.contacts.force[1][rough].any()
    assert not state.contacts.force[1][~rough].any()


def test_a_body_that_gets_near_nothing_solves_no_contacts(monkeypatch):
    monkeypatch.setattr(coulomb, "solve", never)
    scene = Scene(
        [round_body((0, 0)), round_body((9 * R, 0), velocity=(1, 0))], cell=CELL, walls=[Wall((0, -R * 5), (0, 1))]
    )
    *_, state = simulate(scene, dt=1e-5, until=3e-5)
    assert state.report.contact == 0


def test_points_without_outline_touch_at_shared_nodes():
    bodies = [round_body((0, 0.01 * CELL)), round_body((2.02 * R, 0.01 * CELL))]
    bare = [Body(Points(b.points.x, b.points.volume), GEL) for b in bodies]
    rows, _ = rows_of(Scene(bare, cell=0.99 * CELL), SEED)
    with_outline, _ = rows_of(Scene(bodies, cell=0.99 * CELL), SEED)
    same(rows, with_outline)


def test_a_closed_contact_without_friction_beside_an_open_one_with_it_at_the_midpoint_rule():
    """Velocities at the end of the step are found for closed contacts, whose rows were counted with tangents."""
    found = []
    for friction in (0.0, 0.5):
        walls = [Wall((0, 0), (0, 1)), Wall((1.005 * R, 0), (-1, 0), friction=friction)]
        scene = Scene([Body(disc((0, R), R, spacing=R / 5), GEL)], cell=CELL, walls=walls, gravity=(0.0, -10.0))
        *_, state = simulate(scene, dt=1e-4, until=2e-3, scheme=Scheme(theta=0.5))
        found.append(state.wall_force[0])
    assert found[0][1] < 0.0
    assert found[1] == pytest.approx(found[0], rel=1e-5)


@pytest.mark.parametrize("angle", [0.0, np.pi / 4])
def test_contacts_are_found_of_bodies_that_meet_along_any_direction(angle):
    """Each moves by 0.95 cells in the step; along the diagonal they overlapped by 0.16 cells2 without a contact."""
    along, apart = polar(1.0, angle), 0.5 * (2.0 * 6.0 + 1.75)
    discs = [disc(tuple(side * apart * along), 6.0, spacing=0.74) for side in (-1, 1)]
    bodies = [Body(points, GEL, velocity=-side * along) for side, points in zip((-1, 1), discs, strict=True)]
    scene = Scene(bodies, cell=1.0)
    state = step(scene, initial(scene), 0.95)
    assert state.contacts.force[0].sum() > 0.0
    assert state.report.overlap * 2.0 * np.pi * 36.0 < 0.02
