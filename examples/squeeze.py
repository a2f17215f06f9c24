"""Two discs between walls
=======================

Two soft discs compressed between two walls: contact and friction.

    python examples/squeeze.py

A moving lid flattens two discs at three contacts. Contact satisfies Signorini's and Coulomb's laws exactly: there is
no penalty stiffness to choose. `State.wall_force` holds the forces of the bodies on the walls: at low speed, those on
lid and floor are opposite and agree approximately with Hertz's theory of line contact.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt

import skmpm

R = 1e-3  # [m]
gel = skmpm.NeoHookean(E=10e6, nu=0.45, density=990.0)
scene = skmpm.Scene(
    [skmpm.Body(skmpm.disc((0.0, y), R, spacing=R / 8), gel) for y in (R, 3 * R)],
    cell=R / 5,
    walls=[
        skmpm.Wall((0.0, 0.0), (0.0, 1.0), friction=0.5),
        skmpm.Wall((0.0, 4 * R), (0.0, -1.0), velocity=(0.0, -1.0), friction=0.5),
    ],
    friction=0.5,
)


def main(out: Path) -> skmpm.State:
    """The last state; draws its pressure."""
    print(skmpm.preflight(scene, dt=5e-6))
    *_, state = skmpm.simulate(scene, dt=5e-6, until=0.4e-3, progress=True)
    floor, lid = state.wall_force[:, 1]
    print(f"lid down by {4 * R - state.walls[1, 1]:.2e} m: force {lid:.0f} N/m, on the floor {-floor:.0f} N/m")
    print(f"energy [J/m]: {state.report.energy}")

    axes = plt.figure(figsize=(4, 5), layout="constrained").add_subplot()
    skmpm.plot(scene, state, axes=axes, forces=True)
    out.mkdir(parents=True, exist_ok=True)
    axes.figure.savefig(out / "squeeze.png", bbox_inches="tight")
    return state


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/squeeze"), help="directory of the picture")
    main(options.parse_args().out)
