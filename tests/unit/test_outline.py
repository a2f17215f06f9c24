"""Outlines against closed forms and against independent algorithms implemented here."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skmpm import outline
from skmpm.outline import topology
from skmpm.outline.crossings import apart, turns
from skmpm.outline.images import without_images
from skmpm.outline.measures import bend, turning_angles
from skmpm.outline.near import both_ways, candidates
from skmpm.outline.overlaps import box_pairs, boxes

SQUARE = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
SEEDS = st.integers(0, 2**32 - 1)


def build(*bodies):
    """Outlines and positions of bodies given as lists of loops (2, m)."""
    loops, offsets, x, start = [], [], [np.zeros((2, 0))], 0
    for body in bodies:
        offsets.append(start)
        sizes = [loop.shape[1] for loop in body]
        first = np.cumsum([0, *sizes])
        loops.append([np.arange(i, i + n) for i, n in zip(first, sizes, strict=False)])
        x += body
        start += sum(sizes)
    return outline.outlines(loops, offsets), np.concatenate(x, axis=1), len(bodies)


def near_pairs(o, x, n, reach):
    """Pairs of bodies, in both orders, whose boxes are closer than `reach`."""
    low, high = boxes(o, x, n)
    return both_ways(box_pairs(low - 0.5 * reach, high + 0.5 * reach))


def regular(n, radius=1.0, centre=(0, 0), phase=0.0):
    angle = phase + 2 * np.pi * np.arange(n) / n
    return np.reshape(centre, (2, 1)) + radius * np.array((np.cos(angle), np.sin(angle)))


def star(rng, n=12, centre=(0, 0)):
    """Return a simple polygon, rarely convex."""
    angle = 2 * np.pi * (np.arange(n) + 0.8 * rng.random(n)) / n
    return np.reshape(centre, (2, 1)) + rng.uniform(0.3, 1, n) * np.array((np.cos(angle), np.sin(angle)))


def convex(rng, n=8, centre=(0, 0)):
    angle = np.sort(rng.uniform(0, 2 * np.pi, n))
    a, b, tilt = rng.uniform(0.4, 1, 3) * (1, 1, np.pi)
    return np.reshape(centre, (2, 1)) + turn(tilt) @ np.array((a * np.cos(angle), b * np.sin(angle)))


def turn(angle):
    return np.array(((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))))


def reversed_loop(loop):
    return loop[:, ::-1]


def shoelace(x):
    y = np.roll(x, -1, axis=1)
    return np.sum(x[0] * y[1] - x[1] * y[0]) / 2


def clipped(subject, clip):
    """Cut a polygon by the half-planes of a convex one (Sutherland & Hodgman, CACM 17, 1974)."""
    for a, b in zip(clip.T, np.roll(clip, -1, axis=1).T, strict=True):
        t = b - a
        height = t[0] * (subject[1] - a[1]) - t[1] * (subject[0] - a[0])
        kept = []
        for k in range(subject.shape[1]):
            p, q, hp, hq = subject[:, k - 1], subject[:, k], height[k - 1], height[k]
            if (hp > 0) != (hq > 0):
                kept.append(p + hp / (hp - hq) * (q - p))
            if hq > 0:
                kept.append(q)
        if not kept:
            return np.zeros((2, 1))
        subject = np.array(kept).T
    return subject


# --- topology


def test_outlines_follow_the_loops():
    loops = [[np.array([3, 1, 2]), np.array([0, 4, 6, 5])], [], [np.array([1, 0, 2])]]
    o = outline.outlines(loops, [0, 7, 10])
    np.testing.assert_array_equal(o.point, [3, 1, 2, 0, 4, 6, 5, 11, 10, 12])
    np.testing.assert_array_equal(o.body, [0] * 7 + [2] * 3)
    np.testing.assert_array_equal(o.next, [1, 2, 0, 4, 5, 6, 3, 8, 9, 7])
    np.testing.assert_array_equal(o.next[o.previous], np.arange(10))
    assert o.size == 10


def test_nothing_is_measured_where_there_is_no_outline():
    o, x, n = build([], [])
    assert o.size == 0
    np.testing.assert_array_equal(outline.area(o, x, n), [0, 0])
    np.testing.assert_array_equal(outline.perimeter(o, x, n), [0, 0])
    assert np.isnan(outline.centroid(o, x, n)).all()
    assert all(np.isnan(d).all() for d in outline.dimensions(o, x, n))
    assert outline.normals(o, x).shape == (2, 0)
    assert [a.size for a in candidates(o, x, 1.0, near_pairs(o, x, n, 1.0))] == [0, 0]
    assert [a.shape for a in outline.overlap(o, x, n)] == [(2, 0), (0,)]
    assert not outline.inside(o, x, 0, np.zeros((2, 3))).any()
    assert outline.depth(o, x, 0).size == 0


def test_wrong_numbers_of_bodies_and_points_are_refused():
    """Compiled loops would read and write beyond the arrays."""
    o, x, n = build(*([SQUARE + 3 * k] for k in range(5)))
    for measure in (outline.area, outline.perimeter, outline.centroid, outline.dimensions, outline.overlap):
        with pytest.raises(ValueError, match="bodies = 4; they are those of 5 bodies"):
            measure(o, x, n - 1)
    with pytest.raises(ValueError, match=r"x has the shape \(2, 19\); give positions \(2, 20\)"):
        outline.area(o, x[:, :-1], n)


def test_a_body_without_outline_between_others():
    o, x, n = build([SQUARE], [], [SQUARE + 0.5])
    np.testing.assert_allclose(outline.area(o, x, n), [1, 0, 1])
    np.testing.assert_allclose(outline.centroid(o, x, n), [[0.5, np.nan, 1]] * 2)
    np.testing.assert_allclose(outline.dimensions(o, x, n)[0], [1, np.nan, 1])
    pairs, area = outline.overlap(o, x, n)
    np.testing.assert_array_equal(pairs, [[0], [2]])
    np.testing.assert_allclose(area, 0.25)


@given(st.lists(st.integers(0, 9), max_size=20), st.integers(1, 30))
def test_chunks_cover_everything_once(count, size):
    count = np.array(count, dtype=np.int64)
    parts = topology.chunks(count, size)
    np.testing.assert_array_equal(np.concatenate([np.arange(count.size)[p] for p in parts]), np.arange(count.size))
    assert all(count[p].sum() < size + 9 for p in parts)


# --- measures


def test_measures_of_a_square_with_a_square_hole():
    hole = reversed_loop(SQUARE / 2 + [[0.5], [0.25]])
    o, x, n = build([SQUARE * 2, hole])
    np.testing.assert_allclose(outline.area(o, x, n), 3.75)
    np.testing.assert_allclose(outline.perimeter(o, x, n), 10)
    c = (4 * np.array((1, 1)) - 0.25 * np.array((0.75, 0.5))) / 3.75
    np.testing.assert_allclose(outline.centroid(o, x, n)[:, 0], c)
    big, small = np.array((1, 1)) - c, np.array((0.75, 0.5)) - c
    M = (16 / 12 * np.eye(2) + 4 * np.outer(big, big)) - (0.5**4 / 12 * np.eye(2) + 0.25 * np.outer(small, small))
    np.testing.assert_allclose(outline.second_moments(o, x, n)[:, :, 0], M, rtol=1e-13)


@pytest.mark.parametrize("n", [3, 6, 50])
def test_a_regular_polygon_bends_as_the_circle_through_its_corners(n):
    outlines, x, _ = build([regular(n, 2.0)])
    assert bend(outlines, x) == pytest.approx(np.full(n, 0.5), rel=1e-12)


@given(SEEDS)
def test_measures_follow_a_rigid_motion(seed):
    rng = np.random.default_rng(seed)
    loop, rotation, d = star(rng), turn(rng.uniform(0, 7)), rng.uniform(-50, 50, (2, 1))
    o, x, n = build([loop], [rotation @ loop + d])
    c, M = outline.centroid(o, x, n), outline.second_moments(o, x, n)
    np.testing.assert_allclose(np.diff(outline.area(o, x, n)), 0, atol=1e-12)
    np.testing.assert_allclose(np.diff(outline.perimeter(o, x, n)), 0, atol=1e-12)
    np.testing.assert_allclose(rotation @ c[:, :1] + d, c[:, 1:], atol=1e-12)
    np.testing.assert_allclose(rotation @ M[:, :, 0] @ rotation.T, M[:, :, 1], atol=1e-12)
    long, short, _ = outline.dimensions(o, x, n)
    np.testing.assert_allclose([long[0], short[0]], [long[1], short[1]], rtol=1e-6)


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.5, np.pi / 2, -0.7, 2.0, -np.pi / 2, 3.0])
def test_dimensions_of_an_ellipse(angle):
    """Polygon of 400 vertices on the ellipse: its axes are exact, its moments nearly."""
    ellipse = turn(angle) @ (np.array([[3.0], [1.0]]) * regular(400)) + [[20.0], [-7.0]]
    o, x, n = build([ellipse])
    long, short, found = outline.dimensions(o, x, n)
    np.testing.assert_allclose((long[0], short[0]), (6, 2), rtol=1e-12)
    assert -np.pi / 2 < found[0] <= np.pi / 2
    assert np.sin(found[0] - angle) == pytest.approx(0, abs=1e-12)
    moments = np.linalg.eigvalsh(outline.second_moments(o, x, n)[:, :, 0])
    np.testing.assert_allclose(moments, np.pi / 4 * np.array((3, 27)), rtol=2e-4)


def test_upright_body_has_the_angle_plus_half_pi():
    o, x, n = build([SQUARE * [[1.0], [3.0]]])
    long, short, angle = outline.dimensions(o, x, n)
    assert (long[0], short[0], angle[0]) == pytest.approx((3, 1, np.pi / 2))


def test_normals_point_out_of_the_material():
    o, x, _ = build([regular(40, 2.0), reversed_loop(regular(30))])
    expected = np.concatenate((x[:, :40] / 2, -x[:, 40:]), axis=1)
    np.testing.assert_allclose(outline.normals(o, x), expected, atol=1e-13)


def test_normal_of_a_spike_is_zero_not_an_error():
    o, x, _ = build([np.array([[0.0, 1.0, 0.0, -1.0], [0.0, 1.0, 0.0, 1.0]])])
    assert np.isfinite(outline.normals(o, x)).all()


# --- near


def test_closest_point_of_a_segment():
    x = np.array([[0.5, -1.0, 3.0, 0.2], [2.0, 0.0, 4.0, 0.0]])
    start = np.array([[0.0, 0.0, 0.0, 0.2], [0.0, 0.0, 0.0, 0.0]])
    end = np.array([[2.0, 1.0, 0.0, 0.2], [0.0, 0.0, 2.0, 0.0]])
    s, distance = outline.closest(x, start, end)
    np.testing.assert_allclose(s, [0.25, 0, 1, 0])
    np.testing.assert_allclose(distance, [2, 1, np.sqrt(13), 0])


@given(SEEDS, st.floats(0.0, 2.0))
def test_candidates_are_those_of_the_full_search(seed, reach):
    """Stars and slivers: the lengths of the segments differ a hundredfold."""
    rng = np.random.default_rng(seed)
    bodies = [[star(rng, rng.integers(3, 40), rng.uniform(-2, 2, 2))] for _ in range(6)]
    bodies.append([SQUARE * [[50.0], [0.5]] - 3])
    bodies[2] = []
    o, x, n = build(*bodies)
    c, j = (a.ravel() for a in np.meshgrid(np.arange(o.size), np.arange(o.size), indexing="ij"))
    near = outline.closest(x[:, c], x[:, j], x[:, o.next[j]])[1] < reach
    near &= o.body[c] != o.body[j]
    np.testing.assert_array_equal(candidates(o, x, reach, near_pairs(o, x, n, reach)), (c[near], j[near]))


def test_candidates_survive_a_body_of_no_length():
    o, x, n = build([np.zeros((2, 3))], [np.zeros((2, 3)) + 0.5])
    assert candidates(o, x, 1.0, near_pairs(o, x, n, 1.0))[0].size == 18


@given(SEEDS)
def test_inside_a_star_is_inside_one_of_its_triangles(seed):
    rng = np.random.default_rng(seed)
    loop = star(rng, 12)
    o, x, _ = build([regular(5)], [loop])
    y = rng.uniform(-1, 1, (2, 200))
    a, b = loop, np.roll(loop, -1, axis=1)
    fans = [in_triangle(np.array((np.zeros(2), p, q)).T, y) for p, q in zip(a.T, b.T, strict=True)]
    np.testing.assert_array_equal(outline.inside(o, x, 1, y), np.any(fans, axis=0))


def in_triangle(triangle, y):
    """Whether y is in a triangle, counter-clockwise: to the left of its three sides."""
    end = np.roll(triangle, -1, axis=1)
    t = (end - triangle)[:, :, None]
    d = y[:, None, :] - triangle[:, :, None]
    return (t[0] * d[1] - t[1] * d[0] > 0).all(axis=0)


def test_inside_counts_a_corner_on_the_ray_once():
    o, x, _ = build([np.array([[0.0, 1.0, 0.0, -1.0], [-1.0, 0.0, 1.0, 0.0]])])
    y = np.array([[0.0, -2.0, 0.0, -0.5], [0.0, 0.0, -2.0, 0.0]])
    np.testing.assert_array_equal(outline.inside(o, x, 0, y), [1, 0, 0, 1])


def test_inside_knows_holes_and_asks_each_its_body():
    ring = [SQUARE * 3, reversed_loop(SQUARE + 1)]
    o, x, _ = build(ring, [SQUARE + 1])
    y = np.array([[1.5, 1.5, 0.5, 0.5, 5.0], [1.5, 1.5, 0.5, 1.5, 1.5]])
    np.testing.assert_array_equal(outline.inside(o, x, np.array([0, 1, 0, 0, 0]), y), [0, 1, 1, 1, 0])
    np.testing.assert_array_equal(outline.inside(o, x, 0, y), [0, 0, 1, 1, 0])


# --- overlaps


def shared(*bodies):
    """Area shared by the first two bodies; 0 if their boxes are apart."""
    pairs, area = outline.overlap(*build(*bodies))
    return dict(zip(map(tuple, pairs.T.tolist()), area.tolist(), strict=True)).get((0, 1), 0.0)


@pytest.mark.parametrize("shift", [(0.5, 0.25), (0.25, 0.5), (-0.5, 0.75), (0.0, 0.5), (0.0, 0.0)])
def test_overlap_of_squares(shift):
    exact = (1 - abs(shift[0])) * (1 - abs(shift[1]))
    assert shared([SQUARE], [SQUARE + np.reshape(shift, (2, 1))]) == pytest.approx(exact, rel=1e-14)


@pytest.mark.parametrize("shift", [(1.0, 0.0), (0.0, -1.0), (1.0, 1.0), (3.0, 0.0)])
def test_bodies_that_touch_or_are_apart_share_nothing(shift):
    pairs, _ = outline.overlap(*build([SQUARE], [SQUARE + np.reshape(shift, (2, 1))]))
    assert pairs.shape == (2, 0)


def depths(*bodies):
    """How deep bodies overlap, by pairs."""
    o, x, n = build(*bodies)
    pairs, _, depth = without_images(o, n).depth(outline.curve(o, x).through(x))
    return dict(zip(map(tuple, pairs.T.tolist()), depth.tolist(), strict=True))


def sides(corners, n):
    """A polygon with n boundary points on each side."""
    ends = zip(corners.T, np.roll(corners.T, -1, axis=0), strict=True)
    return np.concatenate([np.linspace(a, b, n, endpoint=False) for a, b in ends]).T


@pytest.mark.parametrize("depth", [0.02, 1e-3, 1e-5, 0.0, -1e-5])
@pytest.mark.parametrize("n", [60, 97])
def test_depth_of_a_shaft_in_a_ring_is_the_difference_of_their_radii(depth, n):
    """Their polygons overlap by a sagitta of 1.4e-3 more. Ring of radii 1 and 1.6."""
    found = depths([regular(90, 1.6), reversed_loop(regular(60))], [regular(n, 1.0 + depth)])[0, 1]
    assert found == pytest.approx(max(depth, 0.0), abs=3e-6 + 0.02 * abs(depth))


@pytest.mark.parametrize("n", [4, 7])
def test_depths_of_boxes(n):
    """Flush, one in the other's side, a corner in it, one inside the other and both at one place."""
    box, low = sides(SQUARE, 5), np.array([[0.1], [-1.0]])
    other = sides(SQUARE, n)
    assert depths([box], [other + low]) == {}
    assert depths([box], [other + low + 1e-15])[0, 1] < 1e-14
    assert depths([box], [other + low + [[0.0], [0.02]]])[0, 1] == pytest.approx(0.02, rel=1e-12)
    corner = turn(np.pi / 4) @ other + np.array([[0.5], [-np.sqrt(2.0) + 0.03]])
    assert depths([box], [corner])[0, 1] == pytest.approx(0.03, rel=1e-12)
    assert depths([box], [0.5 * other + 0.2])[0, 1] == pytest.approx(0.7, rel=0.3)
    assert depths([box], [other])[0, 1] == pytest.approx(1.0, rel=1e-12)


def test_depth_of_bars_that_cross():
    """No boundary point of either lies inside the other, by half of the width: middles of segments do."""
    bar = sides(np.array([[-5.0, 5.0, 5.0, -5.0], [0.0, 0.0, 1.0, 1.0]]), 10)
    assert depths([bar], [turn(np.pi / 2) @ bar])[0, 1] > 0.45


def test_overlap_of_boxes_is_not_overlap_of_bodies():
    triangle = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    pairs, area = outline.overlap(*build([triangle], [1.2 - triangle]))
    assert pairs.shape == (2, 1)
    assert area[0] == pytest.approx(0, abs=1e-15)


@pytest.mark.parametrize("direction", [0.0, 0.3, 0.8, 1.5, 2.5])
def test_overlap_of_discs_tends_to_the_lens(direction):
    """Error of inscribed polygons: second order in the number of vertices."""
    r, d = 1.0, 1.8
    lens = 2 * r**2 * np.arccos(d / 2 / r) - d / 2 * np.sqrt(4 * r**2 - d**2)
    there = d * np.array((np.cos(direction), np.sin(direction)))
    errors = [1 - shared([regular(n)], [regular(n, centre=there, phase=0.1)]) / lens for n in (200, 400, 800)]
    assert 0 < errors[0] < 0.01
    assert errors[2] / errors[0] == pytest.approx(1 / 16, rel=0.3)


@given(SEEDS)
def test_overlap_is_that_of_clipping_by_half_planes(seed):
    rng = np.random.default_rng(seed)
    a, b = star(rng, 15), convex(rng, 9, rng.uniform(-1, 1, 2))
    assert shared([a], [b]) == pytest.approx(shoelace(clipped(a, b)), abs=1e-13)


@given(SEEDS)
def test_overlap_of_identical_polygons_is_their_area(seed):
    loop = star(np.random.default_rng(seed), 30)
    assert shared([loop], [loop]) == pytest.approx(shoelace(loop), rel=1e-13)


def test_overlap_of_nested_bodies_is_the_area_of_the_inner_one():
    inner = regular(17, 0.3, (0.2, 0.1))
    assert shared([regular(23)], [inner]) == pytest.approx(shoelace(inner), rel=1e-13)
    assert shared([inner], [regular(23)]) == pytest.approx(shoelace(inner), rel=1e-13)


def test_overlap_leaves_holes_out():
    ring = [SQUARE * 3, reversed_loop(SQUARE + 1)]
    assert shared(ring, [SQUARE + 1]) == pytest.approx(0, abs=1e-14)
    assert shared(ring, [SQUARE + 0.5]) == pytest.approx(0.75, rel=1e-14)
    assert shared(ring, ring) == pytest.approx(8, rel=1e-14)
    assert shared(ring, [regular(7, 0.3, (1.5, 1.5))]) == pytest.approx(0, abs=1e-14)


@given(SEEDS)
def test_overlap_does_not_depend_on_place_turn_order_or_first_vertex(seed):
    rng = np.random.default_rng(seed)
    a, b = star(rng), star(rng, 9, rng.uniform(-0.7, 0.7, 2))
    rotation, d = turn(rng.uniform(0, 7)), rng.uniform(-10, 10, (2, 1))
    before = shared([a], [b])
    assert shared([b], [a]) == pytest.approx(before, abs=1e-13)
    assert shared([np.roll(a, 5, axis=1)], [b]) == pytest.approx(before, abs=1e-13)
    assert shared([rotation @ a + d], [rotation @ b + d]) == pytest.approx(before, abs=1e-12)
    assert shared([1e-3 * a], [1e-3 * b]) == pytest.approx(1e-6 * before, abs=1e-18)


@given(SEEDS)
def test_shared_and_single_areas_add_up(seed):
    """The part of a star in a convex body and the part in a ring around that body make the star."""
    rng = np.random.default_rng(seed)
    loop, cut = star(rng, 20), convex(rng, 7, rng.uniform(-0.3, 0.3, 2))
    outside = [SQUARE * 8 - 4, reversed_loop(cut)]
    assert shared([loop], [cut]) + shared([loop], outside) == pytest.approx(shoelace(loop), rel=1e-13)


def test_overlap_of_thin_deep_bodies_far_from_the_origin():
    """A sliver of 1e-9 of the body at 1e3 body sizes: the local frame loses none of its digits."""
    far = np.array([[1024.0], [512.0]])
    thin = 2.0**-30
    assert shared([SQUARE + far], [SQUARE + far + [[1 - thin], [0.0]]]) == pytest.approx(thin, rel=1e-13)


def test_all_pairs_of_a_packing_at_once():
    rng = np.random.default_rng(1)
    bodies = [[star(rng, rng.integers(5, 30), c)] for c in rng.uniform(0, 6, (40, 2))]
    bodies[7] = []
    o, x, n = build(*bodies)
    pairs, area = outline.overlap(o, x, n)
    assert (pairs[0] < pairs[1]).all()
    assert (np.diff(pairs[0] * n + pairs[1]) > 0).all()
    single = [shared(bodies[a], bodies[b]) for a, b in pairs.T]
    np.testing.assert_allclose(area, single, atol=1e-14)
    boxes = [(b[0].min(axis=1), b[0].max(axis=1)) if b else (np.full(2, np.inf), np.full(2, -np.inf)) for b in bodies]
    expected = [
        (a, b)
        for a in range(n)
        for b in range(a + 1, n)
        if (np.maximum(boxes[a][0], boxes[b][0]) < np.minimum(boxes[a][1], boxes[b][1])).all()
    ]
    np.testing.assert_array_equal(pairs.T, expected)


# --- outlines that cross themselves


def crossed(loops, chosen=(0,)):
    boundary, x, _ = build(loops)
    return outline.crossings(boundary, x, np.array(chosen))


def reference_crossings(loops):
    """All pairs of edges, by the parameters at which their lines meet."""
    boundary, x, _ = build(loops)
    found = []
    for i in range(boundary.size):
        for j in range(i + 1, boundary.size):
            if boundary.next[i] == j or boundary.next[j] == i:
                continue
            edges = np.stack([x[:, boundary.next[i]] - x[:, i], x[:, j] - x[:, boundary.next[j]]], axis=1)
            if abs(np.linalg.det(edges)) > 1e-14:
                s, t = np.linalg.solve(edges, x[:, j] - x[:, i])
                if 0.0 < s < 1.0 and 0.0 < t < 1.0:
                    found.append((i, j))
    return found


@given(SEEDS)
def test_crossings_are_those_of_all_pairs_of_edges(seed):
    """Stars, some of whose points are moved, so that about half of them cross themselves."""
    rng = np.random.default_rng(seed)
    x = star(rng, 16)
    x += rng.choice([0.0, 0.4]) * rng.normal(size=x.shape)
    found = crossed([x])
    assert sorted(map(tuple, found.T.tolist())) == reference_crossings([x])


def test_convex_bodies_turn_back_nowhere_and_a_figure_of_eight_by_a_whole_turn():
    boundary, x, _ = build([regular(40)], [SQUARE])
    assert np.array(turns(boundary, x)) == pytest.approx(2.0 * np.pi * np.array([[1, 1], [0, 0]]), abs=1e-12)
    a = 2.0 * np.pi * (np.arange(100) + 0.5) / 100
    eight = np.array([np.sin(2.0 * a), np.sin(a)])
    assert crossed([eight]).shape[1] == 1
    assert crossed([eight], chosen=()).shape[1] == 0


@given(SEEDS)
def test_turns_are_sums_of_the_angles_at_boundary_points(seed):
    """Of loops through points at random, which wind any number of times, and of a square with a hole."""
    rng = np.random.default_rng(seed)
    o, x, bodies = build([rng.normal(size=(2, rng.integers(3, 20)))], [SQUARE, 0.5 * SQUARE[:, ::-1] + 0.2])
    angle = turning_angles(o, x)
    for sign, turned in zip((1.0, -1.0), turns(o, x), strict=True):
        np.testing.assert_allclose(turned, np.bincount(o.body, np.maximum(sign * angle, 0.0), bodies), atol=1e-12)


def test_a_loop_that_goes_round_twice_crosses_itself_though_it_never_turns_back():
    a = 2.0 * np.pi * (np.arange(60) + 0.25) / 60
    limacon = (0.5 + np.cos(a)) * np.array([np.cos(a), np.sin(a)])
    assert turns(*build([limacon])[:2])[1].max() < 1e-12
    assert crossed([limacon]).shape[1] == 1


def test_a_hole_that_moves_through_the_outer_boundary_crosses_it():
    hole = regular(24, 0.5)[:, ::-1]
    assert crossed([regular(40), hole]).size == 0
    assert crossed([regular(40), hole + np.array([[0.6], [0.0]])]).shape[1] == 2


def test_the_outline_between_two_segments_is_measured_the_shorter_way():
    boundary, x, _ = build([SQUARE], [SQUARE + 2.0, 0.1 * SQUARE[:, ::-1] + 2.3])
    i, j = np.array([0, 0, 4, 4]), np.array([1, 3, 6, 8])
    assert apart(boundary, x, i, j) == pytest.approx([1.0, 1.0, 2.0, np.inf])
