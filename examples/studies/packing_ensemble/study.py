"""The study of Nezamabadi et al. (2017): how soft discs fill space with and without friction, as an ensemble.

    python -m examples.studies.packing_ensemble --out out/study

Runs every member of `members` (friction 0 and 0.5 for several seeds; for each friction a finer grid, a slower lid and
the mode of Nezamabadi et al. (2017); body grids rebuilt at every step), each in a directory of its own:
`observables.csv`, checkpoints at four stages, `manifest.json` (parameters, versions, hashes). Finished members are
not run again, interrupted ones resume from their last checkpoint. `figures.py` draws the results.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import os
import platform
from concurrent.futures import ProcessPoolExecutor
from importlib.metadata import version
from multiprocessing import Manager
from pathlib import Path
from time import sleep
from typing import Any

import numpy as np
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

import skmpm
from examples import compaction

STAGES = (0.75, 0.84, 0.92, 1.00)  # nominal solid fractions at which states are kept
RADIUS = 0.95e-3  # mean [m]
SPACING = 0.14 / 0.19  # of points, over the cell
COLUMNS = [
    *compaction.COLUMNS,
    "dt",
    "retries",
    "pressure_points",
    "pressure_floor",
    "pressure_roof",
    "pressure_left",
    "pressure_right",
    "interior_fraction",
    "interior_pressure",
    "interior_coordination",
    "kinetic",
    "elastic",
    "dissipated",
    "kinetic_discs",
    "swing",
]
PACKAGES = ("skmpm", "numpy", "scipy", "scikit-fem", "pyamg")


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


def run(name: str, chosen: dict[str, Any], out: Path, shared: dict[str, float]) -> str:
    """Run one member to its end, from its checkpoint if it has one; `shared` receives its progress."""
    folder = out / name
    if finished(folder, chosen):
        return name
    folder.mkdir(parents=True, exist_ok=True)
    options = compaction.parser().parse_args([])
    vars(options).update(chosen)
    scene, until = compaction.build(options)
    scheme, checkpoint = compaction.SCHEMES[options.scheme], folder / "last.checkpoint"
    about = manifest(chosen, scene)
    table, start = resumed(folder, about) if checkpoint.exists() else ([], None)
    (folder / "manifest.json").write_text(json.dumps(about, indent=1))
    left = [stage for stage in STAGES if not stage_file(folder, stage).exists()]
    with (folder / "observables.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(table)
        states = skmpm.simulate(scene, dt=options.dt, until=until, scheme=scheme, start=start, checkpoint=checkpoint)
        try:
            for step, state in enumerate(states, start=len(table) + 1):
                line = row(step, scene, state)
                writer.writerow(line)
                file.flush()
                shared[name] = state.t / until
                while left and line["solid_fraction_nominal"] >= left[0]:
                    skmpm.save(stage_file(folder, left.pop(0)), state)
        except skmpm.StepFailed as failure:
            about["failed"] = str(failure)
    end = skmpm.load(checkpoint)
    about |= {"finished": bool(end.t >= until), "t": end.t, "end": digest(end.x, end.v)}
    (folder / "manifest.json").write_text(json.dumps(about, indent=1))
    return name


def finished(folder: Path, chosen: dict[str, Any]) -> bool:
    """Whether a member has been run to its end with these parameters."""
    path = folder / "manifest.json"
    if not path.exists():
        return False
    about = json.loads(path.read_text())
    return bool(about.get("finished")) and about["parameters"] == chosen


def resumed(folder: Path, about: dict[str, Any]) -> tuple[list[dict[str, str]], skmpm.State]:
    """The table up to the checkpoint of an interrupted run, and its state."""
    before = json.loads((folder / "manifest.json").read_text())
    for what in ("parameters", "scene"):
        if before[what] != about[what]:
            raise SystemExit(f"{folder}: its checkpoint is of other {what}; delete the directory or choose another")
    state = skmpm.load(folder / "last.checkpoint")
    with (folder / "observables.csv").open() as file:
        table = [line for line in csv.DictReader(file) if line["seconds"] and float(line["t"]) <= state.t]
    unknown = {name: "nan" for name in COLUMNS if table and not table[0].get(name)}  # to the version that began it
    return [line | unknown for line in table], state


def row(step: int, scene: skmpm.Scene, state: skmpm.State) -> dict[str, float]:
    """One line of the table."""
    report = state.report
    seen, inner = skmpm.observe(scene, state), skmpm.observe(scene, state, interior=True)
    floor, roof, left, right = seen.wall_pressure
    kinetic_discs, swing = motion(scene, state, seen.bodies.centre)
    return {
        **compaction.row(step, scene, state, seen),
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


def stage_file(folder: Path, stage: float) -> Path:
    """Where the state at a nominal solid fraction is kept."""
    return folder / f"stage_{stage:.2f}.checkpoint"


def manifest(chosen: dict[str, Any], scene: skmpm.Scene) -> dict[str, Any]:
    """What a member is: parameters, versions, and a hash of the scene's points."""
    return {
        "parameters": chosen,
        "versions": {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}},
        "scene": digest(scene.initial_positions, scene.initial_volumes),
        "finished": False,
    }


def digest(*arrays: np.ndarray) -> str:
    """SHA-256 of arrays."""
    return hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)).hexdigest()


def main(options: argparse.Namespace) -> None:
    """Run all members in parallel, with one progress display."""
    wanted = members(options)
    names = [name for name in wanted if not options.only or any(name.startswith(o) for o in options.only)]
    with Manager() as manager, ProcessPoolExecutor(options.processes) as pool, display() as progress:
        shared = manager.dict()
        bars = {name: progress.add_task(name, total=1.0) for name in names}
        waiting = {pool.submit(run, name, wanted[name], options.out, shared): name for name in names}
        while waiting:
            for future in [f for f in waiting if f.done()]:
                name = waiting.pop(future)
                future.result()
                about = json.loads((options.out / name / "manifest.json").read_text())
                shared[name] = 1.0 if about["finished"] else shared.get(name, 0.0)
                if "failed" in about:
                    progress.console.print(f"{name} stopped: {about['failed']}")
            for name, share in dict(shared).items():
                progress.update(bars[name], completed=share)
            sleep(0.5)


def display() -> Progress:
    """One line per member: name, bar, time left."""
    return Progress(TextColumn("{task.description:>16}"), BarColumn(), TextColumn("{task.percentage:5.1f} %"),
                    TimeRemainingColumn())  # fmt: skip


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
    options.add_argument("--processes", type=int, default=os.cpu_count(), help="members run at a time")
    options.add_argument("--out", type=Path, default=Path("out/study"), help="directory of the results")
    return options
