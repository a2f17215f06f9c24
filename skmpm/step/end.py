"""The end of a step: nodes, contacts and material, with impacts where theta < 1.

Supports prescribe w, the velocity that moves the nodes in the step. The velocity at the end, v0 + (w - v0) / theta,
would keep a jump of the prescribed one for ever, with alternating signs for theta = 1/2. It is therefore the nearest
one, by kinetic energy, that has the prescribed values, and the impulses for it are part of the reactions.

The contact law holds for the gaps at the end of the step, which the mean velocity w leads to. Where a contact stays
closed the normal component of w is zero, so that the velocity at the end, v0 + (w - v0) / theta, would be -v0 for
theta = 1/2: contact forces would chatter, and rigid bodies rebound. Closed contacts therefore also obey the law for
velocities at the end of the step, Moreau's law of impact without restitution: 0 <= u_n perp r_n >= 0 and Coulomb
friction for the relative velocities u and all impulses r from the start of the step to its end (Moreau, CISM Courses
and Lectures 302 (1988) 1-82). One set of impulses for positions and another for velocities is how Acary (Appl. Numer.
Math. 72 (2013) 203-225) projects, too; the first moves bodies, and both are the contact forces.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from skmpm import coulomb
from skmpm.arrays import EXACT, Array, Bools
from skmpm.material import viscosity_of
from skmpm.scene import PrescribedVelocities
from skmpm.step.contact_problem import ContactIterate
from skmpm.step.equations import Increment
from skmpm.step.errors import StepRejected, of_contact
from skmpm.step.newton import Solution
from skmpm.step.terms import Configuration


def at_supports(increment: Increment, v: Array) -> tuple[Array, Array]:
    """The velocity v (n,) [m/s] with the prescribed values, and impulses on supports (`prescribed`)."""
    supports, mass, nodes = increment.supports, increment.on_nodes(increment.mass), increment.on_nodes(v)
    if supports is None:
        return v, np.zeros(0)
    prescribed, grid = increment.prescribed_only(), increment.grid
    M = sp.diags_array(mass).tobsr((2, 2))
    solver = supports.factorised(increment.scheme.linear, M, grid.blocks, grid.rigid_motions)
    end = prescribed + solver(mass * (nodes - prescribed))
    reaction = np.asarray(supports.prescription.T @ (mass * (nodes - end)))
    return increment.with_scalars(end, increment.of_scalars(v)), reaction


def after_impact(increment: Increment, contact: ContactIterate, v: Array) -> tuple[Array, Array]:
    """The velocity v (n,) [m/s] after impacts, and impulses, rows of H [N s/m].

    Contacts at supports, or that move a periodic box, are left as they are: the impulses would have to move these.
    """
    constraints = contact.constraints
    impulses, chosen = np.zeros_like(contact.r), _closed(increment, contact)
    if not chosen.any():
        return v, impulses
    some, inverse = constraints.among(chosen), 1.0 / increment.mass
    of_chosen = np.repeat(chosen, contact.r.size // chosen.size)
    if constraints.tangential and not some.tangential:
        of_chosen[1::2] = False
    J, change = contact.J[np.flatnonzero(of_chosen)], increment.of_scalars(v - contact.moving)
    u = some.H @ increment.on_nodes(v) + J @ change + some.components(some.prescribed)
    H = sp.csr_array(sp.hstack([some.H, J], format="csr"))
    W = sp.csr_array(H @ sp.diags_array(inverse) @ H.T)
    before = contact.lifted[of_chosen]
    tol = increment.scheme.contact_tol
    after, info = coulomb.solve(W, u - W @ before, some.friction, r0=before, tol=tol, repeated=True)
    rho = after - before
    if not info.converged:
        worst = int(np.argmax(coulomb.residuals(after, u + W @ rho, some.friction, W.diagonal())))
        raise StepRejected(
            of_contact(some, worst, increment.grid.cell),
            f"the contact solver did not converge for the velocities of {some.size} contacts at the end of the step:"
            f" residual {info.residual:.2g} (tolerance {tol:g}) here",
        )
    impulses[of_chosen] = rho
    return v + inverse * (H.T @ rho), impulses


def _closed(increment: Increment, contact: ContactIterate) -> Bools:
    """Whether contacts are closed and all that they press on is moved by impulses at the end of the step, (k,)."""
    constraints, unknowns = contact.constraints, increment.scalars
    if constraints.size == 0:
        return np.zeros(0, dtype=bool)
    stride, shares = contact.r.size // constraints.size, constraints.shares
    moves = np.diff(shares.indptr) > 0
    closed = contact.lifted[::stride] > 0.0
    scale = contact.problem.known.scale
    if constraints.cohesive and scale is not None:
        # Tension across an open gap is the strength up to round-off: such a contact is open by its velocity.
        response = scale.diagonal_of(constraints)[::stride]
        closed &= contact.lifted[::stride] * response > contact.u[::stride]
    if increment.supports is not None:
        fixed = increment.supports.fixed
        held = np.concatenate([fixed, increment.supports.T[fixed].indices]) // 2
        at_support = np.isin(shares.indices, held).astype(np.int64)
        closed &= np.bincount(np.repeat(np.arange(closed.size), np.diff(shares.indptr)), at_support, closed.size) == 0
    moved, midpoint = abs(contact.J[::stride]), unknowns.inertia.theta < 1.0
    moves |= moved @ midpoint > 0.0
    closed &= moved @ (~midpoint).astype(float) <= EXACT
    return np.asarray(closed & moves)


@dataclass(frozen=True)
class End:
    """What a step ends with: configuration, velocity, impulses and internal variables."""

    configuration: Configuration
    velocity: Array  # (n,) [m/s]
    reaction: Array  # impulses on the supports (q,), with those at the end (`at_supports`) [kg m/s per m]
    impulses: Array  # of contacts, rows of H, with those of impacts at the end (`after_impact`) [N s/m]
    motions: PrescribedVelocities  # all prescribed velocities, with those that the step has found
    internal: Array | None = None  # (k, n) internal variables of the points, None if no material has memory


def box_as_prescribed(increment: Increment, solution: Solution) -> tuple[Increment, Solution]:
    """A solved step as if the motion that was found of a periodic box had been prescribed.

    Bodies begin, and end, with what it has added to their velocities (`scalar_unknowns`).
    """
    if increment.scalars.carrier is None:
        return increment, solution
    v0, w = (increment.with_box_motion(v, solution.w) for v in (increment.v0, solution.w))
    return replace(increment, v0=v0), replace(solution, w=w)


def end_of_step(increment: Increment, solution: Solution, motions: PrescribedVelocities) -> End:
    """The end of a solved step with prescribed velocities `motions`."""
    configuration = _configuration_at_end(increment, solution)
    v0, contact = increment.v0, solution.contact
    w = increment.with_scalars(increment.on_nodes(solution.w) + solution.spin, increment.of_scalars(solution.w))
    velocity = np.asarray(v0 + (w - v0) / increment.theta)  # with what w lacks of momentum
    impulses = np.zeros(0) if contact is None else contact.r
    reaction = solution.reaction
    if increment.scheme.theta < 1.0:
        velocity, at_end = at_supports(increment, velocity)
        reaction = reaction + at_end
        if contact is not None:
            velocity, impact = after_impact(increment, contact, velocity)
            impulses = impulses + impact
    motions = increment.scalars.motions(motions, increment.of_scalars(solution.w), increment.of_scalars(velocity))
    return End(configuration, velocity, reaction, impulses, motions, increment.bulk.updated(configuration))


def _configuration_at_end(increment: Increment, solution: Solution) -> Configuration:
    """The configuration at the end of the step: with theta = 1 that of the stresses.

    Viscous forces and statics depend on its round-off, which a state that was loaded from a file does not know.
    """
    moved = increment.dt * solution.w
    displacement, scalars = increment.displacement_at_start + increment.on_nodes(moved), increment.of_scalars(moved)
    viscous = any(viscosity_of(material) for material, _ in increment.bulk.materials)
    if increment.scheme.theta == 1.0 and increment.scheme.inertia and not viscous:
        return solution.configuration.translated(displacement, scalars)
    return increment.bulk.at(displacement, scalars)
