"""Free fall
=========

One body in free fall: a minimal simulation.

    python examples/fall.py

A scene consists of bodies, the cell size of their grids and gravity; `simulate` yields a state after every step. A
scene with one body and no wall never enters the contact code. With backward Euler the body falls by g t (t + dt) / 2,
a mass point by g t^2 / 2.
"""

import argparse
from itertools import islice
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skmpm

G, UNTIL = 9.81, 0.4  # [m/s2], [s]
VELOCITY = (1.0, 2.0)  # [m/s]
jelly = skmpm.LinearElastic(E=1e5, nu=0.3, density=1000.0)
scene = skmpm.Scene(
    [skmpm.Body(skmpm.box((0.0, 0.0), (0.2, 0.1), spacing=0.005), jelly, velocity=VELOCITY)],
    cell=0.01,
    gravity=(0.0, -G),
)


def main(out: Path) -> skmpm.State:
    """The last state; draws every hundredth one and the trajectory of a mass point."""
    print(skmpm.preflight(scene, dt=1e-3))
    states = [skmpm.initial(scene), *skmpm.simulate(scene, dt=1e-3, until=UNTIL)]
    x, y = states[-1].x @ states[-1].mass / states[-1].mass.sum()
    fallen = (0.1 + VELOCITY[0] * UNTIL, 0.05 + VELOCITY[1] * UNTIL - 0.5 * G * UNTIL**2)
    print(f"t = {UNTIL} s: centre at ({x:.4f}, {y:.4f}) m; mass point at ({fallen[0]:.4f}, {fallen[1]:.4f})")

    axes = plt.figure(figsize=(6, 4), layout="constrained").add_subplot()
    for state in islice(states, 0, None, 100):
        skmpm.plot(scene, state, "body", axes=axes)
    t = np.linspace(0.0, UNTIL, 50)
    axes.plot(0.1 + VELOCITY[0] * t, 0.05 + VELOCITY[1] * t - 0.5 * G * t**2, "k--", label="mass point")
    axes.set(xlim=(-0.05, 0.65), ylim=(-0.05, 0.4))
    axes.legend()
    out.mkdir(parents=True, exist_ok=True)
    axes.figure.savefig(out / "fall.png", bbox_inches="tight")
    return states[-1]


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/fall"), help="directory of the picture")
    main(options.parse_args().out)
