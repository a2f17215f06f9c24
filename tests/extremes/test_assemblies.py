"""Stacks of bodies of any shape with supports and loads, all random: a right result or one clear error.

Problem: `assemblies.py`, dynamic steps and quasi-static ones. Reference and tolerances: balances of forces and of
moments, Coulomb's law by the points' displacements and polygons that do not cross: the limits of `checks.py`.
Six examples here, the same at every run; 500 by `--hypothesis-profile=nightly` (tests/conftest.py).
"""

from dataclasses import replace

import numpy as np
import pytest
from assemblies import Assembly, Hold, Piece, Pull, build, drawn
from checks import Outcome, Watch
from found import STANDS, WRONG_TODAY
from geometry import crossings, deepest_in_itself, filled
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st
from statics import has_equilibrium
from sweeps import limited
from test_random import CLEAR, USUAL, by_hypothesis, quiet  # noqa: F401  (a fixture)

import skmpm

EXAMPLES = 6 if USUAL else settings().max_examples // 2
SECONDS = 60  # of the processor for an example, which takes about one: beyond it something hangs
STEPS = 30  # after which a run that halves its steps again and again is left


def run(assembly):
    """How an assembly ends."""
    try:
        case = build(assembly)
    except skmpm.SceneError as refused:
        return Outcome(kind="SceneError", message=str(refused))
    return limited(case, SECONDS, most=STEPS)


@st.composite
def assemblies(draw):
    return drawn(*by_hypothesis(draw))


@pytest.mark.slow
@settings(
    max_examples=EXAMPLES,
    derandomize=USUAL,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.too_slow],
)
@given(assemblies())
def test_every_assembly_is_right_or_ends_in_a_clear_error(assembly):
    outcome = run(assembly)
    event(f"{'quasi-static' if assembly.still else 'dynamic'} {outcome.kind}")
    assert outcome.kind in CLEAR, (outcome.violations, outcome.message)


# --- the checks see what is wrong

RUBBING = Assembly(  # slides on the floor between a support and a load
    pieces=(Piece("box", speed=(0.05, 0.0)), Piece("disc")),
    still=False,
    weight=5e-3,
    floor=0.2,
    loads=(Pull(1, "top", (1e-3, 0.0)),),
    cells=2.5,
    steps=6,
)
HELD = Assembly(  # at rest, one body on a support, one on it
    pieces=(Piece("box"), Piece("box", aspect=0.6)),
    weight=1e-3,
    supports=(Hold(0, "bottom", (0.05, 0.0)),),
    cells=2.5,
)
STILL = replace(HELD, supports=(), loads=(Pull(1, "right", (-1e-4, 0.0)),))


def tampered(state, **changes):
    """The state after a change that a wrong code could have made."""
    return replace(state, **{name: change(getattr(state, name)) for name, change in changes.items()})


def swapped(first, second):
    """What exchanges the places of two points."""

    def change(x):
        x = x.copy()
        x[:, [first, second]] = x[:, [second, first]]
        return x

    return change


H = 1e-3 / 2.5  # side of the cells of the scenes above [m]
ASIDE = np.array([[H], [0.0]])
FIRST = build(STILL).scene.offsets[1]  # where the second body's points begin
WRONG = {
    "momentum": (STILL, {"wall_force": lambda f: 0.83 * f}),
    "momentum of a body": (STILL, {"contacts": lambda c: replace(c, force=0.83 * c.force)}),
    "moment": (STILL, {"contacts": lambda c: replace(c, x=c.x + ASIDE * 0.3)}),
    "travel": (STILL, {"x": lambda x: 2e3 * x}),
    "slip": (STILL, {"x": lambda x: x + ASIDE * 0.05}),
    "drag": (RUBBING, {"contacts": lambda c: replace(c, force=c.force * [[1.0], [-1.0]])}),
    "sunk": (STILL, {"walls": lambda walls: walls + 0.05 * H}),
    "support": (HELD, {"x": lambda x: x + ASIDE * 0.01}),
    "crossings": (STILL, {"x": swapped(3, 5)}),
    "depth": (STILL, {"x": lambda x: np.where(np.arange(x.shape[1]) < FIRST, x, x - [[0.0], [0.4 * H]])}),
}


@pytest.fixture(scope="module")
def two_states():
    """The last two states of a run, of each assembly once."""
    known = {}

    def of(assembly):
        if id(assembly) not in known:
            case = build(assembly)
            *_, old, new = skmpm.simulate(case.scene, dt=case.dt, until=case.until, scheme=case.scheme)
            known[id(assembly)] = case, old, new
        return known[id(assembly)]

    return of


def watched(case, old, new):
    """What the checks find in the step from one state to the next."""
    watch = Watch(case)
    watch.begin(old)
    energy = old.report.energy
    watch.start = energy.kinetic + energy.elastic - energy.external - energy.push_out
    watch.external, watch.largest = energy.external, max(abs(energy.external), energy.elastic, energy.kinetic)
    watch.see(new)
    return watch.found


@pytest.mark.parametrize("assembly", [RUBBING, HELD, STILL], ids=["rubbing", "held", "still"])
def test_the_checks_find_nothing_in_what_is_right(two_states, assembly):
    assert not watched(*two_states(assembly))


@pytest.mark.parametrize("name", WRONG)
def test_the_checks_see_what_is_wrong(two_states, name):
    assembly, changes = WRONG[name]
    case, old, new = two_states(assembly)
    assert name in watched(case, old, tampered(new, **changes))


def test_polygons_are_looked_at_rightly():
    """A bow tie crosses itself, a square and one with a hole do not; what lies in the hole is not in the material."""
    square = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
    hole = 0.25 + 0.5 * square[:, ::-1]
    assert crossings([square]) == 0 and crossings([square, hole]) == 0
    assert crossings([square[:, [0, 1, 3, 2]]]) == 1
    assert crossings([square, hole + 0.5]) == 2
    arms = np.array([[0.0, 4.0, 4.0, 1.0, 1.0, 4.0, 4.0, 0.0], [0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0]])
    for lift, crossed, depth in ((0.9, 0, 0.0), (1.25, 2, 0.25)):
        lifted = arms + np.outer([-0.3, lift], [0, 0, 1, 0, 0, 0, 0, 0])
        fine = np.concatenate([lifted + k / 8 * (np.roll(lifted, -1, axis=1) - lifted) for k in range(8)])
        fine = fine.reshape(8, 2, 8).transpose(1, 2, 0).reshape(2, 64)
        assert crossings([fine]) == crossed and crossings([fine], 0.5) == 0
        assert deepest_in_itself([fine]) == pytest.approx(depth)
    np.testing.assert_array_equal(filled([square, hole], np.array([[0.1, 0.5, 2.0], [0.1, 0.5, 0.5]])), [1, 0, 0])


@pytest.mark.parametrize(("slope", "stands"), [(0.0, True), (0.4, True), (0.5, False), (-0.5, False)])
def test_a_box_stands_where_statics_says_so(slope, stands):
    """On friction 0.5, up to atan 0.5 = 0.46; and on a level floor not beside a load that tips it over."""
    case = build(replace(STILL, pieces=(Piece("box"),), loads=(), slope=slope))
    assert has_equilibrium(case.scene, skmpm.initial(case.scene, scheme=case.scheme)) == stands
    tipped = build(replace(STILL, pieces=(Piece("box"),), loads=(Pull(0, "top", (3e-3, 0.0)),), floor=1.0))
    assert not has_equilibrium(tipped.scene, skmpm.initial(tipped.scene, scheme=tipped.scheme))


# --- what random draws found, made small


def marked(table):
    """The rows of a table; those with a reason are known to fail."""
    return [
        pytest.param(assembly, id=name, marks=[pytest.mark.xfail(strict=True, reason=reason)] if reason else [])
        for name, (assembly, reason) in table.items()
    ]


@pytest.mark.parametrize("assembly", marked(WRONG_TODAY))
def test_what_random_draws_found_is_mended(assembly):
    outcome = run(assembly)
    assert outcome.kind in CLEAR, outcome.violations


@pytest.mark.slow
@pytest.mark.parametrize("assembly", marked(STANDS))
def test_what_can_stand_is_found_standing(assembly):
    outcome = run(assembly)
    assert outcome.kind == "right", (outcome.violations, outcome.message)


@pytest.mark.parametrize("assembly", [assembly for assembly, _ in STANDS.values()], ids=STANDS.keys())
def test_statics_says_that_these_can_stand(assembly):
    """Rigid bodies, which may come down by the gap."""
    case = build(assembly)
    assert has_equilibrium(case.scene, skmpm.initial(case.scene, scheme=case.scheme), near=0.1 + assembly.gap)
