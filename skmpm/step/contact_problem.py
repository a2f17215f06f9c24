"""The contact problem of a step: constraints, impulses and Delassus operator at an iterate.

Contacts enter it that may close and whose gap can change: the candidates.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from skmpm import coulomb
from skmpm.arrays import EXACT, ROUND_OFF, Array, Bools, Ints
from skmpm.contact import Constraints, Linearise
from skmpm.grid import BodyGrids
from skmpm.grid.supports import Elimination
from skmpm.scene import PrescribedVelocities
from skmpm.scene.report import Timer
from skmpm.step.contact_scale import ContactScale
from skmpm.step.contact_stiffness import ScalarMotion, sticking
from skmpm.step.equations import Increment
from skmpm.step.errors import StepRejected, of_contact, pair
from skmpm.step.scalar_unknowns import moved_by_scalars

# [cells] Largest gap of a candidate contact. Candidates are selected in every iteration: a contact that an iteration
# closes from a larger gap is one in the next. Twice of it gives packings of 300 discs 1.1 to 1.35 times as many rows;
# they take as many iterations with twice and with half of it (test_punch).
MAX_CANDIDATE_GAP = 0.08
# [cells] Largest penetration of a supported point, a fifth of what is accepted at walls (test_supports).
MAX_SUPPORTED_PENETRATION = 0.01
BOTH_SUPPORTED, GIVE_NO_SUPPORT = "they press on each other where supports hold both", "give these points no Support"


def _movable(constraints: Constraints, grid: BodyGrids, supports: Elimination, supported: Bools) -> Bools:
    """Whether nodes move contacts along their normals, (k,): supports or rigid bodies may prescribe both sides."""
    normal = constraints.H[:: 2 if constraints.tangential else 1]
    free = abs(normal @ supports.T).sum(axis=1) > EXACT
    rigid = (constraints.bodies[1] < 0) | (np.diff(grid.blocks)[np.maximum(constraints.bodies[1], 0)] == 0)
    prescribed = (supported[:, constraints.point] | (np.abs(constraints.normal) < ROUND_OFF)).all(axis=0)
    return np.asarray(free & ~(rigid & prescribed & (constraints.point >= 0)))


def check_response(constraints: Constraints, normal: Array, supports: Elimination | None) -> None:
    """Raise StepRejected if a contact cannot respond along its normal; `normal` (k,) are entries of diag W [1/kg]."""
    if supports is None:
        return
    stiffest = int(np.argmin(normal))
    if not normal[stiffest] > EXACT * float(np.median(normal)):
        raise StepRejected(pair(constraints.bodies[:, stiffest]), BOTH_SUPPORTED, GIVE_NO_SUPPORT, retryable=False)


@dataclass(frozen=True)
class KnownForces:
    """Contact forces of the previous step, or of the last contact solve in this one."""

    key: Ints  # (k,) contacts
    force: Array  # (2, k) normal and tangential [N/m]
    normal: Array | None = None  # (2, k) of the surfaces, if the forces were found in this step
    scale: ContactScale | None = None  # of residuals, if there was a contact solve in this step

    def on(self, constraints: Constraints, dt: float) -> Array:
        """The known impulses on other constraints: contacts that stick keep the vector, others its components.

        Components are those along the normal and the tangent, which change with the contact geometry.
        """
        r = constraints.impulses(self.key, self.force, dt)
        if not constraints.tangential or self.normal is None:
            return r
        n, t = self.normal, np.stack([-self.normal[1], self.normal[0]])
        vector = constraints.impulses(self.key, self.force[0] * n + self.force[1] * t, dt).reshape(-1, 2).T
        same_vector = np.stack(
            [np.einsum("ik,ik->k", a, vector) for a in (constraints.normal, constraints.tangent)], axis=1
        ).ravel()
        sticks = np.logical_and(
            *(sticking(constraints.lifted(a, dt), constraints.friction) for a in (r, same_vector))
        )
        return np.where(np.repeat(sticks, 2), same_vector, r)


@dataclass(frozen=True)
class ContactProblem:
    """What the contact problems of all iterations of a step have in common, and what they know of the last solve."""

    linearise: Linearise
    increment: Increment
    prescribed: PrescribedVelocities
    known: KnownForces  # of the last contact solve; at first of the step before, or of the static solve before
    timer: Timer
    supported: Bools  # (2, n) velocity components of the points that supports prescribe

    def within(self, increment: Increment) -> ContactProblem:
        """The problem with other equations of the step."""
        return replace(self, increment=increment)

    def after(self, contact: ContactIterate) -> ContactProblem:
        """The problem of a solve that follows another one in the same step."""
        force = contact.constraints.forces(contact.r, self.increment.dt)
        return replace(self, known=KnownForces(contact.constraints.key, force))

    def active_at(self, moving: Array) -> Constraints:
        """The constraints about a velocity (n,) that get rows: those that may close and whose gap can change.

        May close what has a gap below `MAX_CANDIDATE_GAP`, or is in tension.

        Raises
        ------
        StepRejected
            if a point that cannot move penetrates what it touches
        """
        increment, unknowns = self.increment, self.increment.scalars
        nodes, z = increment.on_nodes(moving), increment.of_scalars(moving)
        moved = (unknowns.motions(self.prescribed, z),) if unknowns.kinds else ()
        constraints, grid = self.linearise(nodes, *moved), increment.grid
        if constraints.size == 0:
            return constraints
        near = constraints.gap < MAX_CANDIDATE_GAP * grid.cell
        constraints = constraints.among(near | (constraints.tensile_strength > 0.0))
        if increment.supports is None or constraints.size == 0:
            return constraints
        movable = _movable(constraints, grid, increment.supports, self.supported)
        movable |= moved_by_scalars(unknowns.rows(z, constraints, [constraints.normal]))
        penetrating = np.flatnonzero(~movable & (constraints.gap < -MAX_SUPPORTED_PENETRATION * grid.cell))
        if penetrating.size:
            bodies = constraints.bodies[:, penetrating[0]]
            raise StepRejected(pair(bodies), BOTH_SUPPORTED, GIVE_NO_SUPPORT, retryable=False)
        return constraints.among(movable)

    @cached_property
    def speed_round_off(self) -> float:
        """Round-off of gap velocities that comes from positions [m/s]."""
        grid = self.increment.grid
        extent = grid.cell * float(np.abs(grid.node_index).max(initial=0))
        return 4.0 * float(np.finfo(float).eps) * extent / self.increment.dt

    def at(self, w: Array) -> ContactIterate:
        """The contact problem linearised about the velocity w (n,), with the known impulses."""
        self.timer.lap("bulk")
        increment, r, u = self.increment, np.zeros(0), np.zeros(0)
        J = sp.csr_array((0, increment.of_scalars(w).size))
        moving = increment.with_box_motion(w, w)
        constraints = self.active_at(moving)
        if constraints.size > 0:
            r = self.known.on(constraints, increment.dt)
            u = constraints.D @ constraints.at_contact_points(increment.on_nodes(moving)) + constraints.offset
            J = increment.scalars.rows(increment.of_scalars(moving), constraints, constraints.directions)
        self.timer.lap("detection")
        return ContactIterate(self, constraints, r, u, moving, J)


@dataclass(frozen=True)
class ContactIterate:
    """The contact problem linearised about a velocity w, with impulses: the known ones, or those of a solve at w."""

    problem: ContactProblem
    constraints: Constraints
    r: Array  # impulses (k,) or (2 k,) [kg m/s per m]
    u: Array  # relative velocities at w, with gaps over dt
    moving: Array  # w with what a periodic box adds, (n,) [m/s]
    J: sp.csr_array  # the columns of H for the scalar unknowns, (rows of H, p)
    iterations: int = 0  # of the contact solver in this step

    @property
    def increment(self) -> Increment:
        """The equations of the step without contact."""
        return self.problem.increment

    @property
    def scalar_motion(self) -> ScalarMotion | None:
        """The motion of surfaces by the scalar unknowns; None where there are none."""
        constraints, scalars, z = self.constraints, self.increment.scalars, self.increment.of_scalars(self.moving)
        if not scalars.kinds:
            return None
        first, second = (scalars.spins(constraints, side) for side in range(2))
        virial, rates = scalars.turning(z, constraints, constraints.vectors(self.r))
        return ScalarMotion(scalars.rows(z, constraints, [constraints.tangent]), (first, second), virial, rates)

    @cached_property
    def impulse(self) -> Array:
        """The contact impulse theta H^T r, (n,) [kg m/s per m]."""
        if self.constraints.size == 0:
            return np.zeros_like(self.moving)
        return self.pushed(self.r)

    def pushed(self, r: Array, at_points: Array | float = 0.0, of_scalars: Array | float = 0.0) -> Array:
        """The impulse theta H^T r of impulses r, with others at contact points (2 m,) and scalars (p,), (n,)."""
        nodes = self.constraints.at_nodes(self.constraints.D.T @ r + at_points)
        return self.increment.theta * self.increment.with_scalars(nodes, self.J.T @ r + of_scalars)

    def relative(self, at_points: Array, w: Array) -> Array:
        """Relative velocities H w of contact points that move at (2 m,), with the scalars of w (n,), rows of H."""
        return np.asarray(self.constraints.D @ at_points + self.J @ self.increment.of_scalars(w))

    @property
    def lifted(self) -> Array:
        """The impulses r + c l dt n, which obey the law without cohesion."""
        return self.constraints.lifted(self.r, self.increment.dt)

    @cached_property
    def residual(self) -> float:
        """Relative residual of the contact law; infinite before the first contact solve of the step."""
        constraints, scale = self.constraints, self.problem.known.scale
        if constraints.size == 0:
            return 0.0
        if scale is None:
            return float("inf")
        diagonal = scale.diagonal_of(constraints)
        return coulomb.residual(self.lifted, self.u, constraints.friction, diagonal, reference=scale.reference)

    @property
    def impulse_round_off(self) -> float:
        """Size of the contact impulse of round-off in gap velocities [kg m/s per m]; zero before the first solve."""
        scale = self.problem.known.scale
        if scale is None or scale.key.size == 0:
            return 0.0
        return float(np.linalg.norm(self.problem.speed_round_off / scale.diagonal[0]))

    def worst_pair(self) -> str:
        """The pair of bodies with the largest contact residual, as text."""
        scale = self.problem.known.scale
        if scale is None:
            return "contacts not solved yet"
        diagonal = scale.diagonal_of(self.constraints)
        residuals = coulomb.residuals(self.lifted, self.u, self.constraints.friction, diagonal)
        return of_contact(self.constraints, int(np.argmax(residuals)), self.increment.grid.cell)

    def at(self, w: Array) -> ContactIterate:
        """The contact problem linearised about another velocity."""
        return replace(self.problem.at(w), iterations=self.iterations)
