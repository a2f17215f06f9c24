"""The main job with checks: the scene of `examples/compaction.py`, with invariants evaluated at every step.

    python -m examples.studies.packing_ensemble main_job --out out/main_job

Takes the options of `compaction.py` and writes what it writes; the table has a column for each check. Draws
`curves.png` (pressure, contact surface, anisotropy, aspect ratio, coordination against solid fraction) and prints the
worst values at the end. `docs/studies/results.md` is made of them.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from time import perf_counter

import matplotlib.pyplot as plt
import numpy as np

import skmpm
from examples import compaction
from examples.compaction import LID, Line

from ..pages import picture


def area(scene: skmpm.Scene, state: skmpm.State, seen: skmpm.Observables) -> float:
    """Area inside all outlines over that at the start."""
    return float(seen.bodies.area.sum() / outlined(scene.outlines, scene.initial_positions))


def outlined(boundary: skmpm.outline.Outlines, x: np.ndarray) -> float:
    """Area inside the curves of all outlines at points x (2, n) [m2]."""
    at = x[:, boundary.point]
    return float(skmpm.outline.curve(boundary, at).through(at).area(int(boundary.body.max()) + 1).sum())


def outside(scene: skmpm.Scene, state: skmpm.State, seen: skmpm.Observables) -> float:
    """Largest distance of a point behind a wall [cells]."""
    depth = [-(n @ (state.x - point[:, None])).min() for n, point in zip(scene.normals.T, state.walls, strict=True)]
    return float(max(0.0, *depth)) / scene.cell


def spin(scene: skmpm.Scene, state: skmpm.State, seen: skmpm.Observables) -> float:
    """Largest rotation of a disc in the step [rad]."""
    rotation = np.bincount(state.body, 0.5 * (state.C[1, 0] - state.C[0, 1])) / np.bincount(state.body)
    return float(np.abs(rotation).max()) * state.report.dt


CHECKS = {
    "area": area,
    "volume": lambda scene, state, seen: state.volume.sum() / scene.initial_volumes.sum(),  # by det F
    "outside": outside,
    "spin": spin,
    "lid": lambda scene, state, seen: state.wall_force[LID, 1],
    "floor": lambda scene, state, seen: -state.wall_force[0, 1],
}


def draw_curves(table: list[Line], path: Path) -> None:
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


def main(options: argparse.Namespace) -> list[Line]:
    """Squeeze, draw the curves, and print and return the table."""
    if (options.out / "options.json").exists():
        raise SystemExit(f"{options.out} has a run: give another --out")
    began = perf_counter()
    table = compaction.run(options, CHECKS)
    draw_curves(table, options.out / "curves.png")
    scene, _ = compaction.build(options)
    transit = round(float(scene.walls[LID].point[1]) / scene.fastest_wave / options.dt)
    print(summary(table, perf_counter() - began))
    print(verdict(table, max(1, transit)))
    return table


def summary(table: list[Line], seconds: float) -> str:
    """The figures to look at first."""
    end = table[-1]
    worst = {name: max(line[name] for line in table) for name in ("overlap", "residual", "newton")}
    return (
        f"reached {end['solid_fraction']:.4f} (nominal {end['solid_fraction_nominal']:.4f}) in {len(table)} steps, "
        f"{seconds:.0f} s; pressure {end['pressure'] / 1e6:.3f} MPa, on the lid {end['pressure_lid'] / 1e6:.3f} MPa; "
        f"worst overlap {100 * worst['overlap']:.4f} %, residual {worst['residual']:.1e}, "
        f"{worst['newton']:.0f} Newton iterations (mean {np.mean([line['newton'] for line in table]):.1f})"
    )


def verdict(table: list[Line], transit: int) -> str:
    """The worst of each check; wall forces as running means over the `transit` steps a wave needs."""
    column = {name: np.array([line[name] for line in table]) for name in (*CHECKS, "solid_fraction_nominal")}
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
    options = compaction.parser()
    options.description = __doc__
    options.set_defaults(out=Path("out/main_job"))
    return options
