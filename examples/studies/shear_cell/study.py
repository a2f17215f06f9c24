"""Soft discs between two rows of bonded grains, drawn along and pressed together: friction, height, velocities.

    python -m examples.studies.shear_cell --out out/shear_cell    # run what is missing, write the page
    python -m examples.studies.shear_cell figures                 # draw the figure, write the page

Every member is one run by `skmpm.sweep`: the cell is periodic along x, its floor is held, its lid moves at a given
speed and settles under a load, which grows to its value and stays. Steps are chosen (``dt=None``). Then the page is
written.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import skmpm
from skmpm.sweep import Member

from ..pages import picture, table
from ..sweeps import groups

D, DENSITY, YOUNG, POISSON = 2e-3, 1000.0, 1e6, 0.3  # mean diameter [m]; [kg/m3]; [Pa]
STIFFNESS = YOUNG / (1.0 - POISSON**2)  # E* [Pa]
CELL = D / 8.0  # four cells in the mean radius
COLUMNS = 8  # grains in a row of a rough wall, and mean diameters in the width of the cell
LAYERS = 12  # of the profile of velocities
RAMP = 1.0  # shear strain in which the load grows to its value
STEADY = RAMP + 0.5  # strain from which means are taken
HEAD = ("P / E*", "I", "packings", "μ", "its deviation", "solid fraction", "height [d]", "lid over floor, pressure",
        "lid over floor, shear", "overlap, largest [%]", "steps", "retries", "time [min]")  # fmt: skip
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


def add_options(options: argparse.ArgumentParser) -> None:
    """Options; the defaults are the study of `docs/studies/shear_cell.md`."""
    options.add_argument("--discs", type=int, default=60, help="number of discs")
    options.add_argument("--pressure", type=float, nargs="+", default=[1e-3, 1e-2, 5e-2], help="over E*")
    options.add_argument("--inertial", type=float, nargs="+", default=[0.01, 0.03, 0.1], help="inertial numbers")
    options.add_argument("--friction", type=float, default=0.5, help="friction coefficient of discs")
    options.add_argument("--until", type=float, default=4.0, help="shear strain at the end")
    options.add_argument("--seeds", type=int, default=2, help="packings at each point")


def means(member: Member) -> dict[str, float]:
    """Means over the steady part of a member, weighted with the lengths of steps."""
    columns = member.columns
    late = np.where(columns["strain"] > min(STEADY, 0.5 * columns["strain"][-1]), columns["dt"], 0.0)
    found = {name: float(np.average(values, weights=late)) for name, values in columns.items()}
    each = over(columns["shear_floor"], found["pressure_floor"])
    found["ratio"] = over(found["shear_floor"], found["pressure_floor"])
    found["deviation"] = float(np.sqrt(np.average((each - found["ratio"]) ** 2, weights=late)))
    return found


def over(part: Any, whole: float) -> Any:
    """A part over what a wall bears in the mean; nan where it bears nothing."""
    return part / whole if whole else np.nan * part


def line(point: tuple[float, ...], members: list[Member]) -> tuple[str, ...]:
    """A row of the table."""
    each = [means(member) for member in members]

    def mean(name: str) -> float:
        return float(np.mean([m[name] for m in each]))

    count = [member.columns["t"].size for member in members]
    return (
        f"{point[0]:g}",
        f"{point[1]:g}",
        f"{len(members)}",
        ", ".join(f"{m['ratio']:.3f}" for m in each),
        f"{mean('deviation'):.2f}",
        f"{mean('solid_fraction'):.3f}",
        f"{mean('height') / D:.2f}",
        f"{over(mean('pressure_lid'), mean('pressure_floor')):.3f}",
        f"{over(mean('shear_lid'), mean('shear_floor')):.3f}",
        f"{100 * max(float(member.columns['overlap'].max()) for member in members):.2g}",
        f"{np.mean(count):.0f}",
        f"{np.mean([member.columns['retries'].sum() for member in members]):.0f}",
        f"{np.mean([member.columns['seconds'].sum() for member in members]) / 60:.1f}",
    )


def draw(found: skmpm.Sweep, folder: Path) -> None:
    """Friction and solid fraction against the inertial number, profiles of velocity, and the last state of one."""
    figure, axes = plt.subplots(1, 4, figsize=(14, 3.6), layout="constrained", width_ratios=(1, 1, 1, 1.1))
    by_point = groups(found, "pressure", "inertial")
    for k, pressure in enumerate(sorted({p for p, _ in by_point})):
        numbers = sorted(number for p, number in by_point if p == pressure)
        for axis, name in zip(axes, ("ratio", "solid_fraction"), strict=False):
            each = [[means(m)[name] for m in by_point[pressure, number]] for number in numbers]
            axis.semilogx(numbers, [np.mean(e) for e in each], "-", color=f"C{k}", label=f"P / E* = {pressure:g}")
            for number, values in zip(numbers, each, strict=True):
                axis.plot([number] * len(values), values, "o", color=f"C{k}", ms=3)
        for number in numbers:
            profiles = [[means(m)[f"layer_{i}"] for i in range(LAYERS)] for m in by_point[pressure, number]]
            place = (np.arange(LAYERS) + 0.5) / LAYERS
            axes[2].plot(np.mean(profiles, axis=0), place, color=f"C{k}", alpha=0.3 + 0.7 * number / max(numbers))
    axes[0].set(xlabel="inertial number", title="shear stress over pressure")
    axes[0].legend()
    axes[1].set(xlabel="inertial number", title="solid fraction")
    axes[2].set(xlabel="mean velocity over that of the lid", title="place over the height", xlim=(0.0, 1.0))
    first = next(iter(found))
    skmpm.plot(build(**first.parameters).scene, first.state(), "speed", forces=True, axes=axes[3])
    axes[3].axis("off")
    picture(figure, folder / "shear_cell.png", 110)


def tables(found: skmpm.Sweep) -> dict[str, str]:
    """The parts of the page that are made of the members."""
    return {"members": table(HEAD, [line(*group) for group in groups(found, "pressure", "inertial").items()])}
