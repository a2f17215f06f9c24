"""Kelvin and Voigt's viscosity, sigma_v = 2 eta d, as a potential of where a step ends.

Psi = eta / dt J_n tr[(C_n^-1 (E_1 - E_n))^2] per undeformed volume, E Green and Lagrange's strain, C_n = F_n' F_n at
the start of the step. With G = F F_n^-1, the deformation since then, that is eta / dt |1/2 (G'G - I)|^2 per volume
at the start, whatever the reference configuration: objective exactly, and convex in E. Its derivative is the second
Piola-Kirchhoff stress 2 eta J_n C_n^-1 (dE/dt) C_n^-1 of sigma_v. A linear material has eta / dt |eps_1 - eps_n|^2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skmpm.arrays import Array
from skmpm.material.law import determinant, inverse, isotropic_tensor, product


@dataclass(frozen=True)
class Viscous:
    """The viscosity of one material in one step, per anchor volume; F (2, 2, n) is relative to the anchor."""

    resistance: float  # 2 eta / dt [Pa]
    start: Array  # (2, 2, n) F at the start of the step
    linear: bool

    def energy(self, F: Array) -> Array:
        """Psi, half of what is dissipated if the rate stays the same through the step, (n,) [Pa]."""
        change, volume = self._change(F)
        return np.asarray(0.5 * self.resistance * volume * np.einsum("ijp,ijp->p", change, change))

    def stress(self, F: Array) -> Array:
        """Derivative of Psi by F, (2, 2, n) [Pa]."""
        change, volume = self._change(F)
        if self.linear:
            return self.resistance * change
        back = inverse(self.start)
        S = np.einsum("Iap,abp,Jbp->IJp", back, self.resistance * volume * change, back, optimize=True)
        return product(F, S)

    def tangent(self, F: Array) -> Array:
        """Derivative of `stress`, (2, 2, 2, 2, n) [Pa]."""
        n = F.shape[-1]
        if self.linear:
            return np.broadcast_to(isotropic_tensor(0.0, 0.5 * self.resistance), (2, 2, 2, 2, n))
        change, volume = self._change(F)
        back, scale, one = inverse(self.start), self.resistance * volume, np.eye(2)
        G = product(F, back)
        left = np.einsum("iap,jap->ijp", G, G)
        turned = np.einsum("iBp,jAp->iAjBp", G, G)
        C = 0.5 * (np.einsum("ijp,AB->iAjBp", left, one) + turned) + np.einsum("ij,ABp->iAjBp", one, change)
        return np.asarray(np.einsum("iAjBp,IAp,JBp->iIjJp", scale * C, back, back, optimize=True))

    def _change(self, F: Array) -> tuple[Array, Array | float]:
        """Strain since the start of the step (2, 2, n), in its frame, and the volume there per anchor volume."""
        if self.linear:
            H = F - self.start
            return 0.5 * (H + H.swapaxes(0, 1)), 1.0
        G = product(F, inverse(self.start))
        return 0.5 * (product(G.swapaxes(0, 1), G) - np.eye(2)[:, :, None]), determinant(self.start)
