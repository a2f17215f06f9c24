"""Linear elasticity at small strain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.material.law import Isotropic

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LinearElastic(Isotropic):
    """Isotropic linear elasticity at small strain, plane strain: sigma = C : sym(F - I).

    The law of Nezamabadi et al., Procedia Eng. 175 (2017), eq. 3, doi:10.1016/j.proeng.2017.01.044. Strain is
    measured from the anchor. Anchored once it is the total small strain, which is *not objective*: a body that
    rotates by theta has a false strain theta^2/2; keep rotations and strains below 5 %. Anchored at every step the
    law is their incremental one.

    Parameters
    ----------
    E : Young's modulus [Pa]
    nu : Poisson's ratio
    density : initial density [kg/m3]
    viscosity : eta [Pa s]; 2 eta times the rate of strain is added to the stress
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
        lam, mu = self.lame
        one = np.eye(2)
        C = mu * (np.einsum("ik,jl->ijkl", one, one) + np.einsum("il,jk->ijkl", one, one))
        C += lam * np.einsum("ij,kl->ijkl", one, one)
        return np.broadcast_to(C[..., None], (2, 2, 2, 2, F.shape[-1]))
