"""A neo-Hookean solid at finite strain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.material.invariants import cofactor, hessian
from skmpm.material.law import Isotropic, determinant

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NeoHookean(Isotropic):
    """Compressible neo-Hookean solid at finite strain, plane strain, objective.

    W = mu/2 (tr F'F - 2 - 2 ln J) + lambda/2 (ln J)^2, P = mu (F - F^-T) + lambda ln J F^-T
    (Bonet & Wood, Nonlinear Continuum Mechanics for FEA, 2008, eq. 6.27).

    Parameters
    ----------
    E : Young's modulus at zero strain [Pa]
    nu : Poisson's ratio at zero strain
    density : initial density [kg/m3]
    viscosity : eta [Pa s]; 2 eta times the rate of deformation is added to the Cauchy stress
    """

    def energy(self, F: Array) -> Array:
        """Energy density, (n,) [Pa]; inf where J <= 0.

        tr F'F - 2 - 2 ln J = (F11 - F22)^2 + (F12 + F21)^2 + 2 (J - 1 - ln J): all of it small where strains are.
        """
        lam, mu = self.lame
        J = determinant(F)
        change = np.where(J > 0.0, J, 1.0) - 1.0
        log_J = np.log1p(change)
        shear = (F[0, 0] - F[1, 1]) ** 2 + (F[0, 1] + F[1, 0]) ** 2
        W = 0.5 * mu * shear + mu * (change - log_J) + 0.5 * lam * log_J**2
        return np.asarray(np.where(J > 0.0, W, np.inf))

    def stress(self, F: Array) -> Array:
        """First Piola-Kirchhoff stress, (2, 2, n) [Pa]."""
        return np.asarray(self.lame[1] * F + self._slope(determinant(F)) * cofactor(F))

    def _slope(self, J: Array) -> Array:
        """Derivative by J of lambda/2 (ln J)^2 - mu ln J."""
        lam, mu = self.lame
        return np.asarray(lam * np.log(J) / J - mu / J)

    def tangent(self, F: Array) -> Array:
        """Tangent dP/dF, (2, 2, 2, 2, n) [Pa]."""
        lam, mu = self.lame
        J = determinant(F)
        curvature = mu / J**2 + lam * (1.0 - np.log(J)) / J**2
        return hessian(F, mu, self._slope(J), curvature)

    def stress_zz(self, F: Array) -> Array:
        """Out-of-plane Cauchy stress lambda ln J / J, (n,) [Pa]."""
        J = determinant(F)
        return np.asarray(self.lame[0] * np.log(J) / J)
