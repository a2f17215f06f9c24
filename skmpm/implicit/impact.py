"""Velocities of contacts at the end of a step with theta < 1.

The contact law holds for the gaps at the end of the step, which the mean velocity w leads to. Where a contact stays
closed the normal component of w is zero, so that the velocity at the end, v0 + (w - v0) / theta, would be -v0 for
theta = 1/2, and contact forces would chatter. Closed contacts therefore also obey Moreau's law of impact without
restitution: impulses rho with 0 <= H v + ... perp rho >= 0 and Coulomb friction, v = v1 + M^-1 H^T rho, after which
none of them approaches (Moreau, CISM Courses and Lectures 302 (1988) 1-82; Jean, CMAME 177 (1999) 235-257).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm import coulomb
from skmpm.contact import Constraints
from skmpm.implicit.contact_problem import ContactIterate
from skmpm.implicit.errors import StepRejected, pair
from skmpm.implicit.residual import Increment
from skmpm.linear import Diagonal

Array = NDArray[np.float64]


def after_impact(increment: Increment, contact: ContactIterate, v: Array) -> tuple[Array, Array]:
    """The velocity v (2 nodes,) [m/s] after impacts of closed contacts, and their impulses, rows of H [N s/m].

    Contacts of bodies that supports hold, or of what driving forces and contact alone move, are left as they are: the
    impulses would have to move these, too.
    """
    constraints = contact.constraints
    impulse, chosen = np.zeros_like(contact.r), _closed(increment, contact)
    if not chosen.any():
        return v, impulse
    some, inverse = constraints.among(chosen), Diagonal(1.0 / increment.mass)
    W = inverse.between_contacts(_shares(some), *some.directions)
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


def _shares(constraints: Constraints) -> sp.csr_array:
    """From nodal velocities to relative ones of contacts, (k, nodes)."""
    return sp.csr_array(constraints.difference @ constraints.base)


def _closed(increment: Increment, contact: ContactIterate) -> NDArray[np.bool_]:
    """Whether contacts press on nodes that impulses alone move, (k,)."""
    constraints, grid = contact.constraints, increment.grid
    if constraints.size == 0:
        return np.zeros(0, dtype=bool)
    stride = contact.r.size // constraints.size
    held = np.isin(constraints.bodies, grid.node_body[increment.constrained_dofs // 2]).any(axis=0)
    closed = (contact.r[::stride] > 0.0) & ~held & (np.diff(_shares(constraints).indptr) > 0)
    if contact.problem.unknowns is not None:
        moved = abs(contact.problem.unknowns.rows(contact.z, constraints)).sum(axis=1) > 0.0
        closed &= ~np.asarray(moved).reshape(-1, stride).any(axis=1)
    return np.asarray(closed)
