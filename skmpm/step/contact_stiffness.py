"""Geometric stiffness of contact: the second derivatives of the gaps times the contact impulses.

A boundary point has the gap g to a curve with outward normal n, unit tangent t = (-n_y, n_x) and curvature kappa,
negative where the body is convex. Let tau be the tangential displacement of the point relative to the material point
of the curve at its foot (at fixed curve parameter xi), and beta = n . dt the rotation of the tangent there, positive
clockwise. The second variation of the gap is

    d2 g = -c (kappa tau^2 + 2 tau beta + g beta^2),    c = 1 / (1 - g kappa).

The normal rotates clockwise by phi = c (kappa tau + beta), and the foot moves along the material curve by
s = c (tau + g beta). With the normal impulse r, the impulses conjugate to tau and beta change by

    rho = -r c [[(1 + m^2) kappa, 1 + m^2], [1, g]] (tau, beta) = -r ((1 + m^2) phi, s),

m = 0 without friction; tau and beta are theta dt times their rates, the rows of Z. A slipping contact has
m = r_t / r: its friction force rotates and moves too. Rotation adds m r phi along n, which for an impulse on the cone
is equivalent to -m^2 r phi along t, and the displacement s of the friction force does work on the stretch of the
curve, so that rho acts along the rows of `acting` instead of Z. These terms are unsymmetric, as friction has no
potential. The force of a sticking contact is a constant vector and has no geometric stiffness. Where cohesion acts, r
may be negative and is not proportional to r_t: there m = 0, the rotation of friction alone is left to the iteration.

The geometric stiffness couples bodies and is indefinite, so it is not added to A: rho are further unknowns of the
contact problem, bilateral constraints whose compliance maps -rho to the rates of tau and beta; they vanish at
convergence. A limit point of the contacts is a configuration in which A with the geometric stiffness is singular:
beyond it the contacts snap to another equilibrium, and near it Newton directions are far too long.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from skmpm.arrays import ROUND_OFF, Array, Bools, Ints
from skmpm.contact import Constraints


@dataclass(frozen=True)
class ContactStiffness:
    """Geometric stiffness of l loaded contacts that slip or have no friction, and of t contact points that slide."""

    contacts: Ints  # (l,) indices among the constraints
    friction_ratio: Array  # (l,) m, tangential over normal impulse; zero without friction
    sliding: Ints  # (t,) indices among the constraints
    Z: sp.csr_array  # (2 l + t, 2 contact points) from velocities to rates of tau, of beta, then of turns
    acting: (
        sp.csr_array
    )  # (2 l + t, 2 contact points) directions in which rho acts; equal to Z where there is no friction
    compliance: sp.csr_array  # from -rho to the rates of Z; one negative eigenvalue for each of the l contacts

    @property
    def size(self) -> int:
        """Number of bilateral constraints."""
        return self.Z.shape[0]

    def softer(self, share: float) -> ContactStiffness:
        """A share of the geometric stiffness."""
        return replace(self, compliance=sp.csr_array(self.compliance / share))

    def rotated_impulses(self, r: Array, rho: Array) -> Array:
        """The impulses (2 k,) in the rotated contact frames, from those in the previous frames and rho."""
        i, m, out = self.contacts, self.friction_ratio, r.copy()
        normal = r[2 * i] + m / (1.0 + m**2) * rho[: i.size]
        on_cone = np.abs(r[2 * i + 1] - m * r[2 * i]) <= ROUND_OFF * np.abs(m) * r[2 * i]
        slips = on_cone & (np.minimum(normal, r[2 * i]) > 0.0)
        out[2 * i] = np.where(slips, normal, r[2 * i])
        out[2 * i + 1] = np.where(slips, m * normal, r[2 * i + 1])
        return out


def contact_stiffness(constraints: Constraints, r: Array, dt: float, theta: float) -> ContactStiffness | None:
    """The geometric stiffness of contacts with impulses r; None if no contact has any."""
    chosen, pressed = loaded(constraints, r), _pressed(constraints, r)
    if constraints.tangential:
        chosen = chosen[~sticking(constraints.lifted(r, dt), constraints.friction)[chosen]]
    sliding = pressed[(constraints.geometry.travel[pressed] > 0.0) & (constraints.normal_part(r)[pressed] > 0.0)]
    if chosen.size + sliding.size == 0:
        return None
    normal, friction_ratio = r[chosen], np.zeros(chosen.size)
    if constraints.tangential:
        normal = r[2 * chosen]
        friction_ratio = np.where(constraints.tensile_strength[chosen] > 0.0, 0.0, r[2 * chosen + 1] / normal)
    slide, rotation, stretch = constraints.geometric(chosen)
    measured, loads = [slide, rotation], [slide, rotation + sp.diags_array(friction_ratio) @ stretch]
    compliance = _compliance(constraints, chosen, normal, friction_ratio, dt, theta)
    if sliding.size:
        measured.append(constraints.turning(sliding, constraints.normal[:, sliding]))
        loads.append(_moving_forces(constraints, r, sliding, dt))
        travel = theta * dt * constraints.normal_part(r)[sliding] * constraints.geometry.travel[sliding]
        compliance = sp.csr_array(sp.block_diag([compliance, sp.diags_array(1.0 / travel)], format="csr"))
    Z, acting = (sp.csr_array(sp.vstack(rows, format="csr")) for rows in (measured, loads))
    return ContactStiffness(chosen, friction_ratio, sliding, Z, acting, compliance)


def _moving_forces(constraints: Constraints, r: Array, sliding: Ints, dt: float) -> sp.csr_array:
    """Rows in which the forces of contact points that slide act, per normal impulse; those that stick do not turn."""
    direction = constraints.normal[:, sliding]
    if not constraints.tangential:
        return constraints.turning(sliding, direction)
    ratio = r[2 * sliding + 1] / r[2 * sliding]
    sticks = sticking(constraints.lifted(r, dt), constraints.friction)[sliding]
    direction = direction + ratio * constraints.tangent[:, sliding]
    return constraints.turning(sliding, direction, np.where(sticks, 0.0, 1.0 + ratio**2))


def _compliance(
    constraints: Constraints, chosen: Ints, normal: Array, friction_ratio: Array, dt: float, theta: float
) -> sp.csr_array:
    """The inverse of theta dt r c [[(1 + m^2) kappa, 1 + m^2], [1, g]] for l contacts, (2 l, 2 l)."""
    gap, kappa, c = constraints.gap[chosen], constraints.geometry.curvature[chosen], constraints.spread[chosen]
    factor = theta / (theta**2 * dt * normal * c * (gap * kappa - 1.0))
    friction, l = 1.0 / (1.0 + friction_ratio**2), chosen.size  # noqa: E741
    entries = factor * np.array([[gap * friction, -np.ones(l)], [-friction, kappa]])  # (row, column, contact)
    columns = np.tile(np.arange(2 * l, dtype=np.int32).reshape(2, l).T.ravel(), 2)
    rows = 2 * np.arange(2 * l + 1, dtype=np.int32)
    return sp.csr_array((entries.transpose(0, 2, 1).ravel(), columns, rows), shape=(2 * l, 2 * l))


def loaded(constraints: Constraints, r: Array) -> Ints:
    """The contacts on curved surfaces with a normal impulse, tension or compression, above round-off."""
    pressed = _pressed(constraints, r)
    return np.asarray(pressed[constraints.curved[pressed]])


def _pressed(constraints: Constraints, r: Array) -> Ints:
    size = np.abs(constraints.normal_part(r))
    return np.flatnonzero(size > ROUND_OFF * size.max(initial=0.0))


def sticking(r: Array, friction: Array) -> Bools:
    """Whether impulses (2 k,) are inside their friction cones, (k,)."""
    return np.asarray(np.abs(r[1::2]) < (1.0 - ROUND_OFF) * friction * r[::2])
