"""Packings in a periodic box: compressed to a pressure, kept under it, then sheared at constant vertical stress.

    python -m examples.studies.periodic_shear --out out/shear

Every member runs in three stages by `skmpm.sweep`: both edges of the box shorten at 4 per second until the packing
bears the pressure; both vertical stresses are held for 5 ms; the box shears at 4 per second while its height follows
from the vertical stress. Steps are chosen (``dt=None``). Then the page is written, as by `figures`.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

import skmpm

from .. import sweeps

CELL, SPACING = 0.17e-3, 0.126e-3  # [m]; 5.6 cells in the mean radius
RATE, HOLD, LOOSE = 4.0, 5e-3, 0.77  # [1/s]; [s]; solid fraction of the packing that is compressed
NAN = float("nan")
Row = dict[str, float]


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


def main(options: argparse.Namespace) -> None:
    """Run all members that have not finished, with a line of progress; then write the page."""
    from . import figures

    sweeps.run(build, members(options), options, figures.write)


def parser() -> argparse.ArgumentParser:
    """Options; the defaults are the study of `docs/studies/periodic_shear.md`."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--discs", type=int, default=200, help="number of discs")
    options.add_argument("--friction", type=float, nargs="+", default=[0.5], help="friction coefficients of discs")
    options.add_argument("--confining", type=float, default=1e5, help="pressure and vertical stress [Pa]")
    options.add_argument("--until", type=float, default=0.5, help="shear strain at the end")
    options.add_argument("--seeds", type=int, default=2, help="packings for each friction")
    sweeps.add_options(options, "out/shear", "periodic_shear.md")
    return options
