"""The contacts of one step, from Newton iteration to Newton iteration."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm import coulomb
from skmpm.contact import Constraints, Linearise
from skmpm.contact.constraints import lookup
from skmpm.implicit.active_contacts import check_response, relevant
from skmpm.implicit.contact_stiffness import ContactStiffness, contact_stiffness, sticking
from skmpm.implicit.errors import NotConverged, pair
from skmpm.implicit.residual import Increment
from skmpm.linear import Delassus, Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


# Share of what A resists that turning may take along a direction, with the impulses of the last step or of this one.
SOFTENING_FIRST, SOFTENING_LIMIT = 0.5, 0.95
MAX_ITERATIONS_WITH_STIFFNESS = (
    12  # of the contact solver where contacts turn: it takes one to six, or one is about to snap and a hundred
)
REST_TOLERANCE = 5.0  # how far from rest, in what rounding does to it, counts as resting


@dataclass
class Timer:
    """Seconds by phase, for the report."""

    seconds: dict[str, float] = field(default_factory=dict)
    _since: float = field(default_factory=perf_counter)

    def lap(self, phase: str) -> None:
        """Credit the time since the last lap to `phase`."""
        now = perf_counter()
        self.seconds[phase] = self.seconds.get(phase, 0.0) + now - self._since
        self._since = now


@dataclass(frozen=True)
class Measure:
    """What residuals are relative to: that of the last contact solve."""

    key: Ints  # (k,)
    scale: Array  # (2, k) the diagonal of W, not zero
    reference: float  # size of the right-hand side where contacts close


@dataclass
class ContactProblem:
    """Contacts of a step: the current rows and impulses, and what the last solve left for the next.

    `rows`, `r`, `u` belong to the last `measure`d velocity, r being overwritten by `solve`.
    """

    linearise: Linearise
    increment: Increment
    key: Ints  # of the contacts whose forces are known
    force: Array  # (2, k) [N/m]
    timer: Timer
    prescribed_components: NDArray[np.bool_] = field(  # (2, n) of the points' velocities, by supports
        default_factory=lambda: np.zeros((2, 0), dtype=bool)
    )
    iterations: int = 0
    stopped: float = 0.0  # residual of the last solve
    worst: int = 0  # the contact with the largest part of it, where that found no solution
    rejected: int = 0  # solves without a solution, because loaded contacts turn
    constraints: Constraints = field(init=False)
    r: Array = field(init=False)
    u: Array = field(init=False)
    last: Measure | None = None
    delassus: Delassus | None = None  # by the solver in use: whoever makes another sets it to None
    frozen: Constraints | None = None  # rows whose normals are kept from now on
    present: Constraints = field(init=False)  # the rows with the normals of the last `measure`, settled or not
    normal: Array | None = None  # (2, k) along which the forces act, if this step found them

    @cached_property
    def noise(self) -> float:
        """What rounding of positions does to velocities of gaps [m/s]."""
        extent = float(np.abs(self.increment.grid.position).max(initial=0.0))
        return 4.0 * float(np.finfo(float).eps) * extent / self.increment.dt

    @property
    def round_off(self) -> float:
        """The size of the push that such gaps would make [kg/s]; none before the first solve."""
        if self.last is None or self.last.key.size == 0:
            return 0.0
        return REST_TOLERANCE * float(np.linalg.norm(self.noise / self.last.scale[0]))

    def measure(self, w: Array) -> tuple[Array, float]:
        """Linearise about w; the push theta H' r of the impulses known so far and the contact law's residual."""
        self.timer.lap("bulk")
        found = relevant(self.linearise(w), self.increment.grid, self.increment.supports, self.prescribed_components)
        self.constraints = self.present = found
        if self.frozen is not None and self.frozen.size:
            self.constraints = self.present.with_frames_of(self.frozen, w)
        self.r = self._known()
        self.u = self.constraints.D @ self.constraints.at_contact_points(w) + self.constraints.offset
        residual = self._residual()
        self.timer.lap("detection")
        return self._push(), residual

    def worst_pair(self) -> str:
        """The contact of the last `measure` with the largest residual, as text."""
        if self.last is None:
            return "contacts not solved yet"
        scale = self._scale(self.last)
        return pair(
            self.constraints.bodies[:, np.argmax(coulomb.residuals(self.r, self.u, self.constraints.friction, scale))]
        )

    def couples(self, w: Array) -> Array:
        """Moments of the forces on second bodies, (k,) [kg m/s m]: kept places are not where the surfaces are now."""
        if self.frozen is None or self.frozen.size == 0:
            return np.zeros(self.constraints.size)
        grid, (n, t) = self.increment.bulk.assembly.grid, (self.constraints.normal, self.constraints.tangent)
        x = grid.position.T + (self.increment.start + self.increment.dt * w).reshape(-1, 2)
        apart = ((self.constraints.difference - self.present.difference) @ (self.constraints.base @ x)).T
        r = self.constraints.forces(self.r, 1.0)
        force = r[0] * n + r[1] * t
        return np.asarray(apart[0] * force[1] - apart[1] * force[0])

    def _known(self) -> Array:
        """The impulses known so far on the current rows: as they stand in the frame, as vectors where they stick."""
        constraints, dt = self.constraints, self.increment.dt
        r = constraints.impulses(self.key, self.force, dt)
        if not constraints.tangential or self.normal is None:
            return r
        n, t = self.normal, np.stack([-self.normal[1], self.normal[0]])
        vector = constraints.impulses(self.key, self.force[0] * n + self.force[1] * t, dt).reshape(-1, 2).T
        turned = np.stack(
            [np.einsum("ik,ik->k", a, vector) for a in (constraints.normal, constraints.tangent)], axis=1
        ).ravel()
        sticks = sticking(r, constraints.friction) & sticking(turned, constraints.friction)
        return np.where(np.repeat(sticks, 2), turned, r)

    def solve(self, solver: Solver, gradient: Array) -> tuple[Array, Array]:
        """Newton direction and push of the new impulses, which obey the contact law on the linearised bulk.

        u = u(w) + H [A^-1 (push - gradient)] + W (r_new - r).
        """
        constraints = self.constraints
        if constraints.size == 0:
            return -solver(gradient), self._push()
        if self.delassus is None:
            lasts = self.increment.material_response.linear and self.increment.scheme.anchor > 0.0
            lasts &= solver.name != "amg"  # which is asked for as little as possible
            self.delassus = Delassus.of(solver, constraints.base, self._owners(constraints.base), whole=lasts)
        geometric = None
        if self.frozen is None and not self.increment.scheme.explicit:  # short steps, in which contacts hardly turn
            geometric = contact_stiffness(constraints, self.r, self.increment.dt, self.increment.scheme.theta)
        moved = constraints.at_contact_points(solver(self._push() - gradient))
        self.timer.lap("linear")
        W, self.delassus = self._compliance(self.delassus, geometric)
        self.timer.lap("compliance")
        found = None if geometric is None else self._with_stiffness(solver, gradient, W, moved, geometric)
        if found is None:
            found = self._without_stiffness(solver, gradient, W, moved)
        self.key, self.force, self.normal = (
            constraints.key,
            constraints.forces(self.r, self.increment.dt),
            constraints.normal,
        )
        self.timer.lap("linear")
        return found

    def _owners(self, base: sp.csr_array) -> Ints:
        """The bodies of the places, (m,); those of rigid bodies do not matter."""
        owner = np.zeros(base.shape[0], dtype=np.int64)
        moves = np.flatnonzero(np.diff(base.indptr))
        owner[moves] = self.increment.grid.node_body[base.indices[base.indptr[moves]]]
        return owner

    def _compliance(self, delassus: Delassus, geometric: ContactStiffness | None) -> tuple[sp.csr_array, Delassus]:
        """W = theta H A^-1 H' of the contacts, then of the rows that turn with those along which these act.

        Also returns the response as far as it is known then.
        """
        left = right = self.constraints.D
        if geometric is not None:
            left, right = (
                sp.csr_array(sp.vstack([left, constraints], format="csr"))
                for constraints in (geometric.Z, geometric.acting)
            )
        W, delassus = delassus.between(left, right)
        return self.increment.scheme.theta * W, delassus

    def _with_stiffness(
        self, solver: Solver, gradient: Array, W: sp.csr_array, moved: Array, geometric: ContactStiffness
    ) -> tuple[Array, Array] | None:
        """Direction and push where loaded contacts turn; None if there are none, or none that can be trusted.

        What turns is not definite. Where it takes most of what A resists along the direction, a contact is about to
        snap and the direction leads far away.
        """
        impulses = self._impulses(W, moved, geometric)
        if impulses is None:
            self.rejected += 1
            return None
        r, rho = impulses
        theta, constraints = self.increment.scheme.theta, self.constraints
        contact_impulse = theta * constraints.at_nodes(constraints.D.T @ r + geometric.acting.T @ rho)
        direction = solver(contact_impulse - gradient)
        softened = theta * float((geometric.Z @ constraints.at_contact_points(direction)) @ rho)
        if softened > (SOFTENING_FIRST if self.normal is None else SOFTENING_LIMIT) * float(
            direction @ (contact_impulse - gradient)
        ):
            return None
        self.r = geometric.rotated_impulses(r, rho) if constraints.tangential else r
        return direction, contact_impulse

    def _without_stiffness(
        self, solver: Solver, gradient: Array, W: sp.csr_array, moved: Array
    ) -> tuple[Array, Array]:
        """Direction and push where no contact turns."""
        impulses = self._impulses(W, moved, None)
        if impulses is None:
            raise NotConverged(
                pair(self.constraints.bodies[:, self.worst]),
                f"the contact solver stopped at a residual of {self.stopped:.2g} with {self.constraints.size}"
                f" contacts (wanted {self.increment.scheme.contact_tol:g}), most of it here",
            )
        self.r = impulses[0]
        contact_impulse = self._push()
        return solver(contact_impulse - gradient), contact_impulse

    def _impulses(
        self, W: sp.csr_array, moved: Array, geometric: ContactStiffness | None
    ) -> tuple[Array, Array] | None:
        """The new impulses and those by which loaded contacts turn; None where there is no solution.

        `moved` is how places would move on under the impulses known so far.
        """
        constraints, known = self.constraints, self.r
        k = known.size
        contacts = W[:k, :k]
        q, bilateral = self.u + constraints.D @ moved - contacts @ known, None
        if geometric is not None:
            rest = geometric.Z @ moved - W[k:, :k] @ known
            bilateral = coulomb.Bilateral(W[k:, :k], W[k:, k:] + geometric.compliance, rest, W[:k, k:])
        self.last = self._measure_by(contacts.diagonal(), q)
        tol, reference = self.increment.scheme.contact_tol, self.last.reference
        limit: dict[str, Any] = (
            {} if bilateral is None else {"bilateral": bilateral, "iterations": MAX_ITERATIONS_WITH_STIFFNESS}
        )
        r, info = coulomb.solve(contacts, q, constraints.friction, r0=known, tol=tol, reference=reference, **limit)
        self.iterations, self.stopped = self.iterations + info.iterations, info.residual
        self.timer.lap("contact")
        if not info.converged:
            self.worst = int(
                np.argmax(coulomb.residuals(r, contacts @ r + q, constraints.friction, contacts.diagonal()))
            )
            return None
        return r, info.bilateral

    def _measure_by(self, diagonal: Array, q: Array) -> Measure:
        """Residuals are relative to the size of q where contacts close, or to what rounding makes `gap_tol` of.

        Contacts that stay open do not count: how far they are says nothing of how large forces are. Nor does how fast
        contacts slide, beyond what friction can change of it: nothing where a support prescribes the sliding.

        Raises
        ------
        NotConverged
            where a contact closes at a point that supports hold against it
        """
        constraints, responds = self.constraints, diagonal.reshape(self.constraints.size, -1).T > 0.0
        check_response(constraints, diagonal[:: len(responds)], self.increment.supports)
        scaled = coulomb.row_scales(diagonal, constraints.size)
        responds[1:] &= (scaled == diagonal).reshape(constraints.size, -1).T[1:]
        scale = scaled.reshape(constraints.size, -1).T[[0, -1]]
        speed = np.abs(q).reshape(constraints.size, -1).T  # (1 or 2, k)
        closing = np.where(q[:: len(speed)] < 0.0, speed, 0.0)
        closing[1:] = np.minimum(closing[1:], constraints.friction * closing[0] * (scale[1] / scale[0]))
        size = np.maximum(closing, self.noise / self.increment.scheme.gap_tol) / np.sqrt(scale[: len(speed)])
        return Measure(constraints.key, scale, max(float(np.linalg.norm(np.where(responds, size, 0.0))), 1e-300))

    def _push(self) -> Array:
        return self.increment.scheme.theta * self.constraints.at_nodes(self.constraints.D.T @ self.r)

    def _residual(self) -> float:
        constraints, last = self.constraints, self.last
        if constraints.size == 0:
            return 0.0
        if last is None:
            return float("inf")
        return coulomb.residual(self.r, self.u, constraints.friction, self._scale(last), reference=last.reference)

    def _scale(self, last: Measure) -> Array:
        """The diagonal of W as far as the last solve knew it, typical values for contacts that it did not know."""
        typical = np.median(last.scale, axis=1)
        scale = np.stack([lookup(last.key, last.scale[i], self.constraints.key, float(typical[i])) for i in (0, 1)])
        return scale.T.ravel() if self.constraints.tangential else scale[0]
