"""What the bulk solver asks of a material, and what isotropic ones share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Elastic(Protocol):
    """What the bulk solver asks of a deformable material."""

    @property
    def density(self) -> float:
        """Initial density [kg/m3]."""

    @property
    def linear(self) -> bool:
        """Whether stress is linear in F, so that one factorisation and one solve serve a step."""

    @property
    def lame(self) -> tuple[float, float]:
        """Lame constants (lambda, mu) at zero strain [Pa]."""

    @property
    def bounded_modulus(self) -> float:
        """The modulus lambda + 2 mu, at most 10 mu: it does not grow as nu -> 1/2 [Pa]."""

    def energy(
        self, F: Array, F_anchor: Array | None, stress_anchor: Array | None, dilatation: Array | None = None
    ) -> Array:
        """Strain energy per anchor volume, (n,) [J/m3]; inf where the material is turned inside out."""

    def stress(
        self, F: Array, F_anchor: Array | None, stress_anchor: Array | None, dilatation: Array | None = None
    ) -> Array:
        """First Piola-Kirchhoff stress per anchor area, derivative of `energy` by F, (2, 2, n) [Pa]."""

    def tangent(
        self,
        F: Array,
        F_anchor: Array | None,
        stress_anchor: Array | None,
        dilatation: Array | None = None,
        projected: bool = False,
    ) -> Array:
        """Derivative of `stress` by F, or its projection on positive semi-definite ones, (2, 2, 2, 2, n) [Pa].

        With a dilatation: the derivative while that stays, which leaves out the `bulk_tangent`.
        """

    def cauchy(
        self, F: Array, F_anchor: Array | None, stress_anchor: Array | None, dilatation: Array | None = None
    ) -> Array:
        """Cauchy stress, (2, 2, n) [Pa], tension positive."""

    def volumes(self, F: Array, F_anchor: Array | None, stress_anchor: Array | None) -> Array:
        """Volumes now and undeformed, per anchor volume, (2, n): dilatations are ratios of their sums."""

    def volume_slope(self, F: Array, F_anchor: Array | None, stress_anchor: Array | None) -> Array:
        """Derivative of the volume now by F, (2, 2, n)."""

    def bulk_tangent(self, F: Array, F_anchor: Array | None, stress_anchor: Array | None, dilatation: Array) -> Array:
        """Second derivative of the energy per undeformed volume by the dilatation, (n,) [Pa]."""


@dataclass(frozen=True)
class Isotropic:
    """Constants of an isotropic material: Young's modulus [Pa], Poisson's ratio, initial density [kg/m3]."""

    E: float
    nu: float
    density: float

    @property
    def lame(self) -> tuple[float, float]:
        """Lame constants (lambda, mu) at zero strain [Pa]."""
        E, nu = self.E, self.nu
        return E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), E / (2.0 * (1.0 + nu))

    @property
    def bounded_modulus(self) -> float:
        """The modulus lambda + 2 mu, at most 10 mu: it does not grow as nu -> 1/2 [Pa]."""
        lam, mu = self.lame
        return min(lam + 2.0 * mu, 10.0 * mu)


def poisson_ratio(material: Elastic) -> float:
    """Poisson's ratio at zero strain, from the Lame constants: lambda / 2 (lambda + mu)."""
    lam, mu = material.lame
    return lam / (2.0 * (lam + mu))


def determinant(F: Array) -> Array:
    """Determinants (n,) of (2, 2, n)."""
    return np.asarray(F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0])


def product(A: Array, B: Array) -> Array:
    """Matrix products at the points, (2, 2, n)."""
    return np.asarray(np.einsum("ijp,jkp->ikp", A, B))
