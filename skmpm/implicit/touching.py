"""The contacts of one step, from Newton iteration to Newton iteration."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm import coulomb
from skmpm.contact import Linearise, Rows
from skmpm.contact.rows import lookup
from skmpm.implicit.increment import Increment
from skmpm.linear import Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


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

    solver: Solver
    key: Ints  # (k,) of the rows W was made for
    W: sp.csr_array  # (k, k) or (2 k, 2 k)
    scale: Array  # (2, k) its diagonal
    reference: float = 1.0  # size of the right-hand side


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
    rows: Rows = field(init=False)
    r: Array = field(init=False)
    u: Array = field(init=False)
    last: Contrast | None = None
    settled: Rows | None = None  # rows whose normals are kept from now on

    def measure(self, w: Array) -> tuple[Array, float]:
        """Linearise about w; the push theta H' r of the impulses known so far and the contact law's residual."""
        self.timer.lap("bulk")
        self.rows = self._movable(self.linearise(w))
        if self.settled is not None and self.settled.size:
            self.rows = self.rows.along(self.settled, w)
        self.r = self.rows.impulses(self.key, self.force, self.step.dt)
        self.u = self.rows.H @ w + self.rows.offset
        residual = self._residual()
        self.timer.lap("detection")
        return self._push(), residual

    def _movable(self, rows: Rows) -> Rows:
        """Contacts that can move: supports decide where points go that they hold, whatever touches these."""
        if self.step.supports is None or rows.size == 0:
            return rows
        normal = rows.H[:: 2 if rows.tangential else 1]
        return rows.among(abs(normal @ self.step.supports.T).sum(axis=1) > 1e-12)

    def solve(self, solver: Solver, gradient: Array) -> tuple[Array, Array]:
        """Newton direction and push of the new impulses, which obey the contact law on the linearised bulk.

        u = u(w) + H [A^-1 (push - gradient)] + W (r_new - r): as long as solver and rows stay the same W is kept,
        although H turns a little, because it multiplies a difference that vanishes with convergence.
        """
        rows, known = self.rows, self.r
        if rows.size == 0:
            return -solver(gradient), self._push()
        moved = solver(self._push() - gradient)
        self.timer.lap("linear")
        W = self._compliance(solver)
        q = self.u + rows.H @ moved - W @ known
        self.r, info = coulomb.solve(W, q, rows.friction, r0=known, tol=self.step.scheme.contact_tol)
        self.iterations += info.iterations
        self.timer.lap("contact")
        if not info.converged:
            raise NotConverged(
                f"the contact solver stopped at a residual of {info.residual:.2g} with {rows.size} contacts"
                f" (wanted {self.step.scheme.contact_tol:g}); use a smaller dt"
            )
        diagonal = W.diagonal()
        scale = diagonal.reshape(-1, 2).T if rows.tangential else np.stack([diagonal, diagonal])
        size = float(np.linalg.norm(q / np.sqrt(np.maximum(diagonal, 1e-300))))
        self.last = Contrast(solver, rows.key, W, scale, max(size, 1e-300))
        self.key, self.force = rows.key, rows.forces(self.r, self.step.dt)
        push = self._push()
        direction = solver(push - gradient)
        self.timer.lap("linear")
        return direction, push

    def _compliance(self, solver: Solver) -> sp.csr_array:
        last = self.last
        same = last is not None and last.solver is solver and np.array_equal(last.key, self.rows.key)
        if last is not None and same and last.W.shape[0] == self.rows.H.shape[0]:
            return last.W
        W = sp.csr_array(self.step.scheme.theta * solver.compliance(self.rows.H))
        self.timer.lap("compliance")
        return W

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
