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

import compaction
import matplotlib.pyplot as plt
import numpy as np
from drawing import save

import skmpm


def main(out: Path, discs: int = 60, until: float = 0.92, steps: int = 240) -> list[tuple[float, float, float]]:
    """Kinetic and elastic energy [J/m] and the largest rotation rate [rad/step] after the lid stops."""
    options = compaction.parser().parse_args(["--discs", str(discs), "--friction", "0", "--until", str(until)])
    scene, stop = compaction.build(options)
    print(skmpm.preflight(scene, options.dt))
    *_, compressed = skmpm.simulate(scene, dt=options.dt, until=stop)
    lid = scene.walls[compaction.LID]
    walls = [replace(wall, velocity=(0.0, 0.0)) if wall is lid else wall for wall in scene.walls]
    stopped, table = replace(scene, walls=walls), []
    after = skmpm.simulate(stopped, dt=options.dt, until=stop + steps * options.dt, start=compressed)
    for step, state in enumerate(chain([compressed], after)):
        energy, points = state.report.energy, np.bincount(state.body)
        rotation = options.dt * np.bincount(state.body, 0.5 * (state.C[1, 0] - state.C[0, 1])) / points
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
    save(figure, out / "rest.png")
    return table


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--discs", type=int, default=60)
    options.add_argument("--out", type=Path, default=Path("out/rest"), help="directory of the picture")
    chosen = options.parse_args()
    main(chosen.out, chosen.discs)
