"""Static steps: the proximal point method in the metric of the mass.

A dynamic step minimises the potential plus 1/2 |w - v0|_M^2. A static step has no inertia, but the same problem with
v0 := w of the last solve, repeated until M (w - v0) is negligible, is the proximal point method for the equilibrium
(Rockafellar, SIAM J. Control Optim. 14, 1976; pseudo-transient continuation: Kelley & Keyes, SIAM J. Numer. Anal. 35,
1998). M is the lumped mass of every body, scaled to a share of its shear modulus times dt^2. Start, loads, walls and
time of the step stay.

The share is small where bodies rest, and so large where nothing holds a body that it moves by a tenth of a cell in a
solve: contact points are chosen once per solve. A body that moves by as much again and again has no equilibrium.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.contact_problem import ContactProblem
from skmpm.implicit.errors import StepRejected
from skmpm.implicit.iteration import Solution
from skmpm.implicit.newton import advance
from skmpm.implicit.residual import Increment
from skmpm.implicit.rigid_motion import RigidMotion
from skmpm.implicit.timer import Timer
from skmpm.implicit.unbalanced_motion import no_equilibrium

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Shares of the shear modulus of a body that its metric has: in the first solve of bodies at rest, the least and the
# largest of all. Below the first, solves of bodies that buckle fail. Bodies that supports hold have none.
FIRST, LEAST, LARGEST = 1e-4, 1e-8, 1.0
MOTION = 0.1  # [cells] of a body that nothing holds in one solve, beyond what prescribed motions move
TOO_FAR = 2.0  # of these motions: such a solve is repeated with a larger share
MOVING = 0.7  # of them: a body that moves as far in `FALLING` solves in a row has no equilibrium
FALLING = 10
MAX_SOLVES = 60
AFTER_FAILURE, FLOOR = 10.0, 3.0  # factors of the shares after a solve that failed: of the next, and of the least
SLOWEST = 0.01  # smallest factor of a share from one solve to the next
NEGLIGIBLE = 1e-3  # resultant of M (w - v0) over the forces on a body: discretised surfaces are not smoother
WORK = 0.1  # over Newton's tolerance: work of M (w - v0) that is negligible beside that of the other forces
LIGHTEST = 0.1  # smallest force on a body that counts, over the mean of all: rattlers bear almost none

Problems = Callable[[Increment, Array, Solution | None], ContactProblem | None]


def settle(increment: Increment, centre: Array, problem_of: Problems, timer: Timer, stroke: float) -> Solution:
    """The equilibrium at the end of a step, from a first `centre` v0 (2 nodes,) [m/s].

    Prescribed motions may move bodies by `stroke` [m]. `problem_of` gives the contact problem of a solve, from its
    equations, the velocity at which it begins, and the solution before.

    Raises
    ------
    StepRejected
        if a body moves on and on, if `MAX_SOLVES` do not suffice, or if a solve fails with the largest shares
    """
    motion = RigidMotion.of(increment)
    metric = _Metric.of(increment, motion)
    w, solution, newton, factorisations = increment.initial_guess(), None, 0, 0
    change: _Change | None = None
    for solves in range(MAX_SOLVES):
        trial = metric.applied(increment, centre, w)
        problem = problem_of(trial, w, solution)
        if solves == 0:
            metric.hold(_unheld(trial, motion, problem, w), increment)
            trial = metric.applied(increment, centre, w)
            problem = None if problem is None else replace(problem, increment=trial)
        try:
            found = advance(trial, problem, None, timer)
        except StepRejected as error:
            if not error.retryable or not metric.raised():
                raise
            continue
        newton, factorisations = newton + found.newton, factorisations + found.factorisations
        change = _Change.of(trial, motion, found)
        moved = change.moved - stroke / increment.grid.cell
        if metric.too_far(moved):
            continue
        solution, centre, w = found, found.w, found.w
        if change.negligible(increment.scheme.newton_tol):
            reaction = increment.reaction(_without_metric(trial, found))
            found = replace(found, newton=newton, factorisations=factorisations, imbalance=change.imbalance)
            return replace(found, solver=None, reaction=reaction)
        if metric.follows(moved):
            break
    if solution is None or change is None:
        raise StepRejected(
            "all bodies", f"no solve of {MAX_SOLVES} moves them by less than {TOO_FAR * MOTION:g} cells"
        )
    body = int(np.argmax(np.where(metric.moving > 0, metric.moving, change.resultant)))
    raise no_equilibrium(increment, motion, solution, body, float(change.resultant[body]))


@dataclass
class _Metric:
    """The metric of the bodies; solves change its shares."""

    unit: Array  # (2 nodes,) metric of a share of one [kg/m]
    node_body: NDArray[np.int64]
    modulus: Array  # (bodies,) smallest shear moduli times theta^2 dt^2 [kg/m]
    held: Bools  # (bodies,) whether supports prevent all rigid motions of the body
    share: Array  # (bodies,)
    least: Array  # (bodies,) after solves that failed
    moving: NDArray[np.int64]  # (bodies,) solves in a row in which each has moved on

    @staticmethod
    def of(increment: Increment, motion: RigidMotion) -> _Metric:
        """That of bodies at rest."""
        grid, modulus = increment.grid, increment.shear_modulus
        held = np.zeros(grid.bodies, dtype=bool) if increment.supports is None else increment.supports.holds
        unit = np.repeat((modulus / motion.total)[grid.node_body] * motion.mass, 2)
        first, least = np.full(grid.bodies, FIRST), np.full(grid.bodies, LEAST)
        return _Metric(unit, grid.node_body, modulus, held, first, least, np.zeros(grid.bodies, dtype=np.int64))

    def applied(self, increment: Increment, centre: Array, guess: Array) -> Increment:
        """The equations of a solve about a centre (2 nodes,), that begins at a guess (2 nodes,)."""
        metric = self.unit * np.repeat(self.share[self.node_body], 2)
        return replace(increment, metric=metric, v0=centre, guess=guess, known_start=increment.at_start)

    def hold(self, unheld: Array, increment: Increment) -> None:
        """Let resultants (bodies,) [kg m/s per m] that nothing bears move bodies by `MOTION`."""
        velocity = MOTION * increment.grid.cell / increment.dt
        wanted = unheld / (velocity * np.maximum(self.modulus, 1e-300))
        self.share = np.where(self.held, 0.0, np.clip(wanted, FIRST, LARGEST))

    def raised(self) -> bool:
        """Larger shares after a solve that failed, of bodies that are not held; whether there are any."""
        if self.share[~self.held].min(initial=LARGEST) >= LARGEST:
            return False
        self.least = np.minimum(np.maximum(self.least, FLOOR * self.share), LARGEST)
        self.share = np.where(self.held, 0.0, np.clip(AFTER_FAILURE * self.share, FIRST, LARGEST))
        return True

    def too_far(self, moved: Array) -> bool:
        """Whether bodies moved (bodies,) [cells] farther than a solve may move them: their shares are larger then."""
        far = ~self.held & (moved > TOO_FAR * MOTION) & (self.share < LARGEST)
        self.share = np.where(far, np.minimum(self.share * moved / MOTION, LARGEST), self.share)
        return bool(far.any())

    def follows(self, moved: Array) -> bool:
        """Shares for motions (bodies,) [cells] as large as a solve may move bodies; whether one moves on and on."""
        moved = np.where(self.held, 0.0, moved)
        self.moving = np.where(moved > MOVING * MOTION, self.moving + 1, 0)
        factor = np.clip(moved / MOTION, SLOWEST, 1.0 / MOTION)
        self.share = np.where(self.held, 0.0, np.clip(self.share * factor, self.least, LARGEST))
        return bool(self.moving.max() >= FALLING)


@dataclass(frozen=True)
class _Change:
    """The change by a solve, and what the metric leaves out of balance."""

    moved: Array  # rigid motion of bodies, at their surfaces (bodies,) [cells]
    resultant: Array  # of M (w - v0) over the forces on bodies (bodies,)
    imbalance: float  # norm of M (w - v0) over that of the largest force
    work: float  # of M (w - v0) over that of the other forces

    @staticmethod
    def of(increment: Increment, motion: RigidMotion, solution: Solution) -> _Change:
        """That of a solution."""
        w, step = solution.w, solution.w - increment.v0
        lack, configuration = increment.mass * step, increment.at(w)
        outer = _outer(increment, w) + ([] if solution.contact_impulse is None else [solution.contact_impulse])
        forces = 0.5 * np.hypot(*increment.grid.sums(np.abs(np.stack(outer)).sum(axis=0).reshape(-1, 2).T))
        terms = [increment.theta_dt * increment.material_response.force(configuration), *outer]
        noise = increment.round_off(w, configuration) / increment.scheme.newton_tol
        resultant = np.abs(motion.resultants(lack))
        resultant[:, increment.grid.node_body[increment.constrained_dofs // 2]] = 0.0
        size = np.maximum(np.maximum(forces, LIGHTEST * forces.mean()), noise)
        exchanged = sum(abs(float(term @ w)) for term in terms)
        return _Change(
            increment.dt / increment.grid.cell * motion.at_surface(motion.velocity(step)),
            resultant.max(axis=0) / size,
            float(np.linalg.norm(lack)) / max(*(float(np.linalg.norm(term)) for term in terms), noise),
            float(lack @ step) / max(exchanged, noise * float(np.linalg.norm(w)), 1e-300),
        )

    def negligible(self, tol: float) -> bool:
        """Whether M (w - v0) is, on nodes, on bodies and in the work that it does along w - v0."""
        return self.imbalance <= tol and self.work <= WORK * tol and bool((self.resultant <= NEGLIGIBLE).all())


def _outer(increment: Increment, w: Array) -> list[Array]:
    """The impulses of loads and springs, (2 nodes,) each [kg m/s per m]."""
    terms = [np.asarray(increment.theta_dt * increment.load(w))]
    if increment.springs is not None:
        terms.append(np.asarray(-increment.theta_dt * increment.spring_force(w)))
    return terms


def _unheld(increment: Increment, motion: RigidMotion, problem: ContactProblem | None, w: Array) -> Array:
    """Resultants on bodies that known contact forces do not balance, (bodies,) [kg m/s per m]."""
    impulse = np.stack(_outer(increment, w)).sum(axis=0)
    if problem is not None:
        impulse = impulse + problem.at(w).impulse
    return np.asarray(np.abs(motion.resultants(impulse)).max(axis=0))


def _without_metric(increment: Increment, solution: Solution) -> Array:
    """The out-of-balance impulse without the metric, (2 nodes,) [kg m/s per m]."""
    still = replace(increment, metric=np.zeros_like(solution.w))
    gradient, _ = still.gradient(solution.w, increment.at(solution.w))
    return gradient if solution.contact_impulse is None else gradient - solution.contact_impulse
