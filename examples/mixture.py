"""Hard and soft grains
====================

Half of the grains of a periodic packing are rigid: they move freely, turn, and touch the soft ones and each other.

    python examples/mixture.py

The box is compressed until the packing resists, then kept under a pressure: its edges are unknowns of the contact
problem, and the stress of all contacts, between rigid grains too, is the given one at the end. Whether chains of
force prefer the rigid grains, two dozen do not tell: the mean force between these is that between all to 10 %.
`studies/mixtures` varies pressure, share and friction.
"""

import argparse
from pathlib import Path

import numpy as np

import skmpm

PRESSURE, SPEED, nan = 1e5, 4.0, float("nan")  # [Pa], [1/s]
gel = skmpm.NeoHookean(E=5e6, nu=0.45, density=1000.0)
glass = skmpm.Rigid(density=2500.0)
radii = np.random.default_rng(7).uniform(0.8e-3, 1.2e-3, 24)
width = np.sqrt(np.pi * np.sum(radii**2) / 0.79)
packed = skmpm.packing(radii, width, solid_fraction=0.79, periodic=True, seed=2)
bodies = [
    skmpm.Body(skmpm.disc(x, r, spacing=0.15e-3), glass if i % 2 else gel)
    for i, (x, r) in enumerate(zip(packed.centres.T, radii, strict=True))
]


def scene(**motion: object) -> skmpm.Scene:
    """The packing in its box."""
    box = skmpm.Periodic(packed.width, packed.height, **motion)
    return skmpm.Scene(bodies, cell=0.2e-3, friction=0.3, periodic=box)


def main(out: Path) -> tuple[float, float]:
    """Pressure at the end over the given one, and the mean force between rigid grains over that between all."""
    squeezed = scene(rate=[[-SPEED, 0.0], [0.0, -SPEED]])
    print(skmpm.preflight(squeezed))
    for state in skmpm.simulate(squeezed, until=0.1 / SPEED):
        if skmpm.observe(squeezed, state).pressure > PRESSURE:
            break
    held = scene(stress=[[-PRESSURE, nan], [nan, -PRESSURE]])
    start = skmpm.continued(squeezed, state, held)
    *_, state = skmpm.simulate(held, until=start.t + 0.01, start=start)
    pressure, pairs = skmpm.observe(held, state).pressure / PRESSURE, skmpm.network(held, state)
    hard = pairs.force[0, (pairs.bodies % 2 == 1).all(axis=0)].mean() / pairs.force[0].mean()
    print(f"pressure {pressure:.4f} of the given one; forces between rigid grains {hard:.2f} of the mean")
    out.mkdir(parents=True, exist_ok=True)
    skmpm.plot(held, state, "mises", forces=True).figure.savefig(out / "mixture.png", bbox_inches="tight")
    return pressure, hard


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/mixture"), help="directory of the picture")
    main(options.parse_args().out)
