"""Banded Cholesky against pyamg on one disc, from 10 to 200 cells across, one solve; contact moves the crossover up.

OPENBLAS_NUM_THREADS=1 python -m examples.studies.benchmark crossover
"""

import argparse
from time import perf_counter

import numpy as np

from skmpm import Body, NeoHookean, Scene, Scheme, disc, initial, linear
from skmpm.linear.band import column_lengths, half_bandwidth
from skmpm.step.derived import bulk_of


def seconds(solver: linear.Linear, A, grid) -> float:
    """Set-up and one solve, the better of two."""
    b = np.random.default_rng(0).normal(size=A.shape[0])
    taken = []
    for _ in range(2):
        began = perf_counter()
        solver(A, grid.blocks, grid.rigid_motions)(b)
        taken.append(perf_counter() - began)
    return min(taken)


def main(options: argparse.Namespace) -> list[tuple[int, int, float, float]]:
    """Print and return, per size: cells across, half bandwidth, and the time of banded over that of amg."""
    gel = NeoHookean(E=10e6, nu=0.45, density=990.0)
    table = []
    print("cells across, half bandwidth, banded / amg at c dt / h = 10 and 1000")
    for cells in options.across:
        h = 2.0 / cells
        scene = Scene([Body(disc((0.123 * h, 0.377 * h), 1.0, spacing=0.65 * h), gel)], cell=h)
        state = initial(scene)
        bulk, assembly = bulk_of(scene, state, Scheme()), state.grids.assembly
        stiffness = bulk.stiffness(bulk.at(state.displacement))
        ratios = []
        for steps in (10.0, 1000.0):
            A = assembly.matrix(stiffness, (steps * h / scene.fastest_wave) ** 2)
            ratios.append(seconds(linear.banded, A, assembly.grid) / seconds(linear.amg, A, assembly.grid))
        table.append((cells, half_bandwidth(column_lengths(A, assembly.grid.blocks)), *ratios))
        print("{:5d} {:5d} {:6.2f} {:6.2f}".format(*table[-1]))
    return table


def parser() -> argparse.ArgumentParser:
    """The sizes."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    sizes = [10, 20, 40, 60, 80, 120, 160, 200]
    options.add_argument("--across", type=int, nargs="+", default=sizes, help="cells across the disc")
    return options
