"""Soft discs between two rows of bonded grains, drawn along and pressed together: friction, height, velocities.

    python -m examples.studies.shear_cell --out out/shear_cell

Every member is one run by `skmpm.sweep`: the cell is periodic along x, its floor is held, its lid moves at a given
speed and settles under a load, which grows to its value and stays. Steps are chosen (``dt=None``). Then the page is
written, as by `figures`.
"""

from __future__ import annotations

import argparse
from functools import partial
from typing import Any

import numpy as np

import skmpm

from .. import sweeps

D, DENSITY, YOUNG, POISSON = 2e-3, 1000.0, 1e6, 0.3  # mean diameter [m]; [kg/m3]; [Pa]
STIFFNESS = YOUNG / (1.0 - POISSON**2)  # E* [Pa]
CELL = D / 8.0  # four cells in the mean radius
COLUMNS = 8  # grains in a row of a rough wall, and mean diameters in the width of the cell
LAYERS = 12  # of the profile of velocities
RAMP = 1.0  # shear strain in which the load grows to its value
Row = dict[str, float]


def scene(discs: int, pressure: float, inertial: float, friction: float, seed: int) -> tuple[skmpm.Scene, float]:
    """The cell under a pressure over E*, at an inertial number, and its shear rate [1/s]."""
    radii = np.random.default_rng(seed).uniform(0.4 * D, 0.6 * D, discs)
    width, load = COLUMNS * D, pressure * STIFFNESS
    rate = inertial / (D * np.sqrt(DENSITY / load))
    loose = skmpm.packing(radii, width, solid_fraction=0.77, periodic=(True, False), seed=seed)
    gel = skmpm.NeoHookean(E=YOUNG, nu=POISSON, density=DENSITY)
    places = zip(loose.centres.T, loose.radii, strict=True)
    bodies = [skmpm.Body(skmpm.disc(x, r, spacing=0.74 * CELL), gel) for x, r in places]

    def wall(y: float) -> skmpm.Points:
        return skmpm.row(skmpm.disc((0.5 * D, y), 0.48 * D, spacing=0.74 * CELL), COLUMNS, (D, 0.0))

    hard, speed = skmpm.Rigid(DENSITY), rate * (loose.height + D)
    floor = skmpm.Body(wall(-0.485 * D), hard, motion=(0.0, 0.0, 0.0))
    lid = skmpm.Body(wall(loose.height + 0.485 * D), hard, motion=(speed, None, 0.0))
    ramp = RAMP / rate
    pressed = skmpm.Load(lambda x: x[1] > loose.height, lambda t: (0.0, -load * width * min(t / ramp, 1.0)))
    box = skmpm.Periodic(width, None)
    return (
        skmpm.Scene([*bodies, floor, lid], cell=CELL, friction=friction, periodic=box, loads=[pressed]),
        rate,
    )


def build(discs: int, pressure: float, inertial: float, friction: float, seed: int, until: float) -> skmpm.Run:
    """A member, until a shear strain."""
    cell, rate = scene(discs, pressure, inertial, friction, seed)
    return skmpm.Run(cell, until / rate, observe=partial(row, discs, rate))


def row(discs: int, rate: float, cell: skmpm.Scene, state: skmpm.State) -> Row:
    """One line of the table: tractions on both walls, height between them, mean velocities by layers."""
    width = COLUMNS * D
    floor, lid = state.body_force[:, discs] / width, state.body_force[:, discs + 1] / width
    top = float(np.average(state.x[1, state.body == discs + 1], weights=state.mass[state.body == discs + 1]))
    speed = float(state.v[0, state.body == discs + 1].mean())
    grains = state.body < discs
    height, area = top + 0.485 * D, state.volume[grains].sum()
    layer = np.clip((LAYERS * state.x[1, grains] / (top - 0.48 * D)).astype(int), 0, LAYERS - 1)
    mass = state.mass[grains]
    mean = np.bincount(layer, mass * state.v[0, grains], LAYERS) / np.maximum(
        np.bincount(layer, mass, LAYERS), 1e-300
    )
    return {
        "strain": rate * state.t,
        "shear_floor": float(floor[0]),
        "pressure_floor": -float(floor[1]),
        "shear_lid": -float(lid[0]),
        "pressure_lid": float(lid[1]),
        "height": height,
        "solid_fraction": float(area / (width * (top - 0.485 * D))),
        "dt": state.report.dt,
        "retries": state.report.retries,
        "newton": state.report.newton,
        "overlap": state.report.overlap,
        "seconds": sum(state.report.seconds.values()),
        **{f"layer_{k}": float(v) for k, v in enumerate(mean / max(speed, 1e-300))},
    }


def members(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Parameters of `build`: every pressure at every inertial number, for every seed."""
    common = {"discs": options.discs, "friction": options.friction, "until": options.until}
    return [
        common | {"pressure": p, "inertial": number, "seed": seed}
        for seed in range(options.seeds)
        for p in options.pressure
        for number in options.inertial
    ]


def main(options: argparse.Namespace) -> None:
    """Run all members that have not finished, with a line of progress; then write the page."""
    from . import figures

    sweeps.run(build, members(options), options, figures.write)


def parser() -> argparse.ArgumentParser:
    """Options; the defaults are the study of `docs/studies/shear_cell.md`."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--discs", type=int, default=60, help="number of discs")
    options.add_argument("--pressure", type=float, nargs="+", default=[1e-3, 1e-2, 5e-2], help="over E*")
    options.add_argument("--inertial", type=float, nargs="+", default=[0.01, 0.03, 0.1], help="inertial numbers")
    options.add_argument("--friction", type=float, default=0.5, help="friction coefficient of discs")
    options.add_argument("--until", type=float, default=4.0, help="shear strain at the end")
    options.add_argument("--seeds", type=int, default=2, help="packings at each point")
    sweeps.add_options(options, "out/shear_cell", "shear_cell.md")
    return options
