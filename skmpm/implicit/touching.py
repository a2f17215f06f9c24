"""The contacts of one step, from Newton iteration to Newton iteration."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm import coulomb
from skmpm.contact import Linearise, Rows
from skmpm.contact.rows import lookup
from skmpm.implicit.increment import Increment
from skmpm.implicit.turning import Turning, loaded, sticking, turning
from skmpm.linear import Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


# Share of what A resists that turning may take along a direction, with the impulses of the last step or of this one.
SOFT, UNSTABLE = 0.5, 0.95


class NotConverged(RuntimeError):  # noqa: N818
    """The step's equations were not solved; the message says which."""


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
class Contrast:
    """What the last contact solve knew: its matrix and the measures of its residual."""

    solver: Solver | None  # that W was made with
    key: Ints  # (k,) of the rows W was made for
    turned: Ints  # (m,) those of them whose turning W knows
    W: sp.csr_array  # (k or 2 k + 2 m)^2
    scale: Array  # (2, k) the diagonal of its contacts
    reference: float = 1.0  # size of the right-hand side

    def knows(self, solver: Solver, key: Ints, turned: Ints) -> bool:
        """Whether W is that of these rows, among others."""
        same = self.solver is solver and np.array_equal(self.key, key)
        return same and bool(np.isin(turned, self.turned).all())


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
    iterations: int = 0
    stopped: float = 0.0  # residual of the last solve
    lost: int = 0  # solves without a solution, because loaded contacts turn
    rows: Rows = field(init=False)
    r: Array = field(init=False)
    u: Array = field(init=False)
    last: Contrast | None = None
    settled: Rows | None = None  # rows whose normals are kept from now on
    normal: Array | None = None  # (2, k) along which the forces act, if this step found them

    def measure(self, w: Array) -> tuple[Array, float]:
        """Linearise about w; the push theta H' r of the impulses known so far and the contact law's residual."""
        self.timer.lap("bulk")
        self.rows = self._movable(self.linearise(w))
        if self.settled is not None and self.settled.size:
            self.rows = self.rows.along(self.settled, w)
        self.r = self._known()
        self.u = self.rows.H @ w + self.rows.offset
        residual = self._residual()
        self.timer.lap("detection")
        return self._push(), residual

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

    def _movable(self, rows: Rows) -> Rows:
        """Contacts that can move: supports decide where points go that they hold, whatever touches these."""
        if self.step.supports is None or rows.size == 0:
            return rows
        normal = rows.H[:: 2 if rows.tangential else 1]
        return rows.among(abs(normal @ self.step.supports.T).sum(axis=1) > 1e-12)

    def solve(self, solver: Solver, gradient: Array, *, afresh: bool = False) -> tuple[Array, Array]:
        """Newton direction and push of the new impulses, which obey the contact law on the linearised bulk.

        u = u(w) + H [A^-1 (push - gradient)] + W (r_new - r): unless asked for afresh W is kept while solver and rows
        stay the same, although H turns a little: it multiplies a difference that vanishes with convergence.
        """
        if afresh and self.last is not None:
            self.last = replace(self.last, solver=None)
        if self.rows.size == 0:
            return -solver(gradient), self._push()
        turns = None if self.settled is not None else turning(self.rows, self.r, self.step.dt, self.step.scheme.theta)
        found = None if turns is None else self._turned(solver, gradient, turns)
        if found is None:
            found = self._straight(solver, gradient)
        self.key, self.force, self.normal = self.rows.key, self.rows.forces(self.r, self.step.dt), self.rows.normal
        self.timer.lap("linear")
        return found

    def _turned(self, solver: Solver, gradient: Array, turns: Turning) -> tuple[Array, Array] | None:
        """Direction and push where loaded contacts turn; None if there are none, or none that can be trusted.

        What turns is not definite. Where it takes most of what A resists along the direction, a contact is about to
        snap and the direction leads far away.
        """
        impulses = self._impulses(solver, gradient, turns)
        if impulses is None:
            self.lost += 1
            return None
        r, rho = impulses
        theta = self.step.scheme.theta
        push = theta * (self.rows.H.T @ r + turns.pushed.T @ rho)
        direction = solver(push - gradient)
        softened = theta * float((turns.Z @ direction) @ rho)
        if softened > (SOFT if self.normal is None else UNSTABLE) * float(direction @ (push - gradient)):
            return None
        self.r = turns.settled(r, rho) if self.rows.tangential else r
        return direction, push

    def _straight(self, solver: Solver, gradient: Array) -> tuple[Array, Array]:
        """Direction and push where no contact turns."""
        impulses = self._impulses(solver, gradient, None)
        if impulses is None:
            raise NotConverged(
                f"the contact solver stopped at a residual of {self.stopped:.2g} with {self.rows.size} contacts"
                f" (wanted {self.step.scheme.contact_tol:g}); use a smaller dt"
            )
        self.r = impulses[0]
        push = self._push()
        return solver(push - gradient), push

    def _impulses(self, solver: Solver, gradient: Array, turns: Turning | None) -> tuple[Array, Array] | None:
        """The new impulses and those by which loaded contacts turn; None where there is no solution."""
        rows, known = self.rows, self.r
        moved = solver(self._push() - gradient)
        self.timer.lap("linear")
        W, k = self._compliance(solver, turns), known.size
        q, linear = self.u + rows.H @ moved - W[:k, :k] @ known, None
        if turns is not None:
            rest = turns.Z @ moved - W[k:, :k] @ known
            linear = coulomb.Linear(W[k:, :k], W[k:, k:] + turns.compliance, rest, W[:k, k:])
        self._measure_by(q)
        tol = self.step.scheme.contact_tol
        r, info = coulomb.solve(W[:k, :k], q, rows.friction, r0=known, tol=tol, linear=linear)
        self.iterations, self.stopped = self.iterations + info.iterations, info.residual
        self.timer.lap("contact")
        if not info.converged:
            return None
        return r, info.linear

    def _compliance(self, solver: Solver, turns: Turning | None) -> sp.csr_array:
        """W = theta H A^-1 H' of the contacts, and of the rows that turn with those along which these act."""
        rows, none = self.rows, np.zeros(0, dtype=np.int64)
        turned = none if turns is None else turns.contacts
        if self.last is None or not self.last.knows(solver, rows.key, turned):
            self.last = self._contrast(solver, none if turns is None else np.union1d(turned, loaded(rows, self.r)))
        k, W, known = rows.H.shape[0], self.last.W, self.last.turned
        if known.size == 0:
            return W
        place = np.searchsorted(known, turned)
        # With friction the rows of sliding are there already.
        added = (2 * turned + 1, k + place) if rows.tangential else (k + place, k + known.size + place)
        chosen = np.concatenate([np.arange(k), *added])
        whole = W[chosen][:, chosen]
        if turns is not None and rows.tangential:
            stretch = (turns.slope, (k + known.size + place, k + turned.size + np.arange(turned.size)))
            whole = whole + W[chosen] @ sp.csr_array(stretch, shape=(W.shape[0], chosen.size))
        return sp.csr_array(whole)

    def _contrast(self, solver: Solver, turned: Ints) -> Contrast:
        """W with the rows of all contacts that may turn."""
        rows = self.rows
        extended = [rows.H]
        if turned.size:
            slide, turn, stretch = rows.turned(turned)
            extended += [turn, stretch] if rows.tangential else [slide, turn]
        W = sp.csr_array(self.step.scheme.theta * solver.compliance(sp.csr_array(sp.vstack(extended))))
        diagonal = W.diagonal()[: rows.H.shape[0]]
        scale = diagonal.reshape(-1, 2).T if rows.tangential else np.stack([diagonal, diagonal])
        self.timer.lap("compliance")
        return Contrast(solver, rows.key, turned, W, scale)

    def _measure_by(self, q: Array) -> None:
        """Make residuals relative to the size of q."""
        if self.last is None:
            return
        scale = self.last.scale.T.ravel() if self.rows.tangential else self.last.scale[0]
        size = float(np.linalg.norm(q / np.sqrt(np.maximum(scale, 1e-300))))
        self.last = replace(self.last, reference=max(size, 1e-300))

    def _push(self) -> Array:
        return np.asarray(self.step.scheme.theta * (self.rows.H.T @ self.r))

    def _residual(self) -> float:
        rows, last = self.rows, self.last
        if rows.size == 0:
            return 0.0
        if last is None:
            return float("inf")
        typical = np.median(last.scale, axis=1)
        scale = np.stack([lookup(last.key, last.scale[i], rows.key, float(typical[i])) for i in (0, 1)])
        flat = scale.T.ravel() if rows.tangential else scale[0]
        return coulomb.residual(self.r, self.u, rows.friction, flat, reference=last.reference)
