"""A material of one's own: a foam after Blatz and Ko keeps more area than rubber of the same E and nu (right)."""

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skmpm

R, TURN = 1e-2, np.array([[0, 0, 0, 1], [0, 0, -1, 0], [0, -1, 0, 0], [1, 0, 0, 0.0]])[:, :, None]


def invariants(F):
    c = np.array([[F[1, 1], -F[1, 0]], [-F[0, 1], F[0, 0]]])  # dJ/dF
    return np.sum(F**2, axis=(0, 1)), F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0], c


@dataclass(frozen=True)
class Foam:
    """Shear modulus [Pa], density [kg/m3]."""

    mu: float
    density: float
    lame = property(lambda self: (self.mu, self.mu))

    def energy(self, F):  # noqa: D102
        square, J, _ = invariants(F)
        return np.where(J > 0, 0.5 * self.mu * (square / np.where(J > 0, J, 1.0) ** 2 + 2 * J - 4), np.inf)

    def stress(self, F):  # noqa: D102
        square, J, c = invariants(F)
        return self.mu * (F / J**2 + (1 - square / J**3) * c)

    def tangent(self, F):  # noqa: D102
        (square, J, c), f = invariants(F), F.reshape(4, -1)
        mixed = (1.5 * square / J**4 * c.reshape(4, -1) - 2 / J**3 * f)[:, None] * c.reshape(4, -1)
        C = np.eye(4)[:, :, None] / J**2 + (1 - square / J**3) * TURN + mixed + mixed.swapaxes(0, 1)
        return self.mu * C.reshape(2, 2, 2, 2, -1)


def main(out: Path = Path()) -> tuple[skmpm.Scene, skmpm.State]:
    laws = (Foam(mu=1e5, density=500.0), skmpm.NeoHookean(E=2.5e5, nu=0.25, density=500.0))
    print(skmpm.check_material(laws[0]))
    bodies = [skmpm.Body(skmpm.disc((3 * i * R, R), R, spacing=R / 10), law) for i, law in enumerate(laws)]
    plates = [skmpm.Wall((0, 0), (0, 1)), skmpm.Wall((0, 2 * R), (0, -1), velocity=(0, -0.5))]
    scene = skmpm.Scene(bodies, cell=R / 5, walls=plates)
    print(skmpm.preflight(scene, dt=5e-5))
    *_, state = skmpm.simulate(scene, dt=5e-5, until=1.2 * R)
    plt.figure(figsize=(8, 3), layout="constrained")
    plt.scatter(*(1e3 * state.x), c=state.volume / scene.initial_volumes, s=9)
    plt.gca().set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    plt.colorbar(label="J")
    plt.savefig(out / "own_material.png", dpi=120)
    return scene, state


if __name__ == "__main__":
    main()
