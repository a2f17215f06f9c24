"""What a material is to the library: a density, wave moduli and three functions of the deformation gradient.

A rigid body has a density alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from skmpm.arrays import Array

FUNCTIONS = ("energy", "stress", "tangent")
NEEDED = ("density", "lame", *FUNCTIONS)


class Material(Protocol):
    """What a deformable body needs of its material; any hashable object that has it is one.

    F (2, 2, n) is the total deformation gradient of the points, in plane strain (F33 = 1). Optional attributes:

    - `linear` (False): stress is linear in F, a law of small strain. One factorisation serves a run, and
      strain is measured from the anchor (`material.anchored`)
    - `viscosity` (0.0): of Kelvin and Voigt's model, sigma_v = 2 viscosity d [Pa s]
    - `stress_zz(F)`: out-of-plane Cauchy stress (n,) [Pa], for recordings

    Examples
    --------
    >>> import numpy as np
    >>> import skmpm
    >>> law: skmpm.Material = skmpm.NeoHookean(E=1e6, nu=0.3, density=1000)
    >>> F = np.diag([1.1, 1.0])[:, :, None]
    >>> law.density, law.stress(F).shape, law.tangent(F).shape
    (1000, (2, 2, 1), (2, 2, 2, 2, 1))
    >>> [round(modulus) for modulus in law.lame]
    [576923, 384615]
    """

    @property
    def density(self) -> float:
        """Initial density [kg/m3]."""

    @property
    def lame(self) -> tuple[float, float]:
        """Lame constants (lambda, mu) of the tangent at F = I [Pa]."""

    def energy(self, F: Array) -> Array:
        """Strain energy per undeformed volume, (n,) [Pa]; inf where F is outside the law's domain, as J <= 0."""

    def stress(self, F: Array) -> Array:
        """First Piola-Kirchhoff stress dW/dF, (2, 2, n) [Pa]."""

    def tangent(self, F: Array) -> Array:
        """Derivative dP_iI/dF_jJ, (2, 2, 2, 2, n) [Pa], in this order of indices."""


@dataclass(frozen=True)
class Isotropic:
    """Constants of an isotropic material: Young's modulus [Pa], Poisson's ratio, density, viscosity [Pa s]."""

    E: float
    nu: float
    density: float
    viscosity: float = field(default=0.0, kw_only=True)

    @property
    def lame(self) -> tuple[float, float]:
        """Lame constants (lambda, mu) at zero strain [Pa]."""
        E, nu = self.E, self.nu
        return E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), E / (2.0 * (1.0 + nu))


def is_linear(material: Material) -> bool:
    """Whether the stress of a material is linear in F."""
    return bool(getattr(material, "linear", False))


def viscosity_of(material: Material) -> float:
    """Viscosity of Kelvin and Voigt's model [Pa s]."""
    return float(getattr(material, "viscosity", 0.0))


def poisson_ratio(material: Material) -> float:
    """Poisson's ratio at zero strain, from the Lame constants: lambda / 2 (lambda + mu)."""
    lam, mu = material.lame
    return lam / (2.0 * (lam + mu))


def youngs_modulus(material: Material) -> float:
    """Young's modulus at zero strain, from the Lame constants: mu (3 lambda + 2 mu) / (lambda + mu) [Pa]."""
    lam, mu = material.lame
    return mu * (3.0 * lam + 2.0 * mu) / (lam + mu)


def wave_speed(material: Material) -> float:
    """Speed of pressure waves at zero strain, ((lambda + 2 mu) / density)^(1/2) [m/s]."""
    lam, mu = material.lame
    return float(np.sqrt((lam + 2.0 * mu) / material.density))


def bounded_modulus(material: Material) -> float:
    """The modulus lambda + 2 mu, at most 10 mu: it does not grow as nu -> 1/2 [Pa]."""
    lam, mu = material.lame
    return min(lam + 2.0 * mu, 10.0 * mu)


def isotropic_tensor(lam: float, mu: float) -> Array:
    """The elastic tensor of two Lame constants, lambda d_ij d_kl + mu (d_ik d_jl + d_il d_jk), (2, 2, 2, 2, 1)."""
    one = np.eye(2)
    C = mu * (np.einsum("ik,jl->ijkl", one, one) + np.einsum("il,jk->ijkl", one, one))
    return np.asarray(C + lam * np.einsum("ij,kl->ijkl", one, one))[..., None]


def determinant(F: Array) -> Array:
    """Determinants (n,) of (2, 2, n)."""
    return np.asarray(F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0])


def inverse(F: Array) -> Array:
    """Inverses (2, 2, n) of (2, 2, n)."""
    return np.array([[F[1, 1], -F[0, 1]], [-F[1, 0], F[0, 0]]]) / determinant(F)


def product(A: Array, B: Array) -> Array:
    """Matrix products at the points, (2, 2, n)."""
    return np.asarray(np.einsum("ijp,jkp->ikp", A, B))


def referred_stress(P: Array, G: Array) -> Array:
    """The derivative by F of an energy of F G, (2, 2, n), from its derivative by F G."""
    return np.asarray(np.einsum("ijp,kjp->ikp", P, G))


def referred_tangent(C: Array, G: Array) -> Array:
    """The second derivative by F of an energy of F G, (2, 2, 2, 2, n), from that by F G."""
    return np.asarray(np.einsum("iKjLp,IKp,JLp->iIjJp", C, G, G, optimize=True))


@dataclass(frozen=True)
class Rigid:
    """A rigid body: forces move it, or its motion is prescribed (`Body.motion`).

    Contact between rigid bodies is perfectly inelastic.

    Parameters
    ----------
    density : density [kg/m3], by which the volumes of its points give mass and moment of inertia

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> stone = skmpm.Body(skmpm.disc((0, 3e-3), 1e-3, spacing=2e-4), skmpm.Rigid(density=2500))
    >>> scene = skmpm.Scene([body, stone], cell=4e-4, gravity=(0, -9.81))
    >>> state = skmpm.step(scene, skmpm.initial(scene), 1e-3)
    >>> round(float(state.v[1, state.body == 1].mean()), 5)
    -0.00981
    """

    density: float
