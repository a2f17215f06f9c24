"""Rings, rows and joined points."""

import numpy as np
import pytest

import skmpm

C, A, B = np.array([0.3e-3, -0.2e-3]), 1e-3, 1.7e-3


@pytest.mark.parametrize("spacing", [1e-4, 2e-4, 5e-4, 1e-3])
def test_a_ring_has_exact_area_centroid_and_second_moments(spacing):
    """To round-off: pi (b^2 - a^2), its centre, pi (b^4 - a^4) / 4."""
    points = skmpm.ring(C, A, B, spacing=spacing)
    arm = points.x - C[:, None]
    assert points.volume.sum() == pytest.approx(np.pi * (B**2 - A**2), rel=1e-12)
    assert arm @ points.volume == pytest.approx([0.0, 0.0], abs=1e-12 * points.volume.sum() * B)
    second = np.einsum("ik,jk,k->ij", arm, arm, points.volume)
    assert second == pytest.approx(np.pi / 4.0 * (B**4 - A**4) * np.eye(2), rel=1e-10, abs=1e-18)
    assert points.volume.min() > 0.0


def test_the_outline_of_a_ring_is_two_circles():
    points = skmpm.ring(C, A, B, spacing=1e-4)
    areas = []
    for loop, radius in zip(points.outline, (B, A), strict=True):
        x = points.x[:, loop] - C[:, None]
        assert np.hypot(*x) == pytest.approx(np.full(loop.size, radius), rel=1e-12)
        areas.append(0.5 * float((x[0] * np.roll(x[1], -1) - x[1] * np.roll(x[0], -1)).sum()))
    assert areas[0] > 0.0 > areas[1]


def test_a_ring_under_pressure_widens_as_lame_says():
    """u(a) = p a (1 + nu) / E (a^2 (1 - 2 nu) + b^2) / (b^2 - a^2) in plane strain, to 2 % at 6 cells across."""
    E, nu, p, a, b = 1e6, 0.3, 1e3, 1e-3, 2e-3
    cell = (b - a) / 6
    body = skmpm.Body(skmpm.ring((0, 0), a, b, spacing=0.7 * cell), skmpm.NeoHookean(E=E, nu=nu, density=1000))
    inside = skmpm.Pressure(lambda x: np.hypot(*x) < 0.5 * (a + b), p)
    scene = skmpm.Scene([body], cell=cell, loads=[inside])
    state = skmpm.step(scene, skmpm.initial(scene), 1.0, scheme=skmpm.Scheme(inertia=False))
    hole = body.points.outline[1]
    u = float((np.hypot(*state.x[:, hole]) - a).mean())
    assert u == pytest.approx(p * a * (1 + nu) / E * (a**2 * (1 - 2 * nu) + b**2) / (b**2 - a**2), rel=0.02)


def test_a_row_has_copies_and_moves_as_one():
    """Its moment of inertia is that of the copies about their common centre (Steiner)."""
    part, n, step = skmpm.disc((0, 0), 1e-3, spacing=2e-4), 3, 2.1e-3
    points = skmpm.row(part, n, (step, 0))
    assert points.size == n * part.size and len(points.outline) == n
    x = points.x - np.average(points.x, axis=1, weights=points.volume)[:, None]
    own = np.pi * 1e-12 / 2.0
    assert ((x**2).sum(axis=0) @ points.volume) == pytest.approx(n * own + 2 * np.pi * 1e-6 * step**2, rel=1e-10)
    far = skmpm.Body(skmpm.disc((0, 9e-3), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    scene = skmpm.Scene([skmpm.Body(points, skmpm.Rigid(1000.0), spin=10.0), far], cell=4e-4)
    state = skmpm.step(scene, skmpm.initial(scene), 1e-2)
    apart = [np.hypot(*(state.x[:, i] - state.x[:, i + part.size])) for i in (0, part.size)]
    assert apart == pytest.approx([step, step], rel=1e-12)


def test_groups_are_joined():
    """All or none of the parts have them."""
    soft, hard = (skmpm.disc((x, 0), 1e-3, spacing=4e-4) for x in (0.0, 3e-3))
    named = [part.with_groups(np.full(part.size, name)) for part, name in ((soft, "soft"), (hard, "hard"))]
    assert set(skmpm.joined(named).group) == {"soft", "hard"}
    with pytest.raises(ValueError, match="part 1 has no groups"):
        skmpm.joined([named[0], hard])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: skmpm.ring((0, 0), 2e-3, 1e-3, spacing=1e-4), "inner is 0.002 and outer 0.001"),
        (lambda: skmpm.ring((0, 0), 0.0, 1e-3, spacing=1e-4), "inner = 0.0"),
        (lambda: skmpm.joined([]), "joined"),
        (lambda: skmpm.joined([1]), "not a list of Points"),
        (lambda: skmpm.joined(skmpm.disc((0, 0), 1e-3, spacing=2e-4)), "not a list of Points"),
        (lambda: skmpm.row((0, 0), 2, (1, 0)), "part is a tuple"),
        (lambda: skmpm.row(skmpm.disc((0, 0), 1e-3, spacing=2e-4), 2, (0, 0)), r"step is \(0, 0\)"),
        (lambda: skmpm.row(skmpm.disc((0, 0), 1e-3, spacing=2e-4), 2, ("a", 0)), "step = "),
        (lambda: skmpm.row(skmpm.disc((0, 0), 1e-3, spacing=2e-4), 0, (1, 0)), "count is 0"),
        (lambda: skmpm.row(skmpm.disc((0, 0), 1e-3, spacing=2e-4), 2, 1.0), "step = 1.0"),
    ],
)
def test_bad_arguments_are_named(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_parts_that_overlap_are_named():
    """By their loops, not as points in a wrong order."""
    row = skmpm.row(skmpm.disc((0, 0), 1e-3, spacing=2e-4), 3, (1.9e-3, 0))
    far = skmpm.Body(skmpm.disc((0, 9e-3), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    with pytest.raises(skmpm.SceneError, match=r"body 0: outline loops 0 and 1 cross.*move these parts apart"):
        skmpm.Scene([skmpm.Body(row, skmpm.Rigid(1000.0)), far], cell=4e-4)
