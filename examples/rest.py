"""A packing comes to rest
=======================

A packing comes to rest: frictionless discs are compressed, the lid stops, and the motion decays.

    python examples/rest.py --discs 60

A run can continue in a scene with other wall velocities: `dataclasses.replace` makes it, `simulate(start=...)`
continues. Backward Euler dissipates the kinetic energy; the elastic energy of the compressed packing remains.
"""

import argparse
from dataclasses import replace
from itertools import chain
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skmpm

SPEED, START, DT = 2.0, 0.70, 8e-6  # of the lid [m/s], nominal solid fraction, [s]


def compaction(discs: int, until: float) -> tuple[skmpm.Scene, float]:
    """Frictionless discs under a lid, and the time [s] at which their nominal solid fraction is `until`."""
    radii = np.random.default_rng(0).uniform(0.7e-3, 1.2e-3, discs)
    solid = np.pi * (radii**2).sum()
    width = float(np.sqrt(solid / 0.72))
    gel = skmpm.NeoHookean(E=10e6, nu=0.45, density=990.0)
    packed = skmpm.packing(radii, width, solid_fraction=START, seed=0)
    places = zip(packed.centres.T, packed.radii, strict=True)
    bodies = [skmpm.Body(skmpm.disc(centre, radius, spacing=0.14e-3), gel) for centre, radius in places]
    walls = [
        skmpm.Wall((0, 0), (0, 1)),
        skmpm.Wall((0, packed.height), (0, -1), velocity=(0, -SPEED)),
        skmpm.Wall((0, 0), (1, 0)),
        skmpm.Wall((width, 0), (-1, 0)),
    ]
    scene = skmpm.Scene(bodies, cell=0.19e-3, walls=walls)
    return scene, (packed.height - solid / (width * until)) / SPEED


def main(out: Path, discs: int = 60, until: float = 0.92, steps: int = 240) -> list[tuple[float, float, float]]:
    """Kinetic and elastic energy [J/m] and the largest rotation rate [rad/step] after the lid stops."""
    scene, stop = compaction(discs, until)
    print(skmpm.preflight(scene, DT))
    *_, compressed = skmpm.simulate(scene, dt=DT, until=stop)
    floor, lid, *sides = scene.walls
    stopped, table = replace(scene, walls=[floor, replace(lid, velocity=(0.0, 0.0)), *sides]), []
    after = skmpm.simulate(stopped, dt=DT, until=stop + steps * DT, start=compressed)
    for step, state in enumerate(chain([compressed], after)):
        energy, points = state.report.energy, np.bincount(state.body)
        rotation = DT * np.bincount(state.body, 0.5 * (state.C[1, 0] - state.C[0, 1])) / points
        table.append((energy.kinetic, energy.elastic, float(np.abs(rotation).max())))
        if step % 40 == 0:
            print("step {:4d}  kinetic {:.4f}  elastic {:.4f}  rotation {:.4f}".format(step, *table[-1]))

    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 4), layout="constrained")
    skmpm.plot(scene, state, axes=left)
    for column, label in enumerate(
        ("kinetic energy [J/m]", "elastic energy [J/m]", "largest rotation rate [rad/step]")
    ):
        right.semilogy([line[column] for line in table], label=label)
    right.set_xlabel("steps after the lid has stopped")
    right.legend()
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "rest.png", bbox_inches="tight")
    return table


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--discs", type=int, default=60)
    options.add_argument("--out", type=Path, default=Path("out/rest"), help="directory of the picture")
    chosen = options.parse_args()
    main(chosen.out, chosen.discs)
