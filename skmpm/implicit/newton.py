"""Newton on the incremental potential, with the contacts solved in every iteration."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.bulk import Configuration
from skmpm.implicit.failure import NotConverged, indefinite, worst_body
from skmpm.implicit.increment import DRIFT, Increment
from skmpm.implicit.touching import Timer, Touching
from skmpm.linear import Solver
from skmpm.material import determinant

Array = NDArray[np.float64]


DEPTH = 15  # directions that acceleration remembers
CAUTION = 0.5  # share of a direction that is gone once the iteration converges slowly
HASTE = 8  # iterations with contacts; it takes three where all is well, and two shorter steps take less than many
STUCK = 0.8  # share of the imbalance left by an iteration that tells of a contact about to snap
FREE = 0.05  # the best rate to count on where nothing holds bodies
PERIOD = 3  # then only every so many directions are accelerated: between them contacts settle
SLOW = 0.3  # share of the imbalance that an iteration leaves; above it acceleration and new matrices set in
FAR, NEAR = 20.0, 500.0  # imbalances over `newton_tol`: a new matrix is worth its price; it ends the iteration


@dataclass(frozen=True)
class Solution:
    """A converged step."""

    w: Array  # (2 nodes,) [m/s]
    touching: Touching | None
    newton: int
    factorised: int
    residual: float  # of the contact law at the end of the step
    imbalance: float  # of momentum
    reaction: Array  # (2 supports,) impulses that the bodies give their supports
    solver: Solver | None  # of the last iteration


def advance(step: Increment, touching: Touching | None, kept: Solver | None, timer: Timer) -> Solution:
    """Solve one step from w = v0.

    Every iteration measures the gaps where the current w ends and solves the contacts against the linearised bulk.
    How the forces of loaded contacts turn is part of the contact problem, so convergence is fast with the matrix of
    the velocity to start from; a new one is made where it is not. Where a contact is about to snap there may be
    nothing to converge to: then normals stay as they are, and gaps, Signorini's and Coulomb's laws are solved along
    them. With inertia, contacts that have not converged after `HASTE` iterations are left to a shorter step.

    Raises
    ------
    NotConverged
        after these, or `max_newton`, iterations, or when the contact solver or the line search fails
    """
    if touching is None:
        _check_balance(step)
    scheme, w, solver = step.scheme, _first(step), kept
    at, projected, before, factorised = step.at(w), False, np.inf, 0
    mixing, share, solved = Mixing(step.bulk.assembly.mass), 1.0, np.zeros_like(w)
    limit = min(HASTE, scheme.max_newton) if touching and scheme.inertia else scheme.max_newton
    for iteration in range(limit + 2):
        gradient, size = step.gradient(w, at)
        push, residual = touching.measure(w) if touching else (np.zeros_like(w), 0.0)
        if touching:
            size = max(size, float(np.linalg.norm(push)), touching.round_off / scheme.newton_tol)
        imbalance = float(np.linalg.norm(step.unsupported(gradient - push))) / size if size > 0.0 else 0.0
        exact = iteration == 1 and step.exact and touching is None
        close = iteration > 0 and imbalance <= scheme.newton_tol and residual <= scheme.gap_tol
        balanced = step.balanced(w, push, solved) if exact or close else None
        if balanced is not None:
            reaction = step.reaction(gradient - push)
            return Solution(balanced, touching, iteration, factorised, residual, imbalance, reaction, solver)
        if iteration >= limit + close:  # one full step more balances what is close
            break
        slow, stuck = imbalance > SLOW * before, iteration > 2 and imbalance > STUCK * before
        late = _late(step, touching, iteration, imbalance, before)
        if solver is None or (late and not step.answer.linear):
            solver = None  # the factors of two matrices need not be in memory at once
            if touching:
                touching.response = None
            touches = touching is not None and touching.rows.size > 0
            solver, projected = _factorised(step, at, projected and imbalance > 0.01, touches)
            factorised += 1
            timer.lap("factorisation")
        share = CAUTION if touching and stuck else share
        if touching and touching.settled is None and (touching.lost > 0 or stuck):
            touching.settled, mixing, share = touching.rows, Mixing(step.bulk.assembly.mass), 1.0
        before = imbalance
        if touching:
            direction, push = touching.solve(solver, gradient)
        else:
            direction = -solver(gradient)
        mixed, solved = mixing.mixed(w, direction, 1.0 if close else share, wanted=slow and not close), push
        w, at = _move(step, w, at, direction, mixed, gradient - push, push)
        timer.lap("bulk")
    unmet = _unmet(step, touching, gradient - push, imbalance, residual, step.drift(w, push, solved))
    raise _stopped(limit, unmet)


def _stopped(limit: int, unmet: list[tuple[str, str]]) -> NotConverged:
    """The failure after so many iterations, with the criteria that are not met."""
    what = ", ".join(f"{problem} at {place}" for place, problem in unmet)
    return NotConverged(unmet[0][0], f"no convergence in {limit} Newton iterations: {what}")


def _unmet(
    step: Increment, touching: Touching | None, momentum: Array, imbalance: float, residual: float, drift: Array
) -> list[tuple[str, str]]:
    """The criteria of convergence that are not met, where and by how much; `momentum` (2 nodes,) is missing."""
    scheme, sheets, unmet = step.scheme, step.bulk.assembly.sheets, []
    if not imbalance <= scheme.newton_tol:
        size = f"momentum imbalance {imbalance:.2g} (wanted {scheme.newton_tol:g})"
        unmet.append((worst_body(sheets, step.unsupported(momentum)), size))
    if touching is not None and not residual <= scheme.gap_tol:
        unmet.append((touching.worst_pair(), f"contact residual {residual:.2g} (wanted {scheme.gap_tol:g})"))
    if not drift.max() <= DRIFT:
        b = int(np.argmax(drift))
        size = f"momentum that would move it by {drift[b]:.2g} cells (wanted {DRIFT:g}) missing"
        unmet.append((f"body {b}", size))
    return unmet


def _late(step: Increment, touching: Touching | None, iteration: int, imbalance: float, before: float) -> bool:
    """Whether a new matrix is due: the last one would take more than one iteration more, by what it did in this one.

    Contacts without friction let bodies turn, and without inertia they move more: matrices age faster. Otherwise
    the first iteration, which finds the contacts, says little of the next.
    """
    tol = step.scheme.newton_tol
    if iteration == 0:
        return True
    if imbalance <= FAR * tol:
        return False
    slides = touching is not None and touching.rows.size > 0 and not touching.rows.tangential
    held = step.scheme.inertia and not slides
    if iteration == 1 and held and imbalance > NEAR * tol:
        return imbalance > SLOW * before
    rate = max(imbalance / max(before, 1e-300), 0.0 if held else FREE)
    return rate > SLOW or imbalance * rate > tol


def _first(step: Increment) -> Array:
    """The velocity to start from, if it turns no point inside out; else what a linear solid would do from rest."""
    w = step.first()
    if step.answer.linear or np.isfinite(step.energy(w, step.at(w))):
        return w
    still = np.zeros_like(w)
    at = step.at(still)
    gradient, _ = step.gradient(still, at)
    told = step.told_alone()
    linear = told - step.factorised(at, projected=True)(gradient + step.matrix(at, projected=True) @ told)
    if np.isfinite(step.energy(linear, step.at(linear))):
        return np.asarray(linear)
    if step.supports is None:
        return still
    sheets, worst = step.bulk.assembly.sheets, int(np.argmin(determinant(step.at(linear).F)))
    b = int(sheets.cell_body[sheets.cell_of_point[worst]])
    raise NotConverged(f"body {b}", "the supports move so far in one step that points turn inside out")


def _check_balance(step: Increment) -> None:
    """Raise NotConverged where loads would send a body away for ever that neither inertia nor anything else holds."""
    if not step.floats.any():
        return
    sheets, motions = step.bulk.assembly.sheets, step.bulk.assembly.sheets.rigid_motions()
    stopped = np.zeros_like(motions) if step.supports is None else motions - step.supports.T @ motions
    for b in np.flatnonzero(step.floats).tolist():
        own = slice(sheets.blocks[b], sheets.blocks[b + 1])
        free = _null_space(stopped[own])
        size, net = np.abs(step.force[own]).sum(), step.force[own] @ motions[own]
        if np.abs(free.T @ net).max(initial=0.0) > 1e-6 * size * np.sqrt(own.stop - own.start):
            raise NotConverged(
                f"body {b}",
                f"it is held by nothing along its loads, which do not balance: net {net[0]:.3g}, {net[1]:.3g} N/m",
                "add a Support or a wall, or use inertia",
                curable=False,
            )


def _null_space(rows: Array) -> Array:
    """An orthonormal basis (3, k) of the rigid motions that rows (m, 3) leave free."""
    values, vectors = np.linalg.eigh(rows.T @ rows)
    return np.asarray(vectors[:, values <= 1e-10 * max(float(values[-1]), 1.0)])


def _factorised(step: Increment, at: Configuration, projected: bool, touches: bool = False) -> tuple[Solver, bool]:
    """A solver for the exact A if that is positive definite, else for the projected one, and which it was."""
    if not projected:
        try:
            return step.factorised(at, projected=False, touches=touches), False
        except np.linalg.LinAlgError:
            pass
    try:
        return step.factorised(at, projected=True), True
    except np.linalg.LinAlgError as error:
        raise indefinite(step.bulk.assembly.sheets, error) from error


@dataclass
class Mixing:
    """Anderson acceleration of w -> w + direction(w) (Walker & Ni, SIAM J. Numer. Anal. 49, 2011)."""

    mass: Array  # (n,) weighs the directions
    depth: int = DEPTH
    count: int = 0  # of directions so far
    points: list[Array] = field(default_factory=list)
    directions: list[Array] = field(default_factory=list)

    def mixed(self, w: Array, direction: Array, share: float, *, wanted: bool) -> Array:
        """If wanted, the direction to the combination of all points so far whose combined direction is the smallest.

        Of that combined direction it goes a `share`: all of it, or less where the iteration overshoots. Then it
        also alternates with plain steps (Pratapa, Suryanarayana & Pask, J. Comput. Phys. 306, 2016).
        """
        self.points, self.directions = (
            [*self.points, w][-self.depth :],
            [*self.directions, direction][-self.depth :],
        )
        self.count += 1
        if len(self.points) == 1 or not wanted:
            return direction
        if share < 1.0 and self.count % PERIOD:
            return share * direction
        dw = np.stack([w - p for p in self.points[:-1]], axis=1)
        df = np.stack([direction - d for d in self.directions[:-1]], axis=1)
        root = np.sqrt(self.mass)
        weights, *_ = np.linalg.lstsq(root[:, None] * df, root * direction, rcond=1e-12)
        return np.asarray(share * (direction - df @ weights) - dw @ weights)


def _move(
    step: Increment,
    w: Array,
    at: Configuration,
    direction: Array,
    mixed: Array,
    slope: Array,
    push: Array,
) -> tuple[Array, Configuration]:
    """To the next w: the accelerated step where it is admissible, else a line search along the Newton direction."""
    if step.answer.linear:
        return w + mixed, step.at(w + mixed)
    if mixed is not direction:
        there = step.at(w + mixed)
        # Without contact the potential must go down; with it, it is another one in every iteration.
        limit = float(np.finfo(float).max)
        if not push.any():
            energy = step.energy(w, at)
            limit = energy + _noise(step, w, at, direction, abs(energy))
        if step.energy(w + mixed, there) <= limit:
            return w + mixed, there
    return _search(step, w, at, direction, slope, push)


def _noise(step: Increment, w: Array, at: Configuration, direction: Array, size: float) -> float:
    """How far the potential, of terms of this size, is known [J/m]."""
    materials = 20.0 * float(np.finfo(float).eps) * step.bulk.modulus * float(step.bulk.assembly.volume.sum())
    return 1e-13 * size + materials + step.round_off(w, at) * float(np.linalg.norm(direction))


def _search(
    step: Increment, w: Array, at: Configuration, direction: Array, slope: Array, push: Array
) -> tuple[Array, Configuration]:
    """Backtrack from the full Newton step until the potential less the work of `push` goes down."""
    decrease = float(slope @ direction)
    start = step.energy(w, at) - float(push @ w)
    noise = _noise(step, w, at, direction, abs(start) + abs(float(push @ w)))
    length = 1.0
    while length > 1e-6:
        trial = w + length * direction
        there = step.at(trial)
        merit = step.energy(trial, there) - float(push @ trial)
        if merit <= start + 1e-4 * length * decrease + noise:
            return trial, there
        length *= 0.5
    raise NotConverged(
        worst_body(step.bulk.assembly.sheets, slope),
        "the line search found no step that keeps the points the right way out",
    )
