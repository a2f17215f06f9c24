"""An ensemble of packings
=======================

Four coefficients of friction, three packings each: twelve runs that share the cores, and can be interrupted.

    python examples/sweep.py

A sweep runs `build` for every member, each in a directory of its own with its table, a manifest and a checkpoint. Run
the script again: members that have finished are not run again, an interrupted one goes on from its checkpoint. On a
cluster the same call takes a Dask client, `skmpm.sweep(..., client=client)`. Here each packing is squeezed from a
solid fraction of 0.72 to 0.95: the more friction, the earlier it resists.
"""

import argparse
from functools import partial
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from drawing import save

import skmpm

SPEED, CELL = 1.0, 0.25e-3  # of the lid [m/s], of the grids [m]
gel = skmpm.NeoHookean(E=10e6, nu=0.45, density=990.0)


def build(friction: float, seed: int) -> skmpm.Run:
    """A packing of six discs under a lid, until it has been squeezed to 0.95."""
    radii = np.random.default_rng(seed).uniform(0.7e-3, 1.2e-3, 6)
    packing = skmpm.packing(radii, width=4.2e-3, solid_fraction=0.72, seed=seed)
    bodies = [
        skmpm.Body(skmpm.disc(centre, radius, spacing=0.7 * CELL), gel)
        for centre, radius in zip(packing.centres.T, packing.radii, strict=True)
    ]
    smooth = partial(skmpm.Wall, friction=0.0)
    walls = [
        smooth((0.0, 0.0), (0.0, 1.0)),
        smooth((0.0, packing.height), (0.0, -1.0), velocity=(0.0, -SPEED)),
        smooth((0.0, 0.0), (1.0, 0.0)),
        smooth((4.2e-3, 0.0), (-1.0, 0.0)),
    ]
    scene = skmpm.Scene(bodies, cell=CELL, walls=walls, friction=friction)
    return skmpm.Run(scene, until=(1.0 - 0.72 / 0.95) * packing.height / SPEED, dt=10e-6)


def main(out: Path) -> skmpm.Sweep:
    """Run the ensemble, and draw pressure against solid fraction, mean and range of the packings."""
    members = [{"friction": friction, "seed": seed} for friction in (0.0, 0.1, 0.3, 0.6) for seed in range(3)]
    print(skmpm.preflight(build(**members[0]).scene, dt=10e-6))
    found = skmpm.sweep(build, members, out=out / "members", progress=True)
    print(found)

    axes = plt.figure(figsize=(6, 4), layout="constrained").add_subplot()
    phi = np.linspace(0.75, 0.94, 20)
    for friction in (0.0, 0.1, 0.3, 0.6):
        tables = [member.columns for member in found.where(friction=friction)]
        curves = [np.interp(phi, table["solid_fraction_nominal"], table["pressure"]) / gel.E for table in tables]
        (line,) = axes.plot(phi, np.mean(curves, axis=0), label=f"friction {friction:g}")
        axes.fill_between(phi, np.min(curves, axis=0), np.max(curves, axis=0), color=line.get_color(), alpha=0.15)
    axes.set(xlabel="nominal solid fraction", ylabel="pressure / E", yscale="log")
    axes.legend()
    save(axes.figure, out / "sweep.png")
    return found


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/sweep"), help="directory of the members and the picture")
    main(options.parse_args().out)
