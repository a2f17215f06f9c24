"""The main job: soft discs squeezed in a box by a moving lid, with friction between them.

    python examples/compaction.py --out out/compaction

Writes `observables.csv`, a ParaView series `packing.vtkhdf`, `stages.png` (four stages, by body and by pressure) and
`curves.png` (pressure, contact surface, anisotropy, aspect ratio, coordination against solid fraction), and
`checks.csv`: what must hold at every step, whose worst values it prints at the end.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from time import perf_counter

import matplotlib
import numpy as np

import skmpm

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.collections import PolyCollection

COLUMNS = [
    "step",
    "t",
    "solid_fraction",
    "solid_fraction_nominal",
    "pressure",
    "pressure_lid",
    "contact_surface",
    "anisotropy",
    "aspect_ratio",
    "coordination",
    "overlap",
    "residual",
    "newton",
    "contact_iterations",
    "seconds",
]
CHECKS = ("step", "solid_fraction_nominal", "area", "volume", "outside", "spin", "lid", "floor", "settled")
LID = 1  # its place among the walls
SCHEMES = {
    "balanced": skmpm.Scheme(),
    "standard": skmpm.Scheme(mean_dilatation=False),  # elements that lock where nu is near 1/2
    "seed": skmpm.Scheme.nezamabadi2017(),
    "forgetful": skmpm.Scheme(anchor=0.0),  # new body grids at every step, contact as in "balanced"
}
WAVE = 10e6 * (1.0 - 0.45) / (1.0 + 0.45) / (1.0 - 2.0 * 0.45) / 990.0  # pressure waves, c^2 [m2/s2]


def build(options: argparse.Namespace) -> tuple[skmpm.Scene, float]:
    """The discs of Nezamabadi et al. (2017) at rest in a box, and how long the lid takes to the wanted nominal solid fraction."""
    radii = np.random.default_rng(options.seed).uniform(0.7e-3, 1.2e-3, options.discs)
    solid = np.pi * (radii**2).sum()
    width = float(np.sqrt(solid / 0.72))
    discs = skmpm.packing(radii, width, solid_fraction=options.start, seed=options.seed)
    law = skmpm.LinearElastic if options.scheme == "seed" else skmpm.NeoHookean
    material = law(E=10e6, nu=0.45, density=990.0)
    bodies = [
        skmpm.Body(skmpm.disc(centre, radius, spacing=options.spacing), material)
        for centre, radius in zip(discs.centres.T, discs.radii, strict=True)
    ]
    walls = [
        skmpm.Wall((0.0, 0.0), (0.0, 1.0)),
        skmpm.Wall((0.0, discs.height), (0.0, -1.0), velocity=(0.0, -options.speed)),
        skmpm.Wall((0.0, 0.0), (1.0, 0.0)),
        skmpm.Wall((width, 0.0), (-1.0, 0.0)),
    ]
    scene = skmpm.Scene(bodies, cell=options.cell, walls=walls, friction=options.friction)
    return scene, (discs.height - solid / (width * options.until)) / options.speed


def row(
    step: int, scene: skmpm.Scene, state: skmpm.State, seen: skmpm.Observables, seconds: float
) -> dict[str, float]:
    """One line of the table."""
    report = state.report
    width = float(scene.walls[3].point[0])
    values = {name: getattr(seen, name) for name in COLUMNS if hasattr(seen, name)}
    return {
        **values,
        "step": step,
        "t": state.t,
        "pressure_lid": state.wall_force[LID, 1] / width,
        "residual": report.residual,
        "newton": report.newton,
        "contact_iterations": report.contact,
        "seconds": seconds,
    }


def check(
    step: int, scene: skmpm.Scene, state: skmpm.State, seen: skmpm.Observables, dt: float, filled: float
) -> dict[str, float]:
    """What must hold: area by outlines and by det F, how far points are outside, turning per step, wall forces.

    `filled` is the area by outlines at the start [m2].
    """
    counts = np.bincount(state.body)
    turning = np.bincount(state.body, 0.5 * (state.C[1, 0] - state.C[0, 1])) / counts
    depth = [-(n @ (state.x - point[:, None])).min() for n, point in zip(scene.normals.T, state.walls, strict=True)]
    volume = scene.initial_volumes.sum()
    return {
        "step": step,
        "solid_fraction_nominal": seen.solid_fraction_nominal,
        "area": seen.bodies.area.sum() / filled,
        "volume": state.volume.sum() / volume,
        "outside": max(0.0, *depth) / scene.cell,
        "spin": np.abs(turning).max() * dt,
        "lid": state.wall_force[LID, 1],
        "floor": -state.wall_force[0, 1],
        "settled": int(state.report.frozen_normals),
    }


def outlined(boundary: skmpm.outline.Outlines, x: np.ndarray) -> float:
    """Area inside the curves of all outlines at points x (2, n) [m2]."""
    at = x[:, boundary.point]
    return float(skmpm.outline.curve(boundary, at).through(at).area(int(boundary.body.max()) + 1).sum())


def draw_stages(scene: skmpm.Scene, stages: list[skmpm.State], path: Path) -> None:
    """Four stages: above coloured by body, below by the mean pressure of the points around each point."""
    figure, axes = plt.subplots(2, len(stages), figsize=(5.0 * len(stages), 10.5), layout="constrained")
    boundary = scene.outlines
    top = max(float(np.percentile(pressure(state), 98)) for state in stages)
    colours = np.random.default_rng(1).permutation(len(scene.bodies))
    for (above, below), state in zip(axes.T, stages, strict=True):
        loops = [1e3 * state.x[:, boundary.point[boundary.body == b]].T for b in range(len(scene.bodies))]
        above.add_collection(PolyCollection(loops, array=colours, cmap="tab20", edgecolor="black", linewidth=0.4))
        below.add_collection(PolyCollection(loops, facecolor="none", edgecolor="black", linewidth=0.3))
        cloud = below.scatter(
            *(1e3 * state.x), c=1e-6 * pressure(state), s=1.0, vmin=0.0, vmax=1e-6 * top, cmap="turbo"
        )
        for axis in (above, below):
            box = 1e3 * np.array([state.walls[2, 0], state.walls[3, 0], state.walls[0, 1], state.walls[LID, 1]])
            axis.plot(box[[0, 1, 1, 0, 0]], box[[2, 2, 3, 3, 2]], color="black", linewidth=1.0)
            axis.set(aspect="equal", xticks=[], yticks=[])
        seen = skmpm.observe(scene, state)
        above.set_title(f"solid fraction {seen.solid_fraction:.3f} (nominal {seen.solid_fraction_nominal:.3f})")
    figure.colorbar(cloud, ax=axes[1], label="pressure [MPa]", shrink=0.7)
    figure.savefig(path, dpi=90)
    plt.close(figure)


def pressure(state: skmpm.State) -> np.ndarray:
    """Pressure of the points, (n,) [Pa], compression positive."""
    return -0.5 * (state.stress[0, 0] + state.stress[1, 1])


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
    figure.savefig(path, dpi=90)
    plt.close(figure)


def run(options: argparse.Namespace) -> list[dict[str, float]]:
    """Squeeze; write the table and the series while it runs, the pictures at the end."""
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
    wanted = list(np.linspace(options.start, options.until, 4)[1:-1])
    table: list[dict[str, float]] = []
    checks: list[dict[str, float]] = []
    stages = [start]
    filled = outlined(scene.outlines, scene.initial_positions)
    with (
        skmpm.record(options.out / "packing.vtkhdf", scene) as series,
        (options.out / "observables.csv").open("w", newline="") as file,
        (options.out / "checks.csv").open("w", newline="") as checks_file,
    ):
        writer, checks_writer = csv.DictWriter(file, COLUMNS), csv.DictWriter(checks_file, CHECKS)
        writer.writeheader()
        checks_writer.writeheader()
        last, shown = perf_counter(), 0
        run = skmpm.simulate(
            scene,
            dt=options.dt,
            until=until,
            scheme=scheme,
            start=start,
            progress=True,
            checkpoint=options.out / "last.checkpoint",
        )
        for step, state in enumerate(run, start=1):
            now = perf_counter()
            seen = skmpm.observe(scene, state)
            table.append(row(step, scene, state, seen, now - last))
            checks.append(check(step, scene, state, seen, options.dt, filled))
            last = now
            writer.writerow(table[-1])
            checks_writer.writerow(checks[-1])
            file.flush()
            if step % options.every == 0:
                series.write(state)
                shown = step
            if wanted and table[-1]["solid_fraction_nominal"] >= wanted[0]:
                stages.append(state)
                wanted.pop(0)
        if shown < step:
            series.write(state)
    draw_stages(scene, [*stages, state], options.out / "stages.png")
    draw_curves(table, options.out / "curves.png")
    transit = round(float(start.walls[LID, 1]) / np.sqrt(WAVE) / options.dt)
    print(summary(table, perf_counter() - began))
    print(verdict(checks, max(1, transit)))
    return table


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
        f" turning: {column['spin'].max():.4f} rad per step; lid against floor above 0.90: {100 * uneven.max():.1f} %"
        f"; steps with settled normals: {column['settled'].sum():.0f}"
    )


def parser() -> argparse.ArgumentParser:
    """The options; their defaults are the test of Nezamabadi et al. (2017) at a resolution of five cells per mean radius."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    options.add_argument("--discs", type=int, default=300, help="number of discs, radii uniform in 0.7-1.2 mm")
    options.add_argument("--friction", type=float, default=0.5, help="between discs; the walls have none")
    options.add_argument("--cell", type=float, default=0.19e-3, help="side of a grid cell [m]")
    options.add_argument("--spacing", type=float, default=0.14e-3, help="distance of material points [m]")
    options.add_argument("--speed", type=float, default=2.0, help="of the lid [m/s]")
    options.add_argument("--dt", type=float, default=8e-6, help="time step [s]")
    options.add_argument("--seed", type=int, default=0, help="of the radii and the packing")
    options.add_argument("--start", type=float, default=0.70, help="nominal solid fraction of the packing")
    options.add_argument("--until", type=float, default=0.95, help="nominal solid fraction at the end")
    options.add_argument("--scheme", choices=SCHEMES, default="balanced")
    options.add_argument("--every", type=int, default=10, help="steps between frames of the ParaView series")
    options.add_argument("--out", type=Path, default=Path("out/compaction"), help="directory of the results")
    return options


if __name__ == "__main__":
    run(parser().parse_args())
