"""Does a packing come to rest? Frictionless discs are squeezed, the lid stops, and all motion must die out.

    python examples/rest.py --discs 60

A run goes on in a scene that differs in its walls: `dataclasses.replace` makes it, `simulate(start=...)` continues.
What is left in motion is dissipated by backward Euler; the elastic energy of the squeezed packing stays.
"""

import argparse
from dataclasses import replace
from itertools import chain
from pathlib import Path

import compaction
import matplotlib.pyplot as plt
import numpy as np
from drawing import plot, save

import skmpm


def main(out: Path, discs: int = 60, until: float = 0.92, steps: int = 240) -> list[tuple[float, float, float]]:
    """Kinetic and elastic energy [J/m] and the fastest turning [rad/step] after the lid stops."""
    options = compaction.parser().parse_args(["--discs", str(discs), "--friction", "0", "--until", str(until)])
    scene, stop = compaction.build(options)
    print(skmpm.preflight(scene, options.dt))
    *_, squeezed = skmpm.simulate(scene, dt=options.dt, until=stop)
    lid = scene.walls[compaction.LID]
    walls = [replace(wall, velocity=(0.0, 0.0)) if wall is lid else wall for wall in scene.walls]
    held, table = replace(scene, walls=walls), []
    after = skmpm.simulate(held, dt=options.dt, until=stop + steps * options.dt, start=squeezed)
    for step, state in enumerate(chain([squeezed], after)):
        energy, points = state.report.energy, np.bincount(state.body)
        turning = options.dt * np.bincount(state.body, 0.5 * (state.C[1, 0] - state.C[0, 1])) / points
        table.append((energy.kinetic, energy.elastic, float(np.abs(turning).max())))
        if step % 40 == 0:
            print("step {:4d}  kinetic {:.4f}  elastic {:.4f}  turning {:.4f}".format(step, *table[-1]))

    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 4), layout="constrained")
    plot(scene, state, "pressure", axes=left).axis("off")
    figure.colorbar(left.collections[0], ax=left, label="pressure [Pa]", location="left", shrink=0.7)
    for column, label in enumerate(("kinetic energy [J/m]", "elastic energy [J/m]", "fastest turning [rad/step]")):
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
