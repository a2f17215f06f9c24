"""A semicircular arch of dry blocks stands where Couplet's arch does, and no step of it fails.

Problem: nine stiff blocks on a rough floor, thickness over mean radius 0.15 or 0.08, friction 0.7, from rest without
stress into gravity. Reference: a rigid arch stands above 0.1075 (Milankovitch 1907; Heyman, Int. J. Solids Struct. 4
(1968) 269) and falls below it; weight less the floor's force is the change of momentum. Once at rest, what contacts
give within their tolerance exceeds all that a step exchanges: that once halved steps of arches that stand.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from ledger import Row
from scipy.optimize import linprog
from sectors import sector

from skmpm import Body, NeoHookean, Scene, StepFailed, Wall, simulate

BLOCKS, STEP, FRICTION = 9, 5e-3, 0.7


def arch(thickness, cells=4):
    """Blocks of a semicircle of mean radius 1 m, `cells` thick."""
    inner, outer = 1.0 - 0.5 * thickness, 1.0 + 0.5 * thickness
    stone, angles = NeoHookean(1e9, 0.2, 2000.0), np.linspace(0.0, np.pi, BLOCKS + 1)
    blocks = [sector(inner, outer, a, b, spacing=thickness / cells) for a, b in pairwise(angles)]
    floor = Wall((0, 0), (0, 1), friction=FRICTION)
    bodies = [Body(points, stone) for points in blocks]
    return Scene(bodies, cell=thickness / cells, walls=[floor], friction=FRICTION, gravity=(0, -9.81))


@pytest.mark.slow
def test_an_arch_stands_and_none_of_its_steps_is_repeated():
    scene = arch(0.15)
    states = list(simulate(scene, dt=STEP, until=1.5))
    assert sum(s.report.retries for s in states) == 0
    force = np.array([[0.0, -9.81 * states[0].mass.sum()] - s.wall_force[0] for s in states])
    momentum = (states[-1].v * states[-1].mass).sum(axis=1)
    assert STEP * force.sum(axis=0) == pytest.approx(momentum, abs=1e-9 * STEP * np.abs(force).sum())
    assert max(sunk(scene, s) for s in states) < 1e-3
    energy = [s.report.energy for s in states]
    assert np.diff([e.dissipated for e in energy]).min() > -2e-5 * energy[-1].elastic
    assert np.sqrt(2.0 * energy[-1].kinetic / states[-1].mass.sum()) < 1e-5, "it is at rest [m/s]"


def sunk(scene, state):
    """How far the crown has come down [m]."""
    crown = scene.owner == BLOCKS // 2
    return (scene.initial_positions[1, crown] - state.x[1, crown]).mean()


def rigid_arch_stands(thickness):
    """Whether forces at the ends of joints balance rigid blocks, within friction: a linear programme."""
    radii, angles = (1.0 - 0.5 * thickness, 1.0 + 0.5 * thickness), np.linspace(0.0, np.pi, BLOCKS + 1)
    half, joints = 0.5 * np.pi / BLOCKS, BLOCKS + 1
    mean = 2.0 / 3.0 * (radii[1] ** 3 - radii[0] ** 3) / (radii[1] ** 2 - radii[0] ** 2) * np.sin(half) / half
    balance, weight = np.zeros((3 * BLOCKS, 4 * joints)), np.tile([0.0, 1.0, 0.0], BLOCKS)
    for i in range(BLOCKS):
        centre = mean * np.array([np.cos(angles[i] + half), np.sin(angles[i] + half)])
        for j, sign in ((i, 1.0), (i + 1, -1.0)):
            along = np.array([np.cos(angles[j]), np.sin(angles[j])])
            across = np.array([-along[1], along[0]])
            for k, radius in enumerate(radii):
                arm = radius * along - centre
                for q, f in enumerate((sign * across, sign * along)):
                    balance[3 * i : 3 * i + 3, 4 * j + 2 * k + q] = *f, arm[0] * f[1] - arm[1] * f[0]
    cone = np.kron(np.eye(2 * joints), [[-FRICTION, 1.0], [-FRICTION, -1.0]])
    bounds = [(0.0, None), (None, None)] * (2 * joints)
    found = linprog(np.zeros(4 * joints), cone, np.zeros(4 * joints), balance, weight, bounds, method="highs")
    return found.status == 0


def bisected(stands, falls_at, stands_at, width):
    """The limit between two values, to half of `width`."""
    while stands_at - falls_at > width:
        middle = 0.5 * (falls_at + stands_at)
        falls_at, stands_at = (falls_at, middle) if stands(middle) else (middle, stands_at)
    return 0.5 * (falls_at + stands_at)


def stands(thickness, cells, until=3.0):
    """Whether the crown comes down by less than a tenth of the thickness, by 2 s after gravity is whole.

    Gravity grows for a second: at once it would throw arches that can stand. A step that fails counts as a fall.
    """

    def gravity(X, t):
        return np.outer([0.0, -9.81 * min(t, 1.0)], np.ones(X.shape[1]))

    scene = replace(arch(thickness, cells), gravity=gravity)
    try:
        for state in simulate(scene, dt=STEP, until=until):
            if sunk(scene, state) > 0.1 * thickness:
                return False
    except StepFailed:
        return False
    return True


def test_the_limit_of_a_rigid_arch_of_nine_blocks():
    """0.1021, below the 0.1075 of a continuous arch, which has a joint wherever a hinge forms."""
    assert bisected(rigid_arch_stands, 0.05, 0.15, 1e-6) == pytest.approx(0.10213, abs=1e-5)


@pytest.mark.slow
def test_an_arch_stands_above_the_limit_of_rigid_blocks_and_falls_below():
    """Two per cent above it and two below, which falls within 0.7 s, before gravity is whole."""
    assert stands(1.02 * 0.10213, 4, until=1.5)
    assert not stands(0.98 * 0.10213, 4, until=1.5)


def rows():
    limit = bisected(rigid_arch_stands, 0.05, 0.15, 1e-6)
    found = {n: bisected(lambda t, n=n: stands(t, n), 0.96 * limit, 1.04 * limit, 0.01 * limit) for n in (4, 8)}
    error = [thickness / limit - 1.0 for thickness in found.values()]
    met = "met" if max(map(abs, error)) <= 0.02 else "missed"
    return [
        Row(
            "semicircular arch of nine blocks: least thickness that stands, over the mean radius",
            "rigid blocks, linear programme",
            "blocks 4, 8 cells thick",
            f"{', '.join(f'{x:+.1%}' for x in error)} of {limit:.4f}",
            "-",
            f"0.02: {met}",
            "test_an_arch_stands_above_the_limit_of_rigid_blocks_and_falls_below",
        )
    ]
