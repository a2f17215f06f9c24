"""The smooth curve through the boundary points: order, normals, corners and projection."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skmpm.outline import curve, outlines
from skmpm.outline.cubics import seen


def ring(n, radius=1.0):
    angle = 2.0 * np.pi * np.arange(n) / n
    return radius * np.stack([np.cos(angle), np.sin(angle)])


def one_body(x):
    return outlines([[np.arange(x.shape[1])]], [0, x.shape[1]])


def everywhere(n, parts=7):
    return np.repeat(np.arange(n), parts), np.tile(np.linspace(0.0, 1.0, parts), n)


def test_leaves_the_circle_by_the_fourth_power_of_the_spacing():
    """The polygon's sagitta is 1 - cos(pi/n), order 2; the cubics' distance from the circle is of order 4."""
    errors = []
    for n in (16, 32, 64):
        x = ring(n)
        c = curve(one_body(x), x)
        errors.append(np.abs(np.hypot(*c.through(x).at(*everywhere(n))) - 1.0).max())
    rates = np.log2(np.divide(errors[:-1], errors[1:]))
    assert (rates > 3.9).all()
    assert errors[1] < 0.01 * (1.0 - np.cos(np.pi / 32))


@pytest.mark.parametrize("uneven", [0.0, 0.3])
def test_leaves_an_ellipse_by_the_fourth_power_of_the_spacing_and_its_normals_by_the_third(uneven):
    """Half axes 1 and 0.6, points even in the angle or not; parabolas leave it by the third and the second power."""
    apart, turned = [], []
    axes = np.array([[1.0], [0.6]])
    for n in (32, 64, 128):
        angle = 2.0 * np.pi * np.arange(n) / n
        angle += uneven * 2.0 * np.pi / n * np.sin(5.0 * angle)
        x = axes * np.stack([np.cos(angle), np.sin(angle)])
        shape = curve(one_body(x), x).through(x)
        y, normal = shape.at(*everywhere(n)), shape.normals(*everywhere(n))
        slope = y / axes**2
        apart.append(np.abs(((y / axes) ** 2).sum(axis=0) - 1.0).max())
        turned.append(np.abs((slope[0] * normal[1] - slope[1] * normal[0]) / np.hypot(*slope)).max())
    assert (np.log2(np.divide(apart[:-1], apart[1:])) > 3.7).all()
    assert (np.log2(np.divide(turned[:-1], turned[1:])) > 2.7).all()


@given(st.integers(0, 2**32 - 1))
def test_shares_are_a_partition_of_unity_and_normals_are_continuous(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(12, 40))
    reference = ring(n) * (1.0 + 0.02 * rng.normal(size=n))
    c = curve(one_body(reference), reference)
    x = reference + 0.02 * rng.normal(size=(2, n))
    segment, s = everywhere(n)
    assert np.allclose(c.weights(segment, s).sum(axis=0), 1.0, atol=1e-12)
    assert np.allclose(c.weights(segment, s, 1).sum(axis=0), 0.0, atol=1e-12)
    i = np.flatnonzero(~c.corner)
    before = c.outlines.previous[i]
    assert np.allclose(c.through(x).at(before, np.ones(i.size)), x[:, i], atol=1e-12)
    assert np.allclose(
        c.through(x).normals(before, np.ones(i.size)), c.through(x).normals(i, np.zeros(i.size)), atol=1e-9
    )


@given(st.floats(0.05, 0.95))
def test_derivatives_by_differences(s):
    x = ring(20) * np.array([[1.0], [0.7]])
    c = curve(one_body(x), x)
    segment, s, e = np.arange(20), np.full(20, s), 1e-6
    for order in (0, 1):
        difference = (c.through(x).at(segment, s + e, order) - c.through(x).at(segment, s - e, order)) / (2.0 * e)
        assert np.allclose(difference, c.through(x).at(segment, s, order + 1), atol=1e-8)


def test_corners_stay_and_sides_stay_straight():
    side = np.linspace(0.0, 1.0, 6)[:-1]
    x = np.concatenate(
        [
            np.stack([side, 0 * side]),
            np.stack([1 + 0 * side, side]),
            np.stack([1 - side, 1 + 0 * side]),
            np.stack([0 * side, 1 - side]),
        ],
        axis=1,
    )
    c = curve(one_body(x), x)
    assert np.flatnonzero(c.corner).tolist() == [0, 5, 10, 15]
    on = c.through(x).at(*everywhere(20))
    assert np.allclose(np.minimum(np.abs(on - 0.0), np.abs(on - 1.0)).min(axis=0), 0.0, atol=1e-14)
    segment, s = c.through(x).project(np.array([[1.3], [1.2]]), np.array([9]), np.array([0.5]))
    assert c.through(x).at(segment, s)[:, 0] == pytest.approx([1.0, 1.0]), (
        "a point off a corner is nearest to the corner"
    )


def test_corners_divide_outlines_into_sides_and_are_convex_or_concave():
    """An L between two rings: six sides, numbered around even where the loop begins in the middle of one."""
    L = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]], dtype=float)
    boundary = np.concatenate(
        [np.linspace(a, b, 4, endpoint=False) for a, b in zip(L, np.roll(L, -1, axis=0), strict=True)]
    )
    boundary = np.roll(boundary, -2, axis=0).T
    x = np.concatenate([ring(20) - 5.0, boundary, ring(30) + 9.0], axis=1)
    c = curve(outlines([[np.arange(20)], [np.arange(24)], [np.arange(30)]], [0, 20, 44]), x)
    corners = 20 + np.array([2, 6, 10, 14, 18, 22])
    assert np.flatnonzero(c.corner).tolist() == corners.tolist()
    assert np.flatnonzero(c.corner & ~c.convex).tolist() == [30]
    assert np.unique(c.side).size == 8 and c.side.max() < c.sides
    assert np.unique(c.side[:20]).size == np.unique(c.side[44:]).size == 1
    for first in corners:
        its = 20 + (first - 20 + np.arange(4)) % 24
        assert np.unique(c.side[its]).size == 1


def test_deformation_folds_corners_in_and_makes_other_places_sharp():
    """Which places are corners is said by the reference shape, which of them stick out by the present one."""
    x = np.array([[0.0, 0.5, 1.0, 1.0, 1.0, 0.5, 0.0, 0.0], [0.0, 0.0, 0.0, 0.5, 1.0, 1.0, 1.0, 0.5]])
    now = x.copy()
    now[:, 2], now[:, 5] = (0.6, 0.4), (0.5, 1.7)
    c = curve(one_body(x), x, now)
    assert np.flatnonzero(c.corner).tolist() == [0, 2, 4, 6]
    assert np.flatnonzero(c.convex).tolist() == [0, 4, 6]
    assert np.flatnonzero(c.sharp).tolist() == [0, 1, 3, 4, 5, 6]
    same = curve(one_body(x), x)
    assert np.flatnonzero(same.convex).tolist() == np.flatnonzero(same.sharp).tolist() == [0, 2, 4, 6]
    assert np.array_equal(c.weights(*everywhere(8)), same.weights(*everywhere(8)))


@pytest.mark.parametrize(("segment", "s"), [(1, 1.2), (2, -0.2)])
def test_a_side_goes_on_behind_a_notch_but_not_beyond_a_corner(segment, s):
    """Half a segment at most; the foot of a point behind the notch is on the side's own line."""
    x = np.array([[0.0, 0.5, 1.0, 1.0, 1.0, 2.0, 2.0, 0.0], [0.0, 0.0, 0.0, -0.5, -1.0, -1.0, 2.0, 2.0]])
    c = curve(one_body(x), x)
    assert (c.corner & ~c.convex).nonzero()[0].tolist() == [2]
    shape, middle = c.through(x), np.array([0.5])
    y = shape.at(np.array([segment]), np.array([s])) + 0.1 * shape.normals(np.array([segment]), middle)
    there, at = shape.project(y, np.array([segment]), middle)
    assert there[0] == segment and at[0] == pytest.approx(s)
    _, far = shape.project(y + 10 * (s - 0.5) * shape.at(there, at, 1), there, at)
    assert far[0] == (1.5 if s > 1.0 else -0.5)
    other = np.array([0 if segment == 1 else 3])
    _, corner = shape.project(x[:, [0]] - 1.0 if segment == 1 else x[:, [4]] - 1.0, other, middle)
    assert 0.0 <= corner[0] <= 1.0


def test_projection_is_the_nearest_point_even_from_a_neighbouring_segment():
    x = ring(24)
    c = curve(one_body(x), x)
    rng = np.random.default_rng(1)
    angle, radius = rng.uniform(0.0, 2.0 * np.pi, 300), rng.uniform(0.9, 1.1, 300)
    y = radius * np.stack([np.cos(angle), np.sin(angle)])
    start = ((angle / (2.0 * np.pi) * 24).astype(int) + rng.integers(-1, 2, 300)) % 24
    segment, s = c.through(x).project(y, start, np.full(300, 0.5))
    dense = c.through(x).at(*everywhere(24, 400))
    nearest = np.sqrt(((y[:, :, None] - dense[:, None]) ** 2).sum(axis=0)).min(axis=1)
    distance = np.hypot(*(y - c.through(x).at(segment, s)))
    assert (distance <= nearest + 1e-12).all()
    apart, normal = y - c.through(x).at(segment, s), c.through(x).normals(segment, s)
    assert np.abs(apart[0] * normal[1] - apart[1] * normal[0]).max() < 1e-10
    c = c.through(x).c
    *outward, gap, along = np.array([seen((a, b), c, i, t) for a, b, i, t in zip(*y, segment, s, strict=True)]).T
    assert np.array(outward) == pytest.approx(normal, abs=1e-14) and np.abs(along).max() < 1e-9
    assert gap == pytest.approx(np.copysign(distance, radius - 1.0), abs=1e-3)  # the curve is not quite a circle


def test_where_a_point_lies_relative_to_one_of_the_curve():
    """A square's lower side, from 0.25 of its length on: 0.1 in front of it and a fifth of its length further."""
    x = np.array([[0.0, 2.0, 2.0, 0.0], [0.0, 0.0, 2.0, 2.0]])
    shape = curve(one_body(x), x).through(x)
    assert seen((0.9, -0.1), shape.c, 0, 0.25) == pytest.approx((0.0, -1.0, 0.1, 0.2))


def test_the_normal_and_the_shares_are_the_derivative_of_the_gap():
    """By d gap = n . (dy - sum_m z_m dx_m): what makes a frictionless contact conservative."""
    rng = np.random.default_rng(2)
    x = ring(18) * np.array([[1.0], [0.8]])
    c = curve(one_body(x), x)
    y = np.array([[1.02], [0.21]])
    dx, dy = rng.normal(size=x.shape), rng.normal(size=y.shape)

    def gap(e):
        segment, s = c.through(x + e * dx).project(y + e * dy, np.array([1]), np.array([0.5]))
        return ((y + e * dy - c.through(x + e * dx).at(segment, s)) * c.through(x + e * dx).normals(segment, s)).sum()

    segment, s = c.through(x).project(y, np.array([1]), np.array([0.5]))
    moved = dy[:, 0] - dx[:, c.stencil(segment)[:, 0]] @ c.weights(segment, s)[:, 0]
    expected = c.through(x).normals(segment, s)[:, 0] @ moved
    e = 1e-6
    assert (gap(e) - gap(-e)) / (2.0 * e) == pytest.approx(expected, rel=1e-7)


def test_area_inside_is_that_of_what_the_points_are_on():
    """Of a circle by the fourth power of the spacing, of a square with a hole exactly; far from the origin."""
    errors = []
    for n in (16, 32, 64):
        x = ring(n) + 1e3
        errors.append(abs(curve(one_body(x), x).through(x).area(1)[0] / np.pi - 1.0))
    assert (np.log2(np.divide(errors[:-1], errors[1:])) > 3.9).all()
    assert errors[-1] < 0.01 * (1.0 - np.sin(np.pi / 32) / (np.pi / 32))
    side = np.array([[0.0, 3.0, 3.0, 0.0], [0.0, 0.0, 3.0, 3.0]])
    x = np.concatenate([side, 1.0 + side[:, ::-1] / 3.0], axis=1) + 7.0
    hollow = outlines([[np.arange(4), np.arange(4, 8)], []], [0, 8, 8])
    np.testing.assert_allclose(curve(hollow, x).through(x).area(2), [8.0, 0.0])
