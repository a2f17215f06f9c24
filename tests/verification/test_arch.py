"""A semicircular arch of dry blocks stands where Couplet's arch does, and no step of it fails.

Problem: nine stiff blocks on a rough floor, thickness over mean radius 0.15 or 0.08, friction 0.7, from rest without
stress into gravity. Reference: a rigid arch stands above 0.1075 (Milankovitch 1907; Heyman, Int. J. Solids Struct. 4
(1968) 269) and falls below it; weight less the floor's force is the change of momentum. Once at rest, what contacts
give within their tolerance exceeds all that a step exchanges: that once halved steps of arches that stand.
"""

from itertools import pairwise

import numpy as np
import pytest
from sectors import sector

from skmpm import Body, NeoHookean, Scene, Wall, simulate

BLOCKS, STEP = 9, 5e-3


def arch(thickness):
    """Blocks of a semicircle of mean radius 1 m."""
    inner, outer = 1.0 - 0.5 * thickness, 1.0 + 0.5 * thickness
    stone, angles = NeoHookean(1e9, 0.2, 2000.0), np.linspace(0.0, np.pi, BLOCKS + 1)
    blocks = [sector(inner, outer, a, b, spacing=thickness / 4) for a, b in pairwise(angles)]
    floor = Wall((0, 0), (0, 1), friction=0.7)
    bodies = [Body(points, stone) for points in blocks]
    return Scene(bodies, cell=thickness / 4, walls=[floor], friction=0.7, gravity=(0, -9.81))


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


@pytest.mark.slow
def test_a_thin_arch_falls():
    scene = arch(0.08)
    *_, state = simulate(scene, dt=STEP, until=0.6)
    assert sunk(scene, state) > 0.1
