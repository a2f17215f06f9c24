"""Linear elasticity at small strain: the law of Nezamabadi et al. (2017)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.material.elastic import Isotropic

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LinearElastic(Isotropic):
    """Isotropic linear elasticity at small strain, plane strain: sigma = sigma_anchor + C : sym(F - I).

    The law of Nezamabadi et al. (2017) (Nezamabadi et al., Procedia Eng. 2017, eq. 3). Strain is measured from the
    anchor: anchored once it is the total small strain, which is *not objective* (a body that turns by theta sees a
    false strain theta^2/2; keep rotations and strains below 5 %); anchored at every step it is the incremental of
    Nezamabadi et al. (2017) law.

    Parameters
    ----------
    E : Young's modulus [Pa]
    nu : Poisson's ratio
    density : initial density [kg/m3]
    """

    @property
    def linear(self) -> bool:
        """Stress is linear in F."""
        return True

    def _strain(self, F: Array) -> Array:
        return np.asarray(0.5 * (F + F.swapaxes(0, 1)) - np.eye(2)[:, :, None])

    def _elastic(self, strain: Array, dilatation: Array | None) -> Array:
        lam, mu = self.lame
        trace = strain[0, 0] + strain[1, 1] if dilatation is None else dilatation - 1.0
        return np.asarray(2.0 * mu * strain + lam * trace * np.eye(2)[:, :, None])

    def energy(
        self,
        F: Array,
        F_anchor: Array | None = None,
        stress_anchor: Array | None = None,
        dilatation: Array | None = None,
    ) -> Array:
        """Energy density mu eps : eps + lambda/2 (tr eps)^2 + sigma_anchor : eps, (n,) [J/m3]."""
        lam, mu = self.lame
        strain = self._strain(F)
        trace = strain[0, 0] + strain[1, 1] if dilatation is None else dilatation - 1.0
        stress = mu * strain if stress_anchor is None else mu * strain + stress_anchor
        return np.asarray(np.einsum("ijp,ijp->p", stress, strain) + 0.5 * lam * trace**2)

    def stress(
        self,
        F: Array,
        F_anchor: Array | None = None,
        stress_anchor: Array | None = None,
        dilatation: Array | None = None,
    ) -> Array:
        """Stress, (2, 2, n) [Pa]."""
        stress = self._elastic(self._strain(F), dilatation)
        return stress if stress_anchor is None else stress + stress_anchor

    def tangent(
        self,
        F: Array,
        F_anchor: Array | None = None,
        stress_anchor: Array | None = None,
        dilatation: Array | None = None,
        projected: bool = False,
    ) -> Array:
        """The elastic tensor C at every point, (2, 2, 2, 2, n) [Pa]; positive semi-definite by itself."""
        lam, mu = self.lame
        one = np.eye(2)
        C = mu * (np.einsum("ik,jl->ijkl", one, one) + np.einsum("il,jk->ijkl", one, one))
        if dilatation is None:
            C += lam * np.einsum("ij,kl->ijkl", one, one)
        return np.broadcast_to(C[..., None], (2, 2, 2, 2, F.shape[-1]))

    def cauchy(
        self,
        F: Array,
        F_anchor: Array | None = None,
        stress_anchor: Array | None = None,
        dilatation: Array | None = None,
    ) -> Array:
        """Cauchy stress, (2, 2, n) [Pa]: the same at small strain."""
        return self.stress(F, F_anchor, stress_anchor, dilatation)

    def volumes(self, F: Array, F_anchor: Array | None = None, stress_anchor: Array | None = None) -> Array:
        """Volumes now and at the anchor, where strain begins, to first order, (2, n)."""
        return np.stack([F[0, 0] + F[1, 1] - 1.0, np.ones(F.shape[-1])])

    def volume_slope(self, F: Array, F_anchor: Array | None = None, stress_anchor: Array | None = None) -> Array:
        """Derivative of the trace of the strain by F, (2, 2, n)."""
        return np.broadcast_to(np.eye(2)[:, :, None], F.shape)

    def bulk_tangent(self, F: Array, F_anchor: Array | None, stress_anchor: Array | None, dilatation: Array) -> Array:
        """Lambda, (n,) [Pa]."""
        return np.full_like(dilatation, self.lame[0])
