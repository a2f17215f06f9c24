"""Does a packing come to rest? Frictionless discs are squeezed, the lid stops, and all motion must die out.

OPENBLAS_NUM_THREADS=1 python examples/held.py
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from itertools import chain

import compaction
import numpy as np

import skmpm


def main(discs: int = 60, until: float = 0.92, steps: int = 240) -> list[tuple[float, float, float]]:
    """Print and return kinetic and elastic energy [J/m] and the fastest turning [rad/step] after the lid stops."""
    options = compaction.parser().parse_args(["--discs", str(discs), "--friction", "0", "--until", str(until)])
    scene, stop = compaction.build(options)
    print(skmpm.preflight(scene, options.dt))
    *_, squeezed = skmpm.simulate(scene, dt=options.dt, until=stop)
    lid = scene.walls[compaction.LID]
    walls = [replace(wall, velocity=(0.0, 0.0)) if wall is lid else wall for wall in scene.walls]
    held = replace(scene, walls=walls)
    table = []
    after = skmpm.simulate(held, dt=options.dt, until=stop + steps * options.dt, start=squeezed)
    for step, state in enumerate(chain([squeezed], after)):
        energy, points = state.report.energy, np.bincount(state.body)
        turning = options.dt * np.bincount(state.body, 0.5 * (state.C[1, 0] - state.C[0, 1])) / points
        table.append((energy.kinetic, energy.elastic, float(np.abs(turning).max())))
        if step % 40 == 0:
            print("step {:4d}  kinetic {:.4f}  elastic {:.4f}  turning {:.4f}".format(step, *table[-1]))
    return table


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--discs", type=int, default=60)
    main(parser.parse_args().discs)
