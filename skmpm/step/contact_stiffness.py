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

Scalar unknowns move the surfaces, too: rigid bodies and periodic boxes add columns to Z. Rigid surfaces do not
stretch, and beta = -omega. Arms a of impulses f turn with a rigid body, whose moment changes by -a . f per angle.

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
from skmpm.contact.rows import scaled, stacked


@dataclass(frozen=True)
class ContactStiffness:
    """Geometric stiffness of l loaded contacts that slip or have no friction, and of t contact points that slide."""

    contacts: Ints  # (l,) indices among the constraints
    friction_ratio: Array  # (l,) m, tangential over normal impulse; zero without friction
    Z: sp.csr_array  # (2 l + t, 2 contact points) from velocities to rates of tau, of beta, then of turns
    # (2 l + t, 2 contact points) directions in which rho acts; equal to Z where there is no friction
    acting: sp.csr_array
    Z_scalars: sp.csr_array  # (2 l + t, p) the columns of Z for scalar unknowns
    acting_scalars: sp.csr_array  # (2 l + t, p) those of `acting`
    compliance: sp.csr_array  # from -rho to the rates of Z
    negative: (
        int  # number of its negative eigenvalues: one for each of the l contacts, and those of pressed rigid bodies
    )

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


@dataclass(frozen=True)
class ScalarMotion:
    """From p scalar unknowns to the motion of the surfaces at k contacts. Rigid ones do not stretch."""

    slide: sp.csr_array  # relative velocities along the tangents, (k, p)
    spins: tuple[sp.csr_array, sp.csr_array]  # angular velocities of the first and of the second body, (k, p)
    virial: Array  # of the contact impulses on q rigid bodies, (q,) [kg m2/s per m]
    rates: sp.csr_array  # their angular velocities, (q, p)

    def slipping(self, chosen: Ints) -> sp.csr_array:
        """The columns (2 l, p) of the rows of contacts that slip: they slide, and second bodies turn."""
        return stacked([self.slide[chosen], -self.spins[1][chosen]])

    def turning(self, constraints: Constraints, chosen: Ints, sliding: Array | float) -> sp.csr_array:
        """The columns (chosen, p) of `Constraints.turning` for the unknowns."""
        at, first, second = constraints.geometry, *(spin[chosen] for spin in self.spins)
        along, bend = at.along[chosen], at.curvature[chosen] * sliding
        turned = scaled(second - scaled(self.slide[chosen], bend), along * constraints.spread[chosen])
        return sp.csr_array(turned - scaled(first, along))


def contact_stiffness(
    constraints: Constraints, r: Array, dt: float, theta: float, motion: ScalarMotion | None = None
) -> ContactStiffness | None:
    """The geometric stiffness of contacts with impulses r; None if no contact has any.

    `motion` is that of scalar unknowns, if there are any.
    """
    chosen, pressed = loaded(constraints, r), _pressed(constraints, r)
    if constraints.tangential:
        chosen = chosen[~sticking(constraints.lifted(r, dt), constraints.friction)[chosen]]
    sliding = pressed[(constraints.geometry.travel[pressed] > 0.0) & (constraints.normal_part(r)[pressed] > 0.0)]
    parts = []
    if chosen.size:
        parts.append(_slipping(constraints, r, chosen, motion, dt, theta))
    if sliding.size:
        parts.append(_sliding_points(constraints, r, sliding, motion, dt, theta))
    if motion is not None:
        parts += _turning(constraints, motion, dt, theta)
    if not parts:
        return None
    Z, acting = (stacked(rows) for rows in ([part.Z for part in parts], [part.acting for part in parts]))
    Z_scalars = acting_scalars = sp.csr_array((Z.shape[0], 0))
    if motion is not None:
        Z_scalars, acting_scalars = map(stacked, zip(*(part.scalars for part in parts), strict=True))
    compliance = sp.csr_array(sp.block_diag([part.compliance for part in parts], format="csr"))
    ratio, negative = _friction_ratio(constraints, r, chosen), sum(part.negative for part in parts)
    return ContactStiffness(chosen, ratio, Z, acting, Z_scalars, acting_scalars, compliance, negative)


@dataclass(frozen=True)
class _Part:
    """Rows of one kind."""

    Z: sp.csr_array
    acting: sp.csr_array
    scalars: tuple[sp.csr_array, ...]  # columns of both for scalar unknowns; empty where there are none
    compliance: sp.sparray
    negative: int  # eigenvalues of the compliance


def _slipping(
    constraints: Constraints, r: Array, chosen: Ints, motion: ScalarMotion | None, dt: float, theta: float
) -> _Part:
    """Contacts that slip or have no friction: their normals rotate, their feet move."""
    ratio = _friction_ratio(constraints, r, chosen)
    slide, rotation, stretch = constraints.geometric(chosen)
    Z, acting = (stacked([slide, turned]) for turned in (rotation, rotation + sp.diags_array(ratio) @ stretch))
    scalars = () if motion is None else (motion.slipping(chosen),) * 2
    compliance = _compliance(constraints, chosen, constraints.normal_part(r)[chosen], ratio, dt, theta)
    return _Part(Z, acting, scalars, compliance, chosen.size)


def _friction_ratio(constraints: Constraints, r: Array, chosen: Ints) -> Array:
    """Tangential over normal impulse, (l,); zero without friction and where cohesion acts."""
    if not constraints.tangential:
        return np.zeros(chosen.size)
    return np.where(constraints.tensile_strength[chosen] > 0.0, 0.0, r[2 * chosen + 1] / r[2 * chosen])


def _sliding_points(
    constraints: Constraints, r: Array, sliding: Ints, motion: ScalarMotion | None, dt: float, theta: float
) -> _Part:
    """Contact points that slide along their outlines. Forces of those that stick do not turn."""
    normal, direction = constraints.normal_part(r)[sliding], constraints.normal[:, sliding]
    weight = np.ones(sliding.size)
    Z = constraints.turning(sliding, direction)
    if constraints.tangential:
        ratio = r[2 * sliding + 1] / normal
        sticks = sticking(constraints.lifted(r, dt), constraints.friction)[sliding]
        direction = direction + ratio * constraints.tangent[:, sliding]
        weight = np.where(sticks, 0.0, 1.0 + ratio**2)
    acting = constraints.turning(sliding, direction, weight)
    scalars = () if motion is None else tuple(motion.turning(constraints, sliding, each) for each in (1.0, weight))
    compliance = sp.diags_array(1.0 / (theta * dt * normal * constraints.geometry.travel[sliding]))
    return _Part(Z, acting, scalars, compliance, 0)


def _turning(constraints: Constraints, motion: ScalarMotion, dt: float, theta: float) -> list[_Part]:
    """Rigid bodies that turn, with a virial of their contact impulses: forces keep directions, arms turn."""
    chosen = np.flatnonzero(np.abs(motion.virial) * abs(motion.rates).sum(axis=1) > 0.0)
    if chosen.size == 0:
        return []
    rates, virial = motion.rates[chosen], motion.virial[chosen]
    none = sp.csr_array((chosen.size, 2 * constraints.difference.shape[1]))
    compliance = sp.diags_array(1.0 / (theta * dt * virial))
    return [_Part(none, none, (rates, rates), compliance, int((virial < 0.0).sum()))]


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
