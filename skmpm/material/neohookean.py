"""A neo-Hookean solid at finite strain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.material.elastic import Isotropic, determinant, product
from skmpm.material.hessian import cofactor, hessian, projected_hessian

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
    """

    @property
    def linear(self) -> bool:
        """Stress is not linear in F."""
        return False

    def energy(
        self,
        F: Array,
        F_anchor: Array | None = None,
        stress_anchor: Array | None = None,
        dilatation: Array | None = None,
    ) -> Array:
        """Energy density, (n,) [J/m3]; inf where J <= 0.

        tr F'F - 2 - 2 ln J = (F11 - F22)^2 + (F12 + F21)^2 + 2 (J - 1 - ln J): all of it small where strains are.
        """
        lam, mu = self.lame
        F_total, J_anchor = _total(F, F_anchor)
        J = determinant(F_total)
        change = np.where(J > 0.0, J, 1.0) - 1.0
        log_J = np.log1p(change)
        log_mean = log_J if dilatation is None else np.log(np.where(dilatation > 0.0, dilatation, 1.0))
        shear = (F_total[0, 0] - F_total[1, 1]) ** 2 + (F_total[0, 1] + F_total[1, 0]) ** 2
        W = 0.5 * mu * shear + mu * (change - log_J) + 0.5 * lam * log_mean**2
        return np.asarray(np.where(J > 0.0, W / J_anchor, np.inf))

    def stress(
        self,
        F: Array,
        F_anchor: Array | None = None,
        stress_anchor: Array | None = None,
        dilatation: Array | None = None,
    ) -> Array:
        """First Piola-Kirchhoff stress, (2, 2, n) [Pa]."""
        F_total, J_anchor = _total(F, F_anchor)
        P = self.lame[1] * F_total + self._slope(determinant(F_total), dilatation) * cofactor(F_total)
        return P if F_anchor is None else np.einsum("ijp,kjp->ikp", P, F_anchor) / J_anchor

    def _slope(self, J: Array, dilatation: Array | None) -> Array:
        """Derivative by J of lambda/2 (ln J)^2 - mu ln J, the first with the dilatation for J."""
        lam, mu = self.lame
        mean = J if dilatation is None else dilatation
        return np.asarray(lam * np.log(mean) / mean - mu / J)

    def tangent(
        self,
        F: Array,
        F_anchor: Array | None = None,
        stress_anchor: Array | None = None,
        dilatation: Array | None = None,
        projected: bool = False,
    ) -> Array:
        """Tangent dP/dF, if `projected` with its negative eigenvalues set to zero, (2, 2, 2, 2, n) [Pa]."""
        F_total, J_anchor = _total(F, F_anchor)
        J = determinant(F_total)
        curvature = self.lame[1] / J**2
        if dilatation is None:
            curvature = curvature + self.bulk_tangent(F, F_anchor, stress_anchor, J)
        C = (projected_hessian if projected else hessian)(
            F_total, self.lame[1], self._slope(J, dilatation), curvature
        )
        if F_anchor is None:
            return C
        return np.asarray(np.einsum("iKjLp,IKp,JLp->iIjJp", C / J_anchor, F_anchor, F_anchor, optimize=True))

    def cauchy(
        self,
        F: Array,
        F_anchor: Array | None = None,
        stress_anchor: Array | None = None,
        dilatation: Array | None = None,
    ) -> Array:
        """Cauchy stress P F' / J, (2, 2, n) [Pa]."""
        F_total, _ = _total(F, F_anchor)
        J = determinant(F_total)
        left = np.einsum("ijp,kjp->ikp", F_total, F_total)
        return np.asarray(self.lame[1] * left / J + self._slope(J, dilatation) * np.eye(2)[:, :, None])

    def volumes(self, F: Array, F_anchor: Array | None = None, stress_anchor: Array | None = None) -> Array:
        """Volumes now and undeformed, per anchor volume, (2, n)."""
        rest = np.ones(F.shape[-1]) if F_anchor is None else 1.0 / determinant(F_anchor)
        return np.stack([determinant(F), rest])

    def volume_slope(self, F: Array, F_anchor: Array | None = None, stress_anchor: Array | None = None) -> Array:
        """Derivative of det F by F, (2, 2, n)."""
        return cofactor(F)

    def bulk_tangent(self, F: Array, F_anchor: Array | None, stress_anchor: Array | None, dilatation: Array) -> Array:
        """Second derivative of lambda/2 (ln J)^2 by J, (n,) [Pa]; negative beyond J = e."""
        return np.asarray(self.lame[0] * (1.0 - np.log(dilatation)) / dilatation**2)


def _total(F: Array, F_anchor: Array | None) -> tuple[Array, Array | float]:
    if F_anchor is None:
        return F, 1.0
    return product(F, F_anchor), determinant(F_anchor)
