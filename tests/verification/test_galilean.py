"""A Galilean test: a compressed disc that moves over the grid must keep its stress.

A disc of the material of Nezamabadi et al. (2017) is squeezed by four plates, each by 5 % of its radius, held until
it rests, and then moved rigidly with the plates over six cells. Nothing happens to it on the way, so the forces on
the plates stay. The plates have friction, 0.3: between smooth ones the squeezed disc turns to where it is softer,
moved or not.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from ledger import Row, numbers

from skmpm import linear, outline
from skmpm.material import NeoHookean
from skmpm.points import disc
from skmpm.scene import Body, Scene, Wall
from skmpm.scheme import Scheme
from skmpm.simulation import simulate

SOLVERS = {"banded": linear.banded, "amg": linear.amg}
SEED = NeoHookean(10e6, 0.45, 990.0)
R, CELL, CELLS = 1e-3, 0.2e-3, 6.0
FORCE = SEED.E / (1.0 - SEED.nu**2) * R  # E* R, in which forces are given [N/m]
SQUEEZED, REST, RIDE, END = 4e-4, 8e-4, 28e-4, 30e-4  # when the squeeze, the pause, the ride and the run end [s]
DT = 2e-5  # a shear wave crosses the disc in 3.4e-5 s: theta = 1 damps what the squeeze stirs up within the pause
NORMALS = ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
POINTS = {"2.5": 7, "10": 15, "21": 22}  # points per cell: rings of points


def ramp(t, start, end):
    """A smooth speed [1/s] whose integral from `start` to `end` [s] is 1."""
    s = np.clip((t - start) / (end - start), 0.0, 1.0)
    return 30.0 * (s * (1.0 - s)) ** 2 / (end - start)


def plate(normal, centre, cells, drift):
    """A plate that squeezes, waits and rides on; all with the velocity `drift` (2,) [m/s] besides."""
    n, ride = np.array(normal), np.array([cells * CELL, 0.0])

    def velocity(t):
        return 0.05 * R * ramp(t, 0.0, SQUEEZED) * n + ramp(t, REST, RIDE) * ride + drift

    return Wall(centre - R * n, n, velocity=velocity, friction=0.3)


def squeezed(rings, cells=CELLS, drift=(0.0, 0.0)):
    """The disc, off the nodes of its grid, between its plates."""
    centre, drift = np.array([0.13, 0.07]) * CELL, np.asarray(drift)
    body = Body(disc(centre, R, spacing=R / rings), SEED, velocity=drift)
    return Scene([body], cell=CELL, walls=[plate(n, centre, cells, drift) for n in NORMALS])


@dataclass(frozen=True)
class Ride:
    """What was seen at the end of every step."""

    t: np.ndarray  # (steps,) [s]
    cells: np.ndarray  # (steps,) crossed
    force: np.ndarray  # (4, steps) on the plates over E* R
    area: np.ndarray  # (steps,) inside the outline over the first
    J: np.ndarray  # (steps,) sum V0 det F / sum V0
    moving: np.ndarray  # (steps,) kinetic energy over elastic energy
    states: tuple  # at rest before the ride, and after it

    @property
    def held(self):
        """From the end of the pause on, (steps,)."""
        return self.t > REST - 0.5 * DT

    @property
    def kept(self):
        """The mean force on the plates over that at the end of the pause, from there on."""
        mean = self.force[:, self.held].mean(axis=0)
        return mean / mean[0]


def ride(rings, *, cells=CELLS, drift=(0.0, 0.0), until=END, **options):
    """Squeeze, hold and move the disc."""
    scene = squeezed(rings, cells, drift)
    boundary, volume, rows, states = scene.outlines, scene.initial_volumes.sum(), [], {}
    start = outline.area(boundary, scene.initial_positions[:, boundary.point], 1)[0]
    for state in simulate(scene, dt=DT, until=until, scheme=Scheme(**options)):
        force = -np.einsum("wi,iw->w", state.wall_force, scene.normals) / FORCE
        crossed = (state.walls[:, 0].mean() - 0.13 * CELL - drift[0] * state.t) / CELL
        area = outline.area(boundary, state.x[:, boundary.point], 1)[0] / start
        energy = state.report.energy
        rows.append((state.t, crossed, area, state.volume.sum() / volume, energy.kinetic / energy.elastic, *force))
        states["at rest" if state.t < REST + 0.5 * DT else "after"] = state
    t, crossed, area, J, moving, *force = np.array(rows).T
    return Ride(t, crossed, np.array(force), area, J, moving, tuple(states.values()))


@pytest.mark.parametrize("points", ["2.5", "21"])
def test_anchored_once_the_wall_force_stays_while_the_disc_is_moved_over_six_cells(points):
    """R/h = 5; 2.5 and 21 points per cell: the mean force within the goal of 1 % (1e-3 asserted) on the way.

    What is left is the inertia of the start and of the stop, and cancels between opposite plates to first order. The
    area inside the outline agrees with sum V0 det F within the goal of 0.5 %.
    """
    run = ride(POINTS[points])
    assert run.moving[run.held][0] < 1e-10  # it did rest
    assert run.cells[-1] == pytest.approx(CELLS, rel=1e-6)
    assert run.force[:, run.held].mean() > 0.06
    assert np.abs(run.kept - 1.0).max() <= 1e-3
    assert np.abs(run.area / run.J - 1.0).max() <= 5e-3


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_moving_laboratory_sees_the_same_forces(solver):
    """Disc and plates with (5, -3) m/s besides, 23 cells during the squeeze: all forces as at rest.

    To the tolerances of the steps, 1e-6; and so with either solver, the one at rest being the band.
    """
    rest = ride(7, cells=0.0, until=REST, linear=linear.banded)
    moving = ride(7, cells=0.0, until=REST, linear=SOLVERS[solver], drift=(5.0, -3.0))
    assert np.abs(moving.force - rest.force).max() <= 1e-6 * rest.force.max()


@pytest.mark.slow
def test_a_body_regridded_at_every_step_loses_stress_as_it_crosses_cells():
    """Why the default is to anchor once: with the points' volumes as weights, 2.5 points per cell, anchor = 0.

    At rest the force stays to 1e-4; after one cell a quarter of it is gone, after six three quarters, and the outline
    has lost 2 % more area than det F knows. Fitted weights and places leave more than 0.9 of it. All without mean
    dilatation, as the mode of Nezamabadi et al. (2017) is; with it the force at rest stays to 2.3e-3.
    """
    seeds = {"anchor": 0.0, "moment_fitting": False, "mean_dilatation": False}
    still, moved = (ride(7, **seeds, cells=cells) for cells in (0.0, CELLS))
    assert np.abs(still.kept - 1.0).max() < 1e-4
    assert 0.2 < moved.kept[-1] < 0.3
    assert moved.kept[np.searchsorted(moved.cells[moved.held], 1.0)] < 0.8
    assert moved.area[-1] / moved.J[-1] < 0.98
    fitted = ride(7, anchor=0.0)
    assert 0.9 < fitted.kept[-1] < 0.95


# The table and its figures.

WEIGHTS = {"volumes as weights": False, "fitted weights": True}


def regridded(rings, fitted):
    """Anchored at every step; the contact solver's last digits are out of reach in some of these steps."""
    return ride(rings, anchor=0.0, moment_fitting=fitted, mean_dilatation=False, contact_tol=2e-5, gap_tol=1e-4)


def per_cell(run):
    """Share of the force lost in the first cell, and per cell over the whole way (geometric mean)."""
    first = run.kept[np.searchsorted(run.cells[run.held], 1.0)]
    return 1.0 - first, 1.0 - run.kept[-1] ** (1.0 / CELLS)


def rows():
    """What docs/verification shows of this module."""
    runs = {points: ride(rings) for points, rings in POINTS.items()}
    grids = f"R/h = 5, {', '.join(POINTS)} points per cell"
    worst = [np.abs(run.kept - 1.0).max() for run in runs.values()]
    apart = [np.abs(run.area / run.J - 1.0).max() for run in runs.values()]
    test = "test_anchored_once_the_wall_force_stays_while_the_disc_is_moved_over_six_cells"
    table = [
        Row(
            "squeezed disc moved rigidly over six cells, anchored once: wall force",
            "that at rest",
            grids,
            f"{numbers(worst)} at most on the way",
            "-",
            "1 %: met",
            test,
        ),
        Row(
            "squeezed disc moved rigidly, anchored once: area inside the outline",
            "sum V0 det F",
            grids,
            f"{numbers(apart)} at most",
            "-",
            "0.5 %: met",
            test,
        ),
    ]
    for name, fitted in WEIGHTS.items():
        moved = [regridded(rings, fitted) for rings in POINTS.values()]
        lost = [per_cell(run) for run in moved]
        area = [np.abs(run.area / run.J - 1.0).max() for run in moved]
        table.append(
            Row(
                f"squeezed disc moved rigidly, anchored at every step: stress lost, {name}",
                "that at rest",
                grids,
                f"lost in the first cell {numbers([first for first, _ in lost])}, per cell over six"
                f" {numbers([mean for _, mean in lost])}; area {numbers(area)}",
                "-",
                "measured loss: shown",
                "test_a_body_regridded_at_every_step_loses_stress_as_it_crosses_cells",
            )
        )
    return table


def figures(folder):
    """Draw the wall force against the cells crossed, and the disc before and after the ride."""
    import matplotlib

    matplotlib.use("Agg")
    never = ride(POINTS["10"])
    regrids = {(points, name): regridded(POINTS[points], WEIGHTS[name]) for name in WEIGHTS for points in POINTS}
    draw_force(folder / "galilean_force.png", never, regrids)
    draw_disc(folder / "galilean_disc.png", ride(POINTS["2.5"]), regrids["2.5", "volumes as weights"])
    return {
        "galilean_force.png": "Mean force on four plates that carry a squeezed disc over its grid, over that at rest:"
        " anchored once, and anchored at every step with the points' volumes as weights and with fitted weights, by"
        " points per cell (R/h = 5).",
        "galilean_disc.png": "The squeezed disc at 2.5 points per cell, pressure over E*: at rest, and after six"
        " cells anchored once and anchored at every step with the points' volumes as weights.",
    }


def draw_force(path, never, regrids):
    """Force against cells crossed."""
    from matplotlib import pyplot as plt

    fig, axes = plt.subplots(figsize=(7, 4))
    axes.plot(never.cells[never.held], never.kept, "k", lw=2, label="anchored once, 10 points per cell")
    for (points, name), run in regrids.items():
        colour, line = f"C{list(POINTS).index(points)}", "-" if WEIGHTS[name] else "--"
        axes.plot(run.cells[run.held], run.kept, line, color=colour, label=f"anchor = 0, {points}, {name}")
    axes.set(xlabel="cells crossed", ylabel="wall force over that at rest", ylim=(0.0, 1.1))
    axes.legend(fontsize=7, loc="lower left")
    fig.tight_layout()
    fig.savefig(path, dpi=120)
    plt.close(fig)


def draw_disc(path, never, regrids):
    """Points coloured by their pressure, with outline and grid."""
    from matplotlib import pyplot as plt

    fig, axes = plt.subplots(1, 3, figsize=(8.5, 2.9), sharey=True, layout="constrained")
    shown = (
        ("at rest", never.states[0]),
        ("after six cells, anchored once", never.states[1]),
        ("after six cells, anchor = 0", regrids.states[1]),
    )
    for ax, (title, state) in zip(axes, shown, strict=True):
        x, pressure = state.x / CELL, -0.5 * np.trace(state.stress) * R / FORCE
        dots = ax.scatter(
            *x, c=pressure, s=9, marker="s", lw=0.0, antialiased=False, cmap="viridis", vmin=0.0, vmax=0.08
        )
        centre = np.round(x.mean(axis=1))
        ax.set(title=title, aspect="equal", xlim=centre[0] + [-6, 6], ylim=centre[1] + [-6, 6])
        ax.set_xticks(centre[0] + np.arange(-6, 7, 3))
        ax.set_xticks(centre[0] + np.arange(-6, 7), minor=True)
        ax.set_yticks(centre[1] + np.arange(-6, 7), minor=True)
        ax.grid(which="minor", lw=0.3)
        for i, point in zip((0, 0, 1, 1), state.walls / CELL, strict=True):
            (ax.axhline if i else ax.axvline)(point[i], color="k", lw=1.0)
        ax.title.set_fontsize(8)
    axes[0].set(ylabel="cells")
    fig.colorbar(dots, ax=axes, label="pressure / E*")
    fig.savefig(path, dpi=120)
    plt.close(fig)
