"""Force chains, order and fabric
==============================

What a packing looks like: force chains, fabric, g(r), deviatoric stress of the bodies, and a film.

    python examples/force_chains.py

A hundred discs with friction are squeezed; the fifteen lines of `main` are all that it takes.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from compaction import build, parser
from drawing import save

import skmpm


def main(out: Path) -> np.ndarray:
    """The fabric tensor at the end; writes a picture and a film."""
    scene, until = build(parser().parse_args(["--discs", "100", "--start", "0.78", "--until", "0.88"]))
    print(skmpm.preflight(scene))
    states = list(skmpm.simulate(scene, until=until, progress=True))
    pairs, seen = skmpm.network(scene, states[-1]), skmpm.observe(scene, states[-1])
    low, high = np.linalg.eigvalsh(pairs.fabric)
    print(f"fabric anisotropy {high - low:.3f}, coordination {seen.coordination_without_rattlers:.2f}")
    figure, ((chains, stress), (order, forces)) = plt.subplots(2, 2, figsize=(9, 7), layout="constrained")
    skmpm.plot(scene, states[-1], "body", forces=True, axes=chains)
    skmpm.plot(scene, states[-1], seen.bodies.deviatoric_stress, axes=stress, label="deviatoric stress [Pa]")
    order.plot(*skmpm.pair_correlation(scene, states[-1], bins=40, largest=5e-3))
    forces.semilogy(*pairs.force_distribution(bins=20))
    order.set(xlabel="r [m]", ylabel="g(r)"), forces.set(xlabel="normal force / mean", ylabel="probability density")
    save(figure, out / "force_chains.png")
    skmpm.animate(states[:: len(states) // 15], out / "film.gif", scene=scene, forces=True, fps=5)
    return pairs.fabric


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/force_chains"), help="directory of picture and film")
    main(options.parse_args().out)
