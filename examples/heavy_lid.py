"""A lid of given weight
=====================

A heavy lid is put on a soft block and let go: it swings about the height at which the block carries it.

    python examples/heavy_lid.py

The lid is a wall driven by its weight. Its velocity is an unknown of the contact problem, so at the end of every step
the block presses on it with its weight less its inertia, exactly. At rest the block is shortened by F (1 - nu^2) /
(E width) of its height (plane strain, smooth plates); a mass on a spring swings with sqrt(k / m).
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skmpm

SIDE, G, MASS = 0.02, 9.81, 30.0  # [m], [m/s2], [kg/m]
gel = skmpm.LinearElastic(E=1e6, nu=0.3, density=1000.0)
lid = skmpm.Wall((0.0, SIDE), (0.0, -1.0), force=MASS * G, mass=MASS)
scene = skmpm.Scene(
    [skmpm.Body(skmpm.box((0.0, 0.0), (SIDE, SIDE), spacing=SIDE / 16), gel)],
    cell=SIDE / 8,
    walls=[skmpm.Wall((0.0, 0.0), (0.0, 1.0)), lid],
)


def main(out: Path) -> tuple[float, float]:
    """The final shortening over that of the closed form, and the measured period over that of a spring."""
    print(skmpm.preflight(scene, dt=1e-3))
    states = list(skmpm.simulate(scene, dt=1e-3, until=0.6))
    t = np.array([state.t for state in states])
    height = np.array([state.walls[1, 1] for state in states])
    stiffness = gel.E / (1.0 - gel.nu**2)  # of a square, [N/m per m]
    static, period = MASS * G / stiffness, 2.0 * np.pi * np.sqrt(MASS / stiffness)
    low = t[1:-1][(height[1:-1] < height[:-2]) & (height[1:-1] < height[2:])]
    shortening, measured = (SIDE - height[-1]) / static, (low[2] - low[0]) / 2.0 / period
    print(f"shortening {shortening:.4f} of the closed form, period {measured:.3f} of that of a mass on a spring")

    left, right = plt.figure(figsize=(9, 3.2), layout="constrained").subplots(1, 2, width_ratios=(1, 2))
    skmpm.plot(scene, states[int(np.argmin(height))], "displacement", axes=left)
    right.plot(t, 1e3 * height, label="lid")
    right.axhline(1e3 * (SIDE - static), color="k", ls="--", label="at rest, closed form")
    right.set(xlabel="t [s]", ylabel="height [mm]")
    right.legend()
    out.mkdir(parents=True, exist_ok=True)
    right.figure.savefig(out / "heavy_lid.png", bbox_inches="tight")
    return shortening, measured


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/heavy_lid"), help="directory of the picture")
    main(options.parse_args().out)
