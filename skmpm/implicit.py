"""One implicit step of all bodies: Newton on the incremental potential, contact solved exactly in every iteration.

The unknown w (2 nodes,) is the velocity that moves the points, w = theta v1 + (1 - theta) v0. Without contact it
minimises

    E(w) = 1/2 |w - w*|_M^2 + sum_p V_p W(I + grad(U + theta dt w)) + 1/2 |U + theta dt w|_G^2

over nodal velocities: M lumped mass, w* the velocity that free flight would reach, U the displacement since
anchoring, W the material's energy, G the ghost penalty. With contact, grad E = theta H' r and (r, u = H w + offset)
obey Signorini's and Coulomb's laws.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm import coulomb
from skmpm.assembly import Assembly
from skmpm.contact import Linearise, Rows
from skmpm.contact.rows import lookup
from skmpm.linear import Solver
from skmpm.material import Elastic
from skmpm.scheme import Scheme

Array = NDArray[np.float64]


class NotConverged(RuntimeError):  # noqa: N818
    """The step's equations were not solved; the message says which."""


@dataclass(frozen=True)
class Configuration:
    """The bodies at some nodal displacement."""

    displacement: Array  # (2 nodes,) since anchoring [m]
    F: Array  # (2, 2, n) since anchoring


@dataclass(frozen=True)
class Bulk:
    """The bodies with unknowns, anchored: their energy and its derivatives at any displacement."""

    assembly: Assembly
    materials: Sequence[tuple[Elastic, NDArray[np.int64] | slice]]  # each with its points
    F_anchor: Array | None  # (2, 2, n), None where undeformed
    stress_anchor: Array | None  # (2, 2, n) [Pa], None where unstressed

    @property
    def linear(self) -> bool:
        """Whether all materials are linear."""
        return all(material.linear for material, _ in self.materials)

    def at(self, displacement: Array) -> Configuration:
        """The configuration at a nodal displacement since anchoring (2 nodes,) [m]."""
        F = self.assembly.sheets.gradient_at_points(displacement)
        F[0, 0] += 1.0
        F[1, 1] += 1.0
        return Configuration(displacement, F)

    def _evaluate(self, method: str, F: Array, **options: bool) -> Array:
        """Energy, stress, tangent or Cauchy stress of every point by its own material."""
        if len(self.materials) == 1:
            return np.asarray(getattr(self.materials[0][0], method)(F, self.F_anchor, self.stress_anchor, **options))
        parts = []
        for material, points in self.materials:
            anchor = [None if a is None else a[..., points] for a in (self.F_anchor, self.stress_anchor)]
            parts.append(getattr(material, method)(F[..., points], *anchor, **options))
        out = np.empty((*parts[0].shape[:-1], F.shape[-1]))
        for part, (_, points) in zip(parts, self.materials, strict=True):
            out[..., points] = part
        return out

    def energy(self, at: Configuration) -> float:
        """Strain energy and ghost penalty [J/m]; inf where a point is turned inside out."""
        density = self._evaluate("energy", at.F)
        if not np.isfinite(density).all():
            return float("inf")
        ghost = 0.5 * at.displacement @ self.assembly.ghost_force(at.displacement)
        return float(self.assembly.volume @ density + ghost)

    def force(self, at: Configuration) -> Array:
        """Internal and ghost forces, the derivative of `energy`, (2 nodes,) [N/m]."""
        P = self._evaluate("stress", at.F)
        return self.assembly.internal_force(P) + self.assembly.ghost_force(at.displacement)

    def stiffness(self, at: Configuration, *, projected: bool) -> Array:
        """Stiffness in the pattern of A, positive semi-definite where `projected`, (blocks, 2, 2) [Pa]."""
        return self.assembly.stiffness(self._evaluate("tangent", at.F, projected=projected))

    def cauchy(self, at: Configuration) -> Array:
        """Cauchy stress of the points, (2, 2, n) [Pa]."""
        return self._evaluate("cauchy", at.F)


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
class Increment:
    """The equations of one time step."""

    bulk: Bulk
    start: Array  # U (2 nodes,) [m]
    v0: Array  # (2 nodes,) [m/s]
    free: Array  # w*, (2 nodes,) [m/s]
    dt: float
    scheme: Scheme

    @property
    def _reach(self) -> float:
        return self.scheme.theta * self.dt

    def at(self, w: Array) -> Configuration:
        """The configuration whose stress drives the step."""
        return self.bulk.at(self.start + self._reach * w)

    def energy(self, w: Array, at: Configuration) -> float:
        """The incremental potential E(w) [J/m]."""
        slip = w - self.free
        return self.bulk.energy(at) + 0.5 * float(slip @ (self.bulk.assembly.mass * slip))

    def gradient(self, w: Array, at: Configuration) -> tuple[Array, float]:
        """The imbalance of momentum without contact (2 nodes,) [kg/s], and the size of its terms."""
        inertia = self.bulk.assembly.mass * (w - self.free)
        elastic = self._reach * self.bulk.force(at)
        moved = float(np.linalg.norm(self.bulk.assembly.mass * w))
        size = max(float(np.linalg.norm(inertia)), float(np.linalg.norm(elastic)), 1e-9 * moved)
        return inertia + elastic, size

    def matrix(self, at: Configuration, *, projected: bool = False) -> sp.bsr_array:
        """A = M + theta^2 dt^2 K."""
        return self.bulk.assembly.matrix(self.bulk.stiffness(at, projected=projected), self._reach**2)

    def factorised(self, at: Configuration, *, projected: bool) -> Solver:
        """The scheme's solver for A; LinAlgError where it sees that A is not positive definite."""
        sheets = self.bulk.assembly.sheets
        return self.scheme.linear(self.matrix(at, projected=projected), sheets.blocks, sheets.rigid_motions())


@dataclass
class Touching:
    """The contacts of one step, from Newton iteration to Newton iteration."""

    linearise: Linearise
    step: Increment
    key: NDArray[np.int64]  # of the contacts whose forces are known
    force: Array  # (2, k) [N/m]
    timer: Timer
    scale: Array | None = None  # (2, k) diagonal of W of the last solve
    reference: float = 1.0  # size of its right-hand side
    iterations: int = 0

    def measure(self, w: Array) -> tuple[Array, float]:
        """Linearise about w; the push theta H' r of the impulses known so far and the contact law's residual."""
        self.timer.lap("bulk")
        self.rows = self.linearise(w)
        self.r = self.rows.impulses(self.key, self.force, self.step.dt)
        self.u = self.rows.H @ w + self.rows.offset
        residual = self._residual()
        self.timer.lap("detection")
        return self._push(), residual

    def solve(self, solver: Solver, w: Array, gradient: Array) -> tuple[Array, Array]:
        """Newton direction and push of the new impulses, which obey the contact law on the linearised bulk."""
        scheme, rows = self.step.scheme, self.rows
        free = -solver(gradient)
        self.timer.lap("linear")
        if rows.size == 0:
            self.scale, self.reference = np.zeros((2, 0)), 1.0
            return free, np.zeros_like(w)
        W = scheme.theta * solver.compliance(rows.H)
        q = self.u + rows.H @ free
        self.timer.lap("compliance")
        self.r, info = coulomb.solve(W, q, rows.friction, r0=self.r, tol=scheme.contact_tol)
        self.iterations += info.iterations
        self.timer.lap("contact")
        if not info.converged:
            raise NotConverged(
                f"the contact solver stopped at a residual of {info.residual:.2g} (wanted {scheme.contact_tol:g})"
                f" with {rows.size} contacts; use a smaller dt"
            )
        diagonal = W.diagonal()
        self.scale = diagonal.reshape(-1, 2).T if rows.tangential else np.stack([diagonal, diagonal])
        self.reference = max(float(np.linalg.norm(q / np.sqrt(np.maximum(diagonal, 1e-300)))), 1e-300)
        self.key, self.force = rows.key, rows.forces(self.r, self.step.dt)
        push = self._push()
        direction = free + solver(push)
        self.timer.lap("linear")
        return direction, push

    def _push(self) -> Array:
        return np.asarray(self.step.scheme.theta * (self.rows.H.T @ self.r))

    def _residual(self) -> float:
        rows = self.rows
        if rows.size == 0:
            return 0.0
        if self.scale is None:
            return float("inf")
        typical = float(np.median(self.scale)) if self.scale.size else 1.0
        scale = np.stack([lookup(self.key, self.scale[i], rows.key, typical) for i in (0, 1)])
        flat = scale.T.ravel() if rows.tangential else scale[0]
        return coulomb.residual(self.r, self.u, rows.friction, flat, reference=self.reference)


@dataclass(frozen=True)
class Solution:
    """A converged step."""

    w: Array  # (2 nodes,) [m/s]
    touching: Touching | None
    newton: int
    factorised: int
    residual: float  # of the contact law at the end of the step
    imbalance: float  # of momentum
    solver: Solver | None  # of the last iteration


def advance(step: Increment, touching: Touching | None, kept: Solver | None, timer: Timer) -> Solution:
    """Solve one step from w = v0.

    Every Newton iteration measures the gaps where the current w ends, solves the contacts against the linearised
    bulk and searches along the line to the new w: the potential less the work of the new impulses goes down.

    Raises
    ------
    NotConverged
        after `max_newton` iterations, or when the contact solver or the line search fails
    """
    scheme, w, solver, factorised = step.scheme, step.v0, kept, 0
    at, projected = step.at(w), False
    for iteration in range(scheme.max_newton + 1):
        gradient, size = step.gradient(w, at)
        push, residual = touching.measure(w) if touching else (np.zeros_like(w), 0.0)
        size = max(size, float(np.linalg.norm(push)))
        imbalance = float(np.linalg.norm(gradient - push)) / size if size > 0.0 else 0.0
        exact = iteration == 1 and step.bulk.linear and touching is None
        if exact or (iteration > 0 and imbalance <= scheme.newton_tol and residual <= scheme.gap_tol):
            return Solution(w, touching, iteration, factorised, residual, imbalance, solver)
        if solver is None or not step.bulk.linear:
            solver, projected = _factorised(step, at, projected)
            factorised += 1
            timer.lap("factorisation")
        if touching:
            direction, push = touching.solve(solver, w, gradient)
        else:
            direction = -solver(gradient)
        w, at = _search(step, w, at, direction, gradient - push, push)
        timer.lap("bulk")
    raise NotConverged(
        f"no convergence in {scheme.max_newton} Newton iterations: momentum imbalance {imbalance:.2g}"
        f" (wanted {scheme.newton_tol:g}), contact residual {residual:.2g} (wanted {scheme.gap_tol:g});"
        " use a smaller dt"
    )


def _factorised(step: Increment, at: Configuration, projected: bool) -> tuple[Solver, bool]:
    """A solver for the exact A if that is positive definite, else for the projected one, and which it was."""
    if not projected:
        try:
            return step.factorised(at, projected=False), False
        except np.linalg.LinAlgError:
            pass
    return step.factorised(at, projected=True), True


def _search(
    step: Increment, w: Array, at: Configuration, direction: Array, slope: Array, push: Array
) -> tuple[Array, Configuration]:
    """Backtrack from the full Newton step until the potential less the work of `push` goes down."""
    if step.bulk.linear:
        return w + direction, step.at(w + direction)
    decrease = float(slope @ direction)
    start = step.energy(w, at) - float(push @ w)
    noise = 1e-13 * (abs(start) + abs(float(push @ w)))
    length = 1.0
    while length > 1e-6:
        trial = w + length * direction
        there = step.at(trial)
        merit = step.energy(trial, there) - float(push @ trial)
        if merit <= start + 1e-4 * length * decrease + noise:
            return trial, there
        length *= 0.5
    raise NotConverged("the line search found no step that keeps the points the right way out; use a smaller dt")
