"""Solution of the contact problem on the linearised bulk: Newton direction and contact impulses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from skmpm import coulomb
from skmpm.arrays import Array
from skmpm.linear import Solver
from skmpm.step.compliance import Border, delassus_matrix
from skmpm.step.contact_problem import ContactIterate, KnownForces, check_response
from skmpm.step.contact_scale import FARTHEST, ContactScale, contact_scale
from skmpm.step.contact_stiffness import ContactStiffness, contact_stiffness
from skmpm.step.errors import NOTHING_DEFORMS, StepRejected, of_contact
from skmpm.step.factor import Factor
from skmpm.step.terms import Configuration

# Iterations of the contact solver with geometric stiffness: one to six are usual. Near a limit point it takes a
# hundred or fails, and half of the stiffness, from the contacts without it, solves nearly all such problems. From 6
# to 24 packings take as many iterations.
MAX_STEPS = 12


@dataclass(frozen=True)
class Direction:
    """A Newton direction, the contact impulse that belongs to it, and the contact problem with its impulses."""

    contact: ContactIterate
    direction: Array  # (n,) [m/s]
    impulse: Array  # (n,) [kg m/s per m], with that of the geometric stiffness


def solve(
    contact: ContactIterate, factor: Factor, configuration: Configuration, gradient: Array
) -> tuple[Direction, Factor]:
    """Newton direction with impulses that satisfy the contact law on the linearised bulk, by a factorised matrix.

    u = u(w) + H [A^-1 (theta H^T r - gradient)] + W (r_new - r).

    Also returns the factor, with the responses of all contact points in use.
    """
    constraints, increment, timer = contact.constraints, contact.increment, contact.problem.timer
    solver = factor.at(increment, configuration)
    if constraints.size == 0:
        return Direction(contact, increment.limited(-increment.solved(solver, gradient)), contact.impulse), factor
    geometric = contact_stiffness(constraints, contact.r, increment.dt, increment.scheme.theta, contact.scalar_motion)
    with_known = increment.solved(solver, contact.impulse - gradient)
    timer.lap("linear")
    W, borders, factor = delassus_matrix(contact, solver, factor, geometric)
    timer.lap("delassus")
    found = _Linearised(contact, solver, gradient, W, borders, with_known).with_stiffness(geometric)
    timer.lap("linear")
    return found, factor


@dataclass(frozen=True)
class _Impulses:
    """The result of the contact solver."""

    r: Array
    rho: Array  # of the geometric stiffness
    scale: ContactScale
    iterations: int
    residual: float
    worst: int | None  # the contact with the largest residual, if the solver did not converge


@dataclass(frozen=True)
class _Linearised:
    """The contact problem on the bulk linearised at an iterate."""

    contact: ContactIterate
    solver: Solver
    gradient: Array  # (n,)
    W: sp.csr_array  # of contacts, then of the geometric stiffness
    borders: list[Border]  # of W
    with_known: Array  # (n,) velocity increment under the known impulses

    def with_stiffness(self, geometric: ContactStiffness | None) -> Direction:
        """The direction with the geometric stiffness of contact, or as much of it as is usable.

        The geometric stiffness is indefinite. Where it exceeds the quadratic form of A along the direction, the
        contacts are beyond a limit point (`contact_stiffness`) and the direction leads to no minimum. Where the
        contact solver does not converge with all of it, it tries half of it, from the solution without.
        """
        if geometric is None:
            return self._without(self._impulses(None, self.contact.lifted), 0)
        found = self._impulses(geometric, self.contact.lifted)
        if found.worst is None and (usable := self._usable(geometric, found, 0)):
            return usable
        without = self._impulses(None, self.contact.lifted)
        iterations = found.iterations
        if found.worst is not None and without.worst is None:
            start = self.contact.constraints.lifted(without.r, self.contact.increment.dt)
            half = self._impulses(geometric.softer(0.5), start)
            if half.worst is None and (usable := self._usable(geometric, half, iterations + without.iterations)):
                return usable
            iterations += half.iterations
        return self._without(without, iterations)

    def _usable(self, geometric: ContactStiffness, found: _Impulses, iterations: int) -> Direction | None:
        """The direction of impulses with geometric stiffness; None if that cancels the quadratic form of A."""
        contact, constraints = self.contact, self.contact.constraints
        increment, theta = contact.increment, contact.increment.scheme.theta
        impulse = contact.pushed(found.r, geometric.acting.T @ found.rho, geometric.acting_scalars.T @ found.rho)
        direction = self._direction(impulse)
        turned = geometric.Z @ constraints.at_contact_points(increment.on_nodes(direction))
        turned += geometric.Z_scalars @ increment.of_scalars(direction)
        softening = theta * float(turned @ found.rho)
        if softening > float(direction @ (impulse - self.gradient)):
            return None
        r = geometric.rotated_impulses(found.r, found.rho) if constraints.tangential else found.r
        return Direction(self._after(r, found.scale, iterations + found.iterations), direction, impulse)

    def _without(self, found: _Impulses, iterations: int) -> Direction:
        """The direction of impulses without the geometric stiffness, after iterations of the solver with it."""
        constraints = self.contact.constraints
        if found.worst is not None:
            bodies, tol = constraints.bodies[:, found.worst], self.contact.increment.scheme.contact_tol
            rigid = np.append(np.diff(self.contact.increment.grid.blocks) == 0, True)[np.maximum(bodies, -1)].all()
            raise StepRejected(
                of_contact(constraints, found.worst, self.contact.increment.grid.cell),
                f"the contact solver did not converge for {constraints.size} contacts: residual"
                f" {found.residual:.2g} (tolerance {tol:g}) here",
                NOTHING_DEFORMS if rigid else "",
            )
        contact = self._after(found.r, found.scale, iterations + found.iterations)
        return Direction(contact, self._direction(contact.impulse), contact.impulse)

    def _direction(self, impulse: Array) -> Array:
        """A^-1 (impulse - gradient), (n,), from that with the known impulses.

        Bodies whose contact impulses stay the same need no second solution.
        """
        increment = self.contact.increment
        return increment.limited(self.with_known + increment.solved(self.solver, impulse - self.contact.impulse))

    def _after(self, r: Array, scale: ContactScale, iterations: int) -> ContactIterate:
        """The contact problem with the impulses of the solve, which are known from now on."""
        contact, constraints = self.contact, self.contact.constraints
        known = KnownForces(constraints.key, constraints.forces(r, contact.increment.dt), constraints.normal, scale)
        return replace(
            contact,
            problem=replace(contact.problem, known=known),
            r=r,
            iterations=contact.iterations + iterations,
        )

    def _impulses(self, geometric: ContactStiffness | None, start: Array) -> _Impulses:
        """The new impulses and those of the geometric stiffness; the start has the impulses that cohesion adds."""
        contact, constraints, W = self.contact, self.contact.constraints, self.W
        increment, known = contact.increment, contact.lifted
        scheme, k = increment.scheme, known.size
        by_known = W @ np.concatenate([known, np.zeros(W.shape[0] - k)])
        increment_of_points = constraints.at_contact_points(increment.on_nodes(self.with_known))
        q = contact.u + contact.relative(increment_of_points, self.with_known) - by_known[:k]
        borders = self.borders
        options: dict[str, Any] = {}
        if geometric is not None:
            of_scalars = geometric.Z_scalars @ increment.of_scalars(self.with_known)
            p = geometric.Z @ increment_of_points + of_scalars - by_known[k:]
            W = W + _lower_right(geometric.compliance, k)
            negative = None if constraints.tangential else geometric.negative
            bilateral = coulomb.Bilateral(p, negative)
            options = {"bilateral": bilateral, "iterations": MAX_STEPS}
        elif W.shape[0] > k:
            W, borders = W[:k, :k], [border.of_contacts(k) for border in borders]
        diagonal = W.diagonal()[:k]
        for border in borders:
            W, options["bilateral"] = border.around(W, options.get("bilateral"), known)
        check_response(constraints, diagonal[:: 2 if constraints.tangential else 1], increment.supports)
        free = q
        if constraints.cohesive:
            free = q + (W @ np.concatenate([known - contact.r, np.zeros(W.shape[0] - k)]))[:k]
        round_off = contact.problem.speed_round_off / scheme.gap_tol
        farthest = np.inf if scheme.inertia else FARTHEST * increment.grid.cell / increment.dt
        limits = round_off, increment.dt, scheme.contact_tol, farthest
        scale = contact_scale(constraints, diagonal, free, *limits)
        options |= {"tol": scheme.contact_tol, "reference": scale.reference, "repeated": True}
        r, info = coulomb.solve(W, q, constraints.friction, r0=start, **options)
        contact.problem.timer.lap("contact")
        worst = None
        if not info.converged:
            u = (W @ np.concatenate([r, info.bilateral]))[:k] + q
            residuals = coulomb.residuals(r, u, constraints.friction, diagonal)
            worst = int(np.argmax(residuals))
        lowered, rho = constraints.lifted(r, -increment.dt), info.bilateral[: geometric.size if geometric else 0]
        return _Impulses(lowered, rho, scale, info.iterations, info.residual, worst)


def _lower_right(matrix: sp.csr_array, k: int) -> sp.csr_array:
    """A matrix with k rows and columns of zeros before those of `matrix`."""
    size, offsets = k + matrix.shape[0], np.concatenate([np.zeros(k, dtype=matrix.indptr.dtype), matrix.indptr])
    return sp.csr_array((matrix.data, matrix.indices + k, offsets), shape=(size, size))
