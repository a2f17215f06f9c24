"""The main job with checks: the scene of `examples/compaction.py`, with invariants evaluated at every step.

    python -m examples.studies.packing_ensemble main_job --out out/main_job

Takes the options of `compaction.py`. Writes `observables.csv`, a ParaView series `packing.vtkhdf`, `curves.png`
(pressure, contact surface, anisotropy, aspect ratio, coordination against solid fraction) and `checks.csv`, whose
worst values it prints at the end. `docs/studies/results.md` is made of them.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from time import perf_counter

import matplotlib.pyplot as plt
import numpy as np

import skmpm
from examples.compaction import COLUMNS, LID, SCHEMES, build, row
from examples.compaction import parser as options_of

from ..pages import picture

CHECKS = ("step", "solid_fraction_nominal", "area", "volume", "outside", "spin", "lid", "floor")


def check(
    step: int, scene: skmpm.Scene, state: skmpm.State, seen: skmpm.Observables, dt: float, filled: float
) -> dict[str, float]:
    """Invariants: area by outlines and by det F, distance of points behind walls, rotation per step, wall forces.

    `filled` is the area by outlines at the start [m2].
    """
    counts = np.bincount(state.body)
    rotation = np.bincount(state.body, 0.5 * (state.C[1, 0] - state.C[0, 1])) / counts
    depth = [-(n @ (state.x - point[:, None])).min() for n, point in zip(scene.normals.T, state.walls, strict=True)]
    volume = scene.initial_volumes.sum()
    return {
        "step": step,
        "solid_fraction_nominal": seen.solid_fraction_nominal,
        "area": seen.bodies.area.sum() / filled,
        "volume": state.volume.sum() / volume,
        "outside": max(0.0, *depth) / scene.cell,
        "spin": np.abs(rotation).max() * dt,
        "lid": state.wall_force[LID, 1],
        "floor": -state.wall_force[0, 1],
    }


def outlined(boundary: skmpm.outline.Outlines, x: np.ndarray) -> float:
    """Area inside the curves of all outlines at points x (2, n) [m2]."""
    at = x[:, boundary.point]
    return float(skmpm.outline.curve(boundary, at).through(at).area(int(boundary.body.max()) + 1).sum())


def draw_curves(table: list[dict[str, float]], path: Path) -> None:
    """What the packing did against its solid fraction."""
    shown = {
        "pressure": ("pressure [MPa]", 1e-6),
        "contact_surface": ("contact surface S", 1.0),
        "anisotropy": ("anisotropy $A_m$", 1.0),
        "aspect_ratio": (r"aspect ratio $\alpha$", 1.0),
        "coordination": ("coordination Z", 1.0),
    }
    figure, axes = plt.subplots(1, len(shown), figsize=(4.0 * len(shown), 3.5), layout="constrained")
    fraction = [line["solid_fraction"] for line in table]
    for axis, (name, (label, unit)) in zip(axes, shown.items(), strict=True):
        axis.plot(fraction, [unit * line[name] for line in table], linewidth=1.0)
        axis.set(xlabel=r"solid fraction $\Phi$", ylabel=label)
    picture(figure, path, 90)


def main(options: argparse.Namespace) -> list[dict[str, float]]:
    """Squeeze; write the tables and the series while it runs, the curves at the end. Returns the checks."""
    options.out.mkdir(parents=True, exist_ok=True)
    began = perf_counter()
    scene, until = build(options)
    scheme = SCHEMES[options.scheme]
    print(skmpm.preflight(scene, options.dt, scheme=scheme))
    start = skmpm.initial(scene, scheme=scheme)
    points = start.x.shape[1]
    print(
        f"{options.discs} discs, {points} points ({points / options.discs:.0f} per disc), "
        f"{round(until / options.dt)} steps of {1e6 * options.dt:g} us, friction {options.friction:g}"
    )
    table: list[dict[str, float]] = []
    checks: list[dict[str, float]] = []
    filled = outlined(scene.outlines, scene.initial_positions)
    saved = {"checkpoint": options.out / "last.checkpoint", "progress": True}
    with (
        skmpm.record(options.out / "packing.vtkhdf", scene) as series,
        (options.out / "observables.csv").open("w", newline="") as file,
        (options.out / "checks.csv").open("w", newline="") as checks_file,
    ):
        writer, checks_writer = csv.DictWriter(file, COLUMNS), csv.DictWriter(checks_file, CHECKS)
        writer.writeheader()
        checks_writer.writeheader()
        run = skmpm.simulate(scene, dt=options.dt, until=until, scheme=scheme, start=start, **saved)
        for step, state in enumerate(run, start=1):
            seen = skmpm.observe(scene, state)
            table.append({"step": step, **row(scene, state, seen)})
            checks.append(check(step, scene, state, seen, options.dt, filled))
            writer.writerow(table[-1])
            checks_writer.writerow(checks[-1])
            file.flush()
            if step % options.every == 0:
                series.write(state)
        if step % options.every:
            series.write(state)
    draw_curves(table, options.out / "curves.png")
    transit = round(float(start.walls[LID, 1]) / scene.fastest_wave / options.dt)
    print(summary(table, perf_counter() - began))
    print(verdict(checks, max(1, transit)))
    return checks


def summary(table: list[dict[str, float]], seconds: float) -> str:
    """The figures to look at first."""
    end = table[-1]
    worst = {name: max(line[name] for line in table) for name in ("overlap", "residual", "newton")}
    return (
        f"reached {end['solid_fraction']:.4f} (nominal {end['solid_fraction_nominal']:.4f}) in {len(table)} steps, "
        f"{seconds:.0f} s; pressure {end['pressure'] / 1e6:.3f} MPa, on the lid {end['pressure_lid'] / 1e6:.3f} MPa; "
        f"worst overlap {100 * worst['overlap']:.4f} %, residual {worst['residual']:.1e}, "
        f"{worst['newton']:.0f} Newton iterations (mean {np.mean([line['newton'] for line in table]):.1f})"
    )


def verdict(checks: list[dict[str, float]], transit: int) -> str:
    """The worst of each check; wall forces as running means over the `transit` steps a wave needs."""
    column = {name: np.array([line[name] for line in checks]) for name in CHECKS}
    mean = np.ones(transit) / transit
    lid, floor = (np.convolve(column[name], mean, mode="valid") for name in ("lid", "floor"))
    dense = column["solid_fraction_nominal"][transit - 1 :] > 0.90
    uneven = np.abs(lid - floor)[dense] / (0.5 * (lid + floor)[dense]) if dense.any() else np.zeros(1)
    apart = np.abs(column["area"] / column["volume"] - 1.0)
    return (
        f"area by outlines against det F: {100 * apart.max():.3f} % apart at worst"
        f" (bodies keep {100 * column['volume'][-1]:.2f} %); points outside: {column['outside'].max():.4f} cells;"
        f" spin: {column['spin'].max():.4f} rad per step; lid against floor above 0.90: {100 * uneven.max():.1f} %"
    )


def parser() -> argparse.ArgumentParser:
    """The options of `compaction.py`."""
    options = options_of()
    options.description = __doc__
    options.set_defaults(out=Path("out/main_job"))
    return options
