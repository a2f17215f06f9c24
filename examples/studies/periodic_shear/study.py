"""Packings in a periodic box: compressed to a pressure, kept under it, then sheared at constant vertical stress.

    python -m examples.studies.periodic_shear --out out/shear    # run what is missing, write the page
    python -m examples.studies.periodic_shear figures            # draw the figure, write the page

Every member runs in three stages by `skmpm.sweep`: both edges of the box shorten at 4 per second until the packing
bears the pressure; both vertical stresses are held for 5 ms; the box shears at 4 per second while its height follows
from the vertical stress. Steps are chosen (``dt=None``). Then the page is written.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import skmpm
from skmpm.sweep import Member

from ..pages import picture, table

CELL, SPACING = 0.17e-3, 0.126e-3  # [m]; 5.6 cells in the mean radius
RATE, HOLD, LOOSE = 4.0, 5e-3, 0.77  # [1/s]; [s]; solid fraction of the packing that is compressed
NAN = float("nan")
STEADY = 0.2  # strain from which means are taken
WINDOW = 0.01  # strain over which the curves of the figure are averaged
HEAD = ("member", "steps", "retries", "μ* at most", "μ* mean", "its deviation", "Φ at first", "Φ mean", "Z mean",
        "vertical stress off P", "kinetic / elastic, median", "wall time")  # fmt: skip
Row = dict[str, float]
Columns = dict[str, np.ndarray]


def packing(discs: int, seed: int) -> tuple[list[skmpm.Body], Callable[..., skmpm.Periodic]]:
    """Discs of 0.7-1.2 mm, and the periodic box around them, which takes its motion."""
    radii = np.random.default_rng(seed).uniform(0.7e-3, 1.2e-3, discs)
    width = float(np.sqrt(np.pi * np.sum(radii**2) / LOOSE))
    loose = skmpm.packing(radii, width, solid_fraction=LOOSE, periodic=True, seed=seed)
    rubber = skmpm.NeoHookean(E=10e6, nu=0.45, density=990.0)
    places = zip(loose.centres.T, loose.radii, strict=True)
    bodies = [skmpm.Body(skmpm.disc(x, r, spacing=SPACING), rubber) for x, r in places]
    return bodies, partial(skmpm.Periodic, loose.width, loose.height)


def stages(discs: int, friction: float, confining: float, seed: int) -> list[skmpm.Scene]:
    """The same packing in a box that shrinks, one under pressure, and one that shears under a vertical stress."""
    bodies, box = packing(discs, seed)
    motions = (
        {"rate": [[-RATE, 0.0], [0.0, -RATE]]},
        {"stress": [[-confining, NAN], [NAN, -confining]]},
        {"rate": [[0.0, RATE], [0.0, NAN]], "stress": [[NAN, NAN], [NAN, -confining]]},
    )
    return [skmpm.Scene(bodies, cell=CELL, friction=friction, periodic=box(**motion)) for motion in motions]


def build(discs: int, friction: float, confining: float, seed: int, until: float) -> skmpm.Run:
    """A member: its three stages, under a confining pressure [Pa], until a shear strain."""
    squeezed, held, sheared = stages(discs, friction, confining, seed)

    def hold(state: skmpm.State) -> skmpm.Run:
        start = skmpm.continued(squeezed, state, held)
        return skmpm.Run(held, start.t + HOLD, start=start, observe=partial(row, 1, start.t), then=shear)

    def shear(state: skmpm.State) -> skmpm.Run:
        start = skmpm.continued(held, state, sheared)
        return skmpm.Run(sheared, start.t + until / RATE, start=start, observe=partial(row, 2, start.t))

    full = -np.log(LOOSE) / 2.0 / RATE  # [s] the area of the box is that of the discs: never reached
    return skmpm.Run(
        squeezed, full, observe=partial(row, 0, 0.0), stop=lambda line: line["pressure"] > confining, then=hold
    )


def row(stage: int, begun: float, scene: skmpm.Scene, state: skmpm.State) -> Row:
    """One line of the table; the strain is that of the shear."""
    seen, report = skmpm.observe(scene, state), state.report
    return {
        "stage": stage,
        "strain": RATE * (state.t - begun) if stage == 2 else 0.0,
        "shear": seen.stress[0, 1],
        "vertical": -seen.stress[1, 1],
        "pressure": seen.pressure,
        "solid_fraction": seen.solid_fraction,
        "coordination": seen.coordination,
        "coordination_without_rattlers": seen.coordination_without_rattlers,
        "anisotropy": seen.anisotropy,
        "overlap": seen.overlap,
        "dt": report.dt,
        "retries": report.retries,
        "newton": report.newton,
        "kinetic": report.energy.kinetic,
        "elastic": report.energy.elastic,
        "unbalanced": report.unbalanced,
        "seconds": sum(report.seconds.values()),
    }


def members(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Parameters of `build`: every friction for every seed."""
    common = {"discs": options.discs, "confining": options.confining, "until": options.until}
    return [common | {"friction": mu, "seed": seed} for seed in range(options.seeds) for mu in options.friction]


def add_options(options: argparse.ArgumentParser) -> None:
    """Options; the defaults are the study of `docs/studies/periodic_shear.md`."""
    options.add_argument("--discs", type=int, default=200, help="number of discs")
    options.add_argument("--friction", type=float, nargs="+", default=[0.5], help="friction coefficients of discs")
    options.add_argument("--confining", type=float, default=1e5, help="pressure and vertical stress [Pa]")
    options.add_argument("--until", type=float, default=0.5, help="shear strain at the end")
    options.add_argument("--seeds", type=int, default=2, help="packings for each friction")


def sheared(member: Member) -> Columns:
    """The columns of the third stage."""
    last = member.columns["stage"] == 2
    return {name: column[last] for name, column in member.columns.items()}


def smooth(strain: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Means over the steps within half a window: steps are short where the packing rearranges."""
    weight = np.diff(strain, prepend=0.0)
    summed = np.concatenate([[0.0], np.cumsum(weight * values)]), np.concatenate([[0.0], np.cumsum(weight)])
    begin, end = (np.searchsorted(strain, strain + half) for half in (-WINDOW / 2.0, WINDOW / 2.0))
    first, last = np.minimum(begin, strain.size - 1), np.minimum(end + 1, strain.size)
    return (summed[0][last] - summed[0][first]) / (summed[1][last] - summed[1][first])


def line(member: Member) -> tuple[str, ...]:
    """A row of the table of members; means are weighted with the strain of their steps."""
    found, about = sheared(member), member.parameters
    strain, ratio = found["strain"], found["shear"] / found["vertical"]
    weight = np.where(strain > min(STEADY, strain[-1] / 2.0), np.diff(strain, prepend=0.0), 0.0)

    def mean(values: np.ndarray) -> float:
        return float(np.average(values, weights=weight))

    still = np.median(np.abs(found["vertical"] / about["confining"] - 1.0))
    return (
        f"{about['discs']} discs, friction {about['friction']}, seed {about['seed']}",
        f"{strain.size}",
        f"{found['retries'].sum():.0f}",
        f"{smooth(strain, ratio).max():.2f}",
        f"{mean(ratio):.2f}",
        f"{np.sqrt(mean((ratio - mean(ratio)) ** 2)):.2f}",
        f"{found['solid_fraction'][0]:.4f}",
        f"{mean(found['solid_fraction']):.4f}",
        f"{mean(found['coordination_without_rattlers']):.2f}",
        f"{100 * still:.2g} %",
        f"{np.median(found['kinetic'] / found['elastic']):.0e}",
        f"{member.columns['seconds'].sum() / 60:.0f} min",
    )


def draw(found: skmpm.Sweep, folder: Path) -> None:
    """Friction and solid fraction over the strain, and the last state of the first member."""
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.6), layout="constrained", width_ratios=(1, 1, 1.2))
    for k, member in enumerate(found):
        columns, about = sheared(member), member.parameters
        strain, name = columns["strain"], f"friction {about['friction']}, seed {about['seed']}"
        ratio = columns["shear"] / columns["vertical"]
        axes[0].plot(strain, ratio, color=f"C{k}", lw=0.4, alpha=0.5)
        axes[0].plot(strain, smooth(strain, ratio), color=f"C{k}", label=name)
        axes[1].plot(strain, columns["solid_fraction"], color=f"C{k}")
    axes[0].set(xlabel="shear strain", title="shear stress over vertical stress")
    axes[0].legend()
    axes[1].set(xlabel="shear strain", title="solid fraction")
    first = next(iter(found))
    skmpm.plot(build(**first.parameters).scene, first.state(), forces=True, axes=axes[2])
    axes[2].axis("off")
    picture(figure, folder / "shear.png", 110)


def tables(found: skmpm.Sweep) -> dict[str, str]:
    """The parts of the page that are made of the members."""
    return {"members": table(HEAD, [line(member) for member in found])}
