"""Discs that come to rest under gravity: ten in a box, and a heavy one on a light one."""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from ledger import Row, numbers

from skmpm import linear
from skmpm.material import NeoHookean
from skmpm.points import disc
from skmpm.scene import Body, Scene, StepFailed, Wall
from skmpm.scheme import Scheme
from skmpm.simulation import simulate
from skmpm.step.algorithm import step
from skmpm.step.initial_state import initial

G, R, DENSITY = 10.0, 0.1, 1000.0
SOLVERS = {"banded": linear.banded}  # amg solves for one contact row at a time: a pile takes it a quarter of an hour

# The pile: three loose columns that fall upon each other in a box of 72 cm; the discs sink in by 1-2 % of R.

WIDTH, PILE_E, PILE_CELL, DISCS = 0.72, 1e6, R / 4.0, 10
FALL = np.sqrt(2.0 * G * 0.8)  # from the top of the pile [m/s]


def pile(seed):
    """Ten discs of 8 to 10 cm, friction 0.5 between them and on the floor, side walls without friction."""
    draw = np.random.default_rng(seed)
    shift, top, bodies = PILE_CELL * draw.uniform(0.0, 1.0, 2), np.zeros(3), []
    for i, radius in enumerate(R * draw.uniform(0.8, 1.0, DISCS)):
        reach = 1.02 * radius
        x = np.clip(0.12 + 0.24 * (i % 3) + draw.uniform(-0.01, 0.01), reach, WIDTH - reach)
        points = disc(shift + np.array([x, top[i % 3] + reach]), radius, spacing=0.5 * PILE_CELL)
        bodies.append(Body(points, NeoHookean(PILE_E, 0.3, DENSITY)))
        top[i % 3] += 2.0 * reach
    side = shift + np.array([WIDTH, 0.0])
    walls = [Wall(shift, (0, 1), friction=0.5), Wall(shift, (1, 0), friction=0.0), Wall(side, (-1, 0), friction=0.0)]
    return Scene(bodies, cell=PILE_CELL, walls=walls, friction=0.5, gravity=(0.0, -G))


@dataclass(frozen=True)
class Rest:
    """What the floor bears, and how fast the fastest point is."""

    t: np.ndarray  # (n,) [s]
    floor: np.ndarray  # (n,) force over weight
    speed: np.ndarray  # (n,) over that of free fall
    overlap: float  # at the end
    states: tuple  # first and last


@cache
def settle(seed, solver="banded", until=4.0, dt=1e-2):
    """Backward Euler, whose damping is what takes the energy of normal motion out."""
    scene = pile(seed)
    start, found = initial(scene), []
    weight = start.mass.sum() * G
    for state in simulate(scene, dt=dt, until=until, scheme=Scheme(linear=SOLVERS[solver]), start=start):
        found.append((state.t, -state.wall_force[0, 1] / weight, np.hypot(*state.v).max() / FALL))
    return Rest(*np.array(found).T, state.report.overlap, (start, state))


def at_rest(rest, since=3.8):
    """Largest error of the floor force, and largest speed, from a time on."""
    last = rest.t > since
    return float(np.abs(rest.floor[last] - 1.0).max()), float(rest.speed[last].max())


@pytest.mark.slow
@pytest.mark.parametrize("solver", SOLVERS)
def test_a_pile_of_ten_discs_comes_to_rest_and_the_floor_bears_its_weight(solver):
    """After 2.3 s (3.8 s in the table), dt = 10 ms: at every step the floor force is within 0.5 % of the weight.

    And no point is faster than 1e-3 of the speed of free fall from the top.
    """
    rest = settle(0, solver, until=2.5)
    force, speed = at_rest(rest, since=2.3)
    assert force < 5e-3
    assert speed < 1e-3
    assert rest.speed.max() > 0.2  # they fell
    assert rest.overlap < 1e-4


# A heavy disc on a light one of the same size and stiffness, under which both deform by about 1 % of R.

RATIO = 1e4


@dataclass(frozen=True)
class Burden:
    """A heavy disc on a light one at rest."""

    gap: float  # deepest at the end of any step, over a cell
    overlap: float  # over the area, largest
    floor: float  # force over weight - 1, at the end
    sunk: float  # of the heavy centre, over R
    creep: float  # the same between half time and the end


@cache
def burden(solver="banded", offset=(0.3, 0.6), cells=5, steps=80, dt=5e-3):
    """Heavy disc, 1e4 times the light one's mass; backward Euler; friction 0.5, frictionless walls at both sides."""
    cell = R / cells
    light, heavy = (NeoHookean(3e6, 0.3, density) for density in (0.1, 0.1 * RATIO))
    shift = cell * np.array(offset)
    bodies = [
        Body(disc(shift + np.array([0.0, y * R]), R, spacing=cell / 2), m) for y, m in ((1.0, light), (3.0, heavy))
    ]
    right = np.array([R, 0.0])
    sides = [Wall(shift - right, (1, 0), friction=0.0), Wall(shift + right, (-1, 0), friction=0.0)]
    walls = [Wall(shift, (0, 1), friction=0.5), *sides]
    scene = Scene(bodies, cell=cell, walls=walls, friction=0.5, gravity=(0.0, -G))
    start = initial(scene)
    weight, top, heights, deepest, shared = start.mass.sum() * G, start.body == 1, [3.0 * R + shift[1]], 0.0, 0.0
    for state in simulate(scene, dt=dt, until=steps * dt, scheme=Scheme(linear=SOLVERS[solver]), start=start):
        heights.append(np.average(state.x[1, top], weights=state.mass[top]))
        deepest = min(deepest, float(state.contacts.gap.min(initial=0.0)))
        shared = max(shared, state.report.overlap)
    sunk = (heights[0] - np.array(heights)) / R
    floor = float(-state.wall_force[0, 1] / weight - 1.0)
    return Burden(deepest / cell, shared, floor, float(sunk[-1]), float(sunk[-1] - sunk[len(sunk) // 2]))


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_heavy_disc_on_a_light_one_does_not_sink(solver):
    """Mass ratio 1e4: the light disc bears it, deformed by a few per cent of R, and neither creeps nor overlaps.

    No gap below -1e-3 of a cell at the end of any step; the floor bears the weight within 0.5 %.
    """
    found = burden(solver)
    assert found.gap > -1e-3
    assert found.overlap < 1e-3
    assert abs(found.floor) < 5e-3
    assert 0.0 < found.sunk < 0.05
    assert abs(found.creep) < 1e-4


def test_a_grain_of_gel_rests_under_its_own_weight(spacing=12):
    """A disc of 1 mm and 10 MPa: it gives way by a millionth of R, contacts near by are far from that.

    Full steps throughout, and after 5 ms the floor bears the weight within 0.1 %.
    """
    r = 1e-3
    grain = Body(disc((0.0, r), r, spacing=r / spacing), NeoHookean(1e7, 0.45, 990.0))
    scene = Scene([grain], cell=r / 5.0, walls=[Wall((0, 0), (0, 1), friction=0.5)], gravity=(0.0, -9.81))
    states = list(simulate(scene, dt=1.5e-5, until=5e-3))
    assert sum(state.report.retries for state in states) == 0
    assert -states[-1].wall_force[0, 1] == pytest.approx(9.81 * states[-1].mass.sum(), rel=1e-3)


def test_discs_as_soft_as_their_own_weight_come_to_rest():
    """Four rows whose weight over their height is Young's modulus sink to 0.76 of it; with 3 E a step fails."""
    height = 8.0 * R
    E = DENSITY * G * height
    gel = NeoHookean(E, 0.45, DENSITY, viscosity=0.2 * R * np.sqrt(DENSITY * E))
    centres = [(R * (1 + 2 * i + 0.01 * (j % 2)), R * (1 + 2 * j)) for j in range(4) for i in range(2)]
    bodies = [Body(disc(centre, R, spacing=0.74 * R / 5), gel) for centre in centres]
    sides = [Wall((0.0, 0.0), (1, 0), friction=0.0), Wall((4.02 * R, 0.0), (-1, 0), friction=0.0)]
    walls = [Wall((0.0, 0.0), (0, 1)), *sides]
    scene = Scene(bodies, cell=R / 5, walls=walls, friction=0.3, gravity=(0.0, -G))
    for state in simulate(scene, until=8.0 * np.sqrt(height / G), warn=False):  # noqa: B007
        pass
    energy = state.report.energy
    assert energy.kinetic < 1e-4 * energy.elastic
    assert -state.wall_force[0, 1] == pytest.approx(G * state.mass.sum(), rel=5e-3)
    assert 0.7 * height < state.x[1].max() < 0.85 * height


def test_how_fast_a_frictionless_floor_slides_below_grains_does_not_matter():
    """Two grains that touch with friction, on a floor without: at 20 m/s it bears them as it does at rest."""
    r, gel = 1e-3, NeoHookean(1e7, 0.45, 990.0)
    grains = [Body(disc((x, r), r, spacing=r / 8), gel) for x in (-1.05 * r, 1.05 * r)]

    def borne(speed):
        floor = Wall((0, 0), (0, 1), velocity=(speed, 0.0), friction=0.0)
        scene = Scene(grains, cell=r / 5.0, walls=[floor], friction=0.5, gravity=(0.0, -9.81))
        return [-state.wall_force[0, 1] for state in simulate(scene, dt=1.5e-5, until=1.5e-3)]

    assert borne(20.0) == pytest.approx(borne(0.0), rel=1e-6)


@pytest.mark.parametrize("inertia", [True, False])
@pytest.mark.parametrize("apart", [2.2, 2.6])
def test_three_frictionless_discs_push_the_side_walls_along_their_lines_of_centres(apart, inertia):
    """Two on a floor between walls, one on them: W tan(angle) / 2; contact at boundary points alone is 12 % off."""
    r, gel, h = 0.01, NeoHookean(1e7, 0.3, 1000.0), 0.002
    centres = [(-apart * r / 2, r), (apart * r / 2, r), (0.0, r * (1.0 + np.sqrt(4.0 - apart**2 / 4)))]
    side = r * (1.0 + apart / 2)
    walls = [Wall((0, 0), (0, 1)), Wall((-side, 0), (1, 0)), Wall((side, 0), (-1, 0))]
    bodies = [Body(disc(c, r, spacing=0.66 * h), gel) for c in centres]
    scene = Scene(bodies, cell=h, walls=walls, gravity=(0.0, -9.81))
    *_, state = simulate(scene, until=0.5, dt=None if inertia else 0.25, scheme=Scheme(inertia=inertia))
    left, right, top = (state.x[:, state.body == b].mean(axis=1) for b in range(3))
    weight = 9.81 * state.mass[state.body == 2].sum()
    for wall, below in ((1, left), (2, right)):
        across, up = np.abs(top - below)
        assert abs(state.wall_force[wall, 0]) == pytest.approx(0.5 * weight * across / up, rel=5e-3)


@pytest.mark.nightly
@pytest.mark.parametrize(("share", "stands"), [(0.7, False), (1.15, True)])
@pytest.mark.parametrize("spacing", [0.625, 0.66])
def test_a_pile_without_inertia_needs_about_the_friction_of_its_limit(spacing, share, stands):
    """Two discs on a floor, one on them: tan(angle / 2). On chords it may do with 0.8 of it."""
    r, h, half = 0.01, 0.002, 1.1
    height = np.sqrt(4.0 - half**2)
    centres = [(-half * r, r), (half * r, r), (0.0, r * (1.0 + height))]
    bodies = [Body(disc(c, r, spacing=spacing * h), NeoHookean(1e7, 0.3, 1000.0)) for c in centres]
    friction = share * np.tan(0.5 * np.arctan2(half, height))
    scene = Scene(bodies, cell=h, walls=[Wall((0, 0), (0, 1))], friction=friction, gravity=(0.0, -9.81))
    static = Scheme(inertia=False)
    if not stands:
        with pytest.raises(StepFailed, match="no equilibrium was found"):
            step(scene, initial(scene, scheme=static), 0.3, scheme=static)
        return
    *_, state = simulate(scene, dt=0.3, until=0.6, scheme=static)
    assert state.x[1, state.body == 2].mean() > 2.45 * r


# The table and its figures.

PILES, BURDENS = range(4), 20


def rows():
    """What docs/verification shows of this module."""
    rests = np.array([at_rest(settle(seed)) for seed in PILES]).T
    draw = np.random.default_rng(5)
    found = [burden(offset=tuple(draw.uniform(0.0, 1.0, 2))) for _ in range(BURDENS)]
    sunk = [f.sunk for f in found]
    rested = rests[0].max() <= 5e-3 and rests[1].max() <= 1e-3
    borne = all(f.gap > -1e-3 and abs(f.creep) < 1e-4 and abs(f.floor) < 5e-3 for f in found)
    return [
        Row(
            "ten discs fall into a box and come to rest, 3.8 s after",
            "floor force: the weight; speed: nothing",
            f"R/h = 3.2 to 4, {len(PILES)} piles",
            f"floor force {numbers(rests[0])}; fastest point {numbers(rests[1])} of free fall",
            "-",
            f"0.5 %, 1e-3: {'met' if rested else 'missed'} ({len(PILES)} piles only, not 20: about 12 s each)",
            "test_a_pile_of_ten_discs_comes_to_rest_and_the_floor_bears_its_weight",
        ),
        Row(
            "heavy disc on a light one, mass ratio 1e4, at rest",
            "neither overlap nor creep; floor force: the weight",
            f"R/h = 5, {BURDENS} offsets",
            f"deepest gap {min(f.gap for f in found):.1g} h; sunk in by {min(sunk):.2g} to {max(sunk):.2g} R, creep"
            f" {max(abs(f.creep) for f in found):.1g} R; floor force {max(abs(f.floor) for f in found):.1g}",
            "-",
            f"does not sink: {'met' if borne else 'missed'}",
            "test_a_heavy_disc_on_a_light_one_does_not_sink",
        ),
    ]


def figures(folder):
    """Draw the pile at rest and its floor force over time."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    rest = settle(0)
    fig, (left, right) = plt.subplots(1, 2, figsize=(8, 3.6), layout="constrained")
    state = rest.states[1]
    pressure = -0.5 * np.trace(state.stress) / 1e3
    dots = left.scatter(*state.x, c=pressure, s=7, lw=0.0, cmap="viridis", vmin=0.0, vmax=np.quantile(pressure, 0.98))
    offsets = np.flatnonzero(np.diff(state.body)) + 1
    for own in np.split(np.arange(state.body.size), offsets):
        boundary = own[-state_rim(state, own) :]
        left.fill(*state.x[:, boundary], fill=False, lw=0.6)
    for i, point in enumerate(state.walls):
        (left.axvline(point[0], color="k", lw=1) if i else left.axhline(point[1], color="k", lw=1))
    left.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    fig.colorbar(dots, ax=left, label="pressure [kPa]")
    right.semilogy(rest.t, np.abs(rest.floor - 1.0) + 1e-12, label="floor force over weight - 1")
    right.semilogy(rest.t, rest.speed, label="fastest point over free fall")
    right.axhline(5e-3, color="C0", ls=":", lw=1)
    right.axhline(1e-3, color="C1", ls=":", lw=1)
    right.set(xlabel="time [s]", ylim=(1e-7, 2.0))
    right.legend(fontsize=7)
    fig.savefig(folder / "pile.png", dpi=120)
    plt.close(fig)
    return {
        "pile.png": "Ten discs at rest (pressure), and how they come to rest; dotted: the goals (0.5 % of the weight,"
        " 1e-3 of the speed of free fall)."
    }


def state_rim(state, own):
    """How many of a disc's points, its last, lie on its boundary: all at the largest distance from the centre."""
    x = state.x_anchor[:, own]
    distance = np.hypot(*(x - x.mean(axis=1, keepdims=True)))
    return int((distance > distance.max() * (1.0 - 1e-6)).sum())
