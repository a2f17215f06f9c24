"""Points of polygons and digitised contours against areas and moments in closed form, and against `disc`."""

import numpy as np
import pytest

from skmpm import (
    Body,
    NeoHookean,
    Rigid,
    Scene,
    Scheme,
    Wall,
    box,
    disc,
    from_outline,
    initial,
    observe,
    preflight,
    simulate,
)
from skmpm.outline import curve, outlines
from skmpm.points import check
from skmpm.points.fill import CLEARANCE
from skmpm.preflight.sampling import stress_errors

GEL = NeoHookean(1e6, 0.3, 1000.0)
L_SHAPE = np.array([[0.0, 3.0, 3.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0, 2.0, 2.0]])


def circle(R=1.0, n=400, centre=(0.0, 0.0)):
    t = 2.0 * np.pi * np.arange(n) / n
    return R * np.stack([np.cos(t), np.sin(t)]) + np.array(centre)[:, None]


def teeth(n, inner, flat=1):
    """A star of n tips, or a gear with flat tips and roots of two vertices each, of radius 1."""
    t = np.pi * (np.arange(2 * n * flat) + 0.5) / (n * flat)
    return np.where(np.arange(2 * n * flat) // flat % 2 == 0, 1.0, inner) * np.stack([np.cos(t), np.sin(t)])


def contour(rng, n=400):
    """A smooth contour, star-shaped and mostly not convex, of n vertices."""
    t, r = 2.0 * np.pi * np.arange(n) / n, np.ones(n)
    for k in range(2, 7):
        r += 0.375 / k * rng.uniform(-1, 1) * np.cos(k * t + rng.uniform(0, 7))
    return r * np.stack([np.cos(t), np.sin(t)])


def moments(loops):
    """Area, centroid and second moments (xx, yy, xy) about it of polygons, by sums over their edges."""
    area, first, second = 0.0, np.zeros(2), np.zeros(3)
    for k, x in enumerate(loops):
        p, q = x, np.roll(x, -1, axis=1)
        cross = p[0] * q[1] - q[0] * p[1]
        sign = np.sign(cross.sum()) * (1 if k == 0 else -1)
        area += sign * cross.sum() / 2.0
        first += sign * (cross * (p + q)).sum(axis=1) / 6.0
        second[:2] += sign * (cross * (p**2 + p * q + q**2)).sum(axis=1) / 12.0
        second[2] += sign * (cross * (2 * p[0] * p[1] + p[0] * q[1] + q[0] * p[1] + 2 * q[0] * q[1])).sum() / 24.0
    c = first / area
    return area, c, second - area * np.array([c[0] ** 2, c[1] ** 2, c[0] * c[1]])


def encloses(x, y):
    """Whether the polygon x (2, m) winds around the points y (2, n): the angles under which they see its edges."""
    arms = (x[0] + 1j * x[1])[:, None] - (y[0] + 1j * y[1])
    return np.abs(np.angle(np.roll(arms, -1, axis=0) / arms).sum(axis=0)) > np.pi


def distances(x, y):
    """Of points y (2, n) from the edges of the polygon x (2, m), (n,)."""
    a, d = x[:, :, None], (np.roll(x, -1, axis=1) - x)[:, :, None]
    s = np.clip(((y[:, None] - a) * d).sum(axis=0) / (d**2).sum(axis=0), 0.0, 1.0)
    return np.hypot(*(a + s * d - y[:, None])).min(axis=0)


SHAPES = {
    "L": [L_SHAPE],
    "star": [teeth(5, 0.45)],
    "gear": [teeth(8, 0.6, flat=2)],
    "ring": [circle(), circle(0.5)[:, ::-1]],
    "frame": [4.0 * np.array([[0, 1, 1, 0], [0, 0, 1, 1]]), np.array([[1.0, 3.0, 2.0], [1.0, 1.0, 3.0]])],
    "blob": [contour(np.random.default_rng(5))],
    "notch": [np.array([[-1.0, 1.0, 1.0, 0.05, 0.0, -0.05, -1.0], [0.0, 0.0, 1.5, 1.5, 0.7, 1.5, 1.5]])],
    "slit": [np.array([[0, 2, 2, 0.3, 0.3, 2, 2, 0], [0, 0, 0.5, 0.5, 0.53, 0.53, 1, 1]])],
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("angle", [0.0, 0.4, 1.9])
def test_areas_and_moments_are_those_of_the_polygon(name, angle):
    c, s = np.cos(angle), np.sin(angle)
    loops = [np.array([[c, -s], [s, c]]) @ x + [[2.0], [-7.0]] for x in SHAPES[name]]
    h = 0.1
    points = from_outline(loops, spacing=h)
    assert check(points) is None and len(points.outline) == len(loops)
    x, V = points.x, points.volume
    area, centre, second = moments(loops)
    assert V.sum() == pytest.approx(area, rel=1e-12)
    assert V.min() > 0.005 * h**2
    size = np.sqrt(area)
    assert x @ V / area == pytest.approx(centre, abs=0.003 * size)
    arm = x - centre[:, None]
    mine = np.array([arm[0] ** 2 @ V, arm[1] ** 2 @ V, arm[0] * arm[1] @ V])
    assert mine == pytest.approx(second, abs=0.015 * second[:2].sum())
    boundary = np.concatenate(points.outline)
    for k, loop in enumerate(loops):
        assert distances(loop, x[:, points.outline[k]]).max() < 0.01 * h
    inner = np.delete(x, boundary, axis=1)
    assert (encloses(loops[0], inner)).all() and not any(encloses(loop, inner).any() for loop in loops[1:])
    assert min(distances(loop, inner).min() for loop in loops) > (CLEARANCE - 0.03) * h


def test_no_point_lies_outside_beside_a_sliver():
    """Beside a tip of half a degree the nearest side may be the far one; what lies inside is not told by it."""
    x = np.array([[4.77, -7.4, 3.7, 8.53, -7.06], [10.39, 3.88, -10.66, -5.02, 3.77]])
    points = from_outline(x, spacing=0.74)
    assert encloses(x, np.delete(points.x, points.outline[0], axis=1)).all()
    area, centre, _ = moments([x])
    assert points.x @ points.volume / area == pytest.approx(centre, abs=0.02)


@pytest.mark.parametrize("name", ["L", "star", "gear", "frame"])
def test_corners_are_points_and_sides_have_equal_intervals(name):
    h, loops = 0.1, SHAPES[name]
    points = from_outline([x[:, ::-1] for x in loops], spacing=h)
    for vertices, loop in zip(loops, points.outline, strict=True):
        x = points.x[:, loop]
        assert np.hypot(*(x[:, None] - vertices[:, :, None])).min(axis=1).max() < 1e-12
        apart = np.hypot(*(np.roll(x, -1, axis=1) - x))
        assert 0.7 * h < apart.min() and apart.max() < 1.34 * h


@pytest.mark.parametrize("factor", [1e-9, 1.0, 1e6])
def test_the_sense_repeated_vertices_and_units_change_nothing(factor):
    x = factor * L_SHAPE
    expected = from_outline(x, spacing=0.1 * factor)
    repeated = np.repeat(np.append(x, x[:, :1], axis=1), 2, axis=1)
    for other in (repeated, repeated[:, ::-1], [x], (x[0].tolist(), x[1].tolist())):
        points = from_outline(other, spacing=0.1 * factor)
        assert points.size == expected.size
        assert points.volume.sum() == pytest.approx(4.0 * factor**2, rel=1e-12)


def test_a_contour_of_pixels_has_no_corners_but_its_own():
    """Steps of a fifth of a spacing around a quarter of a disc, whose three corners stay."""
    R, h, pixel = 8.0, 1.0, 0.2
    n = round(R / pixel)
    y = pixel * np.arange(n + 1)
    x = pixel * np.rint(np.sqrt(np.maximum(R**2 - (y[:-1] + 0.5 * pixel) ** 2, 0.0)) / pixel)
    steps = np.stack([np.repeat(x, 2), np.repeat(y, 2)[1:-1]])
    vertices = np.concatenate([[[0.0], [0.0]], steps, [[0.0], [R]]], axis=1)
    points = from_outline(vertices, spacing=h)
    loop = points.x[:, points.outline[0]]
    assert points.volume.sum() == pytest.approx(np.pi * R**2 / 4.0, rel=0.01)
    assert loop.shape[1] == pytest.approx((2.0 + np.pi / 2.0) * R / h, abs=4)
    apart = np.hypot(*(np.roll(loop, -1, axis=1) - loop))
    assert apart.min() > 0.5 * h and apart.max() < 1.3 * h


def test_a_digitised_circle_is_a_disc():
    """400 vertices: as many boundary points, the same area, moments and force between two walls."""
    R, cell = 1e-3, 1e-4
    force = []
    for points in (disc((0, R), R, spacing=0.74 * cell), from_outline(circle(R, 400, (0, R)), spacing=0.74 * cell)):
        assert len(points.outline[0]) == 85
        assert points.volume.sum() == pytest.approx(np.pi * R**2, rel=1e-4)
        arm = points.x - [[0.0], [R]]
        assert (arm**2 @ points.volume) == pytest.approx(np.full(2, np.pi * R**4 / 4.0), rel=0.01)
        walls = [Wall((0, 0), (0, 1)), Wall((0, 2 * R), (0, -1), velocity=(0, -0.02 * R))]
        scene = Scene([Body(points, GEL)], cell=cell, walls=walls)
        *_, state = simulate(scene, dt=0.5, until=2.0, scheme=Scheme(inertia=False))
        force.append(state.wall_force[1, 1])
    assert force[1] == pytest.approx(force[0], rel=0.02)


def of_pixels(side, shift):
    """The contour (2, n) of the pixels of a side whose centres, shifted by so many sides, are in a circle of 1."""
    i = np.arange(-np.ceil(1.0 / side) - 2, np.ceil(1.0 / side) + 3)
    inside = {(a, b) for a in i for b in i if (a + shift) ** 2 + (b + shift) ** 2 < side**-2}
    to = dict[tuple[float, float], tuple[float, float]]()
    for a, b in inside:
        corners = [(a, b), (a + 1, b), (a + 1, b + 1), (a, b + 1)]
        for k, beside in enumerate([(a, b - 1), (a + 1, b), (a, b + 1), (a - 1, b)]):
            if beside not in inside:
                to[corners[k]] = corners[(k + 1) % 4]
    path = [min(to)]
    while len(path) < len(to):
        path.append(to[path[-1]])
    return side * (np.array(path).T + shift - 0.5)


def noisy(n, share):
    return (1.0 + share * np.random.default_rng(4).standard_normal(n)) * circle(n=n)


@pytest.mark.parametrize(
    ("vertices", "spacings", "off", "tilt"),
    [
        (noisy(200, 0.005), 2, 0.01, 10.0),
        (noisy(400, 0.01), 3, 0.015, 12.0),
        (of_pixels(0.05, 0.0), 3, 0.025, 20.0),
        (of_pixels(0.05, 0.3), 3, 0.025, 20.0),
        (of_pixels(0.1, 0.2), 4, 0.05, 35.0),
    ],
)
def test_smoothing_takes_out_noise_and_pixels(vertices, spacings, off, tilt):
    """A disc with R/h = 12: no corners, near the circle in place and direction, with the area that was given."""
    h = 0.7 / 12
    points = from_outline(vertices, spacing=h, smoothing=spacings * h)
    given = moments([vertices])[0]
    assert points.volume.sum() == pytest.approx(given, rel=1e-12)
    own = outlines([points.outline], offsets=[0])
    x = points.x[:, points.outline[0]]
    assert not curve(own, x).corner.any()
    assert np.abs(np.hypot(*x) / np.sqrt(given / np.pi) - 1.0).max() < off
    side, middle = np.roll(x, -1, axis=1) - x, 0.5 * (np.roll(x, -1, axis=1) + x)
    sine = np.abs((side * middle).sum(axis=0)) / (np.hypot(*side) * np.hypot(*middle))
    assert np.rad2deg(np.arcsin(sine)).max() < tilt


def test_smoothing_is_a_moving_average_of_the_same_area():
    """Of a square, against means of many places along a window, whose area the shoelace formula gives."""
    L, h, n = 0.4, 0.01, 4000
    u = (np.arange(n) + 0.5) / n * 4.0
    side, along = np.floor(u).astype(int), u % 1.0
    x = SQUARE[:, side] + along * (np.roll(SQUARE, -1, axis=1) - SQUARE)[:, side] + [[5.0], [-3.0]]
    width = round(n * L / 4.0)
    mean = np.mean([np.roll(x, k, axis=1) for k in range(-width // 2, width // 2)], axis=0)
    centre = np.array([[5.5], [-2.5]])
    mean = centre + (mean - centre) / np.sqrt(moments([mean])[0])
    points = from_outline(SQUARE + np.array([[5.0], [-3.0]]), spacing=h, smoothing=L)
    assert distances(mean, points.x[:, points.outline[0]]).max() < 5e-4
    assert points.volume.sum() == pytest.approx(1.0, rel=1e-12)


def test_smoothing_goes_with_holes_and_arcs():
    outer, hole = noisy(400, 0.005), 0.5 * noisy(200, 0.005) + [[0.2], [0.1]]
    points = from_outline([outer, hole], spacing=0.06, smoothing=0.15, rounding=0.05)
    assert check(points) is None and len(points.outline) == 2
    assert points.volume.sum() == pytest.approx(moments([outer, hole])[0], rel=1e-4)
    centre = points.x[:, points.outline[1]].mean(axis=1)
    assert centre == pytest.approx([0.2, 0.1], abs=0.01)


def test_vertices_that_nearly_repeat_are_one():
    """The first vertex again, and others, up to 3e-8 spacings away and turned back: no crossing, the same points."""
    beside = 3e-9 * np.random.default_rng(1).uniform(-1.0, 1.0, (2, 6, 3))
    x = (L_SHAPE[:, :, None] + np.concatenate([np.zeros((2, 6, 1)), beside], axis=2)).reshape(2, -1)
    expected, points = from_outline(L_SHAPE, spacing=0.1), from_outline(x, spacing=0.1)
    np.testing.assert_allclose(points.x, expected.x, atol=1e-7)
    with pytest.raises(ValueError, match="too large for the thinnest part"):
        from_outline(1e-9 * SQUARE, spacing=1e-6)


@pytest.mark.parametrize(("inside", "radius"), [(0, 0.2), (1, 0.2), (0, 0.99)])
def test_arcs_replace_corners(inside, radius):
    """An L with 5 convex corners and one re-entrant; or a square hole, whose corners are all re-entrant."""
    square = np.array([[0.0, 2.0, 2.0, 0.0], [0.0, 0.0, 2.0, 2.0]])
    loops = [2.0 * square - 1.0, square] if inside else [square if radius > 0.5 else L_SHAPE]
    points = from_outline(loops, spacing=0.1, rounding=radius)
    cut = radius**2 * (1.0 - np.pi / 4.0)  # of a right angle
    area = 12.0 if inside else 4.0
    area -= 0.0 if inside else 4.0 * cut  # an arc of the L that is re-entrant adds what one of five takes
    assert points.volume.sum() == pytest.approx(area, rel=1e-12)
    scene = Scene([Body(points, GEL)], cell=0.135)
    assert observe(scene, initial(scene)).bodies.area.sum() == pytest.approx(area, rel=2e-3)
    x = points.x[:, points.outline[-1]]
    turn = np.angle(np.exp(1j * np.diff(np.unwrap(np.angle((np.roll(x, -1, 1) - x).T @ [1, 1j])))))
    assert np.abs(turn).max() < np.deg2rad(50.0)


def shape(k, rng):
    if k == 0:
        return contour(rng)
    if k == 1:
        a, b = rng.uniform(0.3, 0.7, 2)
        return np.array([[0, 2, 2, 2 * a, 2 * a, 0], [0, 0, 2 * b, 2 * b, 2, 2.0]])
    return teeth(int(rng.integers(6, 12)), rng.uniform(0.7, 0.88), flat=2)


def test_a_uniform_stress_is_represented_at_the_usual_spacing():
    """Of 90 contours, L-shapes and gears with points 0.74 cells apart `preflight` would warn of one, a gear."""
    rng, errors = np.random.default_rng(3), []
    for i in range(90):
        x, angle = rng.uniform(3.2, 8.0) * shape(i % 3, rng), rng.uniform(0, 7)
        turned = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ x
        points = from_outline(turned + rng.uniform(-1, 1, (2, 1)), spacing=0.74)
        assert check(points) is None
        errors.append(float(stress_errors(Scene([Body(points, GEL)], cell=1.0))[0]))
    assert max(errors) < 0.035 and np.count_nonzero(np.array(errors) > 0.01) == 1


def test_a_seal_fills_a_groove():
    """A soft disc under a lid fills a rigid groove that is 0.25 % wider, and hands the force of the lid to it."""
    R = 1e-3
    arc = np.linspace(0.0, -np.pi, 61)
    x = np.concatenate([[1.0], np.cos(arc), [-1.0, -2.0, -2.0, 2.0, 2.0]])
    y = np.concatenate([[1.0], np.sin(arc), [1.0, 1.0, -2.0, -2.0, 1.0]])
    groove = from_outline(R * np.stack([x, y]), spacing=0.15 * R)
    assert groove.volume.sum() == pytest.approx((12.0 - 2.0 - np.pi / 2.0) * R**2, rel=1e-3)
    seal = disc((0.0, 0.0), 0.9975 * R, spacing=0.15 * R)
    bodies = [Body(groove, Rigid(2000.0), motion=(0, 0, 0)), Body(seal, NeoHookean(1e5, 0.45, 1000.0))]
    lid = Wall((0, R), (0, -1), velocity=(0, -0.05 * R))
    scene = Scene(bodies, cell=0.2 * R, walls=[lid], friction=0.3)
    assert not preflight(scene, until=3.0).warnings
    *_, state = simulate(scene, until=3.0, scheme=Scheme(inertia=False))
    assert state.wall_force[0, 1] > 1.0
    assert state.body_force[:, 0] == pytest.approx([0.0, -state.wall_force[0, 1]], abs=0.01 * state.wall_force[0, 1])
    boundary = state.x[:, scene.owner == 1][:, seal.outline[0]]
    assert np.abs(boundary[0]).max() == pytest.approx(R, rel=1e-3)


STAR_CROSSED = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 1.0, 0.0, 1.0]])
SQUARE = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])


@pytest.mark.parametrize(
    ("vertices", "options", "message"),
    [
        ("grain.csv", {}, "vertices is 'str'; give positions"),
        ([], {}, "vertices is 'list'; give positions"),
        (SQUARE.T, {}, r"loop 0 has shape \(4, 2\); give v.T of these v, \(2, n\), components first"),
        (SQUARE.T[:, None], {}, r"loop 0 has shape \(4, 1, 2\); give v\[:, 0\].T of these v, \(2, n\)"),
        ([SQUARE, SQUARE.T[:, None]], {}, r"loop 1 has shape \(4, 1, 2\); give v\[:, 0\].T of these v, \(2, n\)"),
        (SQUARE[:, :2], {}, r"loop 0 has shape \(2, 2\); give .* three vertices or more"),
        (np.repeat(SQUARE[:, :2], 2, axis=1), {}, "loop 0 has no area; list three vertices or more"),
        (SQUARE * [[1.0], [np.nan]], {}, "vertex 0 of loop 0 is not finite; leave it out"),
        ([[0.0, 1.0, 2.0], [0.0, 1.0, 2.0]], {}, "loop 0 has no area"),
        (STAR_CROSSED, {}, "vertices: the outline crosses itself: edges 0-1 and 2-3"),
        ([SQUARE, SQUARE + 0.5], {}, "vertices: outline loops 0 and 1 cross"),
        ([SQUARE, SQUARE + 2.0], {}, "loop 1 is no hole, it lies outside"),
        ([SQUARE, 0.8 * SQUARE + 0.1, 0.4 * SQUARE + 0.3], {}, "loop . is no hole, it lies .* another"),
        ([SQUARE, 0.5 * SQUARE], {}, r"the boundary touches itself at \[0. 0.\] m; move its parts apart"),
        ([SQUARE, 0.5 * SQUARE + [[0.25], [0.5]]], {}, r"spacing is 0.1; a slit, notch or part at .* needs a"),
        (SQUARE, {"spacing": 0.0}, "spacing = 0.0; give a length in metres, greater than zero"),
        (SQUARE, {"spacing": [0.1]}, r"spacing = \[0.1\]; give a length in metres, greater than zero"),
        (SQUARE, {"spacing": 2.5}, "spacing is 2.5, too large for the thinnest part of 1 m; give 2 or less"),
        (SQUARE * [[1.0], [0.04]], {}, "too large for the thinnest part of 0.04 m; give 0.08 or less"),
        (teeth(12, 0.7, 2), {"spacing": 0.9}, "spacing is 0.9; the polygon of boundary points has 125 % of the area"),
        (SQUARE, {"rounding": -0.1}, "rounding = -0.1; give a length in metres of zero or more"),
        (SQUARE, {"smoothing": -1}, "smoothing = -1; give a length in metres of zero or more"),
        (SQUARE, {"spacing": 1e-6, "smoothing": 0.3}, "spacing is 1e-06, at which an area of 1 has 1e[+]12 points"),
        (SQUARE, {"smoothing": 2.0}, "smoothing is 2; the average of loop 0, which is 4 m long, has .* %"),
        (circle(), {"smoothing": 50.0}, "the average of loop 0, which is 6.28 m long, has 0 % of its area"),
        ([SQUARE, 0.5 * SQUARE + [[0.25], [0.002]]], {"smoothing": 0.3}, "the averages of the loops cross"),
        (SQUARE, {"rounding": 0.6}, r"rounding is 0.6, its arcs need 1.2 m of the side of 1 m .* give 0.495 or less"),
        (circle(), {"rounding": 1.01}, "rounding is 1.01, its arcs need .* give 0.99 or less"),
    ],
)  # fmt: skip
def test_bad_input_is_refused(vertices, options, message):
    with pytest.raises(ValueError, match=message):
        from_outline(vertices, **{"spacing": 0.1} | options)


def test_the_area_of_a_box_is_sampled_as_by_box():
    points = from_outline(SQUARE, spacing=0.1)
    other = box((0, 0), (1, 1), spacing=0.1)
    assert len(points.outline[0]) == 40
    assert points.volume.sum() == pytest.approx(other.volume.sum(), rel=1e-12)
