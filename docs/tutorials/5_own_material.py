"""
A material of your own
======================

A material is an object with a density, the Lamé constants of its tangent at rest, and three
functions of the deformation gradient. It needs no base class, and no code of the library changes.
Here: Saint Venant-Kirchhoff's law, and what is wrong with it.
"""

# %%
# Energy, stress, tangent
# -----------------------
# :math:`W = \tfrac\lambda2 (\mathrm{tr}\,E)^2 + \mu\,E:E` with Green's strain :math:`E = \tfrac12
# (F^T F - I)`. Arrays have the points last: F is (2, 2, n). The stress is the derivative of the
# energy by F, the tangent that of the stress.

from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np

import skmpm

I = np.eye(2)[:, :, None]


@dataclass(frozen=True)
class SaintVenantKirchhoff:
    mu: float  # shear modulus [Pa]
    lam: float  # Lamé's first constant [Pa]
    density: float  # [kg/m3]

    @property
    def lame(self):
        return self.lam, self.mu

    def _second(self, F):
        """Green's strain and the second Piola-Kirchhoff stress."""
        E = 0.5 * (np.einsum("kin,kjn->ijn", F, F) - I)
        return E, self.lam * (E[0, 0] + E[1, 1]) * I + 2.0 * self.mu * E

    def energy(self, F):
        E, _ = self._second(F)
        W = 0.5 * self.lam * (E[0, 0] + E[1, 1]) ** 2 + self.mu * np.sum(E**2, axis=(0, 1))
        return np.where(F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0] > 0.0, W, np.inf)

    def stress(self, F):
        return np.einsum("iKn,KJn->iJn", F, self._second(F)[1])

    def tangent(self, F):
        S, d = self._second(F)[1], np.eye(2)
        b = np.einsum("iKn,jKn->ijn", F, F)
        C = np.einsum("ij,IJn->iIjJn", d, S) + self.lam * np.einsum("iIn,jJn->iIjJn", F, F)
        return C + self.mu * (np.einsum("iJn,jIn->iIjJn", F, F) + np.einsum("ijn,IJ->iIjJn", b, d))


# %%
# Is it right?
# ------------
# `check_material` compares the three functions with each other at random deformations, to
# round-off, and looks for objectivity, for zero stress at rest and for the Lamé constants.

law = SaintVenantKirchhoff(mu=4e5, lam=8e5, density=1000.0)
print(skmpm.check_material(law))

# %%
# A mistake is found and named: here the factor 2 is forgotten.


class Wrong(SaintVenantKirchhoff):
    def stress(self, F):
        E, _ = self._second(F)
        return np.einsum("iKn,KJn->iJn", F, self.lam * (E[0, 0] + E[1, 1]) * I + self.mu * E)


try:
    skmpm.check_material(Wrong(mu=4e5, lam=8e5, density=1000.0))
except ValueError as error:
    print(error)

# %%
# Use it
# ------
# A disc of this law beside one of a neo-Hookean solid with the same constants at rest, pressed
# together in steps without inertia.

R = 1e-3
E, nu = law.mu * (3 * law.lam + 2 * law.mu) / (law.lam + law.mu), 0.5 * law.lam / (law.lam + law.mu)
solids = {
    "Saint Venant-Kirchhoff": law,
    "neo-Hookean": skmpm.NeoHookean(E=E, nu=nu, density=1000.0),
}
bodies = [
    skmpm.Body(skmpm.disc((3 * i * R, R), R, spacing=R / 8), solid)
    for i, solid in enumerate(solids.values())
]
lid = skmpm.Wall((0, 2 * R), (0, -1), velocity=(0, -0.6 * R))
scene = skmpm.Scene(bodies, cell=R / 5, walls=[skmpm.Wall((0, 0), (0, 1)), lid])
states = list(skmpm.simulate(scene, dt=0.05, until=1.0, scheme=skmpm.Scheme(inertia=False)))
axes = skmpm.plot(scene, states[-1])

# %%
# Saint Venant-Kirchhoff's law softens in compression, and beyond a strain of about 40 % it loses
# its stiffness altogether: it is a law for large rotations, not for large strains.

axes = plt.figure(figsize=(6, 3), layout="constrained").add_subplot()
for body, name in enumerate(solids):
    force = [
        s.contacts.force[0, (s.contacts.bodies == [[body], [-2]]).all(axis=0)].sum() for s in states
    ]
    axes.plot([0.6 * s.t for s in states], force, label=name)
axes.set(xlabel="compression / R", ylabel="force of the lid [N/m]")
axes.legend()

# %%
# :doc:`/how_to/own_material` lists what a material may have besides: viscosity, the stress out of
# the plane, laws of limited domain.
