"""One large body
==============

One large body by algebraic multigrid: a disc suspended by part of its boundary deforms under its weight.

    OPENBLAS_NUM_THREADS=1 python examples/large.py --points 100000

One quasi-static step with `skmpm.linear.amg` (pyamg), whose number of iterations hardly grows with size. A million
points take about 4.4 GB; `python -m examples.studies.benchmark large` counts iterations and seconds by phase.
"""

import argparse
from pathlib import Path
from time import perf_counter

import matplotlib.pyplot as plt
import numpy as np

import skmpm

RADIUS, SPACING, GRAVITY = 1.0, 0.74, 9.81  # [m], of material points [cells], [m/s2]
HALF_ANGLE = np.deg2rad(30.0)  # of the supported arc at the top


def hanging(points: int, nu: float = 0.3, seed: int = 0) -> skmpm.Scene:
    """A disc of about this many points, its centre at a random position in a cell to cut cells at random."""
    spacing = RADIUS * np.sqrt(np.pi / points)
    cell = spacing / SPACING
    centre = np.random.default_rng(seed).uniform(0.0, cell, 2)

    def top(x):
        arm = x - centre[:, None]
        return (np.hypot(*arm) > (1.0 - 1e-9) * RADIUS) & (arm[1] > np.cos(HALF_ANGLE) * RADIUS)

    body = skmpm.Body(skmpm.disc(centre, RADIUS, spacing=spacing), skmpm.LinearElastic(E=10e6, nu=nu, density=990.0))
    return skmpm.Scene([body], cell=cell, supports=[skmpm.Support(top)], gravity=(0.0, -GRAVITY))


def main(out: Path, points: int = 100_000) -> tuple[float, float]:
    """Displacement of the lowest point [m], and the relative difference of support force and weight."""
    scene, scheme = hanging(points), skmpm.Scheme(inertia=False, linear=skmpm.linear.amg)
    print(skmpm.preflight(scene, 1.0, scheme=scheme))
    start = skmpm.initial(scene, scheme=scheme)
    began = perf_counter()
    state = skmpm.step(scene, start, 1.0, scheme=scheme)
    weight = GRAVITY * state.mass.sum()
    sag, error = start.x[1].min() - state.x[1].min(), abs(1.0 + state.support_force[0, 1] / weight)
    seconds = perf_counter() - began
    print(f"{seconds:.1f} s; the lowest point sinks by {sag:.4g} m; support force less weight: {error:.0e}")

    axes = plt.figure(figsize=(5, 4), layout="constrained").add_subplot()
    skmpm.plot(scene, state, "displacement", axes=axes)
    out.mkdir(parents=True, exist_ok=True)
    axes.figure.savefig(out / "large.png", bbox_inches="tight")
    return float(sag), float(error)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--points", type=int, default=100_000)
    options.add_argument("--out", type=Path, default=Path("out/large"), help="directory of the picture")
    chosen = options.parse_args()
    main(chosen.out, chosen.points)
