"""Velocities of supports and contacts at the end of a step with theta < 1.

Supports prescribe the mean velocity w. The velocity at the end, v0 + (w - v0) / theta, would keep a jump of the
prescribed one for ever, with alternating signs for theta = 1/2. It is therefore the nearest one, by kinetic energy,
that has the prescribed values, and the impulses for it are part of the reactions.

The contact law holds for the gaps at the end of the step, which the mean velocity w leads to. Where a contact stays
closed the normal component of w is zero, so that the velocity at the end, v0 + (w - v0) / theta, would be -v0 for
theta = 1/2, and contact forces would chatter. Closed contacts therefore also obey Moreau's law of impact without
restitution: impulses rho with 0 <= u_n perp rho_n >= 0 and Coulomb friction for the relative velocities u of
v = v1 + M^-1 H^T rho, after which none of them approaches (Moreau, CISM Courses and Lectures 302 (1988) 1-82; Jean,
CMAME 177 (1999) 235-257).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm import coulomb
from skmpm.implicit.contact_problem import ContactIterate
from skmpm.implicit.errors import StepRejected, pair
from skmpm.implicit.residual import Increment
from skmpm.linear import Diagonal

Array = NDArray[np.float64]


def at_supports(increment: Increment, v: Array) -> tuple[Array, Array]:
    """The velocity v (2 nodes,) [m/s] with the prescribed values, and impulses on supports, (2 supports,)."""
    supports, mass = increment.supports, increment.mass
    if supports is None:
        return v, np.zeros(0)
    prescribed, grid = increment.prescribed_only(), increment.grid
    M = sp.diags_array(mass).tobsr((2, 2))
    solver = supports.factorised(increment.scheme.linear, M, grid.blocks, grid.rigid_motions())
    end = prescribed + solver(mass * (v - prescribed))
    return end, np.asarray(supports.prescription.T @ (mass * (v - end)))


def after_impact(increment: Increment, contact: ContactIterate, v: Array) -> tuple[Array, Array]:
    """The velocity v (2 nodes,) [m/s] after impacts of closed contacts, and their impulses, rows of H [N s/m].

    Contacts at supports, or of what driving forces and contact alone move, are left as they are: the impulses would
    have to move these, too.
    """
    constraints = contact.constraints
    impulse, chosen = np.zeros_like(contact.r), _closed(increment, contact)
    if not chosen.any():
        return v, impulse
    some, inverse = constraints.among(chosen), Diagonal(1.0 / increment.mass)
    W = inverse.between_contacts(some.shares, *some.directions)
    u = some.D @ some.at_contact_points(v) + some.components(some.prescribed)
    rho, info = coulomb.solve(W, u, some.friction, tol=increment.scheme.contact_tol)
    if not info.converged:
        worst = int(np.argmax(coulomb.residuals(rho, W @ rho + u, some.friction, W.diagonal())))
        raise StepRejected(
            pair(some.bodies[:, worst]),
            f"the contact solver did not converge for the velocities of {some.size} contacts at the end of the step:"
            f" residual {info.residual:.2g} (tolerance {increment.scheme.contact_tol:g}) here",
        )
    impulse[np.repeat(chosen, impulse.size // chosen.size)] = rho
    return v + inverse(some.at_nodes(some.D.T @ rho)), impulse


def _closed(increment: Increment, contact: ContactIterate) -> NDArray[np.bool_]:
    """Whether contacts press on nodes that impulses alone move, (k,)."""
    constraints = contact.constraints
    if constraints.size == 0:
        return np.zeros(0, dtype=bool)
    stride, shares = contact.r.size // constraints.size, constraints.shares
    closed = (contact.r[::stride] > 0.0) & (np.diff(shares.indptr) > 0)
    if increment.supports is not None:
        fixed = increment.supports.fixed
        held = np.concatenate([fixed, increment.supports.T[fixed].indices]) // 2
        at_support = np.isin(shares.indices, held).astype(np.int64)
        closed &= np.bincount(np.repeat(np.arange(closed.size), np.diff(shares.indptr)), at_support, closed.size) == 0
    if contact.problem.unknowns is not None:
        moved = abs(contact.problem.unknowns.rows(contact.z, constraints)).sum(axis=1) > 0.0
        closed &= ~np.asarray(moved).reshape(-1, stride).any(axis=1)
    return np.asarray(closed)
