"""Supports that turn: rigid rotation, the torsion of a ring, their work, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

import skmpm
from skmpm import Support
from skmpm.step.driven import prescribed_speeds

E, NU, A, B = 1e6, 0.3, 1e-3, 2e-3
GEL = skmpm.NeoHookean(E=E, nu=NU, density=1000.0)
TIGHT = skmpm.Scheme(inertia=False, newton_tol=1e-9)
CELL = (B - A) / 6


def rim(x):
    return np.hypot(*x) > B - 1e-9


def hub(x):
    return np.hypot(*x) < A + 1e-9


def ring(angle, **options):
    body = skmpm.Body(skmpm.ring((0, 0), A, B, spacing=0.7 * CELL), GEL)
    return skmpm.Scene([body], cell=CELL, supports=[Support(rim), Support(hub, rotation=angle, **options)])


def test_a_body_turns_without_strain():
    """All of a boundary turned by a radian about a point outside: positions as of a rotation, to 1e-9 cells."""
    disc, centre = skmpm.Body(skmpm.disc((0, 0), A, spacing=0.7 * CELL), GEL), np.array([2 * A, A])
    scene = skmpm.Scene(
        [disc], cell=CELL, supports=[Support(lambda x: np.hypot(*x) > 0.0, rotation=lambda t: t, centre=centre)]
    )
    *_, state = skmpm.simulate(scene, dt=0.1, until=1.0, scheme=TIGHT)
    turn = np.array([[np.cos(1.0), -np.sin(1.0)], [np.sin(1.0), np.cos(1.0)]])
    expected = centre[:, None] + turn @ (scene.initial_positions - centre[:, None])
    assert np.abs(state.x - expected).max() < 1e-9 * CELL
    assert state.report.energy.elastic < 1e-15 * E * A**2


@pytest.mark.parametrize("angle", [0.01, -0.01])
def test_the_torsion_of_a_ring(angle):
    """M = 4 pi G angle / (1 / a^2 - 1 / b^2), to 3 % at six cells across, on hub and rim."""
    scene = ring(lambda t: angle * t)
    scene = replace(scene, supports=[Support(rim, rotation=lambda t: 0.0), scene.supports[1]])
    state = skmpm.step(scene, skmpm.initial(scene), 1.0, scheme=TIGHT)
    G = E / (2.0 * (1.0 + NU))
    moment = 4.0 * np.pi * G * angle / (1.0 / A**2 - 1.0 / B**2)
    assert state.support_moment[1] == pytest.approx(-moment, rel=0.03)
    assert state.support_moment[0] == pytest.approx(-state.support_moment[1], rel=1e-6)
    assert state.support_force == pytest.approx(np.zeros((2, 2)), abs=1e-3 * abs(moment) / A)


def test_the_work_of_the_moment_is_the_elastic_energy():
    """Of a ring turned by .2 in quasi-static steps to 1 %, and a stage with the same supports goes on alike."""
    scene = ring(lambda t: 0.2 * t)
    first = skmpm.Scheme(inertia=False, newton_tol=1e-7)
    *_, half = skmpm.simulate(scene, dt=0.05, until=0.5, scheme=first)
    *_, whole = skmpm.simulate(scene, dt=0.05, until=1.0, scheme=first, start=half)
    energy = whole.report.energy
    assert energy.external == pytest.approx(energy.elastic, rel=0.01)
    stage = skmpm.continued(scene, half, replace(scene, supports=list(scene.supports)))
    assert stage.support_moment == pytest.approx(half.support_moment)
    *_, again = skmpm.simulate(scene, dt=0.05, until=1.0, scheme=first, start=stage)
    assert again.support_moment[1] == pytest.approx(whole.support_moment[1], rel=1e-6)


def test_a_hub_turns_and_moves():
    """Its points are where displacement and rotation put them at the ends of chosen steps, with inertia, too."""
    disc = skmpm.Body(skmpm.disc((0, 0), A, spacing=0.7 * CELL), GEL)
    moved = Support(
        lambda x: np.hypot(*x) < 0.4 * A, displacement=lambda t: (0.1 * t, 0.0), rotation=lambda t: 50.0 * t
    )
    scene = skmpm.Scene([disc], cell=CELL, supports=[moved])
    *_, state = skmpm.simulate(scene, until=2e-3)
    points = scene.supported[0].points
    x = scene.initial_positions[:, points]
    centre, angle = x.mean(axis=1, keepdims=True), 0.1
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    expected = centre + np.array([[2e-4], [0.0]]) + turn @ (x - centre)
    assert np.abs(state.x[:, points] - expected).max() < 0.01 * CELL
    assert dict(prescribed_speeds(scene))["the rotation of support 0"] == pytest.approx(50.0 * 0.4 * A, rel=0.2)
    still = skmpm.at_rest(scene, state)
    spin = 50.0 * (state.x[:, points] - state.x[:, points].mean(axis=1, keepdims=True))
    assert still.v[:, points] == pytest.approx(np.stack([0.1 - spin[1], spin[0]]), abs=2e-3)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"rotation": 1.0}, "rotation = 1.0; give a function of time"),
        ({"rotation": lambda t: 1.0 + t}, "rotation at t = 0 is 1"),
        ({"rotation": lambda t: np.nan}, "rotation at t = 0"),
        ({"rotation": lambda: 0.0}, "rotation takes the arguments"),
        ({"rotation": lambda t: t, "velocity": (None, 0.0)}, "a component is None beside a rotation"),
        ({"rotation": lambda t: t, "centre": (0.0,)}, "centre"),
        ({"centre": (0.0, 0.0)}, "without a rotation"),
    ],
)
def test_what_is_refused(options, words):
    with pytest.raises(skmpm.SceneError, match=words):
        body = skmpm.Body(skmpm.disc((0, 0), A, spacing=0.7 * CELL), GEL)
        skmpm.Scene([body], cell=CELL, supports=[Support(lambda x: x[0] > 0, **options)])
