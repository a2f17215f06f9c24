"""The contact problem of a step: constraints and impulses from one Newton iteration to the next."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm import coulomb
from skmpm.contact import Constraints, Linearise
from skmpm.implicit.candidate_contacts import candidates, check_response
from skmpm.implicit.contact_scale import ContactScale, contact_scale
from skmpm.implicit.contact_stiffness import ContactStiffness, contact_stiffness, sticking
from skmpm.implicit.errors import StepRejected, pair
from skmpm.implicit.residual import Increment
from skmpm.implicit.timer import Timer
from skmpm.linear import Delassus, Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Largest share of the quadratic form of A along a Newton direction that the geometric stiffness of contact may
# cancel: with the impulses of the previous step, and with those of an earlier iteration of this one.
MAX_SOFTENING_FIRST, MAX_SOFTENING = 0.5, 0.95
# Iterations of the contact solver with geometric stiffness: one to six are usual, near a limit point a hundred.
MAX_STEPS = 12
ROUND_OFF_FACTOR = 5.0  # over the round-off of impulses: what counts as zero


@dataclass
class ContactProblem:
    """Contacts of a step: constraints, impulses, and the Delassus operator.

    `constraints`, `r` and `u` belong to the velocity of the last `evaluate`; `solve` replaces r.
    """

    linearise: Linearise
    increment: Increment
    key: Ints  # (k,) contacts whose forces are known
    force: Array  # (2, k) [N/m]
    timer: Timer
    supported: NDArray[np.bool_] = field(  # (2, n) velocity components of the points that supports prescribe
        default_factory=lambda: np.zeros((2, 0), dtype=bool)
    )
    iterations: int = 0
    solver_residual: float = 0.0  # of the last contact solve
    worst_contact: int = 0  # the contact with the largest residual, where the last solve did not converge
    stiffness_failures: int = 0  # contact solves with geometric stiffness that did not converge
    constraints: Constraints = field(init=False)
    r: Array = field(init=False)
    u: Array = field(init=False)
    scale: ContactScale | None = None
    delassus: Delassus | None = None  # belongs to the solver in use; None after a new factorisation
    frozen: Constraints | None = None  # those of the frozen contact geometry, see `frozen_geometry`
    current: Constraints = field(init=False)  # `constraints` with the geometry at the last `evaluate` instead
    force_normal: Array | None = None  # (2, k) normals of `force`, if it was found in this step

    @cached_property
    def speed_round_off(self) -> float:
        """Round-off of gap velocities that comes from positions [m/s]."""
        extent = float(np.abs(self.increment.grid.position).max(initial=0.0))
        return 4.0 * float(np.finfo(float).eps) * extent / self.increment.dt

    @property
    def impulse_round_off(self) -> float:
        """Size of the contact impulse that such gap velocities cause [kg m/s per m]; zero before the first solve."""
        if self.scale is None or self.scale.key.size == 0:
            return 0.0
        return ROUND_OFF_FACTOR * float(np.linalg.norm(self.speed_round_off / self.scale.diagonal[0]))

    def evaluate(self, w: Array) -> tuple[Array, float]:
        """Linearise about w; contact impulse theta H^T r (2 nodes,) of the known r, residual of the contact law."""
        self.timer.lap("bulk")
        self.constraints = self.current = candidates(
            self.linearise(w), self.increment.grid, self.increment.supports, self.supported
        )
        if self.frozen is not None and self.frozen.size:
            self.constraints = self.current.with_frames_of(self.frozen, w)
        self.r = self._known_impulses()
        self.u = self.constraints.D @ self.constraints.at_contact_points(w) + self.constraints.offset
        residual = self._residual()
        self.timer.lap("detection")
        return self._contact_impulse(), residual

    def worst_pair(self) -> str:
        """The pair of bodies with the largest contact residual at the last `evaluate`, as text."""
        if self.scale is None:
            return "contacts not solved yet"
        diagonal = self.scale.diagonal_of(self.constraints)
        residuals = coulomb.residuals(self._lifted(), self.u, self.constraints.friction, diagonal)
        return pair(self.constraints.bodies[:, np.argmax(residuals)])

    def _known_impulses(self) -> Array:
        """The known impulses on the current constraints: contacts that stick keep the vector, others its components.

        Components are those along the normal and the tangent, which change with the contact geometry.
        """
        constraints, dt = self.constraints, self.increment.dt
        r = constraints.without_excess_tension(constraints.impulses(self.key, self.force, dt), dt)
        if not constraints.tangential or self.force_normal is None:
            return r
        n, t = self.force_normal, np.stack([-self.force_normal[1], self.force_normal[0]])
        vector = constraints.impulses(self.key, self.force[0] * n + self.force[1] * t, dt).reshape(-1, 2).T
        same_vector = np.stack(
            [np.einsum("ik,ik->k", a, vector) for a in (constraints.normal, constraints.tangent)], axis=1
        ).ravel()
        sticks = np.logical_and(
            *(sticking(constraints.lifted(a, dt), constraints.friction) for a in (r, same_vector))
        )
        return np.where(np.repeat(sticks, 2), same_vector, r)

    def solve(self, solver: Solver, gradient: Array) -> tuple[Array, Array]:
        """Newton direction and contact impulse, with impulses that satisfy the contact law on the linearised bulk.

        u = u(w) + H [A^-1 (theta H^T r - gradient)] + W (r_new - r).
        """
        constraints = self.constraints
        if constraints.size == 0:
            return -solver(gradient), self._contact_impulse()
        if self.delassus is None:
            reused = self.increment.material_response.linear and self.increment.scheme.anchor > 0.0
            reused &= solver.name != "amg"  # needs a solve per contact point: only for those in contact
            self.delassus = Delassus.of(solver, constraints.base, self._owners(constraints.base), whole=reused)
        geometric = None
        if self.frozen is None and not self.increment.scheme.explicit:  # contacts hardly rotate in an explicit step
            geometric = contact_stiffness(constraints, self.r, self.increment.dt, self.increment.scheme.theta)
        known_increment = constraints.at_contact_points(solver(self._contact_impulse() - gradient))
        self.timer.lap("linear")
        W, self.delassus = self._delassus_matrix(self.delassus, geometric)
        self.timer.lap("delassus")
        found = None if geometric is None else self._with_stiffness(solver, gradient, W, known_increment, geometric)
        if found is None:
            found = self._without_stiffness(solver, gradient, W, known_increment)
        self.key, self.force_normal = constraints.key, constraints.normal
        self.force = constraints.forces(self.r, self.increment.dt)
        self.timer.lap("linear")
        return found

    def _owners(self, base: sp.csr_array) -> Ints:
        """The bodies of the contact points, (m,); 0 for those of rigid bodies, which are not used."""
        owner = np.zeros(base.shape[0], dtype=np.int64)
        deformable = np.flatnonzero(np.diff(base.indptr))
        owner[deformable] = self.increment.grid.node_body[base.indices[base.indptr[deformable]]]
        return owner

    def _delassus_matrix(
        self, delassus: Delassus, geometric: ContactStiffness | None
    ) -> tuple[sp.csr_array, Delassus]:
        """W = theta H A^-1 H^T of the contacts, extended by the rows and columns of the geometric stiffness.

        Also returns the Delassus operator with the columns computed so far.
        """
        left = right = self.constraints.D
        if geometric is not None:
            left, right = (
                sp.csr_array(sp.vstack([left, rows], format="csr")) for rows in (geometric.Z, geometric.acting)
            )
        W, delassus = delassus.between(left, right)
        return self.increment.scheme.theta * W, delassus

    def _with_stiffness(
        self, solver: Solver, gradient: Array, W: sp.csr_array, known_increment: Array, geometric: ContactStiffness
    ) -> tuple[Array, Array] | None:
        """Direction and contact impulse with the geometric stiffness of contact; None if they are not usable.

        The geometric stiffness is indefinite. Where it cancels most of the quadratic form of A along the direction,
        the contacts are near a limit point (`contact_stiffness`) and the direction is far too long.
        """
        impulses = self._impulses(W, known_increment, geometric)
        if impulses is None:
            self.stiffness_failures += 1
            return None
        r, rho = impulses
        theta, constraints = self.increment.scheme.theta, self.constraints
        contact_impulse = theta * constraints.at_nodes(constraints.D.T @ r + geometric.acting.T @ rho)
        direction = solver(contact_impulse - gradient)
        softening = theta * float((geometric.Z @ constraints.at_contact_points(direction)) @ rho)
        largest = MAX_SOFTENING_FIRST if self.force_normal is None else MAX_SOFTENING
        if softening > largest * float(direction @ (contact_impulse - gradient)):
            return None
        self.r = geometric.rotated_impulses(r, rho) if constraints.tangential else r
        return direction, contact_impulse

    def _without_stiffness(
        self, solver: Solver, gradient: Array, W: sp.csr_array, known_increment: Array
    ) -> tuple[Array, Array]:
        """Direction and contact impulse without the geometric stiffness of contact."""
        impulses = self._impulses(W, known_increment, None)
        if impulses is None:
            raise StepRejected(
                pair(self.constraints.bodies[:, self.worst_contact]),
                f"the contact solver did not converge for {self.constraints.size} contacts:"
                f" residual {self.solver_residual:.2g} (tolerance {self.increment.scheme.contact_tol:g}) here",
            )
        self.r = impulses[0]
        contact_impulse = self._contact_impulse()
        return solver(contact_impulse - gradient), contact_impulse

    def _impulses(
        self, W: sp.csr_array, known_increment: Array, geometric: ContactStiffness | None
    ) -> tuple[Array, Array] | None:
        """The new impulses and those of the geometric stiffness; None if the contact solver does not converge.

        `known_increment` is the velocity increment of the contact points under the known impulses.
        """
        constraints, known, dt = self.constraints, self._lifted(), self.increment.dt
        contacts, k = W[: known.size, : known.size], known.size
        q, bilateral = self.u + constraints.D @ known_increment - contacts @ known, None
        if geometric is not None:
            p = geometric.Z @ known_increment - W[k:, :k] @ known
            bilateral = coulomb.Bilateral(W[k:, :k], W[k:, k:] + geometric.compliance, p, W[:k, k:])
        diagonal = contacts.diagonal()
        check_response(constraints, diagonal[:: 2 if constraints.tangential else 1], self.increment.supports)
        free = q + contacts @ (known - self.r) if constraints.cohesive else q
        round_off = self.speed_round_off / self.increment.scheme.gap_tol
        self.scale = contact_scale(constraints, diagonal, free, round_off, dt)
        tol, reference = self.increment.scheme.contact_tol, self.scale.reference
        options: dict[str, Any] = {} if bilateral is None else {"bilateral": bilateral, "iterations": MAX_STEPS}
        options |= {"tol": tol, "reference": reference, "damped": not self.increment.scheme.inertia}
        r, info = coulomb.solve(contacts, q, constraints.friction, r0=known, **options)
        self.iterations, self.solver_residual = self.iterations + info.iterations, info.residual
        self.timer.lap("contact")
        if not info.converged:
            residuals = coulomb.residuals(r, contacts @ r + q, constraints.friction, contacts.diagonal())
            self.worst_contact = int(np.argmax(residuals))
            return None
        return constraints.lowered(r, dt), info.bilateral

    def _contact_impulse(self) -> Array:
        return self.increment.scheme.theta * self.constraints.at_nodes(self.constraints.D.T @ self.r)

    def _residual(self) -> float:
        constraints, scale = self.constraints, self.scale
        if constraints.size == 0:
            return 0.0
        if scale is None:
            return float("inf")
        diagonal = scale.diagonal_of(constraints)
        return coulomb.residual(self._lifted(), self.u, constraints.friction, diagonal, reference=scale.reference)

    def _lifted(self) -> Array:
        """The impulses r + c l dt n, which obey the law without cohesion."""
        return self.constraints.lifted(self.r, self.increment.dt)
