"""Pull-off of cohesive contacts: flat blocks against c L, a disc against the theory of adhesive line contact.

The disc is pulled from a rigid wall without inertia; its upper part is held and the wall moves. The reference is the
elastic half-plane with the cohesive zone of Dugdale and Maugis (Baney & Hui, J. Adhes. Sci. Technol. 11 (1997)
393-406; Johnson & Greenwood, J. Phys. D 41 (2008) 155315): contact for |x| < a, traction -c for a < |x| < b, where
the gap is delta. With B^2 = b^2 - a^2 the load per length and the slope of the gap are

    P = pi E* a^2 / (4 R) - 2 c B,    g'(x) = z / R + 2 c / (pi E*) ln |(z + B) / (z - B)|,    z^2 = x^2 - a^2.

For small delta the pull-off force tends to that of Johnson, Kendall and Roberts, 3/4 (4 pi E* w^2 R)^(1/3) with the
work of adhesion w = c delta (Barquins, J. Adhes. 26 (1988) 1-12), for stiff discs to 2 c sqrt(2 R delta).
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from ledger import Row, numbers
from scipy.optimize import brentq, minimize_scalar

from skmpm.material import LinearElastic, NeoHookean
from skmpm.points import Points, box, disc
from skmpm.scene import Body, Scene, StepFailed, Support, Wall
from skmpm.scheme import Scheme
from skmpm.simulation import simulate
from skmpm.step.algorithm import step as advance
from skmpm.step.initial_state import initial

E, NU, G, DENSITY = 1e6, 0.3, 10.0, 1000.0
STIFFNESS = E / (1.0 - NU**2)  # E*


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


# Blocks


@dataclass(frozen=True)
class Placing:
    """How two blocks of 1 m x 0.6 m lie on the grid."""

    turn: float  # [rad]
    offset: tuple[float, float]  # [cells]
    cell: float  # [m]
    spacing: tuple[float, float]  # [cells] of the upper and of the lower block


ALIGNED = Placing(0.0, (0.0, 0.0), 0.1, (0.5, 0.5))
TILTED = Placing(0.4, (0.3, 0.7), 0.1, (0.5, 0.37))


def placings(number, seed=5):
    """Aligned, tilted, and others at random."""
    draw = np.random.default_rng(seed)
    others = (
        Placing(
            draw.uniform(0.0, 2.0 * np.pi), tuple(draw.uniform(0.0, 1.0, 2)), cell, tuple(draw.uniform(0.3, 0.6, 2))
        )
        for cell in draw.uniform(0.06, 0.12, number - 2)
    )
    return [ALIGNED, TILTED, *others]


@cache
def block_pull_off(placing, c=1e-3 * E, range_=0.0, step=0.0025, first=0.9, retries=True):
    """Stress over c at which the lower block falls: quasi-static, its weight grows by `step` c L in every step.

    In the first step it is `first` c L. Without `retries` the first step that fails is the last. The range is in
    cells.
    """
    turn, offset, width, height = rotation(placing.turn), placing.cell * np.array(placing.offset), 1.0, 0.6

    def body(bottom, spacing):
        x = box((0.0, bottom), (width, height), spacing=spacing * placing.cell)
        return Body(Points(turn @ x.x + offset[:, None], x.volume, x.outline), NeoHookean(E, 0.0, DENSITY))

    bodies, up = [body(0.0, placing.spacing[0]), body(-height, placing.spacing[1])], turn[:, 1]
    weight = c * width / (DENSITY * width * height)  # acceleration at which the weight is c L
    scene = Scene(
        bodies,
        cell=placing.cell,
        supports=[Support(lambda X: up @ (X - offset[:, None]) > height - 1e-9)],
        gravity=lambda X, t: np.repeat((-weight * t * up)[:, None], X.shape[1], axis=1),
        friction=0.5,
        cohesion=c,
        cohesion_range=range_ * placing.cell,
    )
    scheme = Scheme(inertia=False)
    tension, state, dt = 0.0, initial(scene, scheme=scheme), first
    try:
        while True:
            if retries:
                *_, state = simulate(scene, dt=dt, until=state.t + dt, scheme=scheme, start=state)
            else:
                state = advance(scene, state, dt, scheme=scheme)
            tension, dt = -state.contacts.force[0].sum() / (c * width), step
    except StepFailed:
        return tension


BLOCKS = ((1e-3, 0.0), (1e-2, 0.005))  # c / E, range [cells]


@pytest.mark.parametrize("placing", placings(3), ids=["aligned", "tilted", "a"])
@pytest.mark.parametrize("c, range_", BLOCKS)
def test_two_blocks_come_off_at_their_cohesion(placing, c, range_):
    """Equal cross-sections under uniform tension (nu = 0): pull-off stress c within 1 %, at steps of 0.25 %.

    The stress at single points scatters about the mean. With c / E = 0.01, those that bear c open by more than 0.001
    cells, which is open, before the others bear it too: without range the worst of 20 placings comes off at 0.9 c.
    """
    assert block_pull_off(placing, c * E, range_, first=0.99, retries=False) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("left, width, turn", [(0.0, 1.0, 0.0), (0.21, 0.43, 0.4), (-0.4, 1.0, 0.4)])
def test_the_work_of_separation_of_two_blocks_is_that_of_their_cohesive_zone(left, width, turn, steps=50):
    """Blocks thrown apart that touch along L: the tension takes c delta L, up to one of the steps that cross delta.

    The corners of the upper block lie on those, between the corners and beyond the side of the lower one.
    """
    cell, c, delta, speed, axes = 0.1, 1e3, 0.02, 0.2, rotation(turn)

    def thrown(corner, size, spacing, velocity):
        x = box(corner, size, spacing=spacing * cell)
        body = Points(axes @ x.x + cell * np.array([[0.3], [0.7]]), x.volume, x.outline)
        return Body(body, NeoHookean(E, 0.0, DENSITY), velocity=velocity * axes[:, 1])

    lower = thrown((0.0, -0.6), (1.0, 0.6), 0.5, -speed)
    upper = thrown((left, 0.0), (width, 0.6), 0.37, speed)
    scene = Scene([lower, upper], cell=cell, friction=0.5, cohesion=c, cohesion_range=delta)
    dt = 0.5 * delta / speed / steps
    *_, state = simulate(scene, dt=dt, until=1.5 * steps * dt)
    assert not state.contacts.force.any()
    length = min(left + width, 1.0) - max(left, 0.0)
    assert 1.0 <= -state.report.energy.cohesion / (c * delta * length) < 1.0 + 1.0 / steps


# Disc


NODES, WEIGHTS = np.polynomial.legendre.leggauss(200)


def gap_at_end(a, b, R, c):
    """Gap at the end b of the cohesive zone [m]."""
    B, v = np.sqrt(b * b - a * a), 0.5 * (1.0 + NODES)
    s = 1.0 - v**2  # z = s B; dx = z dz / x, ds = 2 v dv regularises the logarithm
    slope = s * B / R + 2.0 * c / (np.pi * STIFFNESS) * np.log((1.0 + s) / (1.0 - s))
    return float(WEIGHTS @ (slope * s * B**2 / np.hypot(s * B, a) * v))


def load(a, R, c, delta):
    """Load P of half width of contact a [N/m]."""
    b = brentq(lambda b: gap_at_end(a, b, R, c) - delta, a * (1.0 + 1e-9), 2.0 * R)
    return np.pi * STIFFNESS * a * a / (4.0 * R) - 2.0 * c * np.sqrt(b * b - a * a)


@cache
def theory(c, delta, R=1.0):
    """Pull-off force [N/m]."""
    width = np.geomspace(1e-5, 0.5, 90) * R
    k = int(np.argmin([load(a, R, c, delta) for a in width]))
    bounds = width[max(k - 1, 0)], width[min(k + 1, width.size - 1)]
    return -float(minimize_scalar(lambda a: load(a, R, c, delta), bounds=bounds, method="bounded").fun)


def jkr(w, R=1.0):
    """Pull-off force for a short range [N/m]."""
    return 0.75 * (4.0 * np.pi * STIFFNESS * w**2 * R) ** (1.0 / 3.0)


@cache
def disc_curve(cells, c, delta, press=0.005, step=2e-4):
    """Displacement of the wall from the first touch and tension, after every step until the disc comes off.

    LinearElastic, R = 1 m, R/h = `cells`, two boundary points a cell, held above 0.5 R; `step` [m] a step.
    """
    cell, offset = 1.0 / cells, np.array([0.3, 0.7]) / cells
    points = disc((0.0, 0.0), 1.0, spacing=0.5 * cell)
    x = rotation(-0.5 * np.pi) @ points.x + offset[:, None]  # a boundary point at the bottom
    down = round(press / step)
    scene = Scene(
        [Body(Points(x, points.volume, points.outline), LinearElastic(E, NU, DENSITY))],
        cell=cell,
        walls=[
            Wall(offset - [0.0, 1.0], (0.0, 1.0), velocity=lambda t: (0.0, step if t < down else -step), cohesion=c)
        ],
        supports=[Support(lambda X: X[1] > offset[1] + 0.5)],
        cohesion_range=delta,
    )
    found = []
    try:
        for state in simulate(scene, dt=1.0, until=2000.0, scheme=Scheme(inertia=False)):
            found.append((state.walls[0, 1] - offset[1] + 1.0, state.wall_force[0, 1]))
            if state.t > down and found[-1][1] == 0.0:
                break
    except StepFailed:  # it snaps off
        assert state.t > down
    return np.array(found).T


def disc_pull_off(cells, c, delta, **options):
    """Largest tension [N/m]."""
    return float(disc_curve(cells, c, delta, **options)[1].max())


CASES = ((0.05, 0.02), (0.1, 0.02), (0.1, 0.01))  # c / E, delta / R


def disc_error(cells, c, delta, step=0.01):
    """Of the pull-off force against the theory, relative; the wall moves by `step` ranges a step."""
    return disc_pull_off(cells, c * E, delta, press=0.25 * delta, step=step * delta) / theory(c * E, delta) - 1.0


@pytest.mark.parametrize("c, delta", CASES)
def test_a_disc_with_a_range_comes_off_as_theory_says(c, delta):
    """R/h = 10: within 5 %, too large; steps of delta / 50, as the zone is that at the start of a step and lags."""
    assert 0.0 < disc_error(10, c, delta, step=0.02) < 0.05


def test_the_theory_has_its_limits():
    """Short range: Johnson, Kendall & Roberts; stiff disc: 2 c sqrt(2 R delta)."""
    assert theory(0.5 * E, 1e-4) == pytest.approx(jkr(0.5 * E * 1e-4), rel=0.01)
    assert theory(1e-4 * E, 0.01) == pytest.approx(2e-4 * E * np.sqrt(0.02), rel=0.01)


def test_a_disc_without_range_comes_off_at_the_force_of_one_boundary_point():
    """With c / E = 0.01 the force halves with the spacing: without range there is no work of adhesion."""
    force = [disc_pull_off(cells, 0.01 * E, 0.0) / (0.01 * E) for cells in (5, 10, 20)]
    assert force == pytest.approx([0.1, 0.05, 0.025], rel=0.01)


# The table and its figure


def rows():
    """What docs/verification shows of this module."""
    where = placings(20)
    found = []
    for c, range_ in (*BLOCKS, (1e-2, 0.0)):
        errors = [block_pull_off(p, c * E, range_) - 1.0 for p in where]
        worst = float(np.abs(errors).max())
        why = "met" if worst < 0.01 else "missed: points that bear c open before others do, preflight warns of it"
        found.append(Row(f"two flat blocks under tension, c/E = {c:g}, range {range_:g} h: stress when they come off",
                         "c", "20 placings, spacings 0.3 to 0.6 h", f"at most {numbers([worst])}", "-", f"1 %: {why}",
                         "test_two_blocks_come_off_at_their_cohesion"))  # fmt: skip
    for c, delta in CASES:
        errors = [disc_error(cells, c, delta) for cells in SIZES]
        met = "met" if max(np.abs(errors[1:])) < 0.05 else "missed"
        found.append(Row(f"disc on a wall, c/E = {c:g}, range {delta:g} R: pull-off force",
                         "line contact with Dugdale's zone", f"R/h = {numbers(SIZES)}", numbers(errors), "-",
                         f"5 % from R/h = 10 on: {met}",
                         "test_a_disc_with_a_range_comes_off_as_theory_says"))  # fmt: skip
    force = [disc_pull_off(cells, 0.01 * E, 0.0) / (0.01 * E) for cells in SIZES]
    found.append(Row("disc on a wall, c/E = 0.01, without range: pull-off force", "none: no work of adhesion",
                     f"R/h = {numbers(SIZES)}",
                     f"pull-off force {numbers(force)} c R", "-", "shown: the force of one boundary point",
                     "test_a_disc_without_range_comes_off_at_the_force_of_one_boundary_point"))  # fmt: skip
    return found


SIZES = (5, 10, 20)


def figures(folder):
    """Tension over displacement, and pull-off forces over the resolution."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    c, delta = 0.1, 0.02
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.5, 3.4), layout="constrained")
    for i, cells in enumerate(SIZES):
        way, tension = disc_curve(cells, c * E, delta, press=0.25 * delta, step=0.01 * delta)
        left.plot(way, tension / E, color=f"C{i}", label=f"R/h = {cells}")
    left.axhline(theory(c * E, delta) / E, color="k", ls="--", lw=0.8, label="theory, pull-off")
    left.set(xlabel="displacement of the wall over R", ylabel="tension over E R")
    left.legend(fontsize=8)
    for i, (c, delta) in enumerate(CASES):
        error = [1.0 + disc_error(cells, c, delta) for cells in SIZES]
        right.plot(SIZES, error, "o-", color=f"C{i + 3}", label=f"c/E = {c:g}, range {delta:g} R")
    bare = [disc_pull_off(cells, 0.1 * E, 0.0) / theory(0.1 * E, 0.01) for cells in SIZES]
    right.plot(SIZES, bare, "s:", color="0.4", label="c/E = 0.1, no range (over the last)")
    right.axhline(1.0, color="k", ls="--", lw=0.8)
    right.set(
        xlabel="R/h", ylabel="pull-off force over theory", xscale="log", xticks=SIZES, xticklabels=SIZES, ylim=0.0
    )
    right.minorticks_off()
    right.legend(fontsize=8)
    figure.savefig(folder / "adhesion.png", dpi=130)
    plt.close(figure)
    return {
        "adhesion.png": "A disc pulled from a wall. Left: tension over the displacement of the wall from the first"
        " touch, negative under pressure, for c/E = 0.1 and a range of 0.02 R. Right: pull-off force over that of a"
        " line contact with Dugdale's cohesive zone; without range it depends on the cells."
    }
