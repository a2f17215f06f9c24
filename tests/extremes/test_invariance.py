"""Results do not depend on units, the grid offset, directions and the order of bodies.

Reference: the same scene in millimetres and MPa, upright, near the origin. Tolerances: units change no equation, so
only round-off is left, and what twenty steps make of it. Asked: 1e-8 for units, the solver tolerance, 1e-6, for the
rest; asserted: 1e-10 for both, 1e-9 thousands of cells from the origin, where positions are rounded more coarsely.
"""

from dataclasses import replace

import numpy as np
import pytest
from scenes import SCENES, Parameters

import skmpm

STEPS = 20
BASE = Parameters(dt_c_h=3.0, scheme={"newton_tol": 1e-6})  # where rounding ends what Newton leaves
UNITS = {
    "large": {"length": 1.0, "stress": 1e9, "density": 2.7e3},
    "small": {"length": 1e-6, "stress": 1e3, "density": 1.0},
    "odd": {"length": 3e-6, "stress": 7e9},
}
SYMMETRIES = {
    "thousands-of-cells": {"origin": (1000.0, -4000.0)},
    "quarter-turn": {"quarter_turns": 1},
    "mirror": {"mirrored": True},
    "order": {},
}


def turn(parameters):
    """The rotation or reflection of a scene, (2, 2)."""
    quarter = np.linalg.matrix_power(np.array([[0.0, -1.0], [1.0, 0.0]]), parameters.quarter_turns)
    return quarter @ np.diag([-1.0, 1.0]) if parameters.mirrored else quarter


def changed(case, **parameters):
    """The case with other parameters; the grid turns with the scene."""
    parameters = replace(case.parameters, **parameters)
    if not parameters.order and not parameters.quarter_turns and not parameters.mirrored:
        return SCENES[case.name](parameters)
    return SCENES[case.name](replace(parameters, offset=tuple(turn(parameters) @ np.array(parameters.offset))))


def ended(case):
    """After twenty steps, without dimension, upright and in the bodies' own order."""
    *_, state = skmpm.simulate(case.scene, dt=case.dt, until=STEPS * case.dt, scheme=case.scheme)
    d, back = case.parameters, turn(case.parameters).T
    offsets, order = case.scene.offsets, d.order or range(len(case.scene.bodies))
    own = np.concatenate([np.arange(offsets[k], offsets[k + 1]) for k in np.argsort(order)])
    shift = d.cell * (np.array(d.offset) + np.array(d.origin))
    return {
        "x": (back @ (state.x - shift[:, None]) / d.length)[:, own],
        "v": (back @ state.v / (d.closing * d.speed))[:, own],
        "stress": np.einsum("ia,abn,jb->ijn", back, state.stress, back)[..., own] / d.stress,
        "walls": back @ state.wall_force.T / (d.stress * d.length),
    }


def apart(one, other):
    """The largest difference of each field over its largest value."""

    def largest(values):
        return float(np.abs(values).max(initial=0.0))

    return {name: largest(one[name] - other[name]) / max(largest(one[name]), 1e-300) for name in one}


@pytest.fixture(scope="module", params=SCENES)
def reference(request):
    case = SCENES[request.param](BASE)
    return case, ended(case)


@pytest.mark.parametrize("unit", UNITS)
def test_results_do_not_depend_on_units(reference, unit):
    case, wanted = reference
    found = apart(wanted, ended(changed(case, **UNITS[unit])))
    assert max(found.values()) < 1e-10, found


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_results_do_not_depend_on_place_direction_and_order(reference, symmetry):
    case, wanted = reference
    parameters = SYMMETRIES[symmetry]
    if symmetry == "order":
        parameters = {"order": tuple(np.random.default_rng(1).permutation(len(case.scene.bodies)).tolist())}
    found = apart(wanted, ended(changed(case, **parameters)))
    assert max(found.values()) < (1e-9 if symmetry == "thousands-of-cells" else 1e-10), found


def test_the_comparison_sees_what_is_not_symmetric(reference):
    """A grid that stays while the scene turns is another quadrature: the difference shows."""
    case, wanted = reference
    turned = SCENES[case.name](replace(case.parameters, quarter_turns=1))
    assert max(apart(wanted, ended(turned)).values()) > 1e-3


# --- rest

R, CELL, DT, GRAVITY = 1e-3, 1e-3 / 2.5, 1e-4, 50.0
GEL = skmpm.NeoHookean(E=1e6, nu=0.3, density=1000.0)


def drift(scene, dt, steps, every, **options):
    """Largest velocities [m/s], displacements [m] since the first state looked at, elastic energies [J/m]."""
    first, found = None, []
    for k, state in enumerate(skmpm.simulate(scene, dt=dt, until=steps * dt, scheme=skmpm.Scheme(**options))):
        if (k + 1) % every:
            continue
        first = first or state
        found.append((np.abs(state.v).max(), np.abs(state.x - first.x).max(), state.report.energy.elastic))
    return np.array(found).T


def pile(gravity):
    """Two rough discs on one another between two walls."""
    discs = [skmpm.Body(skmpm.disc((0.0, y), R, spacing=CELL / 1.5), GEL) for y in (R, 3.0 * R)]
    walls = [skmpm.Wall((0.0, 0.0), (0.0, 1.0), friction=0.5)]
    walls += [skmpm.Wall((s * R, 0.0), (-s, 0.0), friction=0.5) for s in (-1.0, 1.0)]
    return skmpm.Scene(discs, cell=CELL, walls=walls, friction=0.5, gravity=(0.0, -gravity))


@pytest.mark.slow
def test_what_is_not_pushed_does_not_move():
    """Touching discs without a force, a hundred steps: nothing but the rounding of gaps of 1e-35 m."""
    v, x, _ = drift(pile(0.0), DT, 100, 50)
    assert v.max() < 1e-25
    assert x.max() < 1e-25


@pytest.mark.slow
def test_a_pile_at_rest_stays():
    """Two discs on one another in a box under gravity, 600 steps: settled in the first three hundred, they stay.

    What moves later is what Newton's tolerance leaves in a step: velocities up to 2e-8 g dt. Friction holds
    velocities, not places, so this adds up to a creep: at most 3e-10 R, and 1e-6 of the elastic energy.
    """
    v, x, elastic = drift(pile(GRAVITY), DT, 600, 300)
    assert v.max() < 2e-8 * GRAVITY * DT
    assert x.max() < 3e-10 * R
    np.testing.assert_allclose(elastic, elastic[0], rtol=1e-6)
    assert elastic[0] > 0.0


@pytest.mark.slow
def test_the_creep_is_the_tolerance():
    """With tolerances of 1e-10 the same pile stands still: a thousandth of what the test above allows a step."""
    tight = {"newton_tol": 1e-10, "contact_tol": 1e-10, "gap_tol": 1e-9}
    v, x, elastic = drift(pile(GRAVITY), DT, 400, 133, **tight)
    assert v[1:].max() < 1e-11 * GRAVITY * DT
    assert x[1:].max() < 5e-14 * R
    np.testing.assert_allclose(elastic[1:], elastic[1], rtol=1e-10)
