"""Jamming
=======

Where does a packing without friction begin to resist, how many contacts has it there, and how do pressure, contacts
and bulk modulus grow beyond?

    python examples/jamming.py

Discs of two sizes in a periodic box are compressed and released in static steps to their jamming point. From there
pressures grow, and at each `moduli` strains the box by a hundred-thousandth. Shear moduli of so few discs in a box
that only compression has formed may be negative (Dagois-Bohy, Tighe, Simon, Henkes & van Hecke, PRL 109 (2012)
095703); bulk moduli are not.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skmpm

YOUNG, RADIUS = 1e6, 1e-3  # [Pa], [m]
PRESSURES = (1e2, 2e2, 5e2, 1e3, 2e3, 5e3)  # [Pa]


def loose(discs: int, seed: int) -> skmpm.Scene:
    """Discs, half of them 1.4 times as large, that do not touch yet."""
    radii = np.where(np.arange(discs) % 2 == 0, 1.0, 1.4) * RADIUS
    width = float(np.sqrt(np.pi * (radii**2).sum() / 0.8))
    packed = skmpm.packing(radii, width, solid_fraction=0.8, periodic=True, seed=seed)
    gel = skmpm.NeoHookean(YOUNG, nu=0.3, density=1000.0)
    places = zip(packed.centres.T, packed.radii, strict=True)
    bodies = [skmpm.Body(skmpm.disc(centre, radius, spacing=0.15 * RADIUS), gel) for centre, radius in places]
    box = skmpm.Periodic(packed.width, packed.height)
    return skmpm.Scene(bodies, cell=0.2 * RADIUS, periodic=box)


def main(out: Path, discs: int = 30, seed: int = 0) -> list[tuple[float, ...]]:
    """Solid fraction above jamming, coordination, pressure and K [Pa] at each pressure; writes a picture."""
    scene = loose(discs, seed)
    jammed = skmpm.jam(scene)
    backbone = discs - int(jammed.rattlers.sum())
    contacts = round(jammed.coordination * backbone / 2.0)
    print(f"{jammed}: {contacts} contacts, isostatic are {2 * backbone - 1}")
    found, rows = jammed, []
    for pressure in PRESSURES:
        found = skmpm.jam(found.scene, found.state, pressure=pressure)
        stiff = skmpm.moduli(found.scene, found.state).bulk
        above = found.solid_fraction_nominal - jammed.solid_fraction_nominal
        rows.append((above, found.coordination, found.pressure, stiff))
        print(f"P {pressure:g} Pa: {above:.5f} above jamming, Z {found.coordination:.3f}, K {stiff:.3g} Pa")
    figure, (picture, curves) = plt.subplots(1, 2, figsize=(10, 4.5), layout="constrained")
    skmpm.plot(jammed.scene, jammed.state, "pressure", forces=True, axes=picture)
    above, coordination, pressure, bulk = np.array(rows).T
    curves.loglog(above, bulk / YOUNG, "o-", label="K / E")
    curves.loglog(above, pressure / YOUNG, "o-", label="P / E")
    curves.loglog(above, pressure[0] / YOUNG * above / above[0], ":", color="grey", label="slope 1")
    more = coordination > jammed.coordination
    curves.loglog(above[more], (coordination - jammed.coordination)[more], "s--", label="Z above that at jamming")
    curves.set(xlabel="solid fraction above jamming"), curves.legend()
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "jamming.png", bbox_inches="tight")
    return rows


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/jamming"), help="directory of the picture")
    main(options.parse_args().out)
