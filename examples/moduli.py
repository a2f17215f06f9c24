"""Moduli and photoelastic picture
===============================

How stiff is a packing? Bulk and shear moduli from small static strains, and the fringes of a photoelastic experiment.

    python examples/moduli.py

Discs with friction are compressed in a periodic box. At some pressures `moduli` lets them come to rest, and strains
the box by a hundred-thousandth.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skmpm

YOUNG, SPEED = 10e6, 4.0  # [Pa], [1/s]
PRESSURES = (5e4, 1e5, 2e5, 4e5)  # [Pa]


def compression(discs: int) -> skmpm.Scene:
    """Discs in a periodic box that shrinks."""
    radii = np.random.default_rng(3).uniform(0.8e-3, 1.2e-3, discs)
    width = float(np.sqrt(np.pi * (radii**2).sum() / 0.79))
    packed = skmpm.packing(radii, width, solid_fraction=0.79, periodic=True, seed=3)
    rubber = skmpm.NeoHookean(YOUNG, nu=0.45, density=990.0)
    places = zip(packed.centres.T, packed.radii, strict=True)
    bodies = [skmpm.Body(skmpm.disc(centre, radius, spacing=0.14e-3), rubber) for centre, radius in places]
    box = skmpm.Periodic(packed.width, packed.height, rate=-SPEED * np.eye(2))
    return skmpm.Scene(bodies, cell=0.19e-3, friction=0.5, periodic=box)


def main(out: Path, discs: int = 16) -> list[tuple[float, ...]]:
    """Pressure, bulk and shear modulus at rest [Pa]; writes a picture."""
    scene, rows, left = compression(discs), list[tuple[float, ...]](), list(PRESSURES)
    print(skmpm.preflight(scene))
    for state in skmpm.simulate(scene, until=0.2 / SPEED):
        if skmpm.observe(scene, state).pressure > left[0]:
            found, fringe = skmpm.moduli(scene, state), left.pop(0)
            rows.append((-0.5 * np.trace(found.stress), found.bulk, found.shear, found.shear_pure))
            shown = "P {:.3g} Pa, K {:.3g} Pa, G {:.3g} Pa, at 45 degrees {:.3g} Pa".format(*rows[-1])
            print(f"{shown}; {found.rattlers.sum()} rattlers")
        if not left:
            break
    figure, (picture, curves) = plt.subplots(1, 2, figsize=(10, 4.5), layout="constrained")
    skmpm.plot(scene, state, "fringes", fringe=fringe, axes=picture)
    pressure, *measured = np.array(rows).T / YOUNG
    for values, label in zip(measured, ("K", "G along the box", "G at 45 degrees"), strict=True):
        curves.loglog(pressure, values, "o-", label=label)
    curves.set(xlabel="pressure / E", ylabel="modulus / E"), curves.legend()
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "moduli.png", bbox_inches="tight")
    return rows


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/moduli"), help="directory of the picture")
    main(options.parse_args().out)
