"""A laminated bearing
======================

A body of two materials: layers of rubber bonded to metal plates, compressed and then sheared.

    python examples/bearing.py

Points belong to groups, and a body takes a material for each. Here a function of position gives the groups;
`skmpm.from_mesh` takes them from the physical groups of a mesh. The plates keep the rubber from spreading,
which makes it stiffer: an incompressible strip of width w and thickness t between rigid plates has the modulus
4/3 E (1 + S^2), S = w / 2 t (Gent & Lindley, Proc. Inst. Mech. Eng. 173 (1959) 111-122). Interfaces lie on
grid lines, which makes them exact.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skmpm

WIDTH, RUBBER, PLATE, LAYERS = 40e-3, 10e-3, 2e-3, 3  # [m], of the bearing, of a layer, of a plate
E, CELL = 1e6, 1e-3  # of the rubber [Pa], [m]
PERIOD, HEIGHT = RUBBER + PLATE, LAYERS * (RUBBER + PLATE) + PLATE
SQUEEZE, SHEAR, STEPS = 0.1 * LAYERS * RUBBER, 0.3 * LAYERS * RUBBER, 20  # [m] each in that many steps of 1 s
MATERIALS = {"rubber": skmpm.NeoHookean(E, 0.4995, density=1100.0), "plate": skmpm.NeoHookean(100e9, 0.3, 7800.0)}


def bearing() -> skmpm.Body:
    """The bearing, a plate below and above each layer."""
    points = skmpm.box((0.0, 0.0), (WIDTH, HEIGHT), spacing=CELL / 2)
    groups = points.with_groups(lambda x: np.where(x[1] % PERIOD < PLATE, "plate", "rubber"))
    return skmpm.Body(groups, MATERIALS)


def top(t: float) -> tuple[float, float]:
    """Displacement of the upper plate at time t [m]."""
    return SHEAR * max(t / STEPS - 1.0, 0.0), -SQUEEZE * min(t / STEPS, 1.0)


def main(out: Path) -> tuple[float, float]:
    """Compression modulus of the rubber [Pa]: measured, and of Gent and Lindley."""
    clamps = [
        skmpm.Support(lambda x: x[1] < PLATE / 2),
        skmpm.Support(lambda x: x[1] > HEIGHT - PLATE / 2, displacement=top),
    ]
    scene, scheme = skmpm.Scene([bearing()], cell=CELL, supports=clamps), skmpm.Scheme(inertia=False)
    print(skmpm.preflight(scene, 1.0, scheme=scheme))
    states = [skmpm.initial(scene, scheme=scheme)]
    states += skmpm.simulate(scene, dt=1.0, until=2.0 * STEPS, scheme=scheme, start=states[0])
    modulus = float(states[1].support_force[1, 1]) / WIDTH / (SQUEEZE / STEPS / (LAYERS * RUBBER))
    known = 4.0 / 3.0 * E * (1.0 + (WIDTH / (2.0 * RUBBER)) ** 2)
    print(f"modulus {modulus / E:.3g} E, Gent and Lindley {known / E:.3g} E")
    figure, axes = plt.subplots(1, 3, figsize=(10, 3.4), layout="constrained")
    stiff = (scene.bodies[0].points.group == "plate").astype(float)
    skmpm.plot(scene, states[0], stiff, axes=axes[0], label="plate")
    for state, one in zip(states[STEPS::STEPS], axes[1:], strict=True):
        skmpm.plot(scene, state, axes=one)
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "bearing.png", bbox_inches="tight")
    return modulus, known


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/bearing"), help="directory of the picture")
    main(options.parse_args().out)
