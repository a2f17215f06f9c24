"""Materials: energy, stress and tangent at the points, all per volume of the anchor configuration.

A sheet is anchored: the solver moves points by a deformation gradient `F` relative to the anchor, where the points
already had `F_anchor` and Cauchy stress `stress_anchor` (both None for an undeformed, unstressed anchor). Every
material answers in that frame, so that stresses and tangents meet the gradients of the anchored sheet directly.
"""

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

    def energy(self, F: Array, F_anchor: Array | None, stress_anchor: Array | None) -> Array:
        """Strain energy per anchor volume, (n,) [J/m3]; inf where the material is turned inside out."""

    def stress(self, F: Array, F_anchor: Array | None, stress_anchor: Array | None) -> Array:
        """First Piola-Kirchhoff stress per anchor area, derivative of `energy` by F, (2, 2, n) [Pa]."""

    def tangent(
        self, F: Array, F_anchor: Array | None, stress_anchor: Array | None, projected: bool = False
    ) -> Array:
        """Derivative of `stress` by F, or its projection on positive semi-definite ones, (2, 2, 2, 2, n) [Pa]."""

    def cauchy(self, F: Array, F_anchor: Array | None, stress_anchor: Array | None) -> Array:
        """Cauchy stress, (2, 2, n) [Pa], tension positive."""


def determinant(F: Array) -> Array:
    """Determinants (n,) of (2, 2, n)."""
    return np.asarray(F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0])


def product(A: Array, B: Array) -> Array:
    """Matrix products at the points, (2, 2, n)."""
    return np.asarray(np.einsum("ijp,jkp->ikp", A, B))


def _lame(E: float, nu: float) -> tuple[float, float]:
    return E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), E / (2.0 * (1.0 + nu))


@dataclass(frozen=True)
class LinearElastic:
    """Isotropic linear elasticity at small strain, plane strain: sigma = sigma_anchor + C : sym(F - I).

    The seed's law (Nezamabadi et al., Procedia Eng. 2017, eq. 3). Strain is measured from the anchor: anchored once
    it is the total small strain, which is *not objective* (a body that turns by theta sees a false strain theta^2/2;
    keep rotations and strains below 5 %); anchored at every step it is the seed's incremental law.

    Parameters
    ----------
    E : Young's modulus [Pa]
    nu : Poisson's ratio
    density : initial density [kg/m3]
    """

    E: float
    nu: float
    density: float

    @property
    def linear(self) -> bool:
        """Stress is linear in F."""
        return True

    @property
    def lame(self) -> tuple[float, float]:
        """(lambda, mu) [Pa]."""
        return _lame(self.E, self.nu)

    def _strain(self, F: Array) -> Array:
        return np.asarray(0.5 * (F + F.swapaxes(0, 1)) - np.eye(2)[:, :, None])

    def _elastic(self, strain: Array) -> Array:
        lam, mu = self.lame
        trace = strain[0, 0] + strain[1, 1]
        return np.asarray(2.0 * mu * strain + lam * trace * np.eye(2)[:, :, None])

    def energy(self, F: Array, F_anchor: Array | None = None, stress_anchor: Array | None = None) -> Array:
        """Energy density 1/2 eps : C : eps + sigma_anchor : eps, (n,) [J/m3]."""
        strain = self._strain(F)
        stress = 0.5 * self._elastic(strain)
        if stress_anchor is not None:
            stress = stress + stress_anchor
        return np.asarray(np.einsum("ijp,ijp->p", stress, strain))

    def stress(self, F: Array, F_anchor: Array | None = None, stress_anchor: Array | None = None) -> Array:
        """Stress, (2, 2, n) [Pa]."""
        stress = self._elastic(self._strain(F))
        return stress if stress_anchor is None else stress + stress_anchor

    def tangent(
        self,
        F: Array,
        F_anchor: Array | None = None,
        stress_anchor: Array | None = None,
        projected: bool = False,
    ) -> Array:
        """The elastic tensor C at every point, (2, 2, 2, 2, n) [Pa]; positive semi-definite by itself."""
        lam, mu = self.lame
        one = np.eye(2)
        C = lam * np.einsum("ij,kl->ijkl", one, one)
        C += mu * (np.einsum("ik,jl->ijkl", one, one) + np.einsum("il,jk->ijkl", one, one))
        return np.broadcast_to(C[..., None], (2, 2, 2, 2, F.shape[-1]))

    def cauchy(self, F: Array, F_anchor: Array | None = None, stress_anchor: Array | None = None) -> Array:
        """Cauchy stress, (2, 2, n) [Pa]: the same at small strain."""
        return self.stress(F, F_anchor, stress_anchor)


@dataclass(frozen=True)
class NeoHookean:
    """Compressible neo-Hookean solid at finite strain, plane strain, objective.

    W = mu/2 (tr F'F - 2 - 2 ln J) + lambda/2 (ln J)^2, P = mu (F - F^-T) + lambda ln J F^-T
    (Bonet & Wood, Nonlinear Continuum Mechanics for FEA, 2008, eq. 6.27).

    Parameters
    ----------
    E : Young's modulus at zero strain [Pa]
    nu : Poisson's ratio at zero strain
    density : initial density [kg/m3]
    """

    E: float
    nu: float
    density: float

    @property
    def linear(self) -> bool:
        """Stress is not linear in F."""
        return False

    @property
    def lame(self) -> tuple[float, float]:
        """(lambda, mu) at zero strain [Pa]."""
        return _lame(self.E, self.nu)

    def energy(self, F: Array, F_anchor: Array | None = None, stress_anchor: Array | None = None) -> Array:
        """Energy density, (n,) [J/m3]; inf where J <= 0."""
        lam, mu = self.lame
        F_total, J_anchor = _total(F, F_anchor)
        J = determinant(F_total)
        log_J = np.log(np.where(J > 0.0, J, 1.0))
        W = 0.5 * mu * (np.einsum("ijp,ijp->p", F_total, F_total) - 2.0) - mu * log_J + 0.5 * lam * log_J**2
        return np.asarray(np.where(J > 0.0, W / J_anchor, np.inf))

    def stress(self, F: Array, F_anchor: Array | None = None, stress_anchor: Array | None = None) -> Array:
        """First Piola-Kirchhoff stress, (2, 2, n) [Pa]."""
        lam, mu = self.lame
        F_total, J_anchor = _total(F, F_anchor)
        J = determinant(F_total)
        P = mu * F_total + (lam * np.log(J) - mu) / J * _cofactor(F_total)
        return P if F_anchor is None else np.einsum("ijp,kjp->ikp", P, F_anchor) / J_anchor

    def tangent(
        self,
        F: Array,
        F_anchor: Array | None = None,
        stress_anchor: Array | None = None,
        projected: bool = False,
    ) -> Array:
        """Tangent dP/dF, if `projected` with its negative eigenvalues set to zero, (2, 2, 2, 2, n) [Pa]."""
        lam, mu = self.lame
        F_total, J_anchor = _total(F, F_anchor)
        J = determinant(F_total)
        slope, curvature = (lam * np.log(J) - mu) / J, (lam * (1.0 - np.log(J)) + mu) / J**2
        C = (projected_hessian if projected else hessian)(F_total, mu, slope, curvature)
        if F_anchor is None:
            return C
        return np.asarray(np.einsum("iKjLp,IKp,JLp->iIjJp", C / J_anchor, F_anchor, F_anchor, optimize=True))

    def cauchy(self, F: Array, F_anchor: Array | None = None, stress_anchor: Array | None = None) -> Array:
        """Cauchy stress P F' / J, (2, 2, n) [Pa]."""
        lam, mu = self.lame
        F_total, _ = _total(F, F_anchor)
        J = determinant(F_total)
        left = np.einsum("ijp,kjp->ikp", F_total, F_total)
        return np.asarray((mu * left + (lam * np.log(J) - mu) * np.eye(2)[:, :, None]) / J)


@dataclass(frozen=True)
class Rigid:
    """A body whose motion is prescribed (`Body.velocity`): it has no unknowns, others bump into it.

    Parameters
    ----------
    density : density [kg/m3]; it only weighs the contact normals of the shared-node law
    """

    density: float


Material = LinearElastic | NeoHookean | Rigid


def _total(F: Array, F_anchor: Array | None) -> tuple[Array, Array | float]:
    if F_anchor is None:
        return F, 1.0
    return product(F, F_anchor), determinant(F_anchor)


def _cofactor(F: Array) -> Array:
    return np.stack([np.stack([F[1, 1], -F[1, 0]]), np.stack([-F[0, 1], F[0, 0]])])


def hessian(F: Array, mu: float, slope: Array, curvature: Array) -> Array:
    """Hessian of mu/2 |F|^2 + g(J) by F, (2, 2, 2, 2, n); slope g', curvature g''.

    H = mu I + g'' c c' + g' E with c = dJ/dF and E = d2J/dF2.
    """
    c = _cofactor(F).reshape(4, -1)
    H = curvature * c[:, None] * c[None, :]
    H += mu * np.eye(4)[:, :, None]
    H += slope * np.array([[0, 0, 0, 1], [0, 0, -1, 0], [0, -1, 0, 0], [1, 0, 0, 0]])[:, :, None]
    return H.reshape(2, 2, 2, 2, -1)


def projected_hessian(F: Array, mu: float, slope: Array, curvature: Array) -> Array:
    """Positive semi-definite Hessian of mu/2 |F|^2 + g(J) by F, (2, 2, 2, 2, n); slope g', curvature g''.

    With H, c and E as in `hessian`: the eigenvalues of E are +1 and -1, twice each. In the
    basis of E's eigenvectors c has a part of length p in the first plane and m in the second; H then has the
    eigenvalues mu + g' and mu - g' (across c in either plane) and those of a 2 x 2 block (along c). Each negative
    one is subtracted with its eigenvector (Smith, de Goes & Kim, ACM ToG 2019, for this idea).
    """
    n = F.shape[-1]
    c = _cofactor(F).reshape(4, n)
    plane = np.array([[1, 0, 0, 1], [0, 1, -1, 0], [1, 0, 0, -1], [0, 1, 1, 0]]) / np.sqrt(2.0)
    a = plane @ c  # components of c: two in the +1 plane, two in the -1 plane
    p, m = np.hypot(a[0], a[1]), np.hypot(a[2], a[3])
    plus = plane[:2].T @ (a[:2] / p)
    plus_across = plane[:2].T @ (np.stack([-a[1], a[0]]) / p)
    flat = m < 1e-12 * p
    unit = np.where(flat, np.array([[1.0], [0.0]]), a[2:] / np.where(flat, 1.0, m))
    minus = plane[2:].T @ unit
    minus_across = plane[2:].T @ np.stack([-unit[1], unit[0]])

    top, low, off = mu + slope + curvature * p**2, mu - slope + curvature * m**2, curvature * p * m
    half = 0.5 * (top - low)
    root = np.hypot(half, off)
    # The eigenvector of the smaller eigenvalue, from the better conditioned row.
    along, across = np.where(half >= 0.0, -off, root - half), np.where(half >= 0.0, half + root, -off)
    length = np.hypot(along, across)
    round_ = length < 1e-300
    along, across = np.where(round_, 0.0, along), np.where(round_, 1.0, across)
    length = np.where(round_, 1.0, length)
    small = (along * plus + across * minus) / length
    large = (across * plus - along * minus) / length

    H = hessian(F, mu, slope, curvature).reshape(4, 4, n)
    mean = 0.5 * (top + low)
    for value, vector in (
        (mu + slope, plus_across),
        (mu - slope, minus_across),
        (mean - root, small),
        (mean + root, large),
    ):
        if np.any(value < 0.0):
            H -= np.minimum(value, 0.0) * vector[:, None] * vector[None, :]
    return H.reshape(2, 2, 2, 2, n)
