"""A force that resists the motion of bodies by more than their inertia."""

import importlib

import numpy as np
import pytest

import skmpm
from skmpm.step.forces import Beds

algorithm = importlib.import_module("skmpm.step.algorithm")
DT, GRAVITY = 1e-4, 0.5


def with_drag(ratio):
    """The terms of a scene with a force -ratio m v / dt on all points: beds that rest where a step begins."""
    others = algorithm.terms_of

    def terms_of(scene, state, start, dt, scheme):
        yield from others(scene, state, start, dt, scheme)
        points, before = np.arange(scene.owner.size), start.bulk.assembly.grid.at_points(start.displacement)
        stiffness = np.tile(ratio / dt**2 * state.mass, (2, 1))
        yield Beds(stiffness, np.stack([before, before]), scheme.theta, start.bulk.assembly, points, 0.0 * before)

    return terms_of


@pytest.mark.parametrize("ratio", [1e3, 1e6])
def test_momentum_is_balanced_with_forces_that_resist_more_than_inertia(monkeypatch, ratio):
    """A disc that falls slowly, v1 = (v0 + g dt) / (1 + ratio), does so to round-off, without a spin."""
    monkeypatch.setattr(algorithm, "terms_of", with_drag(ratio))
    body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(1e7, 0.3, 1000.0))
    scene = skmpm.Scene([body], cell=4e-4, gravity=(GRAVITY, 0.0))
    state, expected = skmpm.initial(scene), 0.0
    for _ in range(4):
        state, expected = skmpm.step(scene, state, DT), (expected + GRAVITY * DT) / (1.0 + ratio)
        v, arm = state.v @ state.mass / state.mass.sum(), state.x - (state.x @ state.mass / state.mass.sum())[:, None]
        inertia = float((state.mass * (arm**2).sum(axis=0)).sum())
        spin = float((state.mass * (arm[0] * state.v[1] - arm[1] * state.v[0])).sum()) / inertia
        assert v == pytest.approx([expected, 0.0], rel=1e-12, abs=1e-12 * expected)
        assert abs(spin) * 1e-3 < 1e-11 * expected
