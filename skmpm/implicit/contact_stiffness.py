"""Geometric stiffness of contact: the second derivatives of the gaps times the contact impulses.

The gap of a point that slides by tau along a curve whose tangent rotates by beta has the second variation

    d2 g = -c (kappa tau^2 + 2 tau beta + g beta^2),    c = 1 / (1 - g kappa),

kappa the curvature, negative where the body is convex. A contact with normal impulse r adds Z' D Z to the Hessian
of the Lagrangian, with tau and beta the rows of Z and D = theta^2 dt r c [[kappa, 1], [1, g]]: its force rotates by
phi = c (kappa tau + beta) and moves along the curve by tau. The friction force of a slipping contact, m = r_t / r,
rotates and moves likewise, which has no potential and makes the terms unsymmetric: phi r m along the normal, that is
phi r m^2 along the tangent of the previous iteration, and m r tau on the stretch of the curve. The force of a
sticking contact is a constant vector and has no geometric stiffness.

The geometric stiffness couples bodies and is indefinite, so it is not added to A: the impulses rho = -D Z dw / theta
are unknowns of the contact problem, bilateral constraints with the compliance theta D^-1. They vanish at convergence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.contact import Constraints

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

MIN_IMPULSE = 1e-3  # over the largest normal impulse: below it, the geometric stiffness of a contact is neglected
MIN_CURVATURE_FACTOR = 0.1  # of 1 - g kappa, which is zero for a point at the centre of curvature
CONE_TOLERANCE = 1e-9  # relative distance from the edge of the friction cone that counts as slip


@dataclass(frozen=True)
class ContactStiffness:
    """Geometric stiffness of m loaded contacts that slip or have no friction."""

    contacts: Ints  # (m,) indices among the constraints
    slope: Array  # (m,) tangential over normal impulse; zero without friction
    Z: sp.csr_array  # (2 m, 2 contact points) sliding tau, then rotation beta
    acting: sp.csr_array  # (2 m, 2 contact points) directions in which rho acts: Z without friction
    compliance: sp.csr_array  # (2 m, 2 m) theta D^-1

    @property
    def size(self) -> int:
        """Number of bilateral constraints."""
        return self.Z.shape[0]

    def rotated_impulses(self, r: Array, rho: Array) -> Array:
        """The impulses (2 k,) in the rotated contact frames, from those in the previous frames and rho."""
        i, m, out = self.contacts, self.slope, r.copy()
        normal = r[2 * i] + m / (1.0 + m**2) * rho[: i.size]
        on_edge = np.abs(r[2 * i + 1] - m * r[2 * i]) <= CONE_TOLERANCE * np.abs(m) * r[2 * i]
        slips = on_edge & (np.minimum(normal, r[2 * i]) > 0.0)
        out[2 * i] = np.where(slips, normal, r[2 * i])
        out[2 * i + 1] = np.where(slips, m * normal, r[2 * i + 1])
        return out


def contact_stiffness(constraints: Constraints, r: Array, dt: float, theta: float) -> ContactStiffness | None:
    """The geometric stiffness of contacts with impulses r; None if no contact has any."""
    chosen = loaded(constraints, r)
    if constraints.tangential:
        chosen = chosen[~sticking(r, constraints.friction)[chosen]]
    if chosen.size == 0:
        return None
    normal, slope = r[chosen], np.zeros(chosen.size)
    if constraints.tangential:
        normal = r[2 * chosen]
        slope = r[2 * chosen + 1] / normal
    slide, rotation, stretch = constraints.geometric(chosen)
    Z = sp.csr_array(sp.vstack([slide, rotation], format="csr"))
    acting = sp.csr_array(sp.vstack([slide, rotation + sp.diags_array(slope) @ stretch], format="csr"))
    return ContactStiffness(chosen, slope, Z, acting, _compliance(constraints, chosen, normal, slope, dt, theta))


def _compliance(
    constraints: Constraints, chosen: Ints, normal: Array, slope: Array, dt: float, theta: float
) -> sp.csr_array:
    """Theta D^-1 including friction, (2 m, 2 m)."""
    gap, kappa = constraints.gap[chosen], constraints.curvature[chosen]
    c = 1.0 / np.maximum(1.0 - gap * kappa, MIN_CURVATURE_FACTOR)
    factor = theta / (theta**2 * dt * normal * c * (gap * kappa - 1.0))
    friction = 1.0 / (1.0 + slope**2)
    entries = ((gap * friction, -np.ones_like(gap)), (-friction, kappa))
    return sp.block_array([[sp.diags_array(factor * e) for e in row] for row in entries], format="csr")


def loaded(constraints: Constraints, r: Array) -> Ints:
    """The contacts on curved surfaces with an impulse above `MIN_IMPULSE`."""
    normal = r[::2] if constraints.tangential else r
    return np.flatnonzero((normal > MIN_IMPULSE * normal.max(initial=0.0)) & constraints.curved)


def sticking(r: Array, friction: Array) -> NDArray[np.bool_]:
    """Whether impulses (2 k,) are inside their friction cones, (k,)."""
    return np.asarray(np.abs(r[1::2]) < (1.0 - CONE_TOLERANCE) * friction * r[::2])
