"""Contact forces recovered from our photoelastic picture by the package of experimenters.

    pip install pepe-granular opencv-contrib-python-headless
    python -m examples.studies.photoelastic --out out/photoelastic

PEPE (J. Featherstone, https://jfeatherstone.github.io/pepe) fits contact forces of a disc to its picture between
circular polarisers, by the field of point forces. It sees the picture and the places of the contacts, and begins with
the mean force at each. Its forces and directions are compared with those of `skmpm.network`.
"""

import argparse
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np

import skmpm

RADIUS, YOUNG, PRESSURE, FRINGE = 5e-3, 4e6, 2e4, 1e5  # [m], [Pa]
PIXELS = 100  # across a disc of the mean radius
MARGIN = 20  # pixels around the disc


class Loads(NamedTuple):
    """Forces on a disc at its boundary."""

    force: np.ndarray  # (k,) [N/m]
    place: np.ndarray  # (k,) angle of the contact point about the centre [rad]
    tilt: np.ndarray  # (k,) angle from the inward normal to the force [rad]


def packing(discs: int = 14, resolution: float = 12.0) -> tuple[skmpm.Scene, skmpm.State]:
    """Discs at rest in a periodic box under a pressure."""
    radii = RADIUS * np.random.default_rng(2).uniform(0.8, 1.2, discs)
    width, cell = float(np.sqrt(np.pi * (radii**2).sum() / 0.8)), RADIUS / resolution
    packed = skmpm.packing(radii, width, solid_fraction=0.8, periodic=True, seed=3)
    rubber = skmpm.NeoHookean(YOUNG, nu=0.45, density=1000.0)
    places = zip(packed.centres.T, packed.radii, strict=True)
    bodies = [skmpm.Body(skmpm.disc(x, r, spacing=0.6 * cell), rubber) for x, r in places]
    box = skmpm.Periodic(packed.width, packed.height)
    found = skmpm.jam(skmpm.Scene(bodies, cell=cell, friction=0.3, periodic=box), pressure=PRESSURE)
    return found.scene, found.state


def loads(scene: skmpm.Scene, state: skmpm.State, body: int) -> Loads:
    """The contact forces on a body by `network`."""
    pairs = skmpm.network(scene, state)
    centre = skmpm.observe(scene, state).bodies.centre[:, body]
    own = np.flatnonzero((pairs.bodies == body).any(axis=0))
    first = pairs.bodies[0, own] == body
    force = np.where(first, 1.0, -1.0) * pairs.force_xy[:, own]
    arm = pairs.centre[:, own] - np.where(first, 0.0, pairs.image[:, own]) - centre[:, None]
    inward = -arm / np.hypot(*arm)
    tilt = np.arctan2(inward[0] * force[1] - inward[1] * force[0], (inward * force).sum(axis=0))
    return Loads(np.hypot(*force), np.arctan2(arm[1], arm[0]), tilt)


def picture(scene: skmpm.Scene, state: skmpm.State, body: int) -> tuple[np.ndarray, float]:
    """The light (n, n) between 0 and 1 around a body, and the pixels per metre."""
    centre = skmpm.observe(scene, state).bodies.centre[:, body]
    scale = PIXELS / (2.0 * RADIUS)
    n = int(2.0 * scale * 1.2 * RADIUS) + 2 * MARGIN
    figure = plt.figure(figsize=(n / 100, n / 100), dpi=100)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    skmpm.plot(scene, state, "fringes", fringe=FRINGE, axes=axes, legend=False)
    half = 0.5 * n / scale
    axes.set(xlim=centre[0] + np.array([-half, half]), ylim=centre[1] + np.array([-half, half]), aspect="auto")
    axes.axis("off")
    figure.canvas.draw()
    light = np.asarray(figure.canvas.buffer_rgba())[:, :, 0] / 255.0
    plt.close(figure)
    return light, scale


def recovered(light: np.ndarray, scale: float, radius: float, known: Loads) -> Loads:
    """What PEPE reads off the picture. It measures places from the downward vertical, and tilts the other way."""
    from pepe.analysis import forceOptimize  # only here: it brings many packages with it

    guess = np.full(known.force.size, known.force.mean())
    middle = 0.5 * np.array(light.shape)
    force, place, tilt, _ = forceOptimize(
        guess, known.place + 0.5 * np.pi, np.zeros(guess.size), radius * scale, middle, light, FRINGE, scale, False,
        parametersToFit=["f", "a"], maxEvals=2000, forceTolerance=0.8 * guess[0], alphaTolerance=0.5,
        forceBalanceWeighting=0.0, allowAddForces=False, allowRemoveForces=False,
    )  # fmt: skip
    return Loads(np.asarray(force), np.asarray(place) - 0.5 * np.pi, -np.asarray(tilt))


def main(out: Path) -> None:
    """Print both, contact by contact, and write the picture."""
    scene, state = packing()
    bodies = skmpm.observe(scene, state).bodies
    body = int(np.argmax(np.where(bodies.coordination == 4, bodies.pressure, 0.0)))
    known, (light, scale) = loads(scene, state, body), picture(scene, state, body)
    found = recovered(light, scale, float(np.sqrt(bodies.area[body] / np.pi)), known)
    print("contact at [deg]   force [N/m]   from the picture   tilt [deg]   from the picture")
    place, *tilts = np.degrees([known.place, known.tilt, found.tilt])
    for row in zip(place, known.force, found.force, *tilts, strict=True):
        print("{:16.1f}{:14.1f}{:19.1f}{:13.1f}{:19.1f}".format(*row))
    out.mkdir(parents=True, exist_ok=True)
    plt.imsave(out / "photoelastic.png", light, cmap="gray", vmin=0.0, vmax=1.0)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/photoelastic"), help="directory of the picture")
    main(options.parse_args().out)
