"""Collision of two discs
======================

Two discs collide head-on: momentum is conserved to round-off, kinetic energy as the time scheme allows.

    python examples/collision.py

There is no coefficient of restitution to choose: elastic discs rebound. Kinetic energy is lost to their vibrations
and to the numerical damping of the time scheme: large for backward Euler (theta = 1, the default), small for the
midpoint rule.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skmpm

R, SPEED, DT, UNTIL = 0.2, 0.1, 0.02, 2.2  # [m], [m/s], [s], [s]
gel = skmpm.NeoHookean(E=1000.0, nu=0.3, density=1000.0)
scene = skmpm.Scene(
    [skmpm.Body(skmpm.disc((x, 0.0), R, spacing=R / 10), gel, velocity=(v, 0.0))
     for x, v in ((0.0, SPEED), (2.1 * R, -SPEED))],
    cell=R / 6,
)  # fmt: skip


def speeds(states: list[skmpm.State]) -> np.ndarray:
    """Velocities of the centres of mass of both discs along x, (steps, 2) [m/s]."""
    return np.array([np.bincount(s.body, s.mass * s.v[0]) / np.bincount(s.body, s.mass) for s in states])


def main(out: Path) -> dict[float, tuple[float, float]]:
    """Coefficient of restitution, and the largest total momentum over that of one disc, by theta."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
    found = {}
    for theta in (1.0, 0.5):
        scheme = skmpm.Scheme(theta=theta)
        print(skmpm.preflight(scene, DT, scheme=scheme))
        states = list(skmpm.simulate(scene, dt=DT, until=UNTIL, scheme=scheme))
        v = speeds(states)
        found[theta] = float((v[-1, 1] - v[-1, 0]) / (2 * SPEED)), float(np.abs(v.sum(axis=1)).max() / SPEED)
        print(
            "theta = {:g}: restitution {:.3f}, total momentum over that of a disc {:.0e}".format(theta, *found[theta])
        )
        label = rf"$\theta$ = {theta:g}: restitution {found[theta][0]:.2f}"
        right.plot([state.t for state in states], v[:, 0] / SPEED, label=label)
    closest = min(states, key=lambda state: np.ptp(state.x[0]))
    skmpm.plot(scene, closest, axes=left).set_title(f"t = {closest.t:.2f} s")
    right.set(xlabel="time [s]", ylabel="speed of the left disc / initial")
    right.legend()
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "collision.png", bbox_inches="tight")
    return found


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/collision"), help="directory of the picture")
    main(options.parse_args().out)
