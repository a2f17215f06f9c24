"""Contact pressure of an O-ring
=============================

Contact pressure of an O-ring's cross section squeezed between two plates, and the table of its contacts.

    python examples/contact_pressure.py

A disc of rubber is squeezed by 20 % in steps without inertia. `contact_pressure` recovers the pressure along its
boundary from the contact forces, as the grid feels them: forces of single points alternate. A seal holds as long as
the peak exceeds the pressure of the fluid. `network` merges the contacts to pairs of bodies.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skmpm

R, SQUEEZE = 1.765e-3, 0.2  # radius [m], of the diameter
rubber = skmpm.NeoHookean(E=8e6, nu=0.48, density=1200.0)
section = skmpm.Body(skmpm.disc((0.0, R), R, spacing=R / 24), rubber)
walls = [  # the lid comes down in one second
    skmpm.Wall((0.0, 0.0), (0.0, 1.0), friction=0.2),
    skmpm.Wall((0.0, 2 * R), (0.0, -1.0), velocity=(0.0, -2 * R * SQUEEZE), friction=0.2),
]
scene = skmpm.Scene([section], cell=R / 12, walls=walls)
scheme = skmpm.Scheme(inertia=False, mean_dilatation=True)


def main(out: Path) -> tuple[float, float]:
    """Peak pressure on the floor and that of Hertz [Pa]; draws the pressure on the floor and in the rubber."""
    print(skmpm.preflight(scene, dt=0.025, scheme=scheme))
    *_, state = skmpm.simulate(scene, dt=0.025, until=1.0, scheme=scheme)
    for name, column in skmpm.network(scene, state).table().items():  # or pandas.DataFrame(table)
        print(f"{name:>20}", *(f"{value:12.4g}" for value in column))
    force = -state.wall_force[0, 1]
    a = np.sqrt(4.0 * force * R * (1.0 - rubber.nu**2) / (np.pi * rubber.E))  # half-width
    hertz, x = 2.0 * force / (np.pi * a), np.linspace(-a, a, 201)

    left, right = plt.figure(figsize=(9, 3.6), layout="constrained").subplots(1, 2)
    skmpm.plot(scene, state, axes=left)
    for length, style, label in ((0.0, ".", "point forces"), (None, "-", "contact_pressure")):
        found = skmpm.contact_pressure(scene, state, 0, length=length)
        floor = np.flatnonzero(found.x[1] < 0.3 * R)
        floor = floor[np.argsort(found.x[0, floor])]
        right.plot(1e3 * found.x[0, floor], 1e-6 * found.pressure[floor], style, label=label)
    right.plot(1e3 * x, 1e-6 * hertz * np.sqrt(1.0 - (x / a) ** 2), "k--", label="Hertz, same force")
    right.set(xlabel="x [mm]", title="pressure on the floor [MPa]", ylim=(0.0, 3e-6 * hertz))
    right.legend()
    out.mkdir(parents=True, exist_ok=True)
    right.figure.savefig(out / "contact_pressure.png", bbox_inches="tight")
    error = found.error[found.pressure.argmax()]
    print(f"force {force:.0f} N/m; peak pressure {found.pressure.max():.3g} +- {error:.1g} Pa, Hertz {hertz:.3g} Pa")
    return float(found.pressure.max()), hertz


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/contact_pressure"), help="directory of the picture")
    main(options.parse_args().out)
