"""Mean dilatation: the energy of any material at F-bar, F with the mean dilatation of the cell in place of its own.

F-bar = (theta / J)^(1/2) F in the plane, J = det F per undeformed volume, theta the mean of J over the cell by
undeformed volumes (de Souza Neto et al., Int. J. Solids Struct. 33, 1996, for F-bar; Simo, Taylor & Pister, CMAME 51,
1985, and Moran, Ortiz & Shih, IJNME 29, 1990, for mean dilatation inside the energy). As theta is a function of
the displacement, the force is the derivative of an energy and the stiffness is symmetric. What its shear modulus mu
makes a neo-Hookean solid resist dilatation with stays that of the point,

    W(F, theta) = W(F-bar) + mu (g(J) - g(theta)), g(J) = J - 1 - ln J,

so that lambda alone multiplies theta at small strain (Nagtegaal, Parks & Rice, CMAME 4, 1974); without it, peaks of
pressure are averaged away. In a material with memory nothing of the point resists: where it flows, its shear
stiffness is a small part of mu, and points that mu holds to the dilatation of their cell lock. A linear material
takes F + 1/2 (theta - tr(F - I)) I for F-bar, theta the mean of tr(F - I), and g = 1/2 tr(F - I)^2: it stays
linear. docs/theory/method.md derives what is computed here.
"""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array
from skmpm.compiled import compiled, compiled_in_order
from skmpm.material.anchored import Anchored
from skmpm.material.invariants import cofactor
from skmpm.material.law import determinant
from skmpm.material.memory import InStep
from skmpm.material.response import curvature

ONE = np.array([1.0, 0.0, 0.0, 1.0])[:, None]
DEVIATOR = np.eye(4) - 0.5 * ONE * ONE.T


def volumes(law: Anchored, F: Array) -> Array:
    """Volumes now and undeformed, per anchor volume, (2, n): dilatations are ratios of their sums.

    Of a linear material the change of volume takes the place of the volume.
    """
    now = F[0, 0] + F[1, 1] - 2.0 if law.linear else determinant(F)
    return np.stack([now, law.rest(F.shape[-1])])


def volume_slope(law: Anchored, F: Array) -> Array:
    """Derivative of the volume now by F, (2, 2, n)."""
    return np.broadcast_to(np.eye(2)[:, :, None], F.shape) if law.linear else cofactor(F)


def with_tension(law: Anchored, F: Array, P: Array, tension: Array) -> Array:
    """P (2, 2, n) with the stress of a mean tension (n,), the derivative of the cell's energy by its volume [Pa]."""
    total = np.empty_like(P)
    _with_tension(law.linear, F.reshape(4, -1), P.reshape(4, -1), tension, total.reshape(4, -1))
    return total


@compiled_in_order
def _with_tension(linear: bool, F: Array, P: Array, tension: Array, total: Array) -> None:
    """Write P + tension dV/dF, all (4, n)."""
    for p in range(tension.size):
        a, b, c, d = (1.0, 0.0, 0.0, 1.0) if linear else (F[3, p], -F[2, p], -F[1, p], F[0, p])
        total[0, p], total[1, p] = P[0, p] + tension[p] * a, P[1, p] + tension[p] * b
        total[2, p], total[3, p] = P[2, p] + tension[p] * c, P[3, p] + tension[p] * d


def energy(law: Anchored, F: Array, theta: Array) -> Array:
    """W(F, theta), (n,) [Pa]; inf where a point or the cell is turned inside out."""
    mu = _resistance(law)
    if law.linear:
        own = 0.5 * mu * ((F[0, 0] + F[1, 1] - 2.0) ** 2 - theta**2)
        return np.asarray(law.unstressed.energy(_bar(law, F, theta)[0]) + law.work(F) + own)
    good, rest = (determinant(F) > 0.0) & (theta > 0.0), law.rest(theta.size)
    if not good.all():
        F, theta = np.where(good, F, np.eye(2)[:, :, None]), np.where(good, theta, 1.0)
    own = np.empty(theta.size, dtype=np.result_type(F, theta))
    _resisted(mu, F.reshape(4, -1), theta, rest, own)
    own += law.energy(_bar(law, F, theta)[0])
    return own if good.all() else np.asarray(np.where(good, own, np.inf))


@compiled_in_order
def _resisted(mu: float, F: Array, theta: Array, rest: Array, out: Array) -> None:
    """Write mu (g(J) - g(theta)) of undeformed volumes `rest`, g(J) = J - 1 - ln J."""
    for p in range(theta.size):
        change, mean = (F[0, p] * F[3, p] - F[1, p] * F[2, p]) / rest[p] - 1.0, theta[p] - 1.0
        out[p] = mu * rest[p] * (change - np.log1p(change) - (mean - np.log1p(mean)))


def slopes(law: Anchored, F: Array, theta: Array) -> tuple[Array, Array]:
    """W_F (2, 2, n) and W_theta (n,) [Pa]."""
    mu, (F_bar, s) = _resistance(law), _bar(law, F, theta)
    P = law.unstressed.stress(F_bar)
    if law.linear:
        half = 0.5 * (P[0, 0] + P[1, 1])
        P = P + (mu * (F[0, 0] + F[1, 1] - 2.0) - half) * np.eye(2)[:, :, None]
        return P if law.stress_anchor is None else P + law.stress_anchor, half - mu * theta
    rest, flat, kind = law.rest(theta.size), (4, theta.size), P.dtype
    by_F, by_theta = np.empty_like(F, dtype=kind), np.empty_like(theta, dtype=kind)
    _slopes(mu, F.reshape(flat), theta, rest, s, P.reshape(flat), by_F.reshape(flat), by_theta)
    return by_F, by_theta


@compiled_in_order
def _slopes(mu: float, F: Array, theta: Array, rest: Array, s: Array, P: Array, by_F: Array, by_theta: Array) -> None:
    """First derivatives of W(F, theta) from P (4, n) at F-bar = s F, F (4, n)."""
    for p in range(theta.size):
        J, q = F[0, p] * F[3, p] - F[1, p] * F[2, p], 0.0
        for i in range(4):
            q += s[p] * P[i, p] * F[i, p]
        own = (mu * (J - rest[p]) - 0.5 * q) / J
        by_F[0, p], by_F[1, p] = s[p] * P[0, p] + own * F[3, p], s[p] * P[1, p] - own * F[2, p]
        by_F[2, p], by_F[3, p] = s[p] * P[2, p] - own * F[1, p], s[p] * P[3, p] + own * F[0, p]
        by_theta[p] = (0.5 * q - mu * rest[p] * (theta[p] - 1.0)) / theta[p]


def curvatures(law: Anchored, F: Array, theta: Array, tension: Array) -> tuple[Array, Array, Array]:
    """W_FF (4, 4, n), W_Ftheta (4, n) and W_thetatheta (n,) [Pa], W_FF that of W + `tension` J, (n,) [Pa].

    Of a linear material, in which tension times the change of volume has no curvature, that of W alone.
    """
    mu, (F_bar, s) = _resistance(law), _bar(law, F, theta)
    C = law.tangent(F_bar).reshape(4, 4, -1)
    if law.linear:
        of_one = np.einsum("abp,bc->ap", C, ONE)
        mixed = 0.5 * (of_one - 0.5 * ONE * of_one[[0, 3]].sum(axis=0))
        by_F = np.einsum("ab,bcp,cd->adp", DEVIATOR, C, DEVIATOR, optimize=True)
        return by_F + mu * (ONE * ONE.T)[:, :, None], mixed, 0.25 * of_one[[0, 3]].sum(axis=0) - mu
    P, f, rest = law.stress(F_bar).reshape(4, -1), F_bar.reshape(4, -1), law.rest(theta.size)
    by_F, mixed, by_theta = np.empty_like(C), np.empty_like(P), np.empty_like(theta)
    _chain_rule(mu, determinant(F), theta, rest, s, f, P, C, tension, by_F, mixed, by_theta)
    return by_F, mixed, by_theta


@compiled
def _chain_rule(
    mu: float,
    J: Array,
    theta: Array,
    rest: Array,
    s: Array,
    f: Array,
    P: Array,
    C: Array,
    tension: Array,
    by_F: Array,
    mixed: Array,
    by_theta: Array,
) -> None:
    """Second derivatives of W(F, theta) + `tension` J from P (4, n) and C (4, 4, n) at F-bar, f (4, n)."""
    for p in range(J.size):
        J_bar = f[0, p] * f[3, p] - f[1, p] * f[2, p]
        a = (f[3, p] / J_bar, -f[2, p] / J_bar, -f[1, p] / J_bar, f[0, p] / J_bar)
        q, size = 0.0, 0.0
        for i in range(4):
            stretched = 0.0
            for k in range(4):
                stretched += C[i, k, p] * f[k, p]
            q += P[i, p] * f[i, p]
            size += f[i, p] * stretched
            mixed[i, p] = P[i, p] + stretched
        square, factor = s[p] ** 2, 0.125 * size + 0.375 * q + 0.5 * mu * rest[p]
        for i in range(4):
            for k in range(i, 4):
                outer = 2.0 * factor * a[i] * a[k] - 0.5 * (mixed[i, p] * a[k] + a[i] * mixed[k, p])
                by_F[i, k, p] = by_F[k, i, p] = square * (C[i, k, p] + outer)
        turn = tension[p] + mu * (1.0 - rest[p] / J[p]) - 0.5 * q / J[p]
        by_F[0, 3, p] += turn
        by_F[3, 0, p] += turn
        by_F[1, 2, p] -= turn
        by_F[2, 1, p] -= turn
        for i in range(4):
            mixed[i, p] = 0.5 * s[p] / theta[p] * (mixed[i, p] - 0.5 * (size + q) * a[i])
        by_theta[p] = (0.25 * (size - q) - mu * rest[p]) / theta[p] ** 2


def tangents(law: Anchored, F: Array, theta: Array, tension: Array) -> tuple[Array, Array, Array]:
    """What the stiffness of a cell is made of: `curvatures` with the mean tension of the cell (n,) [Pa].

    `tension` is the derivative of the cell's energy by its volume, which is curved in F itself.
    """
    return curvature(law, F, theta, tension) or curvatures(law, F, theta, tension)


def seen(law: Anchored, F: Array, theta: Array) -> Array:
    """The total deformation gradient in which a material is evaluated, (2, 2, n)."""
    return law.total(_bar(law, F, theta)[0])


def _resistance(law: Anchored) -> float:
    """The modulus with which points resist a dilatation of their own [Pa]."""
    return 0.0 if isinstance(law.material, InStep) else law.material.lame[1]


def _bar(law: Anchored, F: Array, theta: Array) -> tuple[Array, Array]:
    """F-bar (2, 2, n), and (theta / J)^(1/2), J per undeformed volume, one where the material is linear, (n,)."""
    if law.linear:
        return F + 0.5 * (theta - (F[0, 0] + F[1, 1] - 2.0)) * np.eye(2)[:, :, None], np.ones_like(theta)
    s = np.sqrt(theta * law.rest(theta.size) / determinant(F))
    return s * F, s
