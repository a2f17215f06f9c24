"""Ironing: a rigid round punch is pressed into a block and slid along it; its normal force should not oscillate.

Punch of radius R = 20 h, 0.75 h deep, slid by 8 h on a block of 60 h x 15 h on a rigid base, without inertia; with
cells of h/2 the geometry is the same. The oscillation is what a parabola leaves of the force between 15 and 95 % of
the way, peak to peak over the mean: the parabola is the effect of the ends of the block.
"""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from ledger import Row, numbers

from skmpm import Body, NeoHookean, Points, Rigid, Scene, Scheme, Support, box, simulate

RADIUS, DEPTH, WAY, LENGTH, HEIGHT = 20.0, 0.75, 8.0, 60.0, 15.0  # [h]
HALF = np.radians(28.0)  # of the arc of the punch
STEPS = 160  # of the slide
MATERIAL = NeoHookean(1e6, 0.3, 1000.0)


def punch(centre, spacing):
    """A segment of a disc, its arc below."""
    corners = centre[:, None] + RADIUS * np.array([[-np.sin(HALF), np.sin(HALF)], [-np.cos(HALF)] * 2])
    top = np.array([corners[:, 1] * (1, 0) + (0, centre[1]), corners[:, 0] * (1, 0) + (0, centre[1])]).T
    angle = np.linspace(-HALF, HALF, int(np.ceil(2.0 * HALF * RADIUS / spacing)) + 1)
    loop = [centre[:, None] + RADIUS * np.stack([np.sin(angle), -np.cos(angle)])]
    ends = [corners[:, 1], top[:, 0], top[:, 1], corners[:, 0]]
    for begin, end in pairwise(ends):
        n = max(1, round(float(np.hypot(*(end - begin))) / spacing))
        loop.append(begin[:, None] + (end - begin)[:, None] * np.arange(1, n + 1) / n)
    x = np.concatenate(loop, axis=1)[:, :-1]
    y = np.roll(x, -1, axis=1)
    area = 0.5 * float(np.sum(x[0] * y[1] - x[1] * y[0]))
    return Points(x, np.full(x.shape[1], area / x.shape[1]), (np.arange(x.shape[1]),))


def scene(cells, spacing, friction, offset=(0.3, 0.6)):
    """Block and punch; `cells` in the height of 15 h, `spacing` and `offset` in cells."""
    cell = HEIGHT / cells
    corner = cell * np.array(offset)
    block = box(corner, (LENGTH, HEIGHT), spacing=spacing * cell)
    centre = corner + np.array([0.5 * (LENGTH - WAY), HEIGHT + RADIUS + 1e-3 * cell])

    def motion(t):
        return (0.0, -DEPTH, 0.0) if t < 1.0 else (WAY, 0.0, 0.0)

    bodies = [Body(block, MATERIAL), Body(punch(centre, spacing * cell), Rigid(1.0), motion=motion)]
    return Scene(bodies, cell=cell, supports=[Support(lambda x: x[1] < corner[1] + 1e-9)], friction=friction)


@cache
def force(cells=15, spacing=0.74, friction=0.0, offset=(0.3, 0.6)):
    """Share of the slide and normal force on the punch [N/m], (2, STEPS)."""
    ironed, scheme, found = scene(cells, spacing, friction, offset), Scheme(inertia=False), []
    *_, pressed = simulate(ironed, dt=0.05, until=1.0, scheme=scheme)
    for state in simulate(ironed, dt=1.0 / STEPS, until=2.0, scheme=scheme, start=pressed):
        n, c = state.contacts.normal, state.contacts
        found.append((state.t - 1.0, abs(float(c.force[0] @ n[1] + c.force[1] @ n[0]))))
    return np.array(found).T


def oscillation(**options):
    """Peak to peak over the mean."""
    t, normal = force(**options)
    middle = (t > 0.15) & (t < 0.95)
    t, normal = t[middle], normal[middle]
    return float(np.ptp(normal - np.polyval(np.polyfit(t, normal, 2), t)) / normal.mean())


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_punch_slides_with_little_oscillation(friction):
    """2 % at R/h = 20, points 0.74 h apart: 0.5 % is missed there, and met at R/h = 40 (table)."""
    assert oscillation(friction=friction) < 0.02


def test_denser_points_reduce_the_oscillation():
    assert oscillation(spacing=1 / 3) < 0.6 * oscillation()


def rows():
    offsets = [(0.3, 0.6), (0.0, 0.0), (0.7, 0.2)]
    worst = {
        name: max(oscillation(offset=offset, **options) for offset in offsets)
        for name, options in (
            ("coarse", {}),
            ("rough", {"friction": 0.3}),
            ("half", {"spacing": 0.5}),
            ("third", {"spacing": 1 / 3}),
            ("fine", {"cells": 30}),
        )
    }
    met = "met" if worst["coarse"] <= 0.005 else "missed"
    return [
        Row(
            "ironing: normal force on a punch that slides along a block, peak to peak over the mean",
            "no oscillation",
            "R/h = 20, 20 with friction 0.3, 40; points 0.74 h apart; 3 positions on the grid",
            f"{numbers([worst[name] for name in ('coarse', 'rough', 'fine')])};"
            f" R/h = 20, points h/2 and h/3 apart {numbers([worst['half'], worst['third']])}",
            "-",
            f"0.005 at R/h = 20: {met}: boundary points enter and leave one by one",
            "test_a_punch_slides_with_little_oscillation",
        )
    ]


def figures(folder):
    """The force along the way."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(6.0, 3.2), layout="constrained")
    for options, label in (
        ({}, "R/h = 20, points 0.74 h apart"),
        ({"spacing": 1 / 3}, "R/h = 20, points h/3 apart"),
        ({"cells": 30}, "R/h = 40, points 0.74 h apart"),
    ):
        t, normal = force(**options)
        axis.plot(WAY * t, normal / force(cells=30)[1].mean(), label=label, lw=1.0)
    axis.set(xlabel="way [h]", ylabel="normal force over the mean at R/h = 40", ylim=(0.97, 1.03))
    axis.legend(fontsize=8)
    figure.savefig(folder / "ironing.png", dpi=130)
    plt.close(figure)
    return {"ironing.png": "Normal force on a rigid punch pressed 0.75 h into a block and slid along it."}
