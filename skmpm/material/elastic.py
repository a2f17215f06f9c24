"""The elastic laws of the library: linear elasticity and neo-Hookean solids."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skmpm.arrays import Array
from skmpm.compiled import compiled_in_order
from skmpm.material.law import Isotropic, determinant, isotropic_tensor


@dataclass(frozen=True)
class LinearElastic(Isotropic):
    """Isotropic linear elasticity at small strain, plane strain: sigma = C : sym(F - I).

    Parameters
    ----------
    E : Young's modulus [Pa]
    nu : Poisson's ratio
    density : initial density [kg/m3]
    viscosity : eta [Pa s]; 2 eta times the rate of strain is added to the stress

    Notes
    -----
    The law of Nezamabadi et al., Procedia Eng. 175 (2017), eq. 3, doi:10.1016/j.proeng.2017.01.044. Strain is
    measured from the anchor. Anchored once it is the total small strain, which is *not objective*: a body that
    rotates by theta has a false strain theta^2/2; keep rotations and strains below 5 %. Anchored at every step the
    law is their incremental one.

    Examples
    --------
    >>> import numpy as np
    >>> import skmpm
    >>> material = skmpm.LinearElastic(E=1e6, nu=0.3, density=1000)
    >>> F = np.diag([1.01, 1.0])[:, :, None]
    >>> material.stress(F)[0, 0].round(1).item()
    13461.5
    """

    @property
    def linear(self) -> bool:
        """Stress is linear in F."""
        return True

    def _strain(self, F: Array) -> Array:
        return np.asarray(0.5 * (F + F.swapaxes(0, 1)) - np.eye(2)[:, :, None])

    def energy(self, F: Array) -> Array:
        """Energy density mu eps : eps + lambda/2 (tr eps)^2, (n,) [Pa]."""
        lam, mu = self.lame
        strain = self._strain(F)
        trace = strain[0, 0] + strain[1, 1]
        return np.asarray(np.einsum("ijp,ijp->p", mu * strain, strain) + 0.5 * lam * trace**2)

    def stress(self, F: Array) -> Array:
        """Stress, (2, 2, n) [Pa]."""
        lam, mu = self.lame
        strain = self._strain(F)
        trace = strain[0, 0] + strain[1, 1]
        return np.asarray(2.0 * mu * strain + lam * trace * np.eye(2)[:, :, None])

    def tangent(self, F: Array) -> Array:
        """The elastic tensor C at every point, (2, 2, 2, 2, n) [Pa]."""
        return np.broadcast_to(isotropic_tensor(*self.lame), (2, 2, 2, 2, F.shape[-1]))


@dataclass(frozen=True)
class NeoHookean(Isotropic):
    """Compressible neo-Hookean solid at finite strain, plane strain, objective.

    Parameters
    ----------
    E : Young's modulus at zero strain [Pa]
    nu : Poisson's ratio at zero strain
    density : initial density [kg/m3]
    viscosity : eta [Pa s]; 2 eta times the rate of deformation is added to the Cauchy stress

    Notes
    -----
    W = mu/2 (tr F'F - 2 - 2 ln J) + lambda/2 (ln J)^2, P = mu (F - F^-T) + lambda ln J F^-T
    (Bonet & Wood, Nonlinear Continuum Mechanics for FEA, 2008, eq. 6.27).

    Examples
    --------
    >>> import numpy as np
    >>> import skmpm
    >>> material = skmpm.NeoHookean(E=1e6, nu=0.3, density=1000)
    >>> F = np.diag([1.1, 1.0])[:, :, None]
    >>> round(float(material.energy(F)[0]), 1)
    6347.2
    >>> material.stress(F)[0, 0].round().item()
    123414.0
    """

    def energy(self, F: Array) -> Array:
        """Energy density, (n,) [Pa]; inf where J <= 0.

        tr F'F - 2 - 2 ln J = (F11 - F22)^2 + (F12 + F21)^2 + 2 (J - 1 - ln J): all of it small where strains are.
        """
        F = _in_order(F)
        W = np.empty(F.shape[-1], dtype=F.dtype)
        if _energy(*self.lame, F.reshape(4, -1), W):
            W[~(determinant(F) > 0.0)] = np.inf
        return W

    def stress(self, F: Array) -> Array:
        """First Piola-Kirchhoff stress, (2, 2, n) [Pa]."""
        F = _in_order(F)
        P = np.empty_like(F)
        _stress(*self.lame, F.reshape(4, -1), P.reshape(4, -1))
        return P

    def tangent(self, F: Array) -> Array:
        """Tangent dP/dF, (2, 2, 2, 2, n) [Pa].

        It is mu I + g'' c c' + g' d2J/dF2 with c = dJ/dF and g' = (lambda ln J - mu) / J.
        """
        F = _in_order(F)
        C = np.empty((4, 4, F.shape[-1]), dtype=F.dtype)
        _tangent(*self.lame, F.reshape(4, -1), C)
        return C.reshape(2, 2, 2, 2, -1)

    def stress_zz(self, F: Array) -> Array:
        """Out-of-plane Cauchy stress lambda ln J / J, (n,) [Pa]."""
        J = determinant(F)
        return np.asarray(self.lame[0] * np.log(J) / J)


def _in_order(F: Array) -> Array:
    """F as loops take it: in C order, integers as floats."""
    return np.ascontiguousarray(F, dtype=np.result_type(F, np.float64))


@compiled_in_order
def _energy(lam: float, mu: float, F: Array, W: Array) -> int:
    """Write W (n,) from F (4, n) and return the number of points with J <= 0, whose W is another one."""
    inverted = 0
    for p in range(W.size):
        J = F[0, p] * F[3, p] - F[1, p] * F[2, p]
        if not J.real > 0.0:
            inverted += 1
            J = 1.0
        change = J - 1.0
        log_J = np.log1p(change)
        shear = (F[0, p] - F[3, p]) ** 2 + (F[1, p] + F[2, p]) ** 2
        W[p] = 0.5 * mu * shear + mu * (change - log_J) + 0.5 * lam * log_J**2
    return inverted


@compiled_in_order
def _stress(lam: float, mu: float, F: Array, P: Array) -> None:
    """Write P (4, n) from F (4, n)."""
    for p in range(F.shape[1]):
        J = F[0, p] * F[3, p] - F[1, p] * F[2, p]
        slope = (lam * np.log(J) - mu) / J
        P[0, p], P[1, p] = mu * F[0, p] + slope * F[3, p], mu * F[1, p] - slope * F[2, p]
        P[2, p], P[3, p] = mu * F[2, p] - slope * F[1, p], mu * F[3, p] + slope * F[0, p]


@compiled_in_order
def _tangent(lam: float, mu: float, F: Array, C: Array) -> None:
    """Write C (4, 4, n) from F (4, n)."""
    for p in range(F.shape[1]):
        J = F[0, p] * F[3, p] - F[1, p] * F[2, p]
        log_J = np.log(J)
        slope, curvature = (lam * log_J - mu) / J, (mu + lam * (1.0 - log_J)) / J**2
        c = (F[3, p], -F[2, p], -F[1, p], F[0, p])
        for i in range(4):
            for k in range(4):
                C[i, k, p] = curvature * c[i] * c[k]
            C[i, i, p] += mu
            C[i, 3 - i, p] += slope if i in (0, 3) else -slope
