"""Thickness and narrowest slits of bodies: known shapes, rotated, finely and coarsely sampled."""

import numpy as np
import pytest
from test_outline import build, regular, turn

from skmpm import box, disc
from skmpm.outline.widths import MAX_POINTS, _pairs, inclined_thickness, slit_width, thickness

ANGLES = (0.0, 0.3, 1.234)
SPACINGS = (0.25, 0.1, 0.033)


def sampled(corners, spacing):
    """A polygon through corners (2, k), with points no more than `spacing` apart, in pieces of several lengths."""
    corners, out = np.asarray(corners, dtype=float).T, []
    for a, b in zip(corners.T, np.roll(corners, -1, axis=1).T, strict=True):
        n = int(np.ceil(np.hypot(*(b - a)) / spacing))
        out.append(a[:, None] + (b - a)[:, None] * np.linspace(0.0, 1.0, n, endpoint=False) ** 1.1)
    return np.concatenate(out, axis=1)


def ring(radius, spacing, centre=(0.0, 0.0), phase=0.1):
    return regular(max(12, int(2 * np.pi * radius / spacing)), radius, centre, phase)


def arc(radius, first, last, spacing, centre=(0.0, 0.0)):
    angle = np.linspace(first, last, max(3, int(abs(last - first) * radius / spacing)))
    return np.reshape(centre, (2, 1)) + radius * np.array((np.cos(angle), np.sin(angle)))


def dumbbell(d, bar):
    """Two discs of radius 1 joined by a bar."""
    a = np.arcsin(bar / 2)
    return np.concatenate(
        [arc(1, a, 2 * np.pi - a, d, (-1.5, 0)), arc(1, np.pi + a, 3 * np.pi - a, d, (1.5, 0))], axis=1
    )


def open_ring(d):
    return np.concatenate([arc(1.0, 0.3, 6.0, d), arc(0.7, 6.0, 0.3, d)], axis=1)


def lens(d):
    """Two arcs that meet at tips of 40 degrees: 0.352 wide."""
    half = np.deg2rad(20)
    upper = arc(1 / np.sin(half), np.pi / 2 - half, np.pi / 2 + half, d, (0, -1 / np.tan(half)))
    return np.concatenate([upper[:, :-1], -upper[:, :-1]], axis=1)


def waist(d):
    """Between two hyperbolas 0.5 apart."""
    x = np.linspace(-2, 2, max(9, 2 * int(2 / d) + 1))
    y = np.sqrt(0.25**2 + (0.3 * x) ** 2)
    return np.concatenate([[x, -y], [x[::-1], y[::-1]]], axis=1)


SHAPES = {  # loops at a spacing, thickness
    "square": (lambda d: [sampled([(0, 0), (1, 0), (1, 1), (0, 1)], d)], 1.0),
    "square by its corners": (lambda d: [np.array([[0, 1, 1, 0], [0, 0, 1, 1.0]])], 1.0),
    "strip": (lambda d: [sampled([(0, 0), (3, 0), (3, 0.2), (0, 0.2)], d)], 0.2),
    "trapezoid": (lambda d: [sampled([(0, 0), (3, -0.3), (3, 0.9), (0, 0.6)], d)], 0.6),
    "L": (lambda d: [sampled([(0, 0), (2, 0), (2, 0.3), (0.4, 0.3), (0.4, 2), (0, 2)], d)], 0.3),
    "parallelogram": (lambda d: [sampled([(0, 0), (1, 0), (1.5, 0.866), (0.5, 0.866)], d)], 0.866),
    "disc": (lambda d: [ring(1.0, d)], 2.0),
    "ellipse": (lambda d: [np.array([[2.0], [0.5]]) * ring(1.0, d / 4)], 0.885),
    "annulus": (lambda d: [ring(1.0, d), ring(0.7, d)[:, ::-1]], 0.3),
    "hole off the middle": (lambda d: [ring(1.0, d), ring(0.5, d, (0.3, 0.1))[:, ::-1]], 0.5 - np.hypot(0.3, 0.1)),
    "two holes": (lambda d: [sampled([(-2, -2), (2, -2), (2, 2), (-2, 2)], d), ring(0.5, d / 2, (-0.6, 0))[:, ::-1],
                             ring(0.5, d / 2, (0.6, 0.3))[:, ::-1]], np.hypot(1.2, 0.3) - 1.0),
    "dumbbell": (lambda d: [dumbbell(d, 0.4)], 0.4),
    "two discs that run into each other": (
        lambda d: [np.concatenate([arc(1, 0.5, 2 * np.pi - 0.5, d, (-np.cos(0.5), 0))[:, :-1],
                                   arc(1, np.pi + 0.5, 3 * np.pi - 0.5, d, (np.cos(0.5), 0))[:, :-1]], axis=1)],
        2 * np.sin(0.5)),
    "lens": (lambda d: [lens(d / 2)], 0.86 * 0.3527),
    "waist": (lambda d: [waist(d)], 0.5),
    "open ring": (lambda d: [open_ring(d)], 0.3),
    "crack": (lambda d: [sampled([(0, 0), (1, 0), (1, 1), (0.52, 1), (0.5, 0.2), (0.48, 1), (0, 1)], d)], 0.2),
    "two cracks": (lambda d: [sampled([(0, 0), (0.48, 0), (0.5, 0.3), (0.52, 0), (1, 0), (1, 1), (0.52, 1),
                                       (0.5, 0.6), (0.48, 1), (0, 1)], d)], 0.3),
    "strip with a tip": (lambda d: [sampled([(0, 0), (3, 0), (3.5, 0.1), (3, 0.2), (0, 0.2)], d)], 0.2),
}  # fmt: skip
SLITS = {  # loops at a spacing, width of the narrowest
    "slit": (
        lambda d: [sampled([(0, 0), (3, 0), (3, 1), (2, 1), (2, 0.3), (1.8, 0.3), (1.8, 1), (0, 1)], d)], 0.2),
    "flask": (lambda d: [sampled([(0, 0), (3, 0), (3, 3), (1.6, 3), (1.6, 2.5), (2.5, 2.5), (2.5, 0.5), (0.5, 0.5),
                                  (0.5, 2.5), (1.4, 2.5), (1.4, 3), (0, 3)], d)], 0.2),
    "crack": (SHAPES["crack"][0], 0.04),
    "two cracks": (SHAPES["two cracks"][0], 0.04),
    "open ring": (SHAPES["open ring"][0], 2 * 0.7 * np.sin(0.5 * (0.3 + 2 * np.pi - 6.0))),
    "annulus": (SHAPES["annulus"][0], 1.4),
    "hole off the middle": (SHAPES["hole off the middle"][0], 1.0),
    "two holes": (SHAPES["two holes"][0], 1.0),
    **{name: (SHAPES[name][0], np.inf) for name in ("square", "L", "disc", "ellipse", "lens", "waist")},
}  # fmt: skip
COMPACT = {  # without parallel sides: inscribed circles, found on middles of edges
    "triangle": (lambda d: [sampled([(0, 0), (1, 0), (0.5, np.sqrt(3) / 2)], d)], 1 / np.sqrt(3)),
    "right triangle": (lambda d: [sampled([(0, 0), (1, 0), (0, 1)], d)], 2 - np.sqrt(2)),
    "needle": (lambda d: [sampled([(0, 0), (3, -0.25), (3, 0.25)], d / 2)], 0.4605),
}


def measured(loops, angle=0.0, scale=1.0):
    boundary, x, bodies = build([scale * turn(angle) @ loop for loop in loops])
    return thickness(boundary, x, bodies)[0] / scale


@pytest.mark.parametrize("spacing", SPACINGS)
@pytest.mark.parametrize("name", SHAPES)
def test_thickness(name, spacing):
    """Chords lie inside arcs by spacing^2 / 8 R: 5 % at the coarsest; straight parts are exact. Turned, too.

    Where sides taper a pair is found within a spacing of the thinnest place, or of where 15 degrees are reached.
    """
    loops, expected = SHAPES[name]
    tolerance = 0.06 if name in TAPERED else 0.05 * (spacing / SPACINGS[0]) ** 2 * (name not in STRAIGHT) + 1e-9
    for angle in ANGLES:
        assert measured(loops(spacing), angle) == pytest.approx(expected, rel=tolerance)


TAPERED = {"trapezoid", "ellipse", "lens"}
STRAIGHT = {
    "square",
    "square by its corners",
    "strip",
    "L",
    "parallelogram",
    "crack",
    "two cracks",
    "strip with a tip",
}


@pytest.mark.parametrize("name", COMPACT)
def test_triangles_have_their_inscribed_circle(name):
    """Within a spacing: middles of edges are as far from where the circle touches."""
    loops, expected = COMPACT[name]
    for spacing in SPACINGS:
        assert measured(loops(spacing), 0.3) == pytest.approx(expected, rel=spacing)


@pytest.mark.parametrize("spacing", SPACINGS)
@pytest.mark.parametrize("name", SLITS)
def test_slits(name, spacing):
    """Of holes within the sag of chords; convex bodies and open corners have none."""
    loops, expected = SLITS[name]
    tolerance = 0.05 * (spacing / SPACINGS[0]) ** 2 if "hole" in name or name == "annulus" else 0.01
    for angle in ANGLES:
        boundary, x, bodies = build([turn(angle) @ loop for loop in loops(spacing)])
        assert slit_width(boundary, x, bodies)[0] == pytest.approx(expected, rel=tolerance)


def test_each_body_has_its_own_slit(monkeypatch):
    """Whatever is beside it; bodies that are convex or without outline have none, and are not searched."""
    square, wall, cut = SHAPES["square"][0](0.1), SHAPES["annulus"][0](0.1), SLITS["slit"][0](0.1)
    boundary, x, bodies = build(cut, [], [5.0 * loop for loop in wall], square, [3.0 * loop for loop in cut], [])
    found = slit_width(boundary, x, bodies)
    np.testing.assert_allclose(found, [0.2, np.inf, 7.0, np.inf, 0.6, np.inf], rtol=0.01)
    assert slit_width(*build()).shape == (0,)
    monkeypatch.setattr("skmpm.outline.widths._narrowest", None)
    assert np.isinf(slit_width(*build(square, [], SHAPES["disc"][0](0.1)))).all()


@pytest.mark.parametrize("name", SHAPES)
def test_pairs_that_cannot_face_each_other_are_left_out_and_no_others(name, monkeypatch):
    """The same to the last digit with every pair."""
    for spacing, angle in [(0.25, 0.0), (0.1, 1.234), (0.033, 0.3)]:
        boundary, x, bodies = build([turn(angle) @ loop for loop in SHAPES[name][0](spacing)])
        found = [f(boundary, x, bodies) for f in (thickness, slit_width)]
        with monkeypatch.context() as every:
            every.setattr("skmpm.outline.widths._steep_pairs", _pairs)
            assert found == [f(boundary, x, bodies) for f in (thickness, slit_width)]


def test_each_body_has_its_own_and_none_without_outline():
    """Whatever is beside it, or around it: other bodies do not count. Lengths scale."""
    square, wall = SHAPES["square"][0](0.1), SHAPES["annulus"][0](0.1)
    boundary, x, bodies = build([], [5.0 * loop for loop in wall], square, [], [2.0 * loop for loop in square])
    found = thickness(boundary, x, bodies)
    np.testing.assert_allclose(found, [np.nan, 1.5, 1.0, np.nan, 2.0], rtol=0.01)
    assert measured(square, 0.3, 1e-6) == pytest.approx(1.0) == pytest.approx(measured(square, 0.3, 1e6))
    none = thickness(*build())
    assert none.shape == (0,)


@pytest.mark.parametrize("cells", [1, 2, 4, 8])
def test_of_the_library_s_own_shapes(cells):
    """Boxes and discs, whatever the spacing of their points."""
    for spacing in (1.0, 0.74, 0.4):
        strip, round_one = box((0.3, 0.1), (40.0, cells), spacing=spacing), disc((0, 0), cells, spacing=spacing)
        for points, expected in ((strip, cells), (round_one, 2 * cells)):
            (loop,) = points.outline
            assert measured([points.x[:, loop]]) == pytest.approx(expected, rel=0.05 if expected > 2 else 0.2)


def test_many_pairs_in_chunks_give_the_same(monkeypatch):
    """And chunks are made of whole boundary points."""
    loops = SHAPES["two holes"][0](0.05)
    whole = measured(loops)
    monkeypatch.setattr("skmpm.outline.widths.CHUNK", 1000)
    assert measured(loops) == whole
    monkeypatch.setattr("skmpm.outline.widths.MAX_POINTS", 100)  # of about 500: every fifth or sixth
    assert measured(loops) == pytest.approx(whole, rel=0.1)


def notched(d):
    """A bar of 8 by 4 with two opposite notches of 60 degrees that leave a neck of 0.2."""
    x, depth = 4.1, 1.9
    half = depth * np.tan(np.pi / 6)
    below = [(0, 0), (x - half, 0), (x, depth), (x + half, 0), (8, 0)]
    return sampled(below + [(a, 4.0 - b) for a, b in below[::-1]], d)


def lips(d):
    """A slot of 4 by 2 with a mouth of 0.1 between two pointed lips."""
    left = [(3.05, 4), (4.05, 3.5), (3.05, 3.0), (3.05, 1)]
    return sampled([(0, 0), (8, 0), (8, 4), *((8.2 - a, b) for a, b in left), *left[::-1], (0, 4)], d)


@pytest.mark.parametrize(("shape", "width", "expected"), [(notched, thickness, 0.2), (lips, slit_width, 0.1)])
def test_nothing_depends_on_where_a_long_loop_begins(shape, width, expected):
    """More points than pairs begin at, and a neck or mouth between two of them."""
    x = shape(0.04)
    assert x.shape[1] > MAX_POINTS
    for shift in range(5):
        assert width(*build([np.roll(x, shift, axis=1)]))[0] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("degrees", "expected"), [(0.0, np.inf), (10.0, np.inf), (20.0, 0.2), (45.0, 0.2), (75.5, np.inf), (90.0, np.inf)]
)
def test_parts_that_are_inclined_to_the_axes(degrees, expected):
    """A strip that is turned, and a ring, which has such parts at any angle; not of bodies that are not chosen."""
    strip = turn(np.radians(degrees)) @ sampled([(0, 0), (3, 0), (3, 0.2), (0, 0.2)], 0.05)
    boundary, x, _ = build([strip], [ring(1.0, 0.05), ring(0.7, 0.05)[:, ::-1]])
    found = inclined_thickness(boundary, x, np.array([True, True]))
    assert found == pytest.approx([expected, 0.3], rel=0.01)
    assert inclined_thickness(boundary, x, np.array([False, True]))[0] == np.inf
