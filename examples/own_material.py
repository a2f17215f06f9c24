"""A material of your own
======================

A material of your own, as functions of F: a foam (left) keeps more area than rubber of the same E and nu (right).

Run `python examples/own_material.py`; `check_material` compares the functions with each other.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import skmpm

R, TURN = 1e-2, np.array([[0, 0, 0, 1], [0, 0, -1, 0], [0, -1, 0, 0], [1, 0, 0, 0.0]])[:, :, None]
LID = skmpm.Wall((0, 2 * R), (0, -1), velocity=(0, -0.5))


def invariants(F):
    c = np.array([[F[1, 1], -F[1, 0]], [-F[0, 1], F[0, 0]]])  # dJ/dF
    return np.sum(F**2, axis=(0, 1)), F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0], c


@dataclass(frozen=True)
class Foam:  # noqa: D101  (Blatz and Ko)
    mu: float  # shear modulus [Pa]
    density: float  # [kg/m3]
    lame = property(lambda self: (self.mu, self.mu))

    def energy(self, F):  # noqa: D102
        square, J, _ = invariants(F)
        return np.where(J > 0, 0.5 * self.mu * (square / np.where(J > 0, J, 1.0) ** 2 + 2 * J - 4), np.inf)

    def stress(self, F):  # noqa: D102
        square, J, c = invariants(F)
        return self.mu * (F / J**2 + (1 - square / J**3) * c)

    def tangent(self, F):  # noqa: D102
        square, J, c = invariants(F)
        mixed = (1.5 * square / J**4 * c - 2 / J**3 * F).reshape(4, 1, -1) * c.reshape(4, -1)
        C = np.eye(4)[:, :, None] / J**2 + (1 - square / J**3) * TURN + mixed + mixed.swapaxes(0, 1)
        return self.mu * C.reshape(2, 2, 2, 2, -1)


def main(out: Path) -> tuple[skmpm.Scene, skmpm.State]:
    laws = (Foam(mu=1e5, density=500.0), skmpm.NeoHookean(E=2.5e5, nu=0.25, density=500.0))
    bodies = [skmpm.Body(skmpm.disc((3 * i * R, R), R, spacing=R / 10), law) for i, law in enumerate(laws)]
    scene = skmpm.Scene(bodies, cell=R / 5, walls=[skmpm.Wall((0, 0), (0, 1)), LID])
    print(skmpm.check_material(laws[0]), skmpm.preflight(scene, dt=5e-5), sep="\n")
    *_, state = skmpm.simulate(scene, dt=5e-5, until=1.2 * R)
    kept = np.bincount(state.body, state.volume) / np.bincount(state.body, scene.initial_volumes)
    print("area kept: foam {:.4f}, rubber {:.4f}".format(*kept))
    axes = skmpm.plot(scene, state, state.volume / scene.initial_volumes, label="volume ratio J")
    out.mkdir(parents=True, exist_ok=True)
    axes.figure.savefig(out / "own_material.png", bbox_inches="tight")
    return scene, state


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", type=Path, default=Path("out/own_material"), help="directory of the picture")
    main(options.parse_args().out)
