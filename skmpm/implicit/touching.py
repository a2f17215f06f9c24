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
from skmpm.contact import Linearise, Rows
from skmpm.contact.rows import lookup
from skmpm.implicit.failure import NotConverged, pair
from skmpm.implicit.increment import Increment
from skmpm.implicit.relevant import check_response, relevant
from skmpm.implicit.turning import Turning, sticking, turning
from skmpm.linear import Response, Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


# Share of what A resists that turning may take along a direction, with the impulses of the last step or of this one.
SOFT, UNSTABLE = 0.5, 0.95
PATIENCE = 12  # of the contact solver where contacts turn: it takes one to six, or one is about to snap and a hundred
ROUNDING = 5.0  # how far from rest, in what rounding does to it, counts as resting


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
class Touching:
    """Contacts of a step: the current rows and impulses, and what the last solve left for the next.

    `rows`, `r`, `u` belong to the last `measure`d velocity, r being overwritten by `solve`.
    """

    linearise: Linearise
    step: Increment
    key: Ints  # of the contacts whose forces are known
    force: Array  # (2, k) [N/m]
    timer: Timer
    held: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((2, 0), dtype=bool))  # (2, n) by supports
    iterations: int = 0
    stopped: float = 0.0  # residual of the last solve
    worst: int = 0  # the contact with the largest part of it, where that found no solution
    lost: int = 0  # solves without a solution, because loaded contacts turn
    rows: Rows = field(init=False)
    r: Array = field(init=False)
    u: Array = field(init=False)
    last: Measure | None = None
    response: Response | None = None  # for the last solver
    settled: Rows | None = None  # rows whose normals are kept from now on
    normal: Array | None = None  # (2, k) along which the forces act, if this step found them

    @cached_property
    def noise(self) -> float:
        """What rounding of positions does to velocities of gaps [m/s]."""
        extent = float(np.abs(self.step.bulk.assembly.sheets.position).max(initial=0.0))
        return 4.0 * float(np.finfo(float).eps) * extent / self.step.dt

    @property
    def round_off(self) -> float:
        """The size of the push that such gaps would make [kg/s]; none before the first solve."""
        if self.last is None or self.last.key.size == 0:
            return 0.0
        return ROUNDING * float(np.linalg.norm(self.noise / self.last.scale[0]))

    def measure(self, w: Array) -> tuple[Array, float]:
        """Linearise about w; the push theta H' r of the impulses known so far and the contact law's residual."""
        self.timer.lap("bulk")
        sheets = self.step.bulk.assembly.sheets
        self.rows = relevant(self.linearise(w), sheets, self.step.supports, self.held)
        if self.settled is not None and self.settled.size:
            self.rows = self.rows.along(self.settled, w)
        self.r = self._known()
        self.u = self.rows.D @ self.rows.at_places(w) + self.rows.offset
        residual = self._residual()
        self.timer.lap("detection")
        return self._push(), residual

    def worst_pair(self) -> str:
        """The contact of the last `measure` with the largest residual, as text."""
        if self.last is None:
            return "contacts not solved yet"
        scale = self._scale(self.last)
        return pair(self.rows.bodies[:, np.argmax(coulomb.residuals(self.r, self.u, self.rows.friction, scale))])

    def _known(self) -> Array:
        """The impulses known so far on the current rows: as they stand in the frame, as vectors where they stick."""
        rows, dt = self.rows, self.step.dt
        r = rows.impulses(self.key, self.force, dt)
        if not rows.tangential or self.normal is None:
            return r
        n, t = self.normal, np.stack([-self.normal[1], self.normal[0]])
        vector = rows.impulses(self.key, self.force[0] * n + self.force[1] * t, dt).reshape(-1, 2).T
        turned = np.stack([np.einsum("ik,ik->k", a, vector) for a in (rows.normal, rows.tangent)], axis=1).ravel()
        sticks = sticking(r, rows.friction) & sticking(turned, rows.friction)
        return np.where(np.repeat(sticks, 2), turned, r)

    def solve(self, solver: Solver, gradient: Array) -> tuple[Array, Array]:
        """Newton direction and push of the new impulses, which obey the contact law on the linearised bulk.

        u = u(w) + H [A^-1 (push - gradient)] + W (r_new - r).
        """
        rows = self.rows
        if rows.size == 0:
            return -solver(gradient), self._push()
        if self.response is None or self.response.solver is not solver:
            lasts = self.step.answer.linear and self.step.scheme.anchor > 0.0
            lasts &= solver.name != "amg"  # which is asked for as little as possible
            self.response = Response(solver, rows.base, self._owners(rows.base), whole=lasts)
        turns = None
        if self.settled is None and not self.step.scheme.explicit:  # short steps, in which contacts hardly turn
            turns = turning(rows, self.r, self.step.dt, self.step.scheme.theta)
        moved = rows.at_places(solver(self._push() - gradient))
        self.timer.lap("linear")
        W = self._compliance(self.response, turns)
        self.timer.lap("compliance")
        found = None if turns is None else self._turned(solver, gradient, W, moved, turns)
        if found is None:
            found = self._straight(solver, gradient, W, moved)
        self.key, self.force, self.normal = rows.key, rows.forces(self.r, self.step.dt), rows.normal
        self.timer.lap("linear")
        return found

    def _owners(self, base: sp.csr_array) -> Ints:
        """The bodies of the places, (m,); those of rigid bodies do not matter."""
        owner = np.zeros(base.shape[0], dtype=np.int64)
        moves = np.flatnonzero(np.diff(base.indptr))
        owner[moves] = self.step.bulk.assembly.sheets.node_body[base.indices[base.indptr[moves]]]
        return owner

    def _compliance(self, response: Response, turns: Turning | None) -> sp.csr_array:
        """W = theta H A^-1 H' of the contacts, then of the rows that turn with those along which these act."""
        D, theta = self.rows.D, self.step.scheme.theta
        if turns is None:
            return theta * response.between(D, D)
        left, right = (sp.csr_array(sp.vstack([D, rows], format="csr")) for rows in (turns.Z, turns.pushed))
        return theta * response.between(left, right)

    def _turned(
        self, solver: Solver, gradient: Array, W: sp.csr_array, moved: Array, turns: Turning
    ) -> tuple[Array, Array] | None:
        """Direction and push where loaded contacts turn; None if there are none, or none that can be trusted.

        What turns is not definite. Where it takes most of what A resists along the direction, a contact is about to
        snap and the direction leads far away.
        """
        impulses = self._impulses(W, moved, turns)
        if impulses is None:
            self.lost += 1
            return None
        r, rho = impulses
        theta, rows = self.step.scheme.theta, self.rows
        push = theta * rows.at_nodes(rows.D.T @ r + turns.pushed.T @ rho)
        direction = solver(push - gradient)
        softened = theta * float((turns.Z @ rows.at_places(direction)) @ rho)
        if softened > (SOFT if self.normal is None else UNSTABLE) * float(direction @ (push - gradient)):
            return None
        self.r = turns.settled(r, rho) if rows.tangential else r
        return direction, push

    def _straight(self, solver: Solver, gradient: Array, W: sp.csr_array, moved: Array) -> tuple[Array, Array]:
        """Direction and push where no contact turns."""
        impulses = self._impulses(W, moved, None)
        if impulses is None:
            raise NotConverged(
                pair(self.rows.bodies[:, self.worst]),
                f"the contact solver stopped at a residual of {self.stopped:.2g} with {self.rows.size} contacts"
                f" (wanted {self.step.scheme.contact_tol:g}), most of it here",
            )
        self.r = impulses[0]
        push = self._push()
        return solver(push - gradient), push

    def _impulses(self, W: sp.csr_array, moved: Array, turns: Turning | None) -> tuple[Array, Array] | None:
        """The new impulses and those by which loaded contacts turn; None where there is no solution.

        `moved` is how places would move on under the impulses known so far.
        """
        rows, known = self.rows, self.r
        k = known.size
        contacts = W[:k, :k]
        q, linear = self.u + rows.D @ moved - contacts @ known, None
        if turns is not None:
            rest = turns.Z @ moved - W[k:, :k] @ known
            linear = coulomb.Linear(W[k:, :k], W[k:, k:] + turns.compliance, rest, W[:k, k:])
        self.last = self._measure_by(contacts.diagonal(), q)
        tol, reference = self.step.scheme.contact_tol, self.last.reference
        limit: dict[str, Any] = {} if linear is None else {"linear": linear, "iterations": PATIENCE}
        r, info = coulomb.solve(contacts, q, rows.friction, r0=known, tol=tol, reference=reference, **limit)
        self.iterations, self.stopped = self.iterations + info.iterations, info.residual
        self.timer.lap("contact")
        if not info.converged:
            self.worst = int(np.argmax(coulomb.residuals(r, contacts @ r + q, rows.friction, contacts.diagonal())))
            return None
        return r, info.linear

    def _measure_by(self, diagonal: Array, q: Array) -> Measure:
        """Residuals are relative to the size of q where contacts close, or to what rounding makes `gap_tol` of.

        Contacts that stay open do not count: how far they are says nothing of how large forces are. Nor does how fast
        contacts slide, beyond what friction can change of it: nothing where a support prescribes the sliding.

        Raises
        ------
        NotConverged
            where a contact closes at a point that supports hold against it
        """
        rows, responds = self.rows, diagonal.reshape(self.rows.size, -1).T > 0.0
        check_response(rows, diagonal[:: len(responds)], self.step.supports)
        scaled = coulomb.row_scales(diagonal, rows.size)
        responds[1:] &= (scaled == diagonal).reshape(rows.size, -1).T[1:]
        scale = scaled.reshape(rows.size, -1).T[[0, -1]]
        speed = np.abs(q).reshape(rows.size, -1).T  # (1 or 2, k)
        closing = np.where(q[:: len(speed)] < 0.0, speed, 0.0)
        closing[1:] = np.minimum(closing[1:], rows.friction * closing[0] * (scale[1] / scale[0]))
        size = np.maximum(closing, self.noise / self.step.scheme.gap_tol) / np.sqrt(scale[: len(speed)])
        return Measure(rows.key, scale, max(float(np.linalg.norm(np.where(responds, size, 0.0))), 1e-300))

    def _push(self) -> Array:
        return self.step.scheme.theta * self.rows.at_nodes(self.rows.D.T @ self.r)

    def _residual(self) -> float:
        rows, last = self.rows, self.last
        if rows.size == 0:
            return 0.0
        if last is None:
            return float("inf")
        return coulomb.residual(self.r, self.u, rows.friction, self._scale(last), reference=last.reference)

    def _scale(self, last: Measure) -> Array:
        """The diagonal of W as far as the last solve knew it, typical values for contacts that it did not know."""
        typical = np.median(last.scale, axis=1)
        scale = np.stack([lookup(last.key, last.scale[i], self.rows.key, float(typical[i])) for i in (0, 1)])
        return scale.T.ravel() if self.rows.tangential else scale[0]
