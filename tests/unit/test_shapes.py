"""Ellipses, capsules and rounded polygons against their areas, moments and boundaries."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import skmpm
from skmpm import Body, NeoHookean, Scene, Wall, capsule, ellipse, initial, observe, polygon, simulate
from skmpm.points import check
from skmpm.points.fill import CLEARANCE
from skmpm.preflight.sampling import stress_errors

GEL = NeoHookean(1e6, 0.3, 1000.0)


def shapes(k, R, ratio, sides, spacing, centre=(0.0, 0.0), angle=0.0):
    """One of the shapes with a size of about R."""
    if k == 0:
        return ellipse(centre, (R * ratio, R), spacing=spacing, angle=angle)
    if k == 1:
        return capsule(centre, 2 * R * (ratio - 0.9), R, spacing=spacing, angle=angle)
    return polygon(centre, 1.4 * R, sides, rounding=0.3 * R, spacing=spacing, angle=angle)


def back(points, centre, angle):
    """Positions in the frame of the shape."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]]) @ (points.x - np.array(centre)[:, None])


@settings(max_examples=40)
@given(st.integers(0, 2), st.floats(1.0, 2.5), st.integers(3, 9), st.floats(-2.0, 2.0), st.floats(-9.0, 9.0))
def test_areas_centres_and_boundaries_are_those_of_the_shapes(k, ratio, sides, shift, angle):
    R, h, centre = 1.0, 0.12, (shift, -2.0 * shift)
    points = shapes(k, R, ratio, sides, h, centre, angle)
    assert check(points) is None
    x, boundary = back(points, centre, angle), points.outline[0]
    area = [np.pi * ratio, 4.0 * (ratio - 0.9) + np.pi, None][k]
    if area is None:  # a polygon and a strip around it, of the width of the rounding
        inradius = 1.4 * np.cos(np.pi / sides)
        side = 2.0 * (inradius - 0.3) * np.tan(np.pi / sides)
        area = sides * side * ((inradius - 0.3) / 2.0 + 0.3) + np.pi * 0.3**2
    assert points.volume.sum() == pytest.approx(area, rel=1e-12)
    assert (points.volume @ x.T / area) == pytest.approx([0.0, 0.0], abs=0.01)
    on = x[:, boundary]
    if k == 0:
        assert np.hypot(on[0] / ratio, on[1]) == pytest.approx(np.ones(boundary.size), abs=1e-12)
    elif k == 1:
        end = np.clip(on[0], -(ratio - 0.9), ratio - 0.9)
        assert np.hypot(on[0] - end, on[1]) == pytest.approx(np.ones(boundary.size), abs=1e-12)
    else:  # the largest distance from the centre along the normals of the sides
        normals = np.pi / sides + 2.0 * np.pi * np.arange(sides) / sides
        out = np.max(np.cos(normals)[:, None] * on[0] + np.sin(normals)[:, None] * on[1], axis=0)
        assert out.max() == pytest.approx(inradius, abs=1e-12) and np.hypot(*on).max() < 1.4
    apart = np.hypot(*(np.roll(on, -1, axis=1) - on))
    assert apart.max() < 1.1 * h and apart.min() > 0.85 * h


@pytest.mark.parametrize("sides", range(3, 10))
def test_regular_polygons_have_no_long_axis(sides):
    """Whatever the spacing and the angle: no anisotropy, which noise of uneven boundary points made of them."""
    spacings = np.geomspace(0.05, 0.2, 7)
    bodies = [
        Body(polygon((3.0 * i, 0.0), 1.0, sides, rounding=0.1, spacing=h, angle=0.3 * i), GEL)
        for i, h in enumerate(spacings)
    ]
    scene = Scene(bodies, cell=0.25)
    seen = observe(scene, initial(scene))
    assert np.isnan(seen.bodies.angle).all()
    assert seen.anisotropy == 0.0 and seen.aspect_ratio == 1.0


def test_points_of_a_long_capsule_keep_their_distance_from_its_boundary():
    """A boundary of 4,400 spacings: all points inside are as far from it as those of short ones."""
    L, R, h = 110.0, 0.5, 0.05
    points = capsule((0.0, 0.0), L, R, spacing=h)
    inner = np.setdiff1d(np.arange(points.size), points.outline[0])
    x, y = points.x[:, inner]
    assert (R - np.hypot(np.maximum(np.abs(x) - L / 2.0, 0.0), y)).min() > (CLEARANCE - 0.035) * h


def test_second_moments_of_an_ellipse():
    points = ellipse((0.0, 0.0), (2.0, 1.0), spacing=0.1)
    xx, yy, xy = (points.volume @ (points.x[i] * points.x[j]) for i, j in ((0, 0), (1, 1), (0, 1)))
    assert (xx, yy) == pytest.approx((np.pi * 2.0**3 / 4.0, np.pi * 2.0 / 4.0), rel=0.01)
    assert abs(xy) < 1e-3


def test_a_uniform_stress_is_represented_at_the_usual_spacing():
    """Random sizes, angles and positions at 0.74 cells: `preflight` warns of none."""
    rng = np.random.default_rng(7)
    worst = 0.0
    for i in range(60):
        size = rng.uniform(3.2, 8.0), rng.uniform(1.0, 2.5), int(rng.integers(3, 9))
        points = shapes(i % 3, *size, 0.74, rng.uniform(-1, 1, 2), rng.uniform(0, 7))
        worst = max(worst, float(stress_errors(Scene([Body(points, GEL)], cell=1.0))[0]))
    assert worst < 0.04


def test_shapes_come_to_rest_on_each_other():
    """A capsule, an ellipse and a pentagon fall on each other in a box: the floor carries their weight."""
    R = 1e-2
    bodies = [
        Body(capsule((0.0, R), 2 * R, 0.9 * R, spacing=R / 5), GEL),
        Body(ellipse((0.2 * R, 3.0 * R), (1.6 * R, R), spacing=R / 5, angle=0.2), GEL),
        Body(polygon((-0.3 * R, 5.3 * R), 1.2 * R, 5, rounding=0.3 * R, spacing=R / 5), GEL),
    ]
    sides = [Wall((-2.2 * R, 0), (1, 0), friction=0.4), Wall((2.2 * R, 0), (-1, 0), friction=0.4)]
    scene = Scene(bodies, cell=R / 3.4, walls=[Wall((0, 0), (0, 1), friction=0.4), *sides], friction=0.4,
                  gravity=(0.0, -9.81))  # fmt: skip
    *_, state = simulate(scene, dt=1e-3, until=0.3)
    weight = 9.81 * state.mass.sum()
    assert -state.wall_force[:, 1].sum() == pytest.approx(weight, rel=1e-3)
    assert np.hypot(*state.v).max() < 1e-3


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: ellipse((0, 0), (1.0, 0.0), spacing=0.1),
            "semi_axes = 0.0; give a length in metres, greater than zero",
        ),
        (lambda: ellipse((0, 0), 1.0, spacing=0.1), "semi_axes = 1.0; give two finite numbers"),
        (lambda: ellipse((0, np.nan), (1, 1), spacing=0.1), "centre = .*nan"),
        (lambda: ellipse((0, 0), (1, 1), spacing=0.1, angle=np.inf), "angle = inf; give a finite number"),
        (lambda: ellipse((0, 0), (1, 1), spacing=0.1, angle=[0, 1]), r"angle = \[0, 1\]; give a finite number"),
        (lambda: ellipse((0, 0), (1, 1), spacing=0.1, angle=None), "angle = None; give a finite number"),
        (lambda: capsule((0, 0), 0.0, 1.0, spacing=0.1), "length = 0.0"),
        (lambda: capsule((0, 0), 1.0, -1.0, spacing=0.1), "radius = -1.0"),
        (lambda: polygon((0, 0), 1.0, 2, rounding=0.1, spacing=0.1), "sides is 2; give an integer of three or more"),
        (lambda: polygon((0, 0), 1.0, 3.5, rounding=0.1, spacing=0.1), "sides is 3.5"),
        (lambda: polygon((0, 0), 1.0, 3, rounding=0.51, spacing=0.1), "rounding is 0.51; give less than .* 0.5"),
        (lambda: polygon((0, 0), 1.0, 3, rounding=0.0, spacing=0.1), "rounding = 0.0"),
    ],
)
def test_bad_input_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(
    "shape",
    [
        lambda h: skmpm.disc((0, 0), 3.0, spacing=h),
        lambda h: skmpm.box((0, 0), (3.0, 3.0), spacing=h),
        lambda h: skmpm.ring((0, 0), 1.0, 3.0, spacing=h),
        lambda h: skmpm.ellipse((0, 0), (3.0, 2.0), spacing=h),
        lambda h: skmpm.from_outline([[0, 3, 3, 0], [0, 0, 3, 3]], spacing=h),
    ],
)
def test_lengths_in_two_units_are_refused_before_they_fill_the_memory(shape):
    """Millimetres with a spacing in metres."""
    with pytest.raises(
        ValueError, match=r"spacing is 0\.0003, at which an area of \S+ has \de\+08 points; give both"
    ):
        shape(3e-4)
