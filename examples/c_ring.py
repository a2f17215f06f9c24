"""Self-contact of a C-ring
========================

A C-ring pressed flat until it touches itself: self-contact.

    python examples/c_ring.py

Parts of one body that face each other obey the same contact law as different bodies, with the friction of the scene.
In `State.contacts` they name the same body twice. Parts less than two cells apart at the start share grid nodes. The
preflight check warns of the wall of four cells, which is some percent too stiff where it is inclined to the grid.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skmpm

R, THICKNESS, MOUTH = 10e-3, 2.5e-3, 0.6  # [m], [m], [rad]
CELL = R / 16


def bent() -> skmpm.Points:
    """The points of a strip bent to a ring that is open to the right."""
    mean = R - 0.5 * THICKNESS
    strip = skmpm.box((R - THICKNESS, 0.0), (THICKNESS, mean * (2 * np.pi - MOUTH)), spacing=CELL / 2)
    r, angle = strip.x[0], 0.5 * MOUTH + strip.x[1] / mean
    return skmpm.Points(r * np.array([np.cos(angle), np.sin(angle)]), strip.volume * r / mean, strip.outline)


scene = skmpm.Scene(
    [skmpm.Body(bent(), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000.0))],
    cell=CELL,
    walls=[
        skmpm.Wall((0.0, -R), (0.0, 1.0), friction=0.5),
        skmpm.Wall((0.0, R), (0.0, -1.0), velocity=(0.0, -R), friction=0.5),
    ],
    friction=0.5,
)


def main(out: Path) -> list[skmpm.State]:
    """All states; draws three of them."""
    scheme = skmpm.Scheme(inertia=False)
    print(skmpm.preflight(scene, dt=0.008, scheme=scheme))
    states = list(skmpm.simulate(scene, dt=0.008, until=1.0, scheme=scheme, progress=True))
    for state in states[::10]:
        itself = state.contacts.bodies[0] == state.contacts.bodies[1]
        force = state.contacts.force[0, itself].sum()
        print(f"lid down by {R * state.t * 1e3:.1f} mm: {state.wall_force[1, 1]:.1f} N/m, mouth {force:.1f} N/m")
    figure, axes = plt.subplots(1, 3, figsize=(9, 3), layout="constrained")
    for ax, state in zip(axes, (states[0], states[len(states) // 2], states[-1]), strict=True):
        skmpm.plot(scene, state, axes=ax, limits=(-3e4, 3e4), legend=ax is axes[-1])
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "c_ring.png", bbox_inches="tight")
    return states


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/c_ring"), help="directory of the picture")
    main(options.parse_args().out)
