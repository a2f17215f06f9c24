"""A flat rigid punch is pressed into a block on a rigid base, without inertia: where sharp edges stop it.

E = 1 MPa, height 0.1 m, width 3 heights, the punch as wide as the block is high. It goes down by 40 % of the height.
Stress has no bound at a sharp edge; what the tests ask for is that the contacts are found and that Newton
converges (`docs/studies/stability/punch.csv` has all variants).
"""

import logging
import re
from pathlib import Path

import numpy as np
import pytest

from skmpm import Body, NeoHookean, Points, Rigid, Scene, Scheme, StepFailed, Support, box, preflight, simulate

FILE = Path(__file__).parents[2] / "docs" / "studies" / "stability" / "punch.csv"
HEIGHT, CELLS = 0.1, 10
H = HEIGHT / CELLS


def rounded(corner, size, radius, spacing):
    """A rectangle, its corners rounded in steps of 15 degrees."""
    if radius == 0.0:
        return box(corner, size, spacing=spacing)
    inset, angle = np.array(corner)[:, None] + radius, np.deg2rad(np.arange(0, 91, 15))
    centres = inset + (np.array(size) - 2.0 * radius)[:, None] * np.array([[1, 1, 0, 0], [0, 1, 1, 0]])
    arcs = [
        c[:, None] + radius * np.stack([np.cos(a), np.sin(a)])
        for c, a in zip(centres.T, (angle + k * np.pi / 2 for k in range(-1, 3)), strict=True)
    ]
    loop = []
    for arc, after in zip(arcs, [*arcs[1:], arcs[0]], strict=True):
        way = after[:, :1] - arc[:, -1:]
        n = max(1, round(float(np.hypot(*way)[0]) / spacing))
        loop += [arc, arc[:, -1:] + way * np.arange(1, n) / n]
    x = np.concatenate(loop, axis=1)
    y = np.roll(x, -1, axis=1)
    area = 0.5 * float(np.sum(x[0] * y[1] - x[1] * y[0]))
    return Points(x, np.full(x.shape[1], area / x.shape[1]), (np.arange(x.shape[1]),))


def punch(*, nu=0.45, friction=0.0, radius=0.0, shift=0.0, offset=(0.0, 0.0), fine=1.0, cells=CELLS):
    """Block and punch, which comes down by a height in one second; radius, shift and offset in cells."""
    h = HEIGHT / cells
    origin, width = h * np.array(offset), 3.0 * HEIGHT
    block = box(origin, (width, HEIGHT), spacing=h / 2)
    corner = origin + np.array([width / 3 + shift * h, HEIGHT + 1e-3 * h])
    tool = rounded(corner, (HEIGHT, 0.3 * HEIGHT), radius * h, h / 2 / fine)
    bodies = [Body(block, NeoHookean(1e6, nu, 1000.0)), Body(tool, Rigid(1.0), motion=(0.0, -HEIGHT, 0.0))]
    base = Support(lambda x: x[1] < origin[1] + 1e-9)
    return Scene(bodies, cell=h, supports=[base], friction=friction)


def pressed(scene, depth, *, steps):
    """The states of a press to `depth` heights, of `steps` steps to 40 %."""
    return list(simulate(scene, dt=0.4 / steps, until=depth, scheme=Scheme(inertia=False, mean_dilatation=False)))


POSITIONS = ({}, {"offset": (0.3, 0.4), "shift": 0.37}, {"offset": (0.1, 0.7), "shift": 0.6})
VARIANTS = [
    *({"friction": mu, **position} for position in POSITIONS for mu in (0.0, 0.3)),
    *({"friction": mu, "averaged": True, **position} for position in POSITIONS[:2] for mu in (0.0, 0.3)),
    *({"friction": mu, "averaged": True, "nu": 0.49} for mu in (0.0, 0.3)),
    {"friction": 0.0, "nu": 0.3},
    {"friction": 0.3, "cells": 16},
]
RADII = (0.0, 0.25, 0.5, 1.0)


def reached(case, radius):
    """How far a punch goes of 40 % of the height, the retries on its way and Newton's iterations a step."""
    options = {"radius": radius, **case}
    scheme = Scheme(inertia=False, mean_dilatation=options.pop("averaged", False))
    t, retries, newton = 0.0, 0, []
    try:
        for state in simulate(punch(**options), dt=0.004, until=0.4, scheme=scheme):
            t, retries = state.t, retries + state.report.retries
            newton.append(state.report.newton)
    except StepFailed:
        pass
    return t, retries, float(np.mean(newton or [0.0]))


def table():
    """The rows of `docs/studies/stability/punch.csv`: `python tests/verification/test_punch.py`, ten minutes."""
    yield ("nu", "friction", "mean dilatation", "position", "H/h", *(f"r = {r:g} h" for r in RADII))
    for case in VARIANTS:
        position = POSITIONS.index({k: v for k, v in case.items() if k in ("offset", "shift")}) + 1
        averaged = "yes" if case.get("averaged") else "no"
        numbers = f"{case.get('nu', 0.45):g}", f"{case['friction']:g}", averaged, f"{position}"
        depths = (f"{reached(case, radius)[0]:.2f}" for radius in RADII)
        yield (*numbers, f"{case.get('cells', CELLS)}", *depths)


def test_a_rigid_body_gives_the_curve_however_fine_and_its_edges_points():
    """Forces act on the block's points, along the normals of the punch; at its edges on the block's curve."""
    for fine in (0.5, 1.0, 4.0):
        contacts = pressed(punch(fine=fine), 0.02, steps=40)[-1].contacts
        loaded = contacts.force[0] > 1e-6 * contacts.force[0].max()
        edge = contacts.bodies[0] == 1
        assert np.count_nonzero(loaded & edge) == 2
        assert np.count_nonzero(loaded & ~edge) >= 8
        assert np.allclose(contacts.x[0, edge], [HEIGHT, 2.0 * HEIGHT], rtol=0, atol=1e-9)
        assert np.allclose(contacts.normal[:, loaded & ~edge], [[0.0], [-1.0]], rtol=0, atol=1e-9)


def test_a_punch_without_friction_goes_down_in_full_steps():
    """With the punch's points on the block's curve steps were halved from 10 % on, and no length was short enough."""
    states = pressed(punch(offset=(0.3, 0.4), shift=0.37), 0.2, steps=50)
    assert sum(s.report.retries for s in states) == 0
    assert np.mean([s.report.newton for s in states]) < 3.0


def test_small_radii_do_not_slip_between_the_points_of_the_block():
    """An arc of half the spacing of the block's points: with the block's points alone it ends 0.4 cells inside."""
    states = pressed(punch(radius=0.25), 0.16, steps=40)
    assert max(s.report.overlap for s in states) < 2e-4
    assert any((s.contacts.bodies[0] == 1).any() for s in states)


@pytest.mark.slow
@pytest.mark.parametrize(
    "case",
    [
        {"friction": 0.3, "offset": (0.1, 0.7), "shift": 0.6},
        {"friction": 0.0, "averaged": True, "radius": 0.5},
        {"friction": 0.3, "offset": (0.3, 0.4), "shift": 0.37, "radius": 0.5},
    ],
    ids=str,
)
def test_edges_reach_forty_per_cent(case):
    """Without inertia, in full steps but for one or two, and with few iterations of Newton's method."""
    depth, retries, newton = reached({k: v for k, v in case.items() if k != "radius"}, case.get("radius", 0.0))
    assert depth == pytest.approx(0.4)
    assert retries <= 2 and newton < 3.0


def test_a_failure_at_an_edge_names_it_and_the_remedy():
    scene = punch()
    state = pressed(scene, 0.1, steps=20)[-1]
    blocked = Scheme(inertia=False, max_newton=1, newton_tol=1e-12)
    with pytest.raises(
        StepFailed,
        match=r"use inertia, or round the edge of body 1 at \(0\.[12], 0\.09.* m by 0\.005 m: .* snap through",
    ):
        list(simulate(scene, dt=0.05, until=0.2, scheme=blocked, start=state))


def test_sharp_edges_that_meet_a_soft_body_are_warned_of():
    """Before the run, without inertia; not round ones, nor those beside the body or on their way from it."""
    still = Scheme(inertia=False)
    says = r"body 1: its edge at \(0\.[12], 0\.1\) m .* on body 0 .*; use inertia, or an edge rounded by 0\.0051 m"
    assert len(_warned(punch(), still)) == 1
    assert re.match(says, _warned(punch(), still)[0].text)
    assert _warned(punch(radius=0.25), still)
    assert not _warned(punch(radius=0.5), still)
    assert not _warned(punch(), Scheme())
    block, tool = punch().bodies
    wide = Body(box((-1.0, 1.001 * HEIGHT), (3.0, HEIGHT), spacing=H), Rigid(1.0), motion=(0.0, -1.0, 0.0))
    assert not _warned(Scene([block, wide], cell=H), still)
    away = Points(tool.points.x + np.array([[0.0], [2.0 * H]]), tool.points.volume, tool.points.outline)
    assert _warned(Scene([block, Body(away, Rigid(1.0), motion=(0.0, -1.0, 0.0))], cell=H), still)
    assert not _warned(Scene([block, Body(away, Rigid(1.0), motion=(0.0, 1.0, 0.0))], cell=H), still)


def _warned(scene, scheme):
    return [each for each in preflight(scene, 1e-3, scheme=scheme).warnings if each.kind == "radius of a rigid edge"]


if __name__ == "__main__":
    logging.getLogger("skmpm").setLevel(logging.ERROR)
    FILE.write_text("".join(",".join(row) + "\n" for row in table()))
