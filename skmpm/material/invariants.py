"""Derivatives by F of energies that depend on invariants of F in the plane, or on the ratio of stretches."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from skmpm.arrays import Array, Bools
from skmpm.material.law import determinant, poisson_ratio, youngs_modulus

# Largest z, and z order^2, up to which the series is summed: its terms fall by z / 2, after they have grown with the
# order like (2 z order^2)^k / (2 k)!, which is 1e-13 of the largest one after so many.
NEAR, NEAR_OF_ORDER, TERMS = 0.1, 10.0, 15
# The second derivative of det F by F, entry 2 i + I for F_iI.
TURN = np.array([[0, 0, 0, 1], [0, 0, -1, 0], [0, -1, 0, 0], [1, 0, 0, 0]], dtype=float)


def half_angles(order: float, z: Array) -> tuple[Array, Array, Array]:
    """T(1 + z) - 1, T' and T'' of T(y) = cosh(order arccosh y), the Chebyshev function of any order; z >= 0.

    (1 - y^2) T'' - y T' + order^2 T = 0 gives the series at y = 1 and T'' beyond.
    """
    limit = min(NEAR, NEAR_OF_ORDER / max(order**2, 1.0))
    near = z < limit
    y = np.where(near, 1.0 + limit, 1.0 + z)
    angle = np.arccosh(y)
    t0 = np.cosh(order * angle)
    t1 = order * np.sinh(order * angle) / np.sinh(angle)
    t2 = (order**2 * t0 - y * t1) / (y**2 - 1.0)
    return _with_series(near, z, _coefficients(order, order**2), (t0 - 1.0, t1, t2))


def squared_angle(z: Array) -> tuple[Array, Array, Array]:
    """D(1 + z), D' and D'' of D(y) = (arccosh y)^2, the square of ln(l1 / l2) of the stretches; z >= 0.

    (1 - y^2) D'' - y D' + 2 = 0: what `half_angles` tends to at small order, 2 (T - 1) / order^2.
    """
    near = z < NEAR
    y = np.where(near, 1.0 + NEAR, 1.0 + z)
    angle = np.arccosh(y)
    slope = 2.0 * angle / np.sinh(angle)
    return _with_series(near, z, _coefficients(0.0, 2.0), (angle**2, slope, (2.0 - y * slope) / (y**2 - 1.0)))


def _coefficients(order: float, first: float) -> list[float]:
    """Of z, z^2, ... in the solution of the equation, from that of z."""
    found = [first]
    for k in range(1, TERMS):
        found.append(found[-1] * (order**2 - k**2) / ((k + 1) * (2 * k + 1)))
    return found


def _with_series(
    near: Bools, z: Array, coefficients: list[float], far: tuple[Array, Array, Array]
) -> tuple[Array, Array, Array]:
    """The series and its two derivatives where z is small, elsewhere the values `far`."""
    small = np.where(near, z, 0.0)
    series = [np.zeros_like(small) for _ in range(3)]
    for k, a in reversed(list(enumerate(coefficients, start=1))):
        series[0] = (series[0] + a) * small
        series[1] = series[1] * small + k * a
        series[2] = series[2] * small + k * (k - 1) * a if k > 1 else series[2]
    return tuple(np.where(near, s, value) for s, value in zip(series, far, strict=True))  # type: ignore[return-value]


def cofactor(F: Array) -> Array:
    """The derivative of det F by F, (2, 2, n)."""
    return np.stack([np.stack([F[1, 1], -F[1, 0]]), np.stack([-F[0, 1], F[0, 0]])])


class Hyperelastic(ABC):
    """A law W(A, J) of A = tr F'F - 2 J = (F11 - F22)^2 + (F12 + F21)^2 and J = det F.

    Isotropic energies in plane strain are functions of these two, both small (A, J - 1) where strains are, so that
    energies of tiny strains are not lost in round-off. dA/dF = 2 (F - c), c = cof F.
    """

    @property
    @abstractmethod
    def lame(self) -> tuple[float, float]:
        """Lame constants (lambda, mu) at zero strain [Pa]."""

    @property
    def E(self) -> float:
        """Young's modulus at zero strain [Pa]."""
        return youngs_modulus(self)  # type: ignore[arg-type]

    @property
    def nu(self) -> float:
        """Poisson's ratio at zero strain."""
        return poisson_ratio(self)  # type: ignore[arg-type]

    @abstractmethod
    def _energy(self, A: Array, J: Array) -> Array:
        """W, (n,) [Pa]; J > 0."""

    @abstractmethod
    def _slopes(self, A: Array, J: Array) -> tuple[Array, Array]:
        """W_A, W_J, (n,) [Pa]."""

    @abstractmethod
    def _curvatures(self, A: Array, J: Array) -> tuple[Array, Array, Array]:
        """W_AA, W_AJ, W_JJ, (n,) [Pa]."""

    def energy(self, F: Array) -> Array:
        """Energy density, (n,) [Pa]; inf where J <= 0."""
        A, J = _invariants(F)
        W = self._energy(A, np.where(J > 0.0, J, 1.0))
        return np.asarray(np.where(J > 0.0, W, np.inf))

    def stress(self, F: Array) -> Array:
        """First Piola-Kirchhoff stress, (2, 2, n) [Pa]."""
        by_A, by_J = self._slopes(*_invariants(F))
        c = cofactor(F)
        return np.asarray(2.0 * by_A * (F - c) + by_J * c)

    def tangent(self, F: Array) -> Array:
        """Tangent dP/dF, (2, 2, 2, 2, n) [Pa]."""
        invariants = _invariants(F)
        by_A, by_J = self._slopes(*invariants)
        curved_aa, curved_aj, curved_jj = self._curvatures(*invariants)
        c = cofactor(F).reshape(4, -1)
        a = F.reshape(4, -1) - c
        H = (curved_jj * c + 2.0 * curved_aj * a)[:, None] * c + (4.0 * curved_aa * a + 2.0 * curved_aj * c)[
            :, None
        ] * a
        H += 2.0 * by_A * np.eye(4)[:, :, None] + (by_J - 2.0 * by_A) * TURN[:, :, None]
        return np.asarray(H.reshape(2, 2, 2, 2, -1))


def _invariants(F: Array) -> tuple[Array, Array]:
    return (F[0, 0] - F[1, 1]) ** 2 + (F[0, 1] + F[1, 0]) ** 2, determinant(F)


def first_invariant(A: Array, J: Array) -> tuple[Array, Array, Array, Array, Array]:
    """J^-2/3 (A + 2 J + 1) - 3 =: I and its derivatives I_A, I_J, I_AJ, I_JJ; F33 = 1 is counted. I_AA = 0."""
    log_J, left = np.log1p(J - 1.0), J - 1.0 - A
    I = J ** (-2 / 3) * A + 2.0 * np.expm1(log_J / 3) + np.expm1(-2 / 3 * log_J)  # noqa: E741
    by_J = 2 / 3 * J ** (-5 / 3) * left
    curved_jj = 2 / 3 * (J ** (-5 / 3) - 5 / 3 * J ** (-8 / 3) * left)
    return I, J ** (-2 / 3), by_J, -2 / 3 * J ** (-5 / 3), curved_jj


def second_invariant(A: Array, J: Array) -> tuple[Array, Array, Array, Array, Array]:
    """J^-4/3 (A + 2 J + J^2) - 3 =: I and its derivatives I_A, I_J, I_AJ, I_JJ; F33 = 1 is counted. I_AA = 0."""
    log_J, left = np.log1p(J - 1.0), J**2 - J - 2.0 * A
    I = J ** (-4 / 3) * A + 2.0 * np.expm1(-log_J / 3) + np.expm1(2 / 3 * log_J)  # noqa: E741
    by_J = 2 / 3 * J ** (-7 / 3) * left
    curved_jj = 2 / 3 * ((2.0 * J - 1.0) * J ** (-7 / 3) - 7 / 3 * J ** (-10 / 3) * left)
    return I, J ** (-4 / 3), by_J, -4 / 3 * J ** (-7 / 3), curved_jj


def volumetric(J: Array) -> tuple[Array, Array, Array]:
    """U = (J^2 - 1 - 2 ln J) / 4, U', U'' of unit bulk modulus (Simo & Miehe, CMAME 98, 1992; Holzapfel 6.138)."""
    change = J - 1.0
    U = 0.25 * (change**2 + 2.0 * (change - np.log1p(change)))
    return U, 0.5 * (J - 1.0 / J), 0.5 * (1.0 + J**-2)
