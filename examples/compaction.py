"""Compaction of a packing
=======================

The main job: soft discs squeezed in a box by a moving lid, with friction between them.

    python examples/compaction.py --discs 30 --out out/compaction    # without --discs 300 of them
    python examples/compaction.py --resume --out out/compaction      # goes on with a run that was interrupted

Writes a table of what `observe` measures at every step (`observables.csv`), a series for ParaView (`packing.vtkhdf`),
checkpoints and `stages.png`. `python -m examples.studies.packing_ensemble main_job` runs the same scene with checks
at every step.
"""

import argparse
import csv
import json
import sys
from collections.abc import Callable, Mapping
from contextlib import closing
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import skmpm

COLUMNS = ("step", "t", "solid_fraction", "solid_fraction_nominal", "pressure", "pressure_lid", "contact_surface",
           "anisotropy", "aspect_ratio", "coordination", "overlap", "residual", "newton", "contact_iterations",
           "seconds")  # fmt: skip
Line = dict[str, Any]
Check = Callable[[skmpm.Scene, skmpm.State, skmpm.Observables], float]
LID = 1  # index among the walls
SCHEMES = {
    # Tolerances that change the pressure by 0.1 %, and take a third of the iterations off while the packing is loose.
    "balanced": skmpm.Scheme(newton_tol=5e-3, gap_tol=1e-4),
    "standard": skmpm.Scheme(mean_dilatation=False),  # volumetric locking where nu is near 1/2
    "nezamabadi2017": skmpm.Scheme.nezamabadi2017(),
    "regridded": skmpm.Scheme(anchor=0.0),  # updated Lagrangian: new body grids at every step
}


def build(options: argparse.Namespace) -> tuple[skmpm.Scene, float]:
    """The scene of discs at rest in a box, and the time [s] at which the final nominal solid fraction is reached."""
    radii = np.random.default_rng(options.seed).uniform(0.7e-3, 1.2e-3, options.discs)
    solid = np.pi * (radii**2).sum()
    width = float(np.sqrt(solid / 0.72))
    discs = skmpm.packing(radii, width, solid_fraction=options.start, seed=options.seed)
    law = skmpm.LinearElastic if options.scheme == "nezamabadi2017" else skmpm.NeoHookean
    material = law(E=10e6, nu=0.45, density=990.0)
    bodies = [
        skmpm.Body(skmpm.disc(centre, radius, spacing=options.spacing), material)
        for centre, radius in zip(discs.centres.T, discs.radii, strict=True)
    ]
    smooth = partial(skmpm.Wall, friction=0.0)
    floor, left = smooth((0.0, 0.0), (0.0, 1.0)), smooth((0.0, 0.0), (1.0, 0.0))
    lid = smooth((0.0, discs.height), (0.0, -1.0), velocity=(0.0, -options.speed))
    walls = [floor, lid, left, smooth((width, 0.0), (-1.0, 0.0))]
    scene = skmpm.Scene(bodies, cell=options.cell, walls=walls, friction=options.friction)
    return scene, (discs.height - solid / (width * options.until)) / options.speed


def row(scene: skmpm.Scene, state: skmpm.State, seen: skmpm.Observables) -> Line:
    """One line of the table."""
    report, values = state.report, {name: getattr(seen, name) for name in COLUMNS if hasattr(seen, name)}
    lid = state.wall_force[LID, 1] / float(scene.walls[3].point[0])
    values |= {"t": state.t, "pressure_lid": lid, "residual": report.residual, "newton": report.newton}
    return values | {"contact_iterations": report.contact, "seconds": sum(report.seconds.values())}


def draw(scene: skmpm.Scene, stages: list[skmpm.State], path: Path) -> None:
    """Draw the forces between bodies and the pressure in them at some stages, with their solid fractions."""
    figure, axes = plt.subplots(2, len(stages), figsize=(3.0 * len(stages), 6.0), layout="constrained")
    for (above, below), state in zip(axes.T, stages, strict=True):
        last = {"legend": state is stages[-1]}
        skmpm.plot(scene, state, "body", forces=True, axes=above, **last)
        skmpm.plot(scene, state, axes=below, limits=(0.0, 2.0 * skmpm.observe(scene, stages[-1]).pressure), **last)
        below.set_title(f"{skmpm.observe(scene, state).solid_fraction:.3f}")
        above.axis("off"), below.axis("off")
    figure.savefig(path, bbox_inches="tight")


def run(options: argparse.Namespace, checks: Mapping[str, Check] = {}) -> list[Line]:
    """Run the compaction from its last checkpoint, if there is one; write and draw the results; return the table.

    `checks` are further columns of the table, by name.
    """
    (scene, until), scheme, out = build(options), SCHEMES[options.scheme], options.out
    print(skmpm.preflight(scene, options.dt, scheme=scheme, until=until))
    out.mkdir(parents=True, exist_ok=True)
    kept = vars(options).keys() - {"out", "film", "resume"}
    (out / "options.json").write_text(json.dumps({name: getattr(options, name) for name in sorted(kept)}))
    checkpoint, observables = out / "last.checkpoint", out / "observables.csv"
    state = skmpm.load(checkpoint) if checkpoint.exists() else None
    lines = [] if state is None else [line for line in read(observables) if float(line["t"]) < state.t]
    begun = [] if state is None else [state]  # its line may not have been written
    saved = {"checkpoint": checkpoint, "progress": True, "start": state}
    with (
        skmpm.record(out / "packing.vtkhdf", scene, append=state is not None) as series,
        observables.open("w", newline="") as file,
        closing(skmpm.simulate(scene, dt=options.dt, until=until, scheme=scheme, **saved)) as states,
    ):
        table = csv.DictWriter(file, (*COLUMNS, *checks))
        table.writeheader()
        table.writerows(lines)
        for state in chain(begun, states):
            seen = scene, state, skmpm.observe(scene, state)
            more = {name: check(*seen) for name, check in checks.items()}
            lines.append({"step": len(lines) + 1, **row(*seen), **more})
            table.writerow(lines[-1])
            file.flush()
            if len(lines) % options.every == 0:
                series.write(state)
            stage = out / f"stage_{int(3.0 * state.t / until)}.checkpoint"
            if not stage.exists():
                skmpm.save(stage, state)
        if len(lines) % options.every:
            series.write(state)
    draw(scene, [*(skmpm.load(stage) for stage in sorted(out.glob("stage_[012].*"))), state], out / "stages.png")
    if options.film:
        skmpm.animate(skmpm.read(out / "packing.vtkhdf"), out / "packing.gif", forces=True, fps=10)
    shown = ("solid_fraction", "pressure", "coordination")
    print("; ".join(f"{name} {float(lines[-1][name]):.4g}" for name in shown))
    return lines


def read(path: Path) -> list[Line]:
    """The lines of a table that was written."""
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def parser() -> argparse.ArgumentParser:
    """The options."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--discs", type=int, default=300, help="number of discs, radii uniform in 0.7-1.2 mm")
    options.add_argument(
        "--friction", type=float, default=0.5, help="friction coefficient between discs; walls are frictionless"
    )
    options.add_argument("--cell", type=float, default=0.19e-3, help="side of a grid cell [m]")
    options.add_argument("--spacing", type=float, default=0.14e-3, help="distance of material points [m]")
    options.add_argument("--speed", type=float, default=2.0, help="speed of the lid [m/s]")
    options.add_argument("--dt", type=float, default=13.3e-6, help="time step [s]")
    options.add_argument("--seed", type=int, default=0, help="random seed of the radii and the packing")
    options.add_argument("--start", type=float, default=0.70, help="nominal solid fraction of the packing")
    options.add_argument("--until", type=float, default=0.95, help="nominal solid fraction at the end")
    options.add_argument("--scheme", choices=SCHEMES, default="balanced")
    options.add_argument("--every", type=int, default=10, help="steps between frames of the ParaView series")
    options.add_argument("--film", action="store_true", help="make a film of the frames of the series")
    options.add_argument("--out", type=Path, default=Path("out/compaction"), help="directory of the results")
    return options


def main(arguments: list[str] | None = None) -> None:
    """Begin a run in an empty directory, or go on with the one that is there, with the options that it began with."""
    known = parser()
    known.add_argument("--resume", action="store_true", help="go on with the run in --out, with its options")
    options = known.parse_args(arguments)
    again, begun = f"python {sys.argv[0]} --resume --out {options.out}", options.out / "options.json"
    if begun.exists() and not options.resume:
        raise SystemExit(f"{options.out} has a run: go on with `{again}`, or give another --out")
    if options.resume:
        if not begun.exists():
            raise SystemExit(f"{options.out} has no run to resume: leave out --resume")
        vars(options).update(json.loads(begun.read_text()))
    try:
        run(options)
    except KeyboardInterrupt:
        raise SystemExit(f"stopped; go on with `{again}`") from None


if __name__ == "__main__":
    main()
