"""Force chains, order and fabric
==============================

What a packing looks like: force chains, fabric, g(r), deviatoric stress of the bodies, and a film.

    python examples/force_chains.py

A hundred discs with friction are squeezed; `main` measures and draws what they do.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skmpm

SPEED, START, END = 2.0, 0.78, 0.88  # of the lid [m/s]; nominal solid fractions


def squeeze(discs: int) -> tuple[skmpm.Scene, float]:
    """Discs under a lid, and the time [s] at which they would fill 88 % of the box if they kept their area."""
    radii = np.random.default_rng(0).uniform(0.7e-3, 1.2e-3, discs)
    solid = np.pi * (radii**2).sum()
    width = float(np.sqrt(solid / 0.72))
    gel = skmpm.NeoHookean(E=10e6, nu=0.45, density=990.0)
    packed = skmpm.packing(radii, width, solid_fraction=START, seed=0)
    places = zip(packed.centres.T, packed.radii, strict=True)
    bodies = [skmpm.Body(skmpm.disc(centre, radius, spacing=0.14e-3), gel) for centre, radius in places]
    walls = [
        skmpm.Wall((0, 0), (0, 1), friction=0.0),
        skmpm.Wall((0, packed.height), (0, -1), velocity=(0, -SPEED), friction=0.0),
        skmpm.Wall((0, 0), (1, 0), friction=0.0),
        skmpm.Wall((width, 0), (-1, 0), friction=0.0),
    ]
    scene = skmpm.Scene(bodies, cell=0.19e-3, walls=walls, friction=0.5)
    return scene, (packed.height - solid / (width * END)) / SPEED


def main(out: Path, discs: int = 100) -> np.ndarray:
    """The fabric tensor at the end; writes a picture and a film."""
    scene, until = squeeze(discs)
    print(skmpm.preflight(scene))
    states = list(skmpm.simulate(scene, until=until, progress=True))
    pairs, seen = skmpm.network(scene, states[-1]), skmpm.observe(scene, states[-1])
    low, high = np.linalg.eigvalsh(pairs.fabric)
    print(f"fabric anisotropy {high - low:.3f}, coordination {seen.coordination_without_rattlers:.2f}")
    figure, ((chains, stress), (order, forces)) = plt.subplots(2, 2, figsize=(9, 7), layout="constrained")
    skmpm.plot(scene, states[-1], "body", forces=True, axes=chains)
    skmpm.plot(scene, states[-1], seen.bodies.deviatoric_stress, axes=stress, label="deviatoric stress [Pa]")
    order.plot(*skmpm.pair_correlation(scene, states[-1], bins=40, largest=4.5e-3))
    forces.semilogy(*pairs.force_distribution(bins=20))
    order.set(xlabel="r [m]", ylabel="g(r)"), forces.set(xlabel="normal force / mean", ylabel="probability density")
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "force_chains.png", bbox_inches="tight")
    skmpm.animate(states[:: len(states) // 15], out / "film.gif", scene=scene, forces=True, fps=5)
    return pairs.fabric


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/force_chains"), help="directory of picture and film")
    main(options.parse_args().out)
