"""Materials seen from an anchor configuration, built on their energy, stress and tangent as functions of F."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skmpm.arrays import Array
from skmpm.material.law import Material, determinant, is_linear, product, referred_stress, referred_tangent


@dataclass(frozen=True)
class Anchored:
    """A material per volume of the anchor configuration; F (2, 2, n) is relative to that.

    The points had the deformation `F_anchor` there: W_a(F) = W(F F_anchor) / J_anchor. A linear material instead
    measures strain from the anchor and adds the stress that the points had there, so that it is the total
    small-strain law when anchored once and an incremental law when anchored at every regridding:
    W_a(F) = W(F) + stress_anchor : (F - I).
    """

    material: Material
    F_anchor: Array | None = None  # (2, 2, n), None where undeformed
    stress_anchor: Array | None = None  # (2, 2, n) Cauchy [Pa], None where unstressed

    @property
    def linear(self) -> bool:
        """Whether the material is linear."""
        return is_linear(self.material)

    @property
    def unstressed(self) -> Anchored:
        """The material seen from an anchor without stress."""
        return replace(self, stress_anchor=None)

    def total(self, F: Array) -> Array:
        """The total deformation gradient, (2, 2, n)."""
        return F if self.F_anchor is None else product(F, self.F_anchor)

    def rest(self, n: int) -> Array:
        """Undeformed volume of n points per anchor volume, (n,)."""
        if self.linear or self.F_anchor is None:
            return np.ones(n)
        return np.asarray(1.0 / determinant(self.F_anchor))

    def energy(self, F: Array) -> Array:
        """Strain energy, (n,) [Pa]; inf where the material is turned inside out."""
        if self.linear:
            W = self.material.energy(F)
            return W if self.stress_anchor is None else W + self.work(F)
        if self.F_anchor is None:
            return self.material.energy(F)
        return np.asarray(self.material.energy(self.total(F)) / determinant(self.F_anchor))

    def work(self, F: Array) -> Array | float:
        """Work of the stress at the anchor on a linear material, (n,) [Pa]."""
        if not self.linear or self.stress_anchor is None:
            return 0.0
        return np.asarray(np.einsum("ijp,ijp->p", self.stress_anchor, F - np.eye(2)[:, :, None]))

    def stress(self, F: Array) -> Array:
        """First Piola-Kirchhoff stress, (2, 2, n) [Pa]."""
        if self.linear:
            P = self.material.stress(F)
            return P if self.stress_anchor is None else P + self.stress_anchor
        if self.F_anchor is None:
            return self.material.stress(F)
        P = self.material.stress(self.total(F))
        return referred_stress(P, self.F_anchor) / determinant(self.F_anchor)

    def tangent(self, F: Array) -> Array:
        """Derivative of `stress` by F, (2, 2, 2, 2, n) [Pa]."""
        if self.linear or self.F_anchor is None:
            return self.material.tangent(F)
        G = self.F_anchor
        return referred_tangent(self.material.tangent(self.total(F)) / determinant(G), G)

    def cauchy(self, F: Array, P: Array) -> Array:
        """Cauchy stress (2, 2, n) [Pa] of a first Piola-Kirchhoff stress; the same where strains are small."""
        if self.linear:
            return P
        return np.asarray(np.einsum("ijp,kjp->ikp", P, F) / determinant(F))
