"""Packings of convex shapes: no overlap by another code, the fraction wanted, reproducible; errors."""

import sys
from functools import cache

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

import skmpm
from skmpm.outline import area, outlines, overlap
from skmpm.packing import PackingError, generator, packing
from skmpm.packing.discs import Box, rows
from skmpm.packing.shapes import _contacts, shapes_of
from skmpm.points import Points, box, capsule, disc, ellipse, from_outline, polygon

R, SPACING = 1e-3, 0.25e-3


def mixture(count, unit=1.0):
    """Shapes of five kinds in turn."""
    rng, h, zero = np.random.default_rng(0), SPACING * unit, (0.0, 0.0)
    kinds = (
        lambda r: disc(zero, r, spacing=h),
        lambda r: ellipse(zero, (1.4 * r, r / 1.4), spacing=h),
        lambda r: capsule(zero, 1.5 * r, 0.7 * r, spacing=h),
        lambda r: polygon(zero, 1.4 * r, 3, rounding=0.25 * r, spacing=h),
        lambda r: box(zero, (1.5 * r, 1.2 * r), spacing=h),
    )
    return [kinds[i % len(kinds)](unit * R * rng.uniform(0.8, 1.2)) for i in range(count)]


def width_of(clouds):
    return np.sqrt(sum(cloud.volume.sum() for cloud in clouds) / 0.7)


@cache
def packed(count=15, solid_fraction=0.65, friction=0.0, seed=0):
    clouds = mixture(count)
    return packing(clouds, width_of(clouds), solid_fraction=solid_fraction, friction=friction, seed=seed)


def disjoint(a, b):
    """Whether a line separates two convex polygons (2, m), by a linear programme: n.x >= c + s, n.y <= c - s."""
    rows = [
        np.vstack([-a, np.ones(a.shape[1]), np.ones(a.shape[1])]),
        np.vstack([b, -np.ones(b.shape[1]), np.ones(b.shape[1])]),
    ]
    upper = np.concatenate([row.T for row in rows])
    found = linprog(
        [0, 0, 0, -1], A_ub=upper, b_ub=np.zeros(len(upper)), bounds=[(-1, 1), (-1, 1), (None, None), (None, None)]
    )
    return found.status == 0 and found.x[3] > -1e-6 * R


@pytest.mark.slow
@pytest.mark.parametrize(("solid_fraction", "friction"), [(0.4, 0.0), (0.7, 0.0), (0.6, 0.5)])
def test_shapes_do_not_overlap_at_the_fraction_asked(solid_fraction, friction):
    """By a separating line for every pair of outlines, and by the overlap code of the library."""
    p = packed(15, solid_fraction, friction)
    loops = [points.x[:, points.outline[0]] for points in p.points]
    assert all(disjoint(a / R, b / R) for i, a in enumerate(loops) for b in loops[:i])
    for x in loops:
        assert x.min() > -1e-5 * R and (x.max(axis=1) < np.array([p.width, p.height]) + 1e-5 * R).all()
    sizes = sum(points.volume.sum() for points in p.points)
    assert sizes / (p.width * p.height) == pytest.approx(solid_fraction, rel=1e-12)
    x = np.concatenate(loops, axis=1)
    counts = [loop.shape[1] for loop in loops]
    boundary = outlines([(np.arange(n),) for n in counts], np.append(0, np.cumsum(counts)).astype(np.int64))
    _, shared = overlap(boundary, x, len(loops))
    assert shared.sum() < 1e-8 * area(boundary, x, len(loops)).sum()
    skmpm.Scene([skmpm.Body(points, skmpm.NeoHookean(1e6, 0.3, 1e3)) for points in p.points], cell=R / 4)


def test_shapes_keep_their_size_and_lie_at_any_angle():
    p, clouds = packed(), mixture(15)
    for points, cloud, centre in zip(p.points, clouds, p.centres.T, strict=True):
        assert np.array_equal(points.volume, cloud.volume)
        np.testing.assert_allclose(np.average(points.x, axis=1, weights=points.volume), centre, atol=1e-9 * R)
        lengths = [np.hypot(*np.diff(c.x[:, c.outline[0]], axis=1)) for c in (points, cloud)]
        np.testing.assert_allclose(*lengths, rtol=1e-9)
    sides = np.array([points.x[:, 1] - points.x[:, 0] for points in p.points[1::5]])
    assert np.unique(np.round(np.arctan2(sides[:, 1], sides[:, 0]), 6)).size == len(sides)
    np.testing.assert_allclose(np.pi * p.radii**2, [cloud.volume.sum() for cloud in clouds])


def test_the_seed_decides_and_the_unit_of_length_does_not():
    a, clouds = packed(), mixture(15)
    again = packing(clouds, width_of(clouds), solid_fraction=0.65)
    assert np.array_equal(a.centres, again.centres) and np.array_equal(a.points[3].x, again.points[3].x)
    assert np.abs(a.centres - packed(seed=1).centres).max() > 0.1 * R
    large = mixture(15, 1e3)
    np.testing.assert_allclose(
        packing(large, width_of(large), solid_fraction=0.65).centres, 1e3 * a.centres, rtol=1e-11
    )


def test_groups_go_with_the_points():
    clouds = [c.with_groups(lambda x: np.where(x[0] < 0, "left", "right")) for c in mixture(5)]
    p = packing(clouds, width_of(clouds), solid_fraction=0.4)
    assert all(np.array_equal(points.group, cloud.group) for points, cloud in zip(p.points, clouds, strict=True))


def test_gaps_change_as_the_rows_say():
    """Central differences of the gaps of shapes that nearly touch, for any motion with rotations."""
    rng, clouds = np.random.default_rng(0), mixture(4)[1:]
    shapes = shapes_of(clouds, R)
    x = np.array([[3.0, 5.2, 4.1], [3.0, 3.2, 5.0], [0.3, 1.1, 2.0]])
    big = Box(np.array([50.0, 50.0]), np.full(2, False))
    d = 1e-6 * rng.normal(size=x.shape)
    start, plus, minus = (_contacts(shapes, at, 1.0, big) for at in (x, x + d, x - d))
    assert start.gap.size == plus.gap.size == minus.gap.size > 2
    change = rows(start, start.normal, 3) @ d.ravel()
    np.testing.assert_allclose(change, 0.5 * (plus.gap - minus.gap), atol=1e-3 * np.abs(d).max())


def two_pieces():
    """Two discs side by side as one shape."""
    one, other = (disc((x, 0.0), 1.0, spacing=0.3) for x in (0.0, 2.5))
    loops = one.outline[0], one.size + other.outline[0]
    return Points(np.hstack([one.x, other.x]), np.append(one.volume, other.volume), loops)


@pytest.mark.slow
def test_a_jam_says_at_which_fraction(monkeypatch):
    monkeypatch.setattr(generator, "_ATTEMPTED_SHAPES", 0)  # one attempt
    with pytest.raises(
        PackingError, match=r"the shapes jam at a solid fraction of 0\.[4-9]\d{3}, below the requested 0\.97"
    ):
        clouds = mixture(5)
        packing(clouds, 1.2 * width_of(clouds), solid_fraction=0.97)


@pytest.mark.parametrize(
    ("shapes", "message"),
    [
        (["disc"], "expected radii in metres, or a list of skmpm.Points, got a list of str"),
        ([disc((0, 0), 1.0, spacing=0.3), 1.0], "got a list of Points and float"),
        ([two_pieces()], "shape 0 has 2 outer loops; packing takes shapes of one piece"),
        ([Points(np.random.default_rng(0).random((2, 9)), np.ones(9))], "shape 0 has no outline"),
        (
            [Points(np.array([[0, 2, 1, 2, 0.0], [0, 0, 1, 2, 2]]), np.ones(5), (np.arange(5),))],
            "shape 0 is not convex at",
        ),
    ],
)
def test_says_what_is_wrong(shapes, message):
    with pytest.raises(PackingError, match=message):
        packing(shapes, 10.0, solid_fraction=0.3)


def test_shapes_thicker_than_their_box_are_refused_at_once():
    """They were grown for half a minute, and another seed was recommended."""
    rods = [capsule((0.0, 0.0), 4e-3, 0.5e-3, spacing=0.2e-3)] * 4
    with pytest.raises(PackingError, match=r"the box is 1 x .* m, the largest shape is 0\.001 m thick; change the"):
        packing(rods, width=1.0, solid_fraction=0.5)


def test_rods_fit_in_a_box_narrower_than_discs_of_their_areas():
    """Ten of 3.2 x 0.8, whose discs are 1.7 across, in a width of 1.6: their angles adapt."""
    rods = [capsule((0.0, 0.0), 2.4 * R, 0.4 * R, spacing=SPACING)] * 10
    packed = packing(rods, width=1.6 * R, solid_fraction=0.35)
    ends = np.concatenate([points.x[0, points.outline[0]] for points in packed.points])
    assert 2.0 * packed.radii.max() > packed.width
    assert ends.min() > -1e-5 * R and ends.max() < packed.width + 1e-5 * R


def test_discs_never_enter_the_code_of_shapes(monkeypatch):
    monkeypatch.setattr(sys.modules["skmpm.packing.shapes"], "separate", None)
    assert packing(np.full(10, R), 8 * R, solid_fraction=0.5).points == ()


def test_placed_moves_and_turns_a_cloud():
    cloud = box((0, 0), (2, 1), spacing=0.25)
    placed = cloud.placed((5.0, 6.0), np.pi / 2)
    np.testing.assert_allclose(placed.x, [5.5 - cloud.x[1], 5.0 + cloud.x[0]], atol=1e-12)


def bean(i):
    """Vertices (2, n) of a concave grain, far from the origin and turned."""
    t = np.linspace(0.0, 2.0 * np.pi, 240, endpoint=False)
    x = R * (1.5 * np.cos(t) + 1j * (0.5 * np.sin(t) + np.cos(t) ** 2)) * np.exp(1j * i)
    return np.stack([x.real + 3.0 * R, x.imag - 2.0 * R])


def test_grains_lie_in_their_hulls():
    """Hulls placed by hand are those packed; concave grains are within them, and overlap no other."""
    vertices = [bean(i) for i in range(6)]
    convex = [x[:, ConvexHull(x.T).vertices] for x in vertices]
    grains, hulls = ([from_outline(x, spacing=0.15 * R) for x in xs] for xs in (vertices, convex))
    p = packing(hulls, 6.0 * R, solid_fraction=0.6, seed=3)
    assert p.angles.shape == (6,) and np.ptp(p.angles) > 0.5
    placed = []
    for grain, hull, centre, angle, points in zip(grains, hulls, p.centres.T, p.angles, p.points, strict=True):
        about = np.average(hull.x, axis=1, weights=hull.volume)
        turn = np.exp(1j * angle)
        z = (hull.x - about[:, None]).T @ [1.0, 1j] * turn + centre @ [1.0, 1j]
        np.testing.assert_allclose(points.x, [z.real, z.imag], rtol=0.0, atol=1e-14 * p.width)
        placed.append(grain.placed(centre, angle, about=about))
        boundary = points.x[:, points.outline[0]]
        side = np.roll(boundary, -1, axis=1) - boundary
        arm = placed[-1].x[:, None] - boundary[:, :, None]
        depth = (side[0, :, None] * arm[1] - side[1, :, None] * arm[0]) / np.hypot(*side)[:, None]
        assert depth.min() > -0.01 * R  # by the sagitta of segments of the hull's boundary
        assert np.hypot(*(np.average(grain.x, axis=1, weights=grain.volume) - about)) > 0.05 * R
    gel = skmpm.NeoHookean(1e6, 0.3, 1000.0)
    scene = skmpm.Scene([skmpm.Body(points, gel) for points in placed], cell=0.2 * R)
    assert skmpm.observe(scene, skmpm.initial(scene)).overlap < 1e-6
    assert not packing([R] * 3, 6.0 * R, solid_fraction=0.3).angles.any()


def test_shapes_in_a_periodic_box():
    """Ellipses, capsules and polygons across the edges overlap no other and no image, by the check of the scene."""
    spacing, rng = 0.2 * R, np.random.default_rng(2)
    kinds = [ellipse((0, 0), (1.4 * R, 0.8 * R), spacing=spacing), capsule((0, 0), 1.2 * R, 0.7 * R, spacing=spacing),
             polygon((0, 0), 1.1 * R, 5, rounding=0.2 * R, spacing=spacing)]  # fmt: skip
    clouds = [kinds[k] for k in rng.integers(0, 3, 24)]
    packed = packing(clouds, 10.0 * R, solid_fraction=0.72, periodic=True, seed=1)
    gel = skmpm.NeoHookean(1e6, 0.3, 1000.0)
    box = skmpm.Periodic(packed.width, packed.height)
    scene = skmpm.Scene([skmpm.Body(cloud, gel) for cloud in packed.points], cell=0.25 * R, periodic=box)
    assert skmpm.observe(scene, skmpm.initial(scene)).overlap < 1e-9
    x = np.concatenate([cloud.x for cloud in packed.points], axis=1)
    assert x.min() < 0.0 or ([packed.width, packed.height] < x.T).any()
    again = packing(clouds, 10.0 * R, solid_fraction=0.72, periodic=True, seed=1)
    assert np.array_equal(again.centres, packed.centres)
    with pytest.raises(PackingError, match="less than twice the largest shape"):
        packing(clouds[:3], 3.5 * R, solid_fraction=0.7, periodic=True)
