"""Static steps: the proximal point method in the metric of the mass.

A dynamic step minimises the potential plus 1/2 |w - v0|_M^2. A static step has no inertia, but the same problem with
v0 := w of the last solve, repeated until M (w - v0) is negligible, is the proximal point method for the equilibrium
(Rockafellar, SIAM J. Control Optim. 14, 1976; pseudo-transient continuation: Kelley & Keyes, SIAM J. Numer. Anal. 35,
1998). M is the lumped mass of every body, scaled to a share of its shear modulus times dt^2. Start, loads, walls and
time of the step stay.

The share is small where bodies rest, and so large where nothing holds a body that it moves by a tenth of a cell in a
solve: contact points are chosen once per solve. A body that moves by six cells is given up.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from skmpm.arrays import Array, Bools
from skmpm.scene import between_bodies
from skmpm.scene.report import Timer
from skmpm.step.contact_problem import ContactIterate, ContactProblem
from skmpm.step.contact_scale import FARTHEST
from skmpm.step.equations import Increment
from skmpm.step.errors import StepRejected
from skmpm.step.factor import Factor
from skmpm.step.newton import Solution, advance
from skmpm.step.no_equilibrium import no_equilibrium, travel
from skmpm.step.rotation import RigidMotion
from skmpm.step.terms import Configuration

# Shares of the shear modulus of a body that its metric has: in the first solve of bodies at rest, the least (with a
# tenth of it a plus falls off an L, test_assemblies) and the largest. With less than the first, solves of bodies that
# buckle fail; with twice as much boxes take more iterations (test_statics). Bodies that supports hold have none.
FIRST, LEAST, LARGEST = 1e-4, 1e-8, 1.0
# Twice and half of these two, and of `FARTHEST`, are wrong about heaps that stand or discs that fall
# (test_equilibrium).
MOTION = 0.1  # [cells] of a body that nothing holds in one solve, beyond what prescribed motions move
TOO_FAR = 0.2  # [cells] beyond them: such a solve is repeated with a larger share
WORK = 0.1  # over Newton's tolerance: work along the last solve, beside that of all forces (test_crystal)
MAX_SOLVES = round(2.0 * FARTHEST / MOTION)  # a body that moves on takes half, a packing that gives way 80
# Largest factor of a share, or of its inverse, from one solve to the next, and that after a solve that failed. Later
# shares stay above that one by its root. With 5 a heap of six discs does not stand (test_equilibrium).
CHANGE = 10.0

Problems = Callable[[Array, ContactIterate | None], ContactProblem | None]


def settle(increment: Increment, problem_at: Problems, kept: Factor | None, timer: Timer, stroke: float) -> Solution:
    """The equilibrium at the end of a step.

    `problem_at` gives the contact problem with the contact points at a velocity (n,) [m/s], for the contact
    forces of the solve before. The `kept` factor is of use where supports hold all bodies. Prescribed motions may
    move bodies by `stroke` [m].

    Raises
    ------
    StepRejected
        if a body moves too far, if `MAX_SOLVES` do not suffice, or if a solve fails with the largest shares
    """
    motion, solved = RigidMotion.at_start(increment), list[Solution]()
    centre, w = increment.v0, increment.initial_guess()
    problem = problem_at(w, None)
    metric = _Metric.first(increment, motion, _unheld(increment, motion, problem, w))
    kept, travelled = None if metric.share.any() else kept, np.zeros(increment.grid.bodies)
    for _ in range(MAX_SOLVES):
        trial = metric.applied(increment, centre, w)
        try:
            found = advance(trial, None if problem is None else problem.within(trial), kept, timer)
        except StepRejected as error:
            if error.retryable and metric.raise_shares():
                continue
            if travelled.max() > TOO_FAR:
                break  # on the way of a body that moves on
            raise
        solved.append(found)
        change = _Change.by_solve(trial, motion, found)
        moved = change.moved - stroke / increment.grid.cell
        if metric.raise_where_too_far(moved):
            continue
        centre = w = found.w
        settled = change.negligible(increment.scheme.newton_tol)
        if settled and not _widened(found.contact):
            return _equilibrium(trial, change, solved)
        if not settled:
            relative = increment.on_nodes(w) - increment.prescribed_only()
            travelled = np.where(metric.held, 0.0, travel(increment, motion, relative) - stroke / increment.grid.cell)
            if travelled.max() > FARTHEST:
                break
            metric.adapt(moved)
        problem = problem_at(w, found.contact)
    body = int(np.argmax(np.where(travelled > FARTHEST, travelled, change.share)))
    raise no_equilibrium(increment, motion, solved[-1], len(solved), body, float(change.share[body]))


def _widened(contact: ContactIterate | None) -> bool:
    """Whether contacts whose points slide have become too wide for that."""
    if contact is None:
        return False
    at = contact.constraints
    force = at.forces(contact.r, contact.increment.dt)[0]
    return bool((between_bodies(at.bodies, force) >= at.geometry.wide_from).any())


def _equilibrium(increment: Increment, change: _Change, solved: list[Solution]) -> Solution:
    """The last solution of a step, with what all solves took, and the factor where it is without a metric."""
    found = solved[-1]
    return replace(
        found,
        solves=len(solved),
        newton=sum(each.newton for each in solved),
        factorisations=sum(each.factorisations for each in solved),
        imbalance=max(found.imbalance, change.imbalance),
        reaction=increment.reaction(_without_metric(increment, found)),
        factor=None if increment.mass.any() else found.factor,
    )


@dataclass
class _Metric:
    """The metric of the bodies; solves change its shares."""

    unit: Array  # (2 nodes,) metric of a share of one [kg/m]
    held: Bools  # (bodies,) whether supports prevent all rigid motions of the body
    share: Array  # (bodies,)
    least: Array  # (bodies,) after solves that failed
    before: Array  # (bodies,) in the solve before

    @staticmethod
    def first(increment: Increment, motion: RigidMotion, unheld: Array) -> _Metric:
        """The metric with which resultants (bodies,) [kg m/s per m] that nothing bears move bodies by `MOTION`."""
        grid, modulus = increment.grid, increment.shear_modulus
        held = np.zeros(grid.bodies, dtype=bool) if increment.supports is None else increment.supports.holds
        unit = np.repeat((modulus / motion.total)[grid.node_body] * motion.mass, 2)
        wanted = unheld / (MOTION * grid.cell / increment.dt * np.maximum(modulus, 1e-300))
        first, least = np.where(held, 0.0, np.clip(wanted, FIRST, LARGEST)), np.full(grid.bodies, LEAST)
        return _Metric(unit, held, first, least, np.zeros(grid.bodies))

    def applied(self, increment: Increment, centre: Array, guess: Array) -> Increment:
        """The equations of a solve about a centre (n,), that begins at a guess (n,)."""
        metric = self.unit * np.repeat(self.share[increment.grid.node_body], 2)
        return replace(increment, metric=metric, v0=centre, guess=guess)

    def raise_shares(self) -> bool:
        """Larger shares after a solve that failed, of bodies that are not held; whether there are any."""
        if self.share[~self.held].min(initial=LARGEST) >= LARGEST:
            return False
        self.least = np.minimum(np.maximum(self.least, np.sqrt(CHANGE) * self.share), LARGEST)
        self.share = np.where(self.held, 0.0, np.clip(CHANGE * self.share, FIRST, LARGEST))
        return True

    def raise_where_too_far(self, moved: Array) -> bool:
        """Whether bodies moved (bodies,) [cells] farther than a solve may move them: their shares are larger then.

        Those of all bodies are at least what they were in the solve before: with friction, smaller ones may have led
        past an equilibrium nearby.
        """
        far = ~self.held & (moved > TOO_FAR) & (self.share < LARGEST)
        if far.any():
            wanted = np.where(far, self.share * moved / MOTION, self.share)
            self.share = np.minimum(np.maximum(wanted, self.before), LARGEST)
        return bool(far.any())

    def adapt(self, moved: Array) -> None:
        """Shares for motions (bodies,) [cells] as large as a solve may move bodies."""
        factor = np.clip(moved / MOTION, 1.0 / CHANGE, CHANGE)
        self.before = self.share
        self.share = np.where(self.held, 0.0, np.clip(self.share * factor, self.least, LARGEST))


@dataclass(frozen=True)
class _Change:
    """The change by a solve, and what the metric leaves out of balance, M (w - v0)."""

    moved: Array  # rigid motion of bodies, at their surfaces (bodies,) [cells]
    share: Array  # resultants of M (w - v0) over the forces on bodies (bodies,)
    imbalance: float  # its norm over that of the largest force
    work: float  # its work along w - v0 over that of the other forces

    @staticmethod
    def by_solve(increment: Increment, motion: RigidMotion, solution: Solution) -> _Change:
        """The change by a solve. Bodies that bear less than the mean of all count as if they bore it."""
        w, step = (increment.on_nodes(each) for each in (solution.w, solution.w - increment.v0))
        configuration = _configuration(increment, solution)
        lack, impulse = increment.free_nodes(increment.on_nodes(increment.mass) * step), solution.contact_impulse
        pushed = np.zeros_like(w) if impulse is None else increment.on_nodes(impulse)
        outer = [pushed, *(increment.theta_dt * each for each in increment.external_forces(configuration))]
        forces = 0.5 * np.hypot(*increment.grid.sums(np.abs(np.stack(outer)).sum(axis=0).reshape(-1, 2).T))
        inner = [term.force(configuration) for term in increment.terms if term.balanced]
        terms = [*(increment.theta_dt * each for each in inner), *outer]
        noise = increment.round_off(solution.w, configuration) / increment.scheme.newton_tol
        exchanged = sum(abs(float(term @ w)) for term in terms)
        return _Change(
            travel(increment, motion, step),
            np.abs(motion.resultants(lack)).max(axis=0) / np.maximum(forces, max(forces.mean(), noise)),
            float(np.linalg.norm(lack)) / max(*(float(np.linalg.norm(term)) for term in terms), noise),
            float(lack @ step) / max(exchanged, noise * float(np.linalg.norm(w)), 1e-300),
        )

    def negligible(self, tol: float) -> bool:
        """Whether M (w - v0) is, on nodes, in the work that it does along w - v0, and on bodies."""
        return max(self.imbalance, self.work / WORK, float(self.share.max(initial=0.0))) <= tol


def _configuration(increment: Increment, solution: Solution) -> Configuration:
    """The configuration of a solution, without another evaluation of the points."""
    there = increment.at(solution.w)
    return solution.configuration.translated(there.displacement, there.scalars)


def _unheld(increment: Increment, motion: RigidMotion, problem: ContactProblem | None, w: Array) -> Array:
    """Resultants on bodies that neither supports nor known contact forces balance, (bodies,) [kg m/s per m]."""
    if increment.supports is not None and increment.supports.holds.all():
        return np.zeros(increment.grid.bodies)
    force = increment.external_force(increment.at(w)) - increment.bulk.force(increment.at_start)
    impulse = increment.theta_dt * force
    if problem is not None:
        impulse = impulse + increment.on_nodes(problem.at(w).impulse)
    return np.asarray(np.abs(motion.resultants(increment.free_nodes(impulse))).max(axis=0))


def _without_metric(increment: Increment, solution: Solution) -> Array:
    """The out-of-balance impulse without the metric, (n,) [kg m/s per m]."""
    still = replace(increment, metric=np.zeros_like(increment.displacement_at_start))
    gradient, _ = still.gradient(solution.w, _configuration(increment, solution))
    return gradient if solution.contact_impulse is None else gradient - solution.contact_impulse
