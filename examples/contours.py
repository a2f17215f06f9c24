"""Grains from a picture
=====================

Contours of grains in a picture become soft bodies, which a lid presses.

    python examples/contours.py

The picture is drawn here; of a photograph `plt.contour` traces the grains in the same way, after a threshold between
grains and ground. `skmpm.from_outline` takes each contour, whatever its shape, and fills it with material points; its
`smoothing` takes out noise of a photograph, which this picture has not.
Compare: the area of the bodies with the number of pixels of the grains.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skmpm

PIXEL, ROWS, COLUMNS, RADIUS = 0.05e-3, 3, 4, 1e-3  # side of a pixel [m], grains, their mean radius [m]
CELL = RADIUS / 6
WIDTH = 2.6 * RADIUS * COLUMNS  # of the box [m]


def picture(rng: np.random.Generator) -> np.ndarray:
    """Brightness (rows, columns) of grains with dents: above 1 within a grain, below 1 on the ground."""
    x, y = (PIXEL * (np.arange(n) + 0.5) for n in (52 * COLUMNS, 52 * ROWS))
    bright = np.zeros((y.size, x.size))
    for k in range(ROWS * COLUMNS):
        centre = 2.6 * RADIUS * (np.array(divmod(k, ROWS)) + 0.5)
        dx, dy = x - centre[0], (y - centre[1])[:, None]
        angle, (a, b) = np.arctan2(dy, dx), rng.uniform(0.0, 2.0 * np.pi, 2)
        edge = RADIUS * (1.0 + 0.14 * np.cos(2.0 * angle + a) + 0.1 * np.cos(3.0 * angle + b))
        bright = np.maximum(bright, edge / np.hypot(dx, dy))
    return bright


def contours(bright: np.ndarray) -> list[np.ndarray]:
    """The contours (2, n) [m] of the grains."""
    figure, axes = plt.subplots()
    loops = axes.contour(bright, levels=[1.0]).allsegs[0]
    plt.close(figure)
    return [PIXEL * (loop.T + 0.5) for loop in loops]


def main(out: Path) -> tuple[float, float]:
    """Area of all bodies over that of the pixels of grains, and the pressure on the lid at the end [Pa]."""
    bright = picture(np.random.default_rng(0))
    clouds = [skmpm.from_outline(loop, spacing=0.7 * CELL) for loop in contours(bright)]
    area = sum(cloud.volume.sum() for cloud in clouds) / (PIXEL**2 * np.count_nonzero(bright > 1.0))
    gel, height, speed = skmpm.NeoHookean(E=1e6, nu=0.45, density=1000.0), PIXEL * bright.shape[0], 0.5
    sides = [skmpm.Wall(p, n, friction=0.0) for p, n in (((0, 0), (1, 0)), ((WIDTH, 0), (-1, 0)))]
    lid = skmpm.Wall((0, height), (0, -1), velocity=(0, -speed))
    bodies = [skmpm.Body(points, gel) for points in clouds]
    scene = skmpm.Scene(bodies, cell=CELL, walls=[skmpm.Wall((0, 0), (0, 1)), *sides, lid], friction=0.5)
    print(skmpm.preflight(scene))
    states = [skmpm.initial(scene)]
    states += skmpm.simulate(scene, until=0.42 * height / speed, start=states[0])
    pressure = float(states[-1].wall_force[3, 1]) / WIDTH
    print(f"area over that of the pixels {area:.4f}; pressure on the lid at the end {pressure:.3g} Pa")
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.2), layout="constrained")
    axes[0].imshow(bright > 1.0, origin="lower", cmap="gray")
    skmpm.plot(scene, states[0], colour="body", axes=axes[1])
    skmpm.plot(scene, states[-1], forces=True, axes=axes[2])
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "contours.png", bbox_inches="tight")
    return area, pressure


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/contours"), help="directory of the picture")
    main(options.parse_args().out)
