"""A packing of all shapes
=======================

Discs, ellipses, capsules, triangles and pentagons are packed at random and squeezed by a lid.

    python examples/shapes.py

`skmpm.packing` takes radii of discs or a list of `Points` with convex outlines; it draws positions and angles, grows
the shapes without overlap to the wanted solid fraction and returns the points where they lie. Compare: the solid
fraction of the packing with that of the shapes' areas in the box.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skmpm

R, CELL, COUNT, START, END = 1e-3, 0.25e-3, 20, 0.7, 0.85  # [m], of the cells [m], shapes, solid fractions
SPACING = 0.66 * CELL


def shapes(rng: np.random.Generator) -> list[skmpm.Points]:
    """Shapes of five kinds in turn, of about the same area."""
    kinds = (
        lambda r: skmpm.disc((0, 0), r, spacing=SPACING),
        lambda r: skmpm.ellipse((0, 0), (1.4 * r, r / 1.4), spacing=SPACING),
        lambda r: skmpm.capsule((0, 0), 1.5 * r, 0.7 * r, spacing=SPACING),
        lambda r: skmpm.polygon((0, 0), 1.45 * r, 3, rounding=0.25 * r, spacing=SPACING),
        lambda r: skmpm.polygon((0, 0), 1.15 * r, 5, rounding=0.2 * r, spacing=SPACING),
    )
    return [kinds[i % len(kinds)](R * rng.uniform(0.9, 1.1)) for i in range(COUNT)]


def main(out: Path) -> tuple[float, float]:
    """Solid fraction in the box at the start, and the pressure on the lid at the end [Pa]."""
    clouds = shapes(np.random.default_rng(0))
    area = sum(cloud.volume.sum() for cloud in clouds)
    packed = skmpm.packing(clouds, np.sqrt(area / START), solid_fraction=START, seed=1)
    gel = skmpm.NeoHookean(E=1e6, nu=0.45, density=1000.0)
    (w, h), speed = (packed.width, packed.height), 1.0
    sides = [skmpm.Wall(p, n, friction=0.0) for p, n in (((0, 0), (1, 0)), ((w, 0), (-1, 0)))]
    lid = skmpm.Wall((0, h), (0, -1), velocity=(0, -speed))
    bodies = [skmpm.Body(points, gel) for points in packed.points]
    scene = skmpm.Scene(bodies, cell=CELL, walls=[skmpm.Wall((0, 0), (0, 1)), *sides, lid], friction=0.3)
    print(skmpm.preflight(scene))
    states = [skmpm.initial(scene)]
    states += skmpm.simulate(scene, until=h * (1 - START / END) / speed, start=states[0])
    measured, pressure = area / (w * h), float(states[-1].wall_force[3, 1]) / w
    print(f"solid fraction {measured:.3f}, wanted {START}; pressure on the lid at {END}: {pressure:.3g} Pa")
    figure, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
    skmpm.plot(scene, states[0], colour="body", axes=axes[0])
    skmpm.plot(scene, states[-1], forces=True, axes=axes[1])
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "shapes.png", bbox_inches="tight")
    return measured, pressure


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/shapes"), help="directory of the picture")
    main(options.parse_args().out)
