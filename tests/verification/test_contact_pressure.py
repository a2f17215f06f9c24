"""Contact pressures recovered from point forces: Hertz's ellipse, and a block between plates.

Hertz: a disc between frictionless plates, quasi-static, linear elastic, nu = 0.3, random grid offset, direction and
angle of the cloud. Reference: the ellipse of the same force, p0 = 2 P / (pi a), a^2 = 4 P R / (pi E*). It is that of
small strains, so pressures are taken per undeformed length; the current ones, which `contact_pressure` returns, are 3
to 4 % higher at d/R = 0.1. Block: uniform pressure E / (1 - nu^2) times the strain, smooth plates, corners included.

Goals: rms error over the contact at most 0.10 p0 for points h/3 and h/2 apart and 0.15 p0 for 0.74 h, peak within
10 %, where the contact is wider than 1.2 cells on either side (`RESOLVED`, as for Hertz's force).
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from ledger import Row
from pictures import canvas, keep
from test_contact_patch import HEIGHT, WIDTH, blocks
from test_contact_patch import STRAIN as PATCH_STRAIN
from test_hertz import DEPTHS, MATERIAL, MODULUS, NU, RESOLVED, R, formula, frame, half_width, stroke

from skmpm import (
    Body,
    NeoHookean,
    Points,
    Scene,
    Scheme,
    Support,
    Wall,
    box,
    contact_pressure,
    disc,
    initial,
    linear,
    network,
    simulate,
)

SIZES = (5, 10)  # R/h
SPACINGS = (0.74, 0.5, 1 / 3)  # of the points [h]
OFFSETS = 10
LENGTHS = (0.0, 1.0, 1.3, 1.7)  # half-width of the kernel [h]; 1.3 is the default
BARS = {0.74: 0.15, 0.5: 0.10, 1 / 3: 0.10}  # of the rms error, over p0
PEAK = 0.10
WORST = {0.74: 0.25, 0.5: 0.12, 1 / 3: 0.12}  # peak in a single contact: what is measured, see the table
SCHEME = Scheme(inertia=False, linear=linear.banded)
STRAIN = 0.02  # of the block


def turned(points, angle, shift):
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return Points(turn @ points.x + shift[:, None], points.volume, points.outline)


@cache
def pressed_discs(size, spacing, count):
    """Scenes and states of discs between plates by depth, with the frame of each."""
    rng, out = np.random.default_rng(7 * size), []
    for _ in range(count):
        middle, normal, across = frame(size, rng)
        cloud = turned(disc((0, 0), R, spacing=spacing * R / size), rng.uniform(0, 2 * np.pi), middle)
        walls = [Wall(middle + s * R * normal, -s * normal, velocity=-s * normal) for s in (1, -1)]
        scene = Scene([Body(cloud, MATERIAL)], cell=R / size, walls=walls)
        state, found = initial(scene, scheme=SCHEME), []
        for depth in DEPTHS:
            state, _ = stroke(scene, state, depth, SCHEME)
            found.append(state)
        out.append((scene, found, middle, normal, across))
    return out


def undeformed(scene, traction):
    """Pressure per undeformed length (m,) [Pa], and the undeformed length of each point (m,) [m]."""
    X = scene.initial_positions[:, traction.point]
    step = np.hypot(*(np.roll(X, -1, axis=1) - X))  # a disc has no corners: its points are one loop
    length = 0.5 * (step + np.roll(step, 1))
    return traction.pressure * traction.length / length, length


def against_the_ellipse(case, depth, width):
    """Of both contacts of a disc: rms error over the contact, error of the peak, both over p0."""
    scene, states, middle, normal, across = case
    state = states[DEPTHS.index(depth)]
    cells = None if width is None else width * scene.cell
    traction = contact_pressure(scene, state, 0, length=cells)
    pressure, length = undeformed(scene, traction)
    X = scene.initial_positions[:, traction.point] - middle[:, None]
    out = []
    for wall, s in ((-1, 1), (-2, -1)):
        force = state.contacts.force[0, state.contacts.bodies[1] == wall].sum()
        a = R * half_width(force / MODULUS)
        p0 = 2.0 * force / (np.pi * a)
        mine = s * normal @ X > 0.0
        x, p, w = across @ X[:, mine], pressure[mine] / p0, length[mine]
        inside = np.abs(x) < a
        ellipse = np.sqrt(np.clip(1.0 - (x / a) ** 2, 0.0, None))
        out.append((np.sqrt(w[inside] @ (p - ellipse)[inside] ** 2 / w[inside].sum()), p.max() - 1.0))
    return out


def errors(size, spacing, depth, width, count):
    """Rms over contacts of their rms errors, and the errors of the peaks (contacts,)."""
    found = np.array(
        [e for case in pressed_discs(size, spacing, count) for e in against_the_ellipse(case, depth, width)]
    )
    return float(np.sqrt(np.mean(found[:, 0] ** 2))), found[:, 1]


def resolved(size, depth):
    return half_width(formula(depth)) * size >= RESOLVED


def pressed_block(angle, spacing, seed, cell=0.2):
    """A block of 2 by 1 between smooth plates, and the error of its pressure on both of them, over the exact one."""
    normal = np.array([-np.sin(angle), np.cos(angle)])
    middle = cell * np.random.default_rng(seed).random(2)
    cloud = turned(box((-1.0, -0.5), (2.0, 1.0), spacing=spacing * cell), angle, middle)
    walls = [Wall(middle + 0.5 * s * normal, -s * normal, velocity=-0.5 * s * normal) for s in (1, -1)]
    scene = Scene([Body(cloud, MATERIAL)], cell=cell, walls=walls)
    state, _ = stroke(scene, initial(scene, scheme=SCHEME), STRAIN, SCHEME)

    def error(length):
        found = contact_pressure(scene, state, 0, length=length)
        loaded = np.isin(found.side, (0, 2))
        wider = 1.0 + NU / (1.0 - NU) * STRAIN
        return found.pressure[loaded] * wider / (MODULUS * STRAIN) - 1.0, found.length[loaded]

    return error


AT_REST = 5.0  # [s] after the upper plate has moved for one: a thousandth of the blocks' kinetic energy is left


def between_blocks(spacing, seed, scheme):
    """Errors of the pressure of two blocks of `test_contact_patch` on each other and on the plates, over the mean.

    Without the 1.5 cells beside the corners. With inertia the blocks move, then come to rest by their viscosity.
    """
    offset = np.random.default_rng(seed).uniform(0.0, 1.0, 2)
    scene = blocks(offset, 0.3, spacing, 1.0)
    if scheme.inertia:
        calm = NeoHookean(1e3, 0.3, 1.0, viscosity=50.0)
        floor, lid = scene.walls
        lid = replace(lid, velocity=lambda t: (0.0, -2.0 * HEIGHT * PATCH_STRAIN if t < 1.0 else 0.0))
        scene = replace(scene, bodies=[replace(body, material=calm) for body in scene.bodies], walls=[floor, lid])
    until = AT_REST if scheme.inertia else 1.0
    *_, state = simulate(scene, dt=None if scheme.inertia else 1.0, until=until, scheme=scheme)
    mean, out = state.wall_force[1, 1] / WIDTH, ([], [])
    for body in (0, 1):
        found = contact_pressure(scene, state, body)
        inside = np.abs(found.x[0] - offset[0] - 0.5 * WIDTH) < 0.5 * WIDTH - 1.5
        for up in (-1, 1):
            chosen = inside & (up * found.normal[1] > 0.7)
            out[int(up == 1 - 2 * body)].append((found.pressure[chosen] / mean - 1.0, found.length[chosen]))
    return [tuple(np.concatenate(values) for values in zip(*place, strict=True)) for place in out]


def spread(found):
    """Root mean square, weighted by lengths, and largest of errors (errors, lengths)."""
    off, length = (np.concatenate(values) for values in zip(*found, strict=True))
    return float(np.sqrt(length @ off**2 / length.sum())), float(np.abs(off).max())


# Tests.


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("spacing", SPACINGS)
def test_hertz(size, spacing):
    """The goals, of four offsets; the peak on average, and in single contacts within what is measured."""
    for depth in (d for d in DEPTHS if resolved(size, d)):
        rms, peak = errors(size, spacing, depth, None, 4)
        assert rms < BARS[spacing]
        assert np.abs(peak.mean()) < PEAK
        assert np.abs(peak).max() < WORST[spacing]


def test_point_forces_are_no_pressures():
    """Without averaging, points h/3 apart alternate: the reason for it. Narrow contacts are too flat with it."""
    rms, peak = errors(10, 1 / 3, 0.1, 0.0, 4)
    assert rms > 0.6
    assert peak.mean() > 1.5
    assert errors(5, 1 / 3, 0.02, None, 4)[1].mean() < -0.3


@pytest.mark.parametrize(("spacing", "rms", "worst"), [(0.5, 0.05, 0.15), (1 / 3, 0.03, 0.08)])
@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_block(angle, spacing, rms, worst):
    """Uniform pressure up to the corners: rms and largest error; of the force 0.3 %."""
    off, length = pressed_block(angle, spacing, 0)(None)
    assert np.sqrt(length @ off**2 / length.sum()) < rms
    assert np.abs(off).max() < worst
    assert np.abs(length @ off / length.sum()) < 0.003


@pytest.mark.parametrize(("scheme", "rms"), [(SCHEME, 0.06), (Scheme(), 0.2)], ids=["quasi-static", "inertia"])
def test_between_two_blocks_pressure_scatters_more_than_on_plates(scheme, rms):
    """Single forces between bodies are not unique within a cell; with inertia they keep what motion has left."""
    found = [between_blocks(0.5, seed, scheme) for seed in range(2)]
    plates, blocks_ = (spread([run[place] for run in found])[0] for place in (0, 1))
    assert blocks_ < rms
    assert plates < 0.7 * rms


@pytest.mark.parametrize("spacing", SPACINGS)
def test_resultant_and_moment(spacing):
    """Force of each contact on a disc to round-off; moment about its centre, smooth plates, to 1e-3 a P."""
    for scene, states, middle, *_ in pressed_discs(5, spacing, 4):
        for state in states:
            traction, c = contact_pressure(scene, state, 0), state.contacts
            force, f = traction.traction * traction.length, c.force[0] * c.normal
            P = c.force[0].sum() / 2.0
            np.testing.assert_allclose(traction.force, f.sum(axis=1), atol=1e-12 * P)
            arm, x = traction.x - middle[:, None], c.x - middle[:, None]
            moments = [np.sum(r[0] * g[1] - r[1] * g[0]) for r, g in ((arm, force), (x, f))]
            assert np.abs(moments[0] - moments[1]) < 1e-3 * P * R
            assert traction.pressure.min() > -1e-12 * traction.pressure.max()


def test_two_discs_see_equal_and_opposite_tractions():
    """Points of one disc, curve of the other, friction 0.5: resultants, peaks, and the force of the pair."""
    cell, normal = 0.2, np.array([np.cos(0.4), np.sin(0.4)])
    bodies, supports = [], []
    for s in (1, -1):
        centre = -s * R * normal
        bodies.append(Body(turned(disc((0, 0), R, spacing=(0.3 + 0.1 * s) * cell), 0.2 * s, centre), MATERIAL))
        supports.append(Support(_far(centre, -s * normal), velocity=s * normal))
    scene = Scene(bodies, cell=cell, supports=supports, friction=0.5)
    state, _ = stroke(scene, initial(scene, scheme=SCHEME), 0.2, SCHEME)
    pair = network(scene, state)
    one, two = (contact_pressure(scene, state, b) for b in (0, 1))
    P = float(np.hypot(*pair.force_xy[:, 0]))
    np.testing.assert_allclose(one.force, pair.force_xy[:, 0], atol=1e-12 * P)
    np.testing.assert_allclose(two.force, -pair.force_xy[:, 0], atol=1e-12 * P)
    assert one.pressure.max() == pytest.approx(two.pressure.max(), rel=0.03)
    p0 = 2.0 * P / (np.pi * R * half_width(P / MODULUS))
    assert one.pressure.max() == pytest.approx(p0, rel=0.15)


def _far(centre, direction):
    def where(x):
        arm = x - centre[:, None]
        return (np.hypot(*arm) > R * (1 - 1e-9)) & (direction @ arm > R * np.cos(0.2))

    return where


# The table and the figure.


def rows():
    return [
        *(_hertz_row(width) for width in LENGTHS),
        _narrow_row(),
        _block_row(),
        *map(_interface_row, (SCHEME, Scheme())),
    ]


def _text(size, spacing, depths, width):
    parts = []
    for depth in depths:
        rms, peak = errors(size, spacing, depth, width, OFFSETS)
        parts.append(f"{rms:.2f} / {100 * peak.mean():+.0f} ({100 * np.abs(peak).max():.0f})")
    return f"{size}, {spacing:.2f} h: " + ", ".join(parts)


def _hertz_row(width):
    cases = [(size, [d for d in DEPTHS if resolved(size, d)]) for size in SIZES]
    good = True
    for size, depths in cases:
        for spacing in SPACINGS:
            for rms, peak in (errors(size, spacing, d, width, OFFSETS) for d in depths):
                good &= rms < BARS[spacing] and np.abs(peak.mean()) < PEAK
    name = "point forces" if width == 0.0 else f"averaged over {width} h"
    return Row(
        f"contact pressure, Hertz, {name}{' (default)' if width == 1.3 else ''}",
        "ellipse of the same force",
        "R/h = 5 (d/R = 0.1), 10 (d/R = 0.05, 0.1)",
        "rms over p0 / peak in % mean (worst); R/h, spacing: "
        + "; ".join(_text(size, spacing, depths, width) for size, depths in cases for spacing in SPACINGS),
        "-",
        "rms 0.15 (0.74 h), 0.10; mean peak within 10 %: " + ("met" if good else "missed"),
        "test_hertz" if width else "test_point_forces_are_no_pressures",
    )


def _narrow_row():
    cases = [(size, [d for d in DEPTHS if not resolved(size, d)]) for size in SIZES]
    return Row(
        "contact pressure, Hertz, half-width below 1.2 cells",
        "ellipse of the same force",
        "R/h = 5 (d/R = 0.02, 0.05), 10 (d/R = 0.02)",
        "rms over p0 / peak in % mean (worst); R/h, spacing: "
        + "; ".join(_text(size, spacing, depths, None) for size, depths in cases for spacing in SPACINGS),
        "-",
        "-",
        "test_point_forces_are_no_pressures",
    )


def _block_row():
    texts = []
    for spacing in SPACINGS:
        for length in (0.0, None):
            found = [pressed_block(angle, spacing, seed)(length) for angle in (0.0, 0.3) for seed in range(3)]
            off, w = (np.concatenate(values) for values in zip(*found, strict=True))
            texts.append(f"{100 * np.sqrt(w @ off**2 / w.sum()):.1f} ({100 * np.abs(off).max():.0f})")
    pairs = [f"{s:.2f} h: {a} -> {b}" for s, a, b in zip(SPACINGS, texts[::2], texts[1::2], strict=True)]
    return Row(
        "contact pressure, block between smooth plates, along the grid and at 0.3 rad",
        "uniform pressure",
        "height 5 h",
        "rms (largest) error in %, point forces -> averaged: " + ", ".join(pairs),
        "-",
        "-",
        "test_block",
    )


def _interface_row(scheme):
    texts = []
    for spacing in SPACINGS:
        found = [between_blocks(spacing, seed, scheme) for seed in range(4)]
        each = (spread([run[place] for run in found]) for place in (1, 0))
        texts.append(f"{spacing:.2f} h: " + " / ".join(f"{100 * rms:.1f} ({100 * most:.0f})" for rms, most in each))
    how = "at rest after chosen steps" if scheme.inertia else "quasi-static"
    return Row(
        f"contact pressure, two blocks on each other, {how}",
        "uniform pressure",
        "10 by 5 cells each, four positions on the grid, without 1.5 cells at corners",
        f"rms (largest) error in %, between blocks / on plates: {', '.join(texts)}",
        "-",
        "-",
        "test_between_two_blocks_pressure_scatters_more_than_on_plates",
    )


def figures(folder):
    figure, axes = canvas()
    s = np.linspace(-1.0, 1.0, 201)
    for ax, size in zip(axes, SIZES, strict=True):
        for i, (scene, states, middle, normal, across) in enumerate(pressed_discs(size, 1 / 3, OFFSETS)[:4]):
            contacts = states[-1].contacts
            force = contacts.force[0, contacts.bodies[1] == -1].sum()
            a = R * half_width(force / MODULUS)
            for length, style in ((0.0, ".C7"), (None, "-C0")):
                traction = contact_pressure(scene, states[-1], 0, length=length)
                X = scene.initial_positions[:, traction.point] - middle[:, None]
                order = np.argsort(across @ X)
                order = order[normal @ X[:, order] > 0.5 * R]
                p = undeformed(scene, traction)[0][order] * np.pi * a / (2.0 * force)
                label = ("point forces" if length == 0.0 else "averaged") if i == 0 else None
                ax.plot((across @ X)[order] / a, p, style, ms=3, lw=0.8, label=label)
        ax.plot(s, np.sqrt(1.0 - s**2), "k", lw=1.5, label="Hertz")
        ax.set(title=f"R/h = {size}", xlabel="position / half-width", xlim=(-1.8, 1.8), ylim=(-0.1, 4.0))
    axes[0].set_ylabel("pressure / p0")
    axes[0].legend(fontsize=8)
    keep(figure, folder / "contact_pressure.png")
    return {
        "contact_pressure.png": "Contact pressure in a disc between plates at d/R = 0.1, points h/3 apart, four grid"
        " offsets: force over tributary length (`length=0`), and `contact_pressure` by default."
    }
