"""Steel discs in a box under a lid at 10 m/s: its force, the solid fraction, overlap and the time of a step.

    python -m examples.studies.lmgc90_box --out out/lmgc90_box    # run what is missing, write the page
    python -m examples.studies.lmgc90_box figures                 # draw the figure, write the page

Radii, material, friction, gravity, lid and step are those of examples/Pre/prepro_grains/box_disk_defo of LMGC90. The
box is larger, so that all discs fit in it. Every member is one run by `skmpm.sweep`; then the page is written.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from time import process_time
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import skmpm
from skmpm.sweep import Member

from ..pages import picture, table

RADII, RATIO = (0.5, 2.0), 15.0 / 10.0  # [m], of the width of the box to its height
STEEL = skmpm.NeoHookean(E=2.05e11, nu=0.3, density=7850.0)
BETWEEN, AT_WALLS, LID, GRAVITY = 0.3, 0.5, 10.0, 9.81  # friction; [m/s]; [m/s2]
DT, EXAMPLE = 1e-5, 1e-3  # [s], and the end of LMGC90's run
FELT = 0.01  # share of the lid's force on the floor at which it has arrived there
FLOOR, TOP = 0, 1  # among the walls
TIMED = 10  # steps whose time is taken, after two
HEAD = ("R/h", "theta", "points", "lid in the first step [GN/m]", "lid, mean to 1 ms [GN/m]", "lid at 1 ms [GN/m]",
        "lid at 1 ms over a solid block", "lid at the end [GN/m]", "floor at the end [GN/m]",
        "floor bears 1 % at [ms]", "solid fraction at first", "solid fraction at the end", "overlap, largest",
        "momentum off", "retries", "a step at 1 ms [ms]", "a step at the end [ms]")  # fmt: skip
Row = dict[str, float]


def scene(discs: int, fraction: float, cells: float, seed: int) -> skmpm.Scene:
    """Discs at rest that touch, in a box as wide to its height as LMGC90's; `cells` in the mean radius."""
    radii = np.random.default_rng(seed).uniform(*RADII, discs)
    width = float(np.sqrt(RATIO * np.pi * (radii**2).sum() / fraction))
    packed = skmpm.packing(radii, width, solid_fraction=fraction, seed=seed)
    cell = float(np.mean(RADII)) / cells
    bodies = [
        skmpm.Body(skmpm.disc(centre, radius, spacing=0.74 * cell), STEEL)
        for centre, radius in zip(packed.centres.T, packed.radii, strict=True)
    ]
    walls = [
        skmpm.Wall((0.0, 0.0), (0.0, 1.0), friction=AT_WALLS),
        skmpm.Wall((0.0, packed.height), (0.0, -1.0), velocity=(0.0, -LID), friction=AT_WALLS),
        skmpm.Wall((0.0, 0.0), (1.0, 0.0), friction=AT_WALLS),
        skmpm.Wall((width, 0.0), (-1.0, 0.0), friction=AT_WALLS),
    ]
    return skmpm.Scene(bodies, cell=cell, walls=walls, friction=BETWEEN, gravity=(0.0, -GRAVITY))


def build(discs: int, fraction: float, cells: float, theta: float, seed: int, until: float) -> skmpm.Run:
    """A member, on one core; the state at the end of LMGC90's run, or of a shorter one, is kept."""
    end = min(EXAMPLE, until) - 0.5 * DT
    keep = {"example": lambda row: row["t"] > end}
    scheme = skmpm.Scheme(theta=theta, threads=1)
    return skmpm.Run(scene(discs, fraction, cells, seed), until, dt=DT, scheme=scheme, observe=row, keep=keep)


def row(box: skmpm.Scene, state: skmpm.State) -> Row:
    """One line of the table."""
    return {
        "dt": state.report.dt,
        "lid": float(state.wall_force[TOP, 1]),
        "floor": -float(state.wall_force[FLOOR, 1]),
        "walls": float(state.wall_force[:, 1].sum()),
        "momentum": float(state.mass @ state.v[1]),
        "mass": float(state.mass.sum()),
        "solid_fraction": skmpm.observe(box, state).solid_fraction,
        "overlap": state.report.overlap,
        "retries": state.report.retries,
        "newton": state.report.newton,
    }


def block(box: skmpm.Scene) -> float:
    """Force that a solid block as wide as the box would exert on the lid before waves return, rho c v width [N/m]."""
    return float(STEEL.density * box.fastest_wave * LID * box.walls[-1].point[0])


def cost(box: skmpm.Scene, member: Member, name: str) -> float:
    """Median processor time of further steps of a kept state, on one core [s]."""
    state, times = member.state(name), []
    scheme = skmpm.Scheme(theta=member.parameters["theta"], threads=1)
    for _ in range(2 + TIMED):
        began = process_time()
        state = skmpm.step(box, state, DT, scheme=scheme)
        times.append(process_time() - began)
    return float(np.median(times[2:]))


def unbalanced(columns: dict[str, Any]) -> float:
    """Momentum less the impulse of walls and weight, the largest over the run, over the impulse of the lid."""
    impulse = -np.cumsum(columns["dt"] * (columns["walls"] + GRAVITY * columns["mass"]))
    start = columns["momentum"] - impulse
    return float(np.abs(start).max() / (columns["dt"] @ columns["lid"]))


def arrival(columns: dict[str, Any]) -> float:
    """Time at which the floor bears a share FELT of the force on the lid [s]; nan if it does not."""
    felt = columns["floor"] > FELT * columns["lid"]
    return float(columns["t"][np.argmax(felt)]) if felt.any() else float("nan")


def line(member: Member) -> tuple[str, ...]:
    """A column of the table."""
    columns, about, box = member.columns, member.parameters, build(**member.parameters).scene
    early = columns["t"] < EXAMPLE + 0.5 * DT
    lid = 1e-9 * columns["lid"]
    return (
        f"{about['cells']:g}",
        f"{about['theta']:g}",
        f"{member.state().mass.size:,}",
        f"{lid[0]:.2f}",
        f"{lid[early].mean():.2f}",
        f"{lid[early][-1]:.2f}",
        f"{1e9 * lid[early][-1] / block(box):.2f}",
        f"{lid[-1]:.2f}",
        f"{1e-9 * columns['floor'][-1]:.2f}",
        f"{1e3 * arrival(columns):.1f}",
        f"{columns['solid_fraction'][0]:.4f}",
        f"{columns['solid_fraction'][-1]:.4f}",
        f"{columns['overlap'].max():.0e}",
        f"{unbalanced(columns):.0e}",
        f"{columns['retries'].sum():.0f}",
        f"{1e3 * cost(box, member, 'example'):.0f}",
        f"{1e3 * cost(box, member, 'last'):.0f}",
    )


def ordered(found: skmpm.Sweep) -> list[Member]:
    """Backward Euler first, then the finest."""
    return sorted(found, key=lambda member: (-member.parameters["theta"], -member.parameters["cells"]))


def draw(found: skmpm.Sweep, folder: Path) -> None:
    """Forces over time of all members, and two states of the first one in its box."""
    members = ordered(found)
    box = build(**members[0].parameters).scene
    figure, axes = plt.subplots(1, 3, figsize=(15, 4.2), layout="constrained", width_ratios=(1, 1.2, 1.2))
    for k, member in enumerate(members):
        columns, about = member.columns, member.parameters
        label = f"R/h = {about['cells']:g}, theta = {about['theta']:g}"
        axes[0].plot(1e3 * columns["t"], 1e-9 * columns["lid"], color=f"C{k}", lw=1, label=label)
        axes[0].plot(1e3 * columns["t"], 1e-9 * columns["floor"], color=f"C{k}", lw=1, ls="--")
    axes[0].axvline(1e3 * EXAMPLE, color="k", lw=0.8, ls=":")
    axes[0].set(xlabel="t [ms]", ylabel="force on lid (dashed: floor) [GN/m]", ylim=(0.0, None))
    axes[0].legend(fontsize=8)
    for axis, name in zip(axes[1:], ("example", "last"), strict=True):
        state = members[0].state(name)
        skmpm.plot(box, state, "speed", forces=True, limits=(0.0, 1.5 * LID), axes=axis)
        axis.set_title(f"{1e3 * state.t:.2g} ms", loc="right")
    picture(figure, folder / "lmgc90_box.png", 100)


def tables(found: skmpm.Sweep) -> dict[str, str]:
    """The table, a line for each quantity and a column for each member."""
    head, *rest = zip(HEAD, *map(line, ordered(found)), strict=True)
    return {"members": table(head, rest)}


def members(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Parameters of `build`: every resolution by backward Euler, the first also by the midpoint rule of LMGC90."""
    common = {name: getattr(options, name) for name in ("discs", "fraction", "seed", "until")}
    each = [*((cells, 1.0) for cells in options.cells), (options.cells[0], 0.5)]
    return [common | {"cells": cells, "theta": theta} for cells, theta in each]


def add_options(options: argparse.ArgumentParser) -> None:
    """Options; the defaults are the study of `docs/studies/lmgc90_box.md`."""
    options.add_argument("--discs", type=int, default=100, help="number of discs")
    options.add_argument("--fraction", type=float, default=0.80, help="solid fraction at first; more of it jams")
    options.add_argument("--cells", type=float, nargs="+", default=[12.0, 8.0, 5.0], help="in the mean radius")
    options.add_argument("--until", type=float, default=1e-2, help="end of the runs [s]")
    options.add_argument("--seed", type=int, default=0, help="of the packing")
    options.set_defaults(processes=1)  # steps are timed
