"""Von Mises plasticity at finite strain, plane strain."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from skmpm.arrays import Array
from skmpm.material.invariants import Hyperelastic, squared_angle
from skmpm.material.law import Isotropic, determinant, product, referred_stress, referred_tangent

ITERATIONS = 8  # of Newton's method for ln J, exact to round-off for J from 0.05 to 3
EQUAL = 1e-8  # ln(l1 / l2) below which sinh(r x) / sinh(x) is r to round-off


@dataclass(frozen=True)
class ElastoPlastic(Isotropic):
    """Elastoplastic solid at finite strain: von Mises yield, linear isotropic hardening, plane strain, objective.

    Parameters
    ----------
    E : Young's modulus at zero strain [Pa]
    nu : Poisson's ratio at zero strain
    density : initial density [kg/m3]
    yield_stress : initial uniaxial yield stress [Pa]
    hardening : H, slope of the yield stress over the equivalent plastic strain [Pa]; 0 is perfectly plastic
    viscosity : eta [Pa s]; 2 eta times the rate of deformation is added to the Cauchy stress

    Notes
    -----
    F = F_e F_p; the elastic law is Hencky's in the logarithmic strains e of F_e. The flow is associated and
    integrated by the exponential map, which conserves plastic volume exactly (Simo, CMAME 99, 1992; de Souza Neto,
    Peric & Owen, Computational Methods for Plasticity, 2008, section 14.4). With the equivalent strain
    q = (2/3 dev e : dev e)^(1/2) of the elastic trial strain and the equivalent plastic strain a, a step has the
    potential (Ortiz & Stainier, CMAME 171, 1999)

        W = kappa/2 (ln J)^2 + min over d >= 0 of 3/2 mu (q - d)^2 + H/2 (a + d)^2 + yield_stress d,

    of which yield_stress d is dissipated; the part with H is stored. The von Mises norm of Kirchhoff's stress is at
    most yield_stress + H a. The internal variables are a and the components xx, yy, xy of C_p^-1, C_p = F_p' F_p.

    Examples
    --------
    >>> import numpy as np
    >>> import skmpm
    >>> steel = skmpm.ElastoPlastic(E=2e11, nu=0.3, density=7800, yield_stress=2e8, hardening=1e9)
    >>> F = np.diag([1.1, 1.0])[:, :, None]
    >>> state = steel.update(F, np.array(steel.state0)[:, None])
    >>> round(float(steel.plastic_strain(state)[0]), 3)
    0.062
    """

    yield_stress: float = field(kw_only=True)
    hardening: float = field(default=0.0, kw_only=True)

    @property
    def state0(self) -> tuple[float, float, float, float]:
        """Internal variables of the virgin material: equivalent plastic strain, xx, yy, xy of C_p^-1."""
        return 0.0, 1.0, 1.0, 0.0

    def energy(self, F: Array, state: Array) -> Array:
        """Potential of a step that begins with `state` (4, n), per undeformed volume, (n,) [Pa]; inf where J <= 0."""
        trial, G = self._trial(state)
        return trial.energy(product(F, G))

    def stress(self, F: Array, state: Array) -> Array:
        """First Piola-Kirchhoff stress, the derivative of `energy` by F, (2, 2, n) [Pa]."""
        trial, G = self._trial(state)
        return referred_stress(trial.stress(product(F, G)), G)

    def tangent(self, F: Array, state: Array) -> Array:
        """Consistent tangent, the derivative of `stress` by F, (2, 2, 2, 2, n) [Pa]."""
        trial, G = self._trial(state)
        return referred_tangent(trial.tangent(product(F, G)), G)

    def update(self, F: Array, state: Array) -> Array:
        """Internal variables (4, n) at the end of a step that ends with F (2, 2, n).

        With the right stretch U of F_e trial = F G, G G' = C_p^-1, the flow multiplies its principal logarithmic
        strains by 1 - r in the deviator: C_p^-1 = G exp(-2 r dev ln U) G'. Where J <= 0 they stay.
        """
        trial, G = self._trial(state)
        A, one = product(F, G), np.eye(2)[:, :, None]
        good = determinant(A) > 0.0
        A = np.where(good, A, one)
        d, r = trial.flow(A)
        J, M = determinant(A), product(A.swapaxes(0, 1), A)
        half = 0.5 * (M[0, 0] + M[1, 1])
        apart = np.arccosh(np.maximum(half / J, 1.0))  # ln(l1 / l2); M - half has the eigenvalues +-J sinh(apart)
        equal = apart < EQUAL
        ratio = np.where(equal, r, np.sinh(r * apart) / np.sinh(np.where(equal, 1.0, apart)))
        mean = np.exp(-r * (np.log(J) - 2.0 / 3.0 * (np.log(J) + trial.zz)))
        B = product(product(G, mean * (np.cosh(r * apart) * one - ratio / J * (M - half * one))), G.swapaxes(0, 1))
        updated = np.stack([state[0] + d, B[0, 0], B[1, 1], 0.5 * (B[0, 1] + B[1, 0])])
        return np.asarray(np.where(good & (d > 0.0), updated, state))

    def plastic_strain(self, state: Array) -> Array:
        """Equivalent plastic strain, (n,)."""
        return np.asarray(state[0])

    def stress_zz(self, stress: Array, state: Array) -> Array:
        """Out-of-plane Cauchy stress nu (s_xx + s_yy) + E e_zz / J of the elastic strain e_zz, (n,) [Pa].

        2 (lambda + mu) ln J = J (s_xx + s_yy) + 2 mu e_zz.
        """
        (lam, mu), zz = self.lame, _elastic_zz(state)
        trace, ln_J = stress[0, 0] + stress[1, 1], np.zeros_like(zz)
        for _ in range(ITERATIONS):
            pressed = np.exp(ln_J) * trace
            ln_J -= (2.0 * (lam + mu) * ln_J - pressed - 2.0 * mu * zz) / (2.0 * (lam + mu) - pressed)
        return np.asarray(self.nu * trace + self.E * zz * np.exp(-ln_J))

    def _trial(self, state: Array) -> tuple[_Trial, Array]:
        """The law of the elastic trial state A = F G, and G (2, 2, n), lower triangular."""
        xx, yy, xy = state[1:]
        first = np.sqrt(xx)
        G = np.array([[first, np.zeros_like(first)], [xy / first, np.sqrt(yy - xy**2 / xx)]])
        return _Trial(self, state[0], _elastic_zz(state)), G


def _elastic_zz(state: Array) -> Array:
    """Elastic logarithmic strain across the plane, minus the plastic one, whose trace is zero, (n,)."""
    xx, yy, xy = state[1:]
    return np.asarray(-0.5 * np.log(xx * yy - xy**2))


@dataclass(frozen=True, eq=False)
class _Trial(Hyperelastic):
    """W as a function of the elastic trial deformation A in the plane: of s = ln J_A and D = ln(l1 / l2)^2.

    With the elastic strain e_zz, ln J = s + e_zz and q^2 = (s^2 + D) / 3 + 2/3 e_zz^2 - 2/9 (ln J)^2.
    """

    material: ElastoPlastic
    hardened: Array  # (n,) equivalent plastic strain at the start of the step
    zz: Array  # (n,) elastic strain across the plane

    @property
    def lame(self) -> tuple[float, float]:
        """Lame constants (lambda, mu) at zero strain [Pa]."""
        return self.material.lame

    def flow(self, A: Array) -> tuple[Array, Array]:
        """Increment d of the equivalent plastic strain, and d / q, (n,) each."""
        J = determinant(A)
        apart = (A[0, 0] - A[1, 1]) ** 2 + (A[0, 1] + A[1, 0]) ** 2
        square = self._strain(squared_angle(apart / (2.0 * J))[0], np.log(J))[0]
        d, q = self._increment(square)
        return d, d / q

    def _strain(self, D: Array, s: Array) -> tuple[Array, Array]:
        """Square and Q_s; Q_D = 1/3, Q_ss = 2/9, Q_sD = 0."""
        volume = s + self.zz
        square = (s**2 + D) / 3.0 + 2.0 / 3.0 * self.zz**2 - 2.0 / 9.0 * volume**2
        return square, 2.0 / 3.0 * s - 4.0 / 9.0 * volume

    def _increment(self, square: Array) -> tuple[Array, Array]:
        """The minimiser d >= 0, and q; where nothing flows d = 0 and q is any positive number."""
        law, mu = self.material, self.lame[1]
        limit = law.yield_stress + law.hardening * self.hardened
        plastic = 9.0 * mu**2 * square > limit**2
        q = np.sqrt(np.where(plastic, square, 1.0))
        return np.where(plastic, (3.0 * mu * q - limit) / (3.0 * mu + law.hardening), 0.0), q

    def _shear(self, square: Array) -> tuple[Array, Array, Array]:
        """The deviatoric part of W and its derivatives by q^2."""
        law, mu = self.material, self.lame[1]
        d, q = self._increment(square)
        elastic = 1.5 * mu * np.where(d > 0.0, (q - d) ** 2, square)
        W = elastic + 0.5 * law.hardening * (self.hardened + d) ** 2 + law.yield_stress * d
        curvature = law.hardening / (3.0 * mu + law.hardening) - 1.0 + d / q
        return W, 1.5 * mu * (1.0 - d / q), np.where(d > 0.0, 0.75 * mu * curvature / q**2, 0.0)

    @property
    def _bulk(self) -> float:
        lam, mu = self.lame
        return lam + 2.0 / 3.0 * mu

    def _energy(self, A: Array, J: Array) -> Array:
        s = np.log1p(J - 1.0)
        square, _ = self._strain(squared_angle(A / (2.0 * J))[0], s)
        return np.asarray(0.5 * self._bulk * (s + self.zz) ** 2 + self._shear(square)[0])

    def _slopes(self, A: Array, J: Array) -> tuple[Array, Array]:
        z, s = A / (2.0 * J), np.log1p(J - 1.0)
        D, by_z, _ = squared_angle(z)
        square, by_s = self._strain(D, s)
        slope = self._shear(square)[1]
        W_s = self._bulk * (s + self.zz) + slope * by_s
        return slope / 3.0 * by_z / (2.0 * J), (W_s - slope / 3.0 * by_z * z) / J

    def _curvatures(self, A: Array, J: Array) -> tuple[Array, Array, Array]:
        z, s = A / (2.0 * J), np.log1p(J - 1.0)
        D, by_z, by_zz = squared_angle(z)
        square, by_s = self._strain(D, s)
        _, slope, curved = self._shear(square)
        W_D, W_s = slope / 3.0, self._bulk * (s + self.zz) + slope * by_s
        W_DD, W_Ds = curved / 9.0, curved * by_s / 3.0
        W_ss = self._bulk + curved * by_s**2 + 2.0 / 9.0 * slope
        curved_aa = (W_DD * by_z**2 + W_D * by_zz) / 4.0
        curved_aj = 0.5 * (W_Ds * by_z - W_DD * by_z**2 * z - W_D * (by_z + z * by_zz))
        curved_jj = (
            W_DD * (by_z * z) ** 2 + W_D * (by_zz * z**2 + 2.0 * by_z * z) - 2.0 * W_Ds * by_z * z + W_ss - W_s
        )
        return curved_aa / J**2, curved_aj / J**2, curved_jj / J**2
