"""Packings of soft discs squeezed in a box, inspected after every step, for the long verification runs.

`python tests/verification/packings.py [name ...]` runs the members of `MEMBERS` (all: three hours on two cores) in
two processes and writes one table each to docs/verification/packings/; those that are there are not run again.
"""

import csv
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

import skmpm

TABLES = Path(__file__).resolve().parents[2] / "docs" / "verification" / "packings"
RADII, YOUNG, POISSON, DENSITY = (0.7e-3, 1.2e-3), 10e6, 0.45, 990.0  # the discs of Nezamabadi et al. (2017)
GEL = skmpm.NeoHookean(YOUNG, POISSON, DENSITY)
SEEDS = range(4)
RANGES = {0.0: (0.80, 0.865), 0.5: (0.77, 0.835)}  # solid fractions of the box from loose to well above jamming


def packed(discs, friction, cells, *, start, speed, seed=0, material=GEL):
    """Discs of `cells` grid cells per mean radius at rest under a lid, (scene, solid area over width)."""
    radii = np.random.default_rng(seed).uniform(*RADII, discs)
    cell, solid = float(np.mean(RADII)) / cells, np.pi * (radii**2).sum()
    width = float(np.sqrt(solid / 0.72))
    placed = skmpm.packing(radii, width, solid_fraction=start, seed=seed)
    bodies = [
        skmpm.Body(skmpm.disc(centre, radius, spacing=0.74 * cell), material)
        for centre, radius in zip(placed.centres.T, placed.radii, strict=True)
    ]
    walls = [
        skmpm.Wall((0.0, 0.0), (0.0, 1.0)),
        skmpm.Wall((0.0, placed.height), (0.0, -1.0), velocity=(0.0, -speed)),
        skmpm.Wall((0.0, 0.0), (1.0, 0.0)),
        skmpm.Wall((width, 0.0), (-1.0, 0.0)),
    ]
    return skmpm.Scene(bodies, cell=cell, walls=walls, friction=friction), solid / width


@dataclass(frozen=True)
class Squeeze:
    """After every step."""

    fraction: np.ndarray  # (steps,) nominal solid fraction
    overlap: np.ndarray  # (steps,) share of the area
    gap: np.ndarray  # (steps,) the smallest [cells]
    spin: np.ndarray  # (steps,) turn of the fastest disc in the step [rad]
    newton: np.ndarray  # (steps,) iterations
    pressure: np.ndarray  # (steps,) on the lid [Pa]


def squeeze(discs, friction, cells, *, start=0.70, until=0.97, dt=8e-6, speed=2.0):
    """Squeeze to a nominal solid fraction and look at every step."""
    scene, filled = packed(discs, friction, cells, start=start, speed=speed)
    first = skmpm.initial(scene)
    found = []
    for state in skmpm.simulate(scene, dt=dt, until=(first.walls[1, 1] - filled / until) / speed, start=first):
        report, gap = state.report, state.contacts.gap
        turning = np.bincount(state.body, 0.5 * (state.C[1, 0] - state.C[0, 1])) / np.bincount(state.body)
        smallest = gap.min(initial=scene.cell) / scene.cell
        lid = state.wall_force[1, 1] / scene.walls[3].point[0]
        found.append((filled / state.walls[1, 1], report.overlap, smallest, dt * np.abs(turning).max(),
                      report.newton, lid))  # fmt: skip
    return Squeeze(*np.array(found, dtype=float).T)


@dataclass(frozen=True)
class Compression:
    """After every step; fractions, pressure and coordination of the interior, two mean diameters from every wall."""

    nominal: np.ndarray  # (steps,) solid fraction by initial volumes
    fraction: np.ndarray  # (steps,) by outlines
    pressure: np.ndarray  # (steps,) over E*
    coordination: np.ndarray  # (steps,)
    without_rattlers: np.ndarray  # (steps,) coordination, discs with fewer than three contacts removed
    inertial: np.ndarray  # (steps,) strain rate x mean diameter x sqrt(density / pressure)
    box: np.ndarray  # (steps,) nominal solid fraction of the whole box
    lid: np.ndarray  # (steps,) pressure on the lid over E*
    unbalanced: np.ndarray  # (steps,) largest resultant force on a body over the mean contact force
    kinetic: np.ndarray  # (steps,) energy over the elastic energy
    overlap: np.ndarray  # (steps,) share of the area
    newton: np.ndarray  # (steps,) iterations
    retries: np.ndarray  # (steps,)
    seconds: np.ndarray  # (steps,) of processor time since the start


def compress(discs, friction, cells, *, start, until, speed, seed=0, poisson=POISSON, shared_grid=False):
    """Lower a lid in steps that `simulate` chooses; `shared_grid` as Nezamabadi et al. (2017), with a linear law."""
    scheme = skmpm.Scheme.nezamabadi2017() if shared_grid else skmpm.Scheme()
    gel = (skmpm.LinearElastic if shared_grid else skmpm.NeoHookean)(YOUNG, poisson, DENSITY)
    scene, filled = packed(discs, friction, cells, start=start, speed=speed, seed=seed, material=gel)
    first, modulus = skmpm.initial(scene, scheme=scheme), YOUNG / (1.0 - poisson**2)
    found, began, height = [], time.process_time(), first.walls[1, 1]
    for state in skmpm.simulate(scene, until=(height - filled / until) / speed, start=first, scheme=scheme):
        seen, report = skmpm.observe(scene, state, interior=True), state.report
        pressure, height = max(seen.pressure / modulus, 1e-9), state.walls[1, 1]
        inertial = speed / height * 2.0 * np.mean(RADII) * np.sqrt(DENSITY / (pressure * modulus))
        lid = state.wall_force[1, 1] / scene.walls[3].point[0] / modulus
        kinetic = report.energy.kinetic / max(report.energy.elastic, np.finfo(float).tiny)
        found.append((
            seen.solid_fraction_nominal, seen.solid_fraction, pressure, seen.coordination,
            seen.coordination_without_rattlers, inertial, filled / height, lid, report.unbalanced, kinetic,
            report.overlap, report.newton, report.retries, time.process_time() - began,
        ))  # fmt: skip
    return Compression(*np.array(found, dtype=float).T)


MEMBERS = {
    **{
        f"squeeze_mu{friction:g}_r{cells}": (squeeze, (100, friction, cells), {})
        for cells in (5, 8)
        for friction in (0.0, 0.1, 0.5)
    },
    **{
        f"jamming_{name}mu{friction:g}_seed{seed}": (
            compress, (300, friction, 5), {"start": start, "until": until, "speed": speed, "seed": seed},
        )
        for seed in SEEDS
        for name, speed in (("", 6e-3), ("fast_", 6e-2))
        for friction, (start, until) in RANGES.items()
    },
    "jamming_r8": (compress, (300, 0.0, 8), {"start": 0.80, "until": 0.865, "speed": 6e-3}),
    **{
        f"jamming_poisson{poisson:g}": (
            compress, (100, 0.0, 5), {"start": 0.76, "until": 0.95, "speed": 6e-3, "poisson": poisson},
        )
        for poisson in (0.3, 0.45, 0.495)
    },
    **{
        f"jamming_shared_grid_r{cells}": (
            compress, (100, 0.0, cells), {"start": 0.55, "until": 0.84, "speed": 0.5, "shared_grid": True},
        )
        for cells in (6, 8, 10)
    },
}  # fmt: skip


def write(name, table):
    """One column for every field."""
    TABLES.mkdir(parents=True, exist_ok=True)
    names = [field.name for field in fields(table)]
    with (TABLES / f"{name}.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows([f"{value:.6g}" for value in row] for row in zip(*(getattr(table, n) for n in names)))  # noqa: B905


def read(name):
    """The table of a member, `Squeeze` or `Compression`."""
    kind = Squeeze if MEMBERS[name][0] is squeeze else Compression
    with (TABLES / f"{name}.csv").open() as file:
        names, *rows = csv.reader(file)
    if names != [field.name for field in fields(kind)]:
        raise ValueError(f"{name}.csv has columns {names}; delete it and run packings.py again")
    return kind(*np.array(rows, dtype=float).T)


def has(name):
    """Whether a member has been run."""
    return (TABLES / f"{name}.csv").exists()


def run(name):
    """Run one member and keep its table."""
    function, arguments, options = MEMBERS[name]
    write(name, function(*arguments, **options))
    return name


if __name__ == "__main__":
    missing = [name for name in sys.argv[1:] or MEMBERS if not has(name)]
    with ProcessPoolExecutor(2) as processes:
        for name in processes.map(run, missing):
            print(name)  # noqa: T201
