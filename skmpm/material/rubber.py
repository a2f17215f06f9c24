"""Rubber-like solids: energies of isochoric invariants or stretches, and one of the volume.

In all three W = W_iso(J^-1/3 F) + kappa/4 (J^2 - 1 - 2 ln J), in three dimensions with F33 = 1
(Holzapfel, Nonlinear Solid Mechanics, 2000, sections 6.4 and 6.5).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from skmpm.arrays import Array
from skmpm.material.invariants import Hyperelastic, first_invariant, half_angles, second_invariant, volumetric
from skmpm.material.law import determinant


def _moduli(shear: float, bulk: float) -> tuple[float, float]:
    """Lame constants (lambda, mu) of a shear and a bulk modulus [Pa]."""
    return bulk - 2.0 / 3.0 * shear, shear


@dataclass(frozen=True)
class MooneyRivlin(Hyperelastic):
    """Mooney-Rivlin rubber at finite strain, plane strain, objective; shear modulus 2 (c10 + c01) at zero strain.

    Parameters
    ----------
    c10, c01 : coefficients [Pa]
    bulk : bulk modulus kappa at zero strain [Pa]
    density : initial density [kg/m3]
    viscosity : eta [Pa s]; 2 eta times the rate of deformation is added to the Cauchy stress

    Notes
    -----
    W = c10 (I1 - 3) + c01 (I2 - 3) + kappa/4 (J^2 - 1 - 2 ln J), with the invariants I of J^-1/3 F and F33 = 1
    (Holzapfel, Nonlinear Solid Mechanics, 2000, eqs 6.127 and 6.146).

    Examples
    --------
    >>> import numpy as np
    >>> import skmpm
    >>> rubber = skmpm.MooneyRivlin(c10=1e5, c01=2e4, bulk=2e6, density=1000)
    >>> F = np.diag([1.1, 1.0])[:, :, None]
    >>> rubber.stress(F)[0, 0].round().item()
    219280.0
    """

    c10: float
    c01: float
    bulk: float
    density: float
    viscosity: float = field(default=0.0, kw_only=True)

    @property
    def lame(self) -> tuple[float, float]:
        """Lame constants (lambda, mu) at zero strain [Pa]."""
        return _moduli(2.0 * (self.c10 + self.c01), self.bulk)

    def _energy(self, A: Array, J: Array) -> Array:
        first, second = first_invariant(A, J)[0], second_invariant(A, J)[0]
        return np.asarray(self.c10 * first + self.c01 * second + self.bulk * volumetric(J)[0])

    def _sum(self, k: int, A: Array, J: Array) -> Array:
        return np.asarray(self.c10 * first_invariant(A, J)[k] + self.c01 * second_invariant(A, J)[k])

    def _slopes(self, A: Array, J: Array) -> tuple[Array, Array]:
        return self._sum(1, A, J), self._sum(2, A, J) + self.bulk * volumetric(J)[1]

    def _curvatures(self, A: Array, J: Array) -> tuple[Array, Array, Array]:
        return np.zeros_like(J), self._sum(3, A, J), self._sum(4, A, J) + self.bulk * volumetric(J)[2]

    def stress_zz(self, F: Array) -> Array:
        """Out-of-plane Cauchy stress, (n,) [Pa]."""
        J, I = determinant(F), np.sum(F**2, axis=(0, 1))  # noqa: E741
        iso = 2 / 3 * (self.c10 * J ** (-5 / 3) * (2.0 - I) + self.c01 * J ** (-7 / 3) * (I - 2.0 * J**2))
        return np.asarray(iso + self.bulk * volumetric(J)[1])


@dataclass(frozen=True)
class Yeoh(Hyperelastic):
    """Yeoh rubber at finite strain, plane strain, objective; shear modulus 2 c10 at zero strain.

    Parameters
    ----------
    c10, c20, c30 : coefficients [Pa]
    bulk : bulk modulus kappa at zero strain [Pa]
    density : initial density [kg/m3]
    viscosity : eta [Pa s]; 2 eta times the rate of deformation is added to the Cauchy stress

    Notes
    -----
    W = sum of c_i0 (I1 - 3)^i + kappa/4 (J^2 - 1 - 2 ln J), i = 1, 2, 3, with I1 of J^-1/3 F and F33 = 1 (Yeoh,
    Rubber Chem. Technol. 66, 1993).

    Examples
    --------
    >>> import numpy as np
    >>> import skmpm
    >>> rubber = skmpm.Yeoh(c10=1e5, c20=-1e4, c30=1e3, bulk=2e6, density=1000)
    >>> F = np.diag([1.1, 1.0])[:, :, None]
    >>> rubber.stress(F)[0, 0].round().item()
    214738.0
    """

    c10: float
    c20: float
    c30: float
    bulk: float
    density: float
    viscosity: float = field(default=0.0, kw_only=True)

    @property
    def lame(self) -> tuple[float, float]:
        """Lame constants (lambda, mu) at zero strain [Pa]."""
        return _moduli(2.0 * self.c10, self.bulk)

    def _of(self, I: Array) -> tuple[Array, Array, Array]:  # noqa: E741
        """W_iso and its derivatives by I1 - 3."""
        c1, c2, c3 = self.c10, self.c20, self.c30
        return I * (c1 + I * (c2 + I * c3)), c1 + I * (2.0 * c2 + 3.0 * c3 * I), 2.0 * c2 + 6.0 * c3 * I

    def _energy(self, A: Array, J: Array) -> Array:
        return np.asarray(self._of(first_invariant(A, J)[0])[0] + self.bulk * volumetric(J)[0])

    def _slopes(self, A: Array, J: Array) -> tuple[Array, Array]:
        I, by_A, by_J, *_ = first_invariant(A, J)  # noqa: E741
        slope = self._of(I)[1]
        return slope * by_A, slope * by_J + self.bulk * volumetric(J)[1]

    def _curvatures(self, A: Array, J: Array) -> tuple[Array, Array, Array]:
        I, by_A, by_J, curved_aj, curved_jj = first_invariant(A, J)  # noqa: E741
        _, slope, curvature = self._of(I)
        of_J = slope * curved_jj + curvature * by_J**2 + self.bulk * volumetric(J)[2]
        return curvature * by_A**2, slope * curved_aj + curvature * by_A * by_J, of_J

    def stress_zz(self, F: Array) -> Array:
        """Out-of-plane Cauchy stress, (n,) [Pa]."""
        J, I = determinant(F), np.sum(F**2, axis=(0, 1))  # noqa: E741
        slope = self._of(J ** (-2 / 3) * (I + 1.0) - 3.0)[1]
        return np.asarray(slope * 2 / 3 * J ** (-5 / 3) * (2.0 - I) + self.bulk * volumetric(J)[1])


@dataclass(frozen=True)
class Ogden(Hyperelastic):
    """Ogden rubber at finite strain, plane strain, objective; shear modulus sum of mu_p alpha_p / 2.

    Parameters
    ----------
    mu : mu_p, one per term [Pa]
    alpha : alpha_p, as many
    bulk : bulk modulus kappa at zero strain [Pa]
    density : initial density [kg/m3]
    viscosity : eta [Pa s]; 2 eta times the rate of deformation is added to the Cauchy stress

    Notes
    -----
    W = sum of mu_p / alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3) + kappa/4 (J^2 - 1 - 2 ln J), with the
    stretches l of J^-1/3 F and F33 = 1 (Ogden, Proc. R. Soc. A 328, 1972; Holzapfel, Nonlinear Solid Mechanics, 2000,
    eqs 6.119 and 6.139). In the plane l1^alpha + l2^alpha = 2 J^(alpha/6) T(y), T(y) = cosh(alpha/2 arccosh y), y = 1
    + A / 2 J, smooth at y = 1.

    Examples
    --------
    >>> import numpy as np
    >>> import skmpm
    >>> rubber = skmpm.Ogden(mu=(1e5,), alpha=(2.0,), bulk=2e6, density=1000)
    >>> F = np.diag([1.1, 1.0])[:, :, None]
    >>> rubber.stress(F)[0, 0].round().item()
    202853.0
    """

    mu: tuple[float, ...]
    alpha: tuple[float, ...]
    bulk: float
    density: float
    viscosity: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        mu, alpha = (np.atleast_1d(np.asarray(values, dtype=float)) for values in (self.mu, self.alpha))
        if mu.shape != alpha.shape or mu.ndim != 1 or (alpha == 0.0).any():
            raise ValueError(f"Ogden: mu = {self.mu!r}, alpha = {self.alpha!r}; give as many of both, no alpha zero")
        object.__setattr__(self, "mu", tuple(mu.tolist()))
        object.__setattr__(self, "alpha", tuple(alpha.tolist()))

    @property
    def _terms(self) -> list[tuple[float, float]]:
        return list(zip(self.mu, self.alpha, strict=True))

    @property
    def lame(self) -> tuple[float, float]:
        """Lame constants (lambda, mu) at zero strain [Pa]."""
        return _moduli(0.5 * sum(m * a for m, a in self._terms), self.bulk)

    def _energy(self, A: Array, J: Array) -> Array:
        W, log_J = self.bulk * volumetric(J)[0], np.log1p(J - 1.0)
        for m, a in self._terms:
            beyond = half_angles(a / 2, A / (2.0 * J))[0]
            iso = 2.0 * J ** (a / 6) * beyond + 2.0 * np.expm1(a / 6 * log_J) + np.expm1(-a / 3 * log_J)
            W = W + m / a * iso
        return np.asarray(W)

    def _slopes(self, A: Array, J: Array) -> tuple[Array, Array]:
        z, by_A, by_J = A / (2.0 * J), np.zeros_like(J), self.bulk * volumetric(J)[1]
        for m, a in self._terms:
            t0, t1, _ = half_angles(a / 2, z)
            by_A = by_A + m / a * J ** (a / 6 - 1) * t1
            own = J ** (a / 6 - 1) * (a / 3 * (1.0 + t0) - 2.0 * z * t1) - a / 3 * J ** (-a / 3 - 1)
            by_J = by_J + m / a * own
        return np.asarray(by_A), np.asarray(by_J)

    def _curvatures(self, A: Array, J: Array) -> tuple[Array, Array, Array]:
        z, curved_jj = A / (2.0 * J), self.bulk * volumetric(J)[2]
        curved_aa = curved_aj = np.zeros_like(J)
        for m, a in self._terms:
            t0, t1, t2 = half_angles(a / 2, z)
            b, scale = a / 6, m / a * J ** (a / 6 - 2)
            curved_aa = curved_aa + scale * t2 / 2
            curved_aj = curved_aj + scale * ((b - 1) * t1 - z * t2)
            own = 2 * b * (b - 1) * (1.0 + t0) + 4 * (1 - b) * z * t1 + 2 * z**2 * t2
            curved_jj = curved_jj + scale * own + m / a * 2 * b * (2 * b + 1) * J ** (-2 * b - 2)
        return np.asarray(curved_aa), np.asarray(curved_aj), np.asarray(curved_jj)

    def stress_zz(self, F: Array) -> Array:
        """Out-of-plane Cauchy stress, (n,) [Pa]."""
        J, I = determinant(F), np.sum(F**2, axis=(0, 1))  # noqa: E741
        S = self.bulk * volumetric(J)[1]
        for m, a in self._terms:
            t0 = half_angles(a / 2, I / (2.0 * J) - 1.0)[0]
            S = S + 2 / 3 * m / J * (J ** (-a / 3) - J ** (a / 6) * (1.0 + t0))
        return np.asarray(S)
