"""The study of Nezamabadi et al. (2017): how soft discs fill space with and without friction, as an ensemble.

    python -m examples.studies.packing_ensemble --out out/study

Runs every member of `members` (friction 0 and 0.5 for several seeds; for each friction a finer grid, a slower lid and
the mode of Nezamabadi et al. (2017); body grids rebuilt at every step) by `skmpm.sweep`, each in a directory of its
own: `table.csv`, checkpoints at four stages, `manifest.json` (parameters, versions, command). Finished members are
not run again, interrupted ones go on from their last checkpoint. `figures.py` draws the results.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import skmpm
from examples import compaction

STAGES = (0.75, 0.84, 0.92, 1.00)  # nominal solid fractions at which states are kept
RADIUS = 0.95e-3  # mean [m]
SPACING = 0.14 / 0.19  # of points, over the cell


def members(options: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """Options of `compaction.py` by member, the longest runs first."""
    found: dict[str, dict[str, Any]] = {}
    both = (0.0, 0.5)
    for friction in both:
        found[f"fine_mu{friction:g}"] = {**resolved(8), "friction": friction}
    for friction in both:
        found[f"slow_mu{friction:g}"] = {"speed": 0.5, "friction": friction}
    for friction, cells in ((0.0, 6), (0.0, 8), (0.0, 10), (0.5, 6)):
        found[f"shared_grid_mu{friction:g}_r{cells}"] = {
            **resolved(cells),
            "friction": friction,
            "scheme": "nezamabadi2017",
            "dt": 0.5e-6,
            "start": 0.55,
            "until": 0.85,
            "discs": max(options.discs // 3, 10),
        }
    found["regridded_mu0.5"] = {"friction": 0.5, "scheme": "regridded"}
    for seed in range(options.seeds):
        for friction in both:
            found[f"mu{friction:g}_seed{seed}"] = {"friction": friction, "seed": seed}
    defaults = {"discs": options.discs, "start": options.start, "until": options.until}
    return {name: defaults | chosen for name, chosen in found.items()}


def resolved(cells: int) -> dict[str, float]:
    """Cell and spacing for so many cells per mean radius [m]."""
    cell = RADIUS / cells
    return {"cell": cell, "spacing": SPACING * cell}


def build(**chosen: Any) -> skmpm.Run:
    """A member from its options, the others being those of `compaction.py`."""
    options = compaction.parser().parse_args([])
    vars(options).update(chosen)
    scene, until = compaction.build(options)
    keep = {name_of(stage): partial(reached, stage) for stage in STAGES}
    scheme = compaction.SCHEMES[options.scheme]
    return skmpm.Run(scene, until, dt=options.dt, scheme=scheme, observe=row, keep=keep)


def reached(stage: float, line: dict[str, float]) -> bool:
    """Whether a row is at a stage or beyond."""
    return line["solid_fraction_nominal"] >= stage


def name_of(stage: float) -> str:
    """Under which the state at a nominal solid fraction is kept."""
    return f"stage_{stage:.2f}"


def row(scene: skmpm.Scene, state: skmpm.State) -> dict[str, float]:
    """One line of the table."""
    report = state.report
    seen, inner = skmpm.observe(scene, state), skmpm.observe(scene, state, interior=True)
    floor, roof, left, right = seen.wall_pressure
    kinetic_discs, swing = motion(scene, state, seen.bodies.centre)
    line = compaction.row(scene, state, seen) | {
        "dt": report.dt,
        "retries": report.retries,
        "pressure_points": of_points(scene, state, seen),
        "pressure_floor": floor,
        "pressure_roof": roof,
        "pressure_left": left,
        "pressure_right": right,
        "interior_fraction": inner.solid_fraction,
        "interior_pressure": inner.pressure,
        "interior_coordination": inner.coordination,
        "kinetic": report.energy.kinetic,
        "elastic": report.energy.elastic,
        "dissipated": report.energy.dissipated,
        "kinetic_discs": kinetic_discs,
        "swing": swing,
    }
    del line["t"]  # which the sweep adds
    return line


def of_points(scene: skmpm.Scene, state: skmpm.State, seen: skmpm.Observables) -> float:
    """Pressure of the points over the box [Pa]: their stress, and their motion relative to the centre of their disc.

    That is what contact forces carry; `Observables.pressure_points` has the motion of the discs in it as well.
    """
    volume = np.add.reduceat(state.volume, scene.offsets[:-1])
    return float(seen.bodies.pressure_points @ volume / np.ptp(state.walls, axis=0).prod())


def motion(scene: skmpm.Scene, state: skmpm.State, centre: np.ndarray) -> tuple[float, float]:
    """Sums over the discs of M V.(V - c')/2 [J/m] and of M V.(X - c) [J s/m], c the middle of the box.

    By the virial theorem walls feel what contacts carry, plus the first over the area of the box, less half the rate
    of the second over it (R. Clausius, Philosophical Magazine 40 (1870) 122-127). `centre` (2, bodies), X.
    """
    start = scene.offsets[:-1]
    momentum, mass = (np.add.reduceat(a, start, axis=-1) for a in (state.mass * state.v, state.mass))
    middle, drift = 0.5 * state.walls.sum(axis=0), 0.5 * scene.wall_velocities(state.t).sum(axis=0)
    kinetic = 0.5 * np.sum(momentum * (momentum / mass - drift[:, None]))
    return float(kinetic), float(np.sum(momentum * (centre - middle[:, None])))


def main(options: argparse.Namespace) -> None:
    """Run all members that have not finished, with a line of progress."""
    wanted = members(options)
    chosen = {n: about for n, about in wanted.items() if not options.only or n.startswith(tuple(options.only))}
    found = skmpm.sweep(build, chosen, out=options.out, processes=options.processes, progress=True)
    print(found)
    for name, error in found.failed.items():
        print(f"{name} stopped: {error}")


def parser() -> argparse.ArgumentParser:
    """Options; the defaults are the study of `docs/studies/packing_ensemble.md`."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    options.add_argument(
        "--discs", type=int, default=300, help="a third of them in the mode of Nezamabadi et al. (2017)"
    )
    options.add_argument("--seeds", type=int, default=4, help="packings for each friction")
    options.add_argument("--start", type=float, default=0.70, help="nominal solid fraction at the start")
    options.add_argument("--until", type=float, default=1.02, help="nominal solid fraction at the end")
    options.add_argument("--only", nargs="*", default=[], help="members whose names begin so")
    options.add_argument("--processes", type=int, help="members run at a time; None: as many as there are cores")
    options.add_argument("--out", type=Path, default=Path("out/study"), help="directory of the results")
    return options
