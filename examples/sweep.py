"""An ensemble of runs
===================

Four coefficients of friction, three pyramids of discs each: twelve runs that share the cores and can be interrupted.

    python examples/sweep.py

A sweep runs `build` for every member, each in a directory of its own with table, manifest and checkpoint. Run the
script again: members that have finished are not run again, an interrupted one goes on from its checkpoint. On a
cluster the same call takes a Dask client, `skmpm.sweep(..., client=client)`.

A lid presses on two discs with a third on top of them. The pyramid stands if friction exceeds tan 15° = 0.27 (equal
discs: the contact forces of a lower disc act along the line through its two contacts); below, it is pushed apart.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skmpm

R, SPEED, CELL, DT = 1e-3, 0.5, 0.2e-3, 40e-6  # [m], of the lid [m/s], [m], [s]
FRICTIONS, SEEDS = (0.1, 0.2, 0.3, 0.6), range(3)


def build(friction: float, seed: int) -> skmpm.Run:
    """A pyramid of three discs under a lid; the radii of the lower ones and of the upper one differ by up to 10 %."""
    low, top = R * np.random.default_rng(seed).uniform(0.95, 1.05, 2)
    height = low + np.sqrt((low + top) ** 2 - low**2)
    gel = skmpm.NeoHookean(E=1e6, nu=0.45, density=1000.0)
    places = ((-low, low), low), ((low, low), low), ((0.0, height), top)
    bodies = [skmpm.Body(skmpm.disc(centre, r, spacing=0.7 * CELL), gel) for centre, r in places]
    lid = skmpm.Wall((0.0, height + top), (0.0, -1.0), velocity=(0.0, -SPEED))
    scene = skmpm.Scene(bodies, cell=CELL, walls=[skmpm.Wall((0.0, 0.0), (0.0, 1.0)), lid], friction=friction)
    return skmpm.Run(scene, until=0.6 * R / SPEED, dt=DT, observe=force)


def force(scene: skmpm.Scene, state: skmpm.State) -> dict[str, float]:
    """A row of the table: stroke of the lid over R, and the force on it [N/m]."""
    return {"stroke": SPEED * state.t / R, "force": state.wall_force[1, 1]}


def main(out: Path) -> skmpm.Sweep:
    """Run the ensemble, and draw the force of every member and two of the pyramids."""
    members = [{"friction": friction, "seed": seed} for friction in FRICTIONS for seed in SEEDS]
    print(skmpm.preflight(build(**members[0]).scene, dt=DT))
    found = skmpm.sweep(build, members, out=out / "members", progress=True)
    print(found)

    figure = plt.figure(figsize=(9, 3.2), layout="constrained")
    curves, *pictures = figure.subplots(1, 3, width_ratios=(1.3, 1, 1))
    for colour, friction in enumerate(FRICTIONS):
        for member in found.where(friction=friction):
            label = f"friction {friction}" if member.parameters["seed"] == 0 else None
            curves.plot(member.columns["stroke"], member.columns["force"], color=f"C{colour}", label=label)
    curves.set(xlabel="stroke of the lid / R", ylabel="force [N/m]")
    curves.legend()
    for axes, name in zip(pictures, ("friction=0.2,seed=0", "friction=0.3,seed=0"), strict=True):
        scene, state = build(**found[name].parameters).scene, found[name].state()
        skmpm.plot(scene, state, "body", forces=True, axes=axes, legend=False)
        axes.set_title(name)
    figure.savefig(out / "sweep.png", bbox_inches="tight")
    return found


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/sweep"), help="directory of members and picture")
    main(options.parse_args().out)
