"""Friction on an incline against closed forms: a block that sticks or slides, a disc that rolls or slides.

Errors are relative to the reference. The incline is a wall at any angle to the grid, and gravity is rotated with it.
An inclined wall under vertical gravity, and a wall along the grid under inclined gravity, are two of these cases. At
first only the part of gravity normal to the wall acts, in long steps of backward Euler, until the body rests. Then
its part along the wall sets in.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from ledger import Row, numbers
from placements import ALIGNED, Placement, at_random

from skmpm import linear
from skmpm.material import LinearElastic, NeoHookean
from skmpm.points import Points, box, disc
from skmpm.scene import Body, Scene, Wall
from skmpm.scheme import Scheme
from skmpm.simulation import simulate
from skmpm.step.initial_state import initial

G, DENSITY, SLOPE = 10.0, 1000.0, np.radians(30.0)
SOLVERS = {"banded": linear.banded, "amg": linear.amg}
CASES = 20  # of the table


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


INCLINED = Placement(-SLOPE, (0.37, 0.81))  # gravity is vertical


def positions(count, seed=3):
    """Aligned, inclined, and others at random."""
    return [ALIGNED, INCLINED, *at_random(count - 2, seed)]


def incline(points, material, *, cell, friction, position, ramp):
    """A body on a wall; the part of gravity along the wall rises from nothing in the times `ramp` [s]."""
    turn, offset = rotation(position.turn), cell * np.array(position.offset)
    along, down = turn @ [G * np.sin(SLOPE), 0.0], turn @ [0.0, -G * np.cos(SLOPE)]

    def gravity(X, t):
        share = np.clip((t - ramp[0]) / (ramp[1] - ramp[0]), 0.0, 1.0)
        return np.repeat((down + share * along)[:, None], X.shape[1], axis=1)

    body = Body(Points(turn @ points.x + offset[:, None], points.volume, points.outline), material)
    return Scene([body], cell=cell, walls=[Wall(offset, turn[:, 1], friction=friction)], gravity=gravity)


@dataclass(frozen=True)
class Motion:
    """Of the centre of mass along and normal to the wall, and of the spin, after every step."""

    t: np.ndarray  # (n,) [s]
    v: np.ndarray  # (2, n) [m/s]
    spin: np.ndarray  # (n,) [rad/s]
    force: np.ndarray  # (2, n) of the wall on the body [N/m]

    def acceleration(self, since):
        """Slopes of velocities and spin over time, by least squares from a time on, (3,)."""
        i = self.t > since
        return np.polyfit(self.t[i], np.stack([*self.v, self.spin])[:, i].T, 1)[0]


def follow(scene, position, stages, **options):
    """The motion through stages (dt, until, options)."""
    back, last, found = rotation(position.turn).T, initial(scene, scheme=Scheme(**options)), []
    share = last.mass / last.mass.sum()
    for dt, until, more in stages:
        for state in simulate(scene, dt=dt, until=until, scheme=Scheme(**{**options, **more}), start=last):
            arm = state.x - (state.x @ share)[:, None]
            spin = share @ (arm[0] * state.v[1] - arm[1] * state.v[0]) / (share @ (arm**2).sum(axis=0))
            found.append((state.t, *(back @ state.v @ share), spin, *(-back @ state.wall_force[0])))
            last = state
    t, along, normal, spin, *force = np.array(found).T
    return Motion(t, np.stack([along, normal]), spin, np.array(force))


# The block: 20 x 10 cm, 10 x 5 cells; its slowest vibration lasts about 12 ms.

BLOCK_CELL, SLIDES, STICKS = 0.02, 0.3, 1.1 * np.tan(SLOPE)
TIGHT = {"newton_tol": 1e-10, "contact_tol": 1e-9, "gap_tol": 1e-8}


@cache
def block(friction, position, solver="banded"):
    """LinearElastic, 0.3 s at rest and 0.3 s after gravity along the wall has set in; backward Euler, dt = 5 ms."""
    points = box((0.0, 0.0), (0.2, 0.1), spacing=0.75 * BLOCK_CELL)
    scene = incline(
        points,
        LinearElastic(1e6, 0.3, DENSITY),
        cell=BLOCK_CELL,
        friction=friction,
        position=position,
        ramp=(0.3, 0.35),
    )
    return follow(scene, position, [(5e-3, 0.6, {})], linear=SOLVERS[solver], **TIGHT)


def block_slides(friction):
    return G * (np.sin(SLOPE) - friction * np.cos(SLOPE))


def lift(motion):
    """Largest normal velocity over that along the wall, in the last 0.1 s."""
    last = motion.t > 0.5
    return float(np.abs(motion.v[1, last] / motion.v[0, last]).max())


def slide_error(motion, friction):
    """Of the acceleration in the last 0.2 s, relative."""
    return float(motion.acceleration(0.4)[0] / block_slides(friction) - 1.0)


def placed(names):
    """Positions of these names with the banded solver, and the inclined one with multigrid."""
    where = dict(zip(names, positions(len(names)), strict=True))
    cases = [*((name, "banded") for name in names), ("inclined", "amg")]
    return pytest.mark.parametrize(
        ("position", "solver"), [pytest.param(where[name], solver, id=f"{name}-{solver}") for name, solver in cases]
    )


@placed(["aligned", "inclined", "a"])
def test_block_slides_without_lift(position, solver):
    """Friction 0.3 on 30 degrees: a = g (sin - mu cos) within 1 %, normal velocity below 1e-8 of the sliding speed.

    Asserted to 1e-6: Coulomb's law holds in every contact, so it holds in their sum to the contact tolerance (1e-9).
    """
    motion = block(SLIDES, position, solver)
    assert abs(slide_error(motion, SLIDES)) < 1e-6
    assert lift(motion) < 1e-8
    assert motion.v[0, -1] > 0.5


@placed(["aligned", "inclined"])
def test_block_sticks(position, solver):
    """Friction 1.1 tan(slope): at rest, its speed below 1e-6 of what it would have fallen to along the wall."""
    motion = block(STICKS, position, solver)
    assert np.abs(motion.v[:, motion.t > 0.5]).max() < 1e-6 * G * np.sin(SLOPE) * 0.25
    assert motion.force[0, -1] == pytest.approx(-0.02 * DENSITY * G * np.sin(SLOPE), rel=1e-6)


# The disc: R/h = 10, E so that it sinks in by 0.5 % of R.

RADIUS, REST = 0.1, 0.5
LIMIT = np.tan(SLOPE) / 3.0
ROLLS, SLIPS, NEAR = 0.5, 0.1, 0.97 * np.tan(SLOPE) / 3.0


@cache
def round_body(friction, position, solver="banded", cells=10, young=1e6):
    """NeoHookean; midpoint rule once gravity along the wall sets in, over 20 ms, dt = 2.5 ms, 0.25 s."""
    cell = RADIUS / cells
    scene = incline(
        disc((0.0, RADIUS), RADIUS, spacing=0.5 * cell),
        NeoHookean(young, 0.3, DENSITY),
        cell=cell,
        friction=friction,
        position=position,
        ramp=(REST, REST + 0.02),
    )
    stages = [(0.02, REST, {}), (2.5e-3, REST + 0.25, {"theta": 0.5})]
    return follow(scene, position, stages, linear=SOLVERS[solver])


def disc_exact(friction):
    """Acceleration along the wall and of the spin."""
    if friction >= LIMIT:
        a = 2.0 / 3.0 * G * np.sin(SLOPE)
        return np.array([a, -a / RADIUS])
    return np.array([block_slides(friction), -2.0 * friction * G * np.cos(SLOPE) / RADIUS])


def disc_errors(motion, friction):
    """Of the accelerations along the wall and of the spin from 0.1 s after the start on, relative, (2,)."""
    return motion.acceleration(REST + 0.1)[[0, 2]] / disc_exact(friction) - 1.0


def test_disc_rolls():
    """Friction 0.5 on 30 degrees, R/h = 10: a = 2/3 g sin(slope), spin a / R, within 1 %."""
    errors = disc_errors(round_body(ROLLS, INCLINED), ROLLS)
    assert np.abs(errors).max() < 0.01


def test_disc_slides():
    """Friction 0.1 on 30 degrees, R/h = 10: a = g (sin - mu cos) within 1 %.

    Goal 1 % for the spin's acceleration: missed, 1 to 4 % too small (asserted: 5 %). Lumped mass makes the moment of
    inertia larger by 2/3 (h/R)^2, 0.7 %; the arm is shorter than R by the 0.5 % that the disc sinks in; the rest are
    probably blows: every boundary point that comes down hits the wall on the leading side, a resistance to rolling.
    It grows with stiffness (5 and 7 % at E = 1e7 and 1e8 Pa, where the disc stands on one or two points), shrinks
    with h and is the same for dt = 1 and 2 ms, theta = 1 and a boundary twice as fine. Contact points that glide
    along the boundary cure it where the disc stands on one point (1.3 % at 1e8) and make it worse where they are many
    and loaded.
    """
    errors = disc_errors(round_body(SLIPS, INCLINED), SLIPS)
    assert abs(errors[0]) < 0.01
    assert -0.05 < errors[1] < 0.0


def slip(friction, position):
    """Acceleration of the disc's boundary along the wall over that of rolling."""
    along, _, spin = round_body(friction, position).acceleration(REST + 0.1)
    return float((along + RADIUS * spin) / disc_exact(1.0)[0])


def stick_limit(position):
    """The friction at which slip vanishes, from two discs that slide, over tan(slope) / 3."""
    friction = np.array([SLIPS, NEAR])
    slips = np.array([slip(mu, position) for mu in friction])
    return float((friction[1] - slips[1] * np.diff(friction) / np.diff(slips))[0] / LIMIT)


def test_the_limit_of_rolling_is_a_third_of_the_slope():
    """R/h = 10: slip grows linearly with mu below tan(slope) / 3 and vanishes there, within 2 %.

    And 3 % above it the boundary creeps by less than the elastic bound mu a / R = 1 % of Carter's theory (Proc. R.
    Soc. Lond. A 112, 1926), while 3 % below it slips.
    """
    assert stick_limit(INCLINED) == pytest.approx(1.0, abs=0.02)
    assert slip(1.03 * LIMIT, INCLINED) < 0.015 < 0.04 < slip(NEAR, INCLINED)


# The table and its figures.


def spread(values):
    """Mean and largest size."""
    values = np.asarray(values)
    return f"mean {values.mean():.2g}, worst {values[np.abs(values).argmax()]:.2g}"


def verdict(goal, values, bar):
    """Met: the mean size within the bar and the worst within three times the bar."""
    size = np.abs(np.asarray(values))
    return f"{goal}: {'met' if size.mean() <= bar and size.max() <= 3.0 * bar else 'missed'}"


def rows():
    """What docs/verification shows of this module."""
    where = positions(CASES)
    slides, sticks = ([block(mu, position) for position in where] for mu in (SLIDES, STICKS))
    rolls, slips = (np.array([disc_errors(round_body(mu, p), mu) for p in where]) for mu in (ROLLS, SLIPS))
    limits = np.array([stick_limit(position) for position in where]) - 1.0
    errors = [slide_error(motion, SLIDES) for motion in slides]
    lifts = [lift(motion) for motion in slides]
    drift = [np.abs(m.v[:, m.t > 0.5]).max() / (G * np.sin(SLOPE) * 0.25) for m in sticks]
    block_grid, disc_grid = f"10 x 5 cells, {CASES} positions", f"R/h = 10, {CASES} positions"
    limited = "test_the_limit_of_rolling_is_a_third_of_the_slope"
    return [
        Row("block slides on an incline: acceleration", "g (sin - mu cos)", block_grid, spread(errors), "-",
            verdict("1 %", errors, 0.01), "test_block_slides_without_lift"),
        Row("block slides on an incline: normal over sliding velocity", "0", block_grid,
            f"{max(lifts):.1g} at most", "-", verdict("1e-8, with contact_tol 1e-9", lifts, 1e-8),
            "test_block_slides_without_lift"),
        Row("block sticks: speed over that without friction", "0", block_grid, f"{max(drift):.1g} at most", "-",
            verdict("rest, 1e-6", drift, 1e-6), "test_block_sticks"),
        Row("disc rolls: acceleration; of the spin", "2/3 g sin; a / R", disc_grid,
            f"{spread(rolls[:, 0])}; {spread(rolls[:, 1])}", "-", verdict("1 %", rolls, 0.01), "test_disc_rolls"),
        Row("disc slides: acceleration", "g (sin - mu cos)", disc_grid, spread(slips[:, 0]), "-",
            verdict("1 %", slips[:, 0], 0.01), "test_disc_slides"),
        Row("disc slides: acceleration of the spin", "2 mu g cos / R", disc_grid, spread(slips[:, 1]), "-",
            verdict("1 %", slips[:, 1], 0.01) + " (lumped mass 0.7 %, shorter arm 0.5 %, likely boundary points)",
            "test_disc_slides"),
        Row("disc slides, E = 1e6, 1e7, 1e8 Pa, inclined: acceleration of the spin", "2 mu g cos / R", "R/h = 10; 20",
            "; ".join(numbers([disc_errors(round_body(SLIPS, INCLINED, cells=c, young=E), SLIPS)[1]
                               for E in (1e6, 1e7, 1e8)]) for c in (10, 20)),
            "-", "shown", "test_disc_slides"),
        Row("stick limit of a disc", "tan / 3", disc_grid, spread(limits), "-",
            verdict("2 %", limits, 0.02), limited),
    ]  # fmt: skip


def figures(folder):
    """Draw accelerations of block and disc over friction."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    fig, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    mu, scale = np.linspace(0.0, 0.8, 400), G * np.sin(SLOPE)
    axes.plot(mu, np.maximum(block_slides(mu), 0.0) / scale, "k", lw=1, label="block, closed form")
    axes.plot(mu, [disc_exact(m)[0] / scale for m in mu], "k--", lw=1, label="disc, closed form")
    axes.plot(mu, [-disc_exact(m)[1] * RADIUS / scale for m in mu], "C1:", lw=1, label="disc, spin x R, closed form")
    shown = np.array([0.05, 0.2, 0.35, 0.5, 0.55, 0.6, 0.75])
    found = [block(m, INCLINED).acceleration(0.4)[0] / scale for m in shown]
    axes.plot(shown, found, "C0s", label="block, 10 x 5 cells")
    shown = np.array([0.03, SLIPS, 0.15, NEAR, 1.03 * LIMIT, 0.3, ROLLS])
    found = np.array([round_body(m, INCLINED).acceleration(REST + 0.1) for m in shown]) / scale
    axes.plot(shown, found[:, 0], "C2o", label="disc, R/h = 10")
    axes.plot(shown, -RADIUS * found[:, 2], "C1^", label="disc, spin x R")
    axes.axvline(LIMIT, color="0.7", lw=0.8)
    axes.set(xlabel="friction coefficient", ylabel="acceleration over g sin(slope)", ylim=(-0.03, 1.03))
    axes.legend(fontsize=7)
    fig.savefig(folder / "friction_incline.png", dpi=120)
    plt.close(fig)
    return {
        "friction_incline.png": "Accelerations of a block and a disc on an incline of 30 degrees under vertical"
        " gravity, against friction; the grey line is the stick limit tan / 3 of the disc."
    }
