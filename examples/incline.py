"""Sticking and sliding on a slope
===============================

A block on a slope: it sticks if tan(slope) is below the friction coefficient, else it slides with a known speed.

    python examples/incline.py

Coulomb's law holds exactly at every contact: a block that sticks does not creep, one that slides accelerates by
g (sin(slope) - mu cos(slope)). The wall is inclined to the grid; a body is rotated by rotating its points.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skmpm

G, SLOPE, UNTIL, DT = 9.81, np.radians(20.0), 0.3, 2e-3  # [m/s2], [rad], [s], [s]
DOWN, NORMAL = np.array([np.cos(SLOPE), -np.sin(SLOPE)]), np.array([np.sin(SLOPE), np.cos(SLOPE)])


def build(friction: float) -> skmpm.Scene:
    """A block on a slope, one corner at the origin."""
    flat = skmpm.box((0.0, 0.0), (0.2, 0.1), spacing=0.0065)
    block = skmpm.Points(np.stack([DOWN, NORMAL], axis=1) @ flat.x, flat.volume, flat.outline)
    rubber = skmpm.NeoHookean(E=1e6, nu=0.3, density=1000.0)
    wall = skmpm.Wall((0.0, 0.0), NORMAL, friction=friction)
    return skmpm.Scene([skmpm.Body(block, rubber)], cell=0.01, walls=[wall], gravity=(0.0, -G))


def main(out: Path) -> dict[float, tuple[float, float]]:
    """Speed down the slope at the end [m/s] by friction coefficient: measured, closed form."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.5), layout="constrained")
    found = {}
    print(skmpm.preflight(build(0.2), DT))
    for k, friction in enumerate((0.0, 0.2, 0.3, 0.5)):
        scene = build(friction)
        states = list(skmpm.simulate(scene, dt=DT, until=UNTIL))
        t = np.array([state.t for state in states])
        speed = [DOWN @ state.v @ state.mass / state.mass.sum() for state in states]
        formula = G * max(np.sin(SLOPE) - friction * np.cos(SLOPE), 0.0) * t
        found[friction] = float(speed[-1]), float(formula[-1])
        v, exact = found[friction]
        print(f"friction {friction}: {v:.4f} m/s after {UNTIL} s, closed form {exact:.4f} m/s")
        right.plot(t, speed, color=f"C{k}", label=f"friction {friction:g}")
        right.plot(t, formula, "k:", label="closed form" if k == 0 else None)
        if friction == 0.2:
            skmpm.plot(scene, states[-1], axes=left)
    right.set(xlabel="time [s]", ylabel="speed down the slope [m/s]")
    right.legend()
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "incline.png", bbox_inches="tight")
    return found


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/incline"), help="directory of the picture")
    main(options.parse_args().out)
