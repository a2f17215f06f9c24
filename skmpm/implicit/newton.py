"""Newton on the incremental potential, with the contacts solved in every iteration."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.bulk import Configuration
from skmpm.implicit.contact_problem import ContactProblem, Timer
from skmpm.implicit.errors import NotConverged, indefinite, worst_body
from skmpm.implicit.residual import DRIFT, Increment
from skmpm.linear import Solver
from skmpm.material import determinant

Array = NDArray[np.float64]


ANDERSON_DEPTH = 15  # directions that acceleration remembers
RELAXATION = 0.5  # share of a direction that is gone once the iteration converges slowly
MAX_ITERATIONS_WITH_CONTACT = (
    8  # iterations with contacts; it takes three where all is well, and two shorter steps take less than many
)
STALLED_RATE = 0.8  # share of the imbalance left by an iteration that tells of a contact about to snap
LEAST_RATE = 0.05  # the best rate to count on where nothing holds bodies
PULAY_PERIOD = 3  # then only every so many directions are accelerated: between them contacts settle
SLOW_RATE = 0.3  # share of the imbalance that an iteration leaves; above it acceleration and new matrices set in
REFACTORISE_ABOVE, REFACTORISE_AT_ONCE = (
    20.0,
    500.0,
)  # imbalances over `newton_tol`: a new matrix is worth its price; it ends the iteration


@dataclass(frozen=True)
class Solution:
    """A converged step."""

    w: Array  # (2 nodes,) [m/s]
    contact: ContactProblem | None
    newton: int
    factorised: int
    residual: float  # of the contact law at the end of the step
    imbalance: float  # of momentum
    reaction: Array  # (2 supports,) impulses that the bodies give their supports
    solver: Solver | None  # of the last iteration


def advance(increment: Increment, contact: ContactProblem | None, kept: Solver | None, timer: Timer) -> Solution:
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
    if contact is None:
        _check_balance(increment)
    scheme, w, solver = increment.scheme, _initial_guess(increment), kept
    at, projected, before, factorised = increment.at(w), False, np.inf, 0
    mixing, share, solved = Mixing(increment.bulk.assembly.mass), 1.0, np.zeros_like(w)
    limit = min(MAX_ITERATIONS_WITH_CONTACT, scheme.max_newton) if contact and scheme.inertia else scheme.max_newton
    for iteration in range(limit + 2):
        gradient, size = increment.gradient(w, at)
        contact_impulse, residual = contact.measure(w) if contact else (np.zeros_like(w), 0.0)
        if contact:
            size = max(size, float(np.linalg.norm(contact_impulse)), contact.round_off / scheme.newton_tol)
        imbalance = (
            float(np.linalg.norm(increment.unsupported(gradient - contact_impulse))) / size if size > 0.0 else 0.0
        )
        exact = iteration == 1 and increment.exact and contact is None
        close = iteration > 0 and imbalance <= scheme.newton_tol and residual <= scheme.gap_tol
        balanced = increment.balanced(w, contact_impulse, solved) if exact or close else None
        if balanced is not None:
            reaction = increment.reaction(gradient - contact_impulse)
            return Solution(balanced, contact, iteration, factorised, residual, imbalance, reaction, solver)
        if iteration >= limit + close:  # one full step more balances what is close
            break
        slow, stuck = imbalance > SLOW_RATE * before, iteration > 2 and imbalance > STALLED_RATE * before
        late = _refactorisation_due(increment, contact, iteration, imbalance, before)
        if solver is None or (late and not increment.material_response.linear):
            solver = None  # the factors of two matrices need not be in memory at once
            if contact:
                contact.delassus = None
            touches = contact is not None and contact.constraints.size > 0
            solver, projected = _factorised(increment, at, projected and imbalance > 0.01, touches)
            factorised += 1
            timer.lap("factorisation")
        share = RELAXATION if contact and stuck else share
        if contact and contact.frozen is None and (contact.rejected > 0 or stuck):
            contact.frozen, mixing, share = contact.constraints, Mixing(increment.bulk.assembly.mass), 1.0
        before = imbalance
        if contact:
            direction, contact_impulse = contact.solve(solver, gradient)
        else:
            direction = -solver(gradient)
        mixed, solved = (
            mixing.mixed(w, direction, 1.0 if close else share, wanted=slow and not close),
            contact_impulse,
        )
        w, at = _advanced(increment, w, at, direction, mixed, gradient - contact_impulse, contact_impulse)
        timer.lap("bulk")
    unmet = _unmet(
        increment,
        contact,
        gradient - contact_impulse,
        imbalance,
        residual,
        increment.drift(w, contact_impulse, solved),
    )
    raise _not_converged(limit, unmet)


def _not_converged(limit: int, unmet: list[tuple[str, str]]) -> NotConverged:
    """The failure after so many iterations, with the criteria that are not met."""
    what = ", ".join(f"{problem} at {place}" for place, problem in unmet)
    return NotConverged(unmet[0][0], f"no convergence in {limit} Newton iterations: {what}")


def _unmet(
    increment: Increment,
    contact: ContactProblem | None,
    momentum: Array,
    imbalance: float,
    residual: float,
    drift: Array,
) -> list[tuple[str, str]]:
    """The criteria of convergence that are not met, where and by how much; `momentum` (2 nodes,) is missing."""
    scheme, grid, unmet = increment.scheme, increment.bulk.assembly.grid, []
    if not imbalance <= scheme.newton_tol:
        size = f"momentum imbalance {imbalance:.2g} (wanted {scheme.newton_tol:g})"
        unmet.append((worst_body(grid, increment.unsupported(momentum)), size))
    if contact is not None and not residual <= scheme.gap_tol:
        unmet.append((contact.worst_pair(), f"contact residual {residual:.2g} (wanted {scheme.gap_tol:g})"))
    if not drift.max() <= DRIFT:
        b = int(np.argmax(drift))
        size = f"momentum that would move it by {drift[b]:.2g} cells (wanted {DRIFT:g}) missing"
        unmet.append((f"body {b}", size))
    return unmet


def _refactorisation_due(
    increment: Increment, contact: ContactProblem | None, iteration: int, imbalance: float, before: float
) -> bool:
    """Whether a new matrix is due: the last one would take more than one iteration more, by what it did in this one.

    Contacts without friction let bodies turn, and without inertia they move more: matrices age faster. Otherwise
    the first iteration, which finds the contacts, says little of the next.
    """
    tol = increment.scheme.newton_tol
    if iteration == 0:
        return True
    if imbalance <= REFACTORISE_ABOVE * tol:
        return False
    slides = contact is not None and contact.constraints.size > 0 and not contact.constraints.tangential
    held = increment.scheme.inertia and not slides
    if iteration == 1 and held and imbalance > REFACTORISE_AT_ONCE * tol:
        return imbalance > SLOW_RATE * before
    rate = max(imbalance / max(before, 1e-300), 0.0 if held else LEAST_RATE)
    return rate > SLOW_RATE or imbalance * rate > tol


def _initial_guess(increment: Increment) -> Array:
    """The velocity to start from, if it turns no point inside out; else what a linear solid would do from rest."""
    w = increment.first()
    if increment.material_response.linear or np.isfinite(increment.energy(w, increment.at(w))):
        return w
    still = np.zeros_like(w)
    at = increment.at(still)
    gradient, _ = increment.gradient(still, at)
    prescribed = increment.prescribed_alone()
    linear = prescribed - increment.factorised(at, projected=True)(
        gradient + increment.matrix(at, projected=True) @ prescribed
    )
    if np.isfinite(increment.energy(linear, increment.at(linear))):
        return np.asarray(linear)
    if increment.supports is None:
        return still
    grid, worst = increment.bulk.assembly.grid, int(np.argmin(determinant(increment.at(linear).F)))
    b = int(grid.cell_body[grid.cell_of_point[worst]])
    raise NotConverged(f"body {b}", "the supports move so far in one step that points turn inside out")


def _check_balance(increment: Increment) -> None:
    """Raise NotConverged where loads would send a body away for ever that neither inertia nor anything else holds."""
    if not increment.floats.any():
        return
    grid, motions = increment.bulk.assembly.grid, increment.bulk.assembly.grid.rigid_motions()
    stopped = np.zeros_like(motions) if increment.supports is None else motions - increment.supports.T @ motions
    for b in np.flatnonzero(increment.floats).tolist():
        own = slice(grid.blocks[b], grid.blocks[b + 1])
        free = _null_space(stopped[own])
        size, net = np.abs(increment.force[own]).sum(), increment.force[own] @ motions[own]
        if np.abs(free.T @ net).max(initial=0.0) > 1e-6 * size * np.sqrt(own.stop - own.start):
            raise NotConverged(
                f"body {b}",
                f"it is held by nothing along its loads, which do not balance: net {net[0]:.3g}, {net[1]:.3g} N/m",
                "add a Support or a wall, or use inertia",
                retryable=False,
            )


def _null_space(constraints: Array) -> Array:
    """An orthonormal basis (3, k) of the rigid motions that rows (m, 3) leave free."""
    values, vectors = np.linalg.eigh(constraints.T @ constraints)
    return np.asarray(vectors[:, values <= 1e-10 * max(float(values[-1]), 1.0)])


def _factorised(
    increment: Increment, at: Configuration, projected: bool, touches: bool = False
) -> tuple[Solver, bool]:
    """A solver for the exact A if that is positive definite, else for the projected one, and which it was."""
    if not projected:
        try:
            return increment.factorised(at, projected=False, touches=touches), False
        except np.linalg.LinAlgError:
            pass
    try:
        return increment.factorised(at, projected=True), True
    except np.linalg.LinAlgError as error:
        raise indefinite(increment.bulk.assembly.grid, error) from error


@dataclass
class Mixing:
    """Anderson acceleration of w -> w + direction(w) (Walker & Ni, SIAM J. Numer. Anal. 49, 2011)."""

    mass: Array  # (n,) weighs the directions
    depth: int = ANDERSON_DEPTH
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
        if share < 1.0 and self.count % PULAY_PERIOD:
            return share * direction
        dw = np.stack([w - p for p in self.points[:-1]], axis=1)
        df = np.stack([direction - d for d in self.directions[:-1]], axis=1)
        root = np.sqrt(self.mass)
        weights, *_ = np.linalg.lstsq(root[:, None] * df, root * direction, rcond=1e-12)
        return np.asarray(share * (direction - df @ weights) - dw @ weights)


def _advanced(
    increment: Increment,
    w: Array,
    at: Configuration,
    direction: Array,
    mixed: Array,
    slope: Array,
    contact_impulse: Array,
) -> tuple[Array, Configuration]:
    """To the next w: the accelerated step where it is admissible, else a line search along the Newton direction."""
    if increment.material_response.linear:
        return w + mixed, increment.at(w + mixed)
    if mixed is not direction:
        there = increment.at(w + mixed)
        # Without contact the potential must go down; with it, it is another one in every iteration.
        limit = float(np.finfo(float).max)
        if not contact_impulse.any():
            energy = increment.energy(w, at)
            limit = energy + _noise(increment, w, at, direction, abs(energy))
        if increment.energy(w + mixed, there) <= limit:
            return w + mixed, there
    return _backtracked(increment, w, at, direction, slope, contact_impulse)


def _noise(increment: Increment, w: Array, at: Configuration, direction: Array, size: float) -> float:
    """How far the potential, of terms of this size, is known [J/m]."""
    materials = (
        20.0 * float(np.finfo(float).eps) * increment.bulk.modulus * float(increment.bulk.assembly.volume.sum())
    )
    return 1e-13 * size + materials + increment.round_off(w, at) * float(np.linalg.norm(direction))


def _backtracked(
    increment: Increment, w: Array, at: Configuration, direction: Array, slope: Array, contact_impulse: Array
) -> tuple[Array, Configuration]:
    """Backtrack from the full Newton step until the potential less the work of `push` goes down."""
    decrease = float(slope @ direction)
    start = increment.energy(w, at) - float(contact_impulse @ w)
    noise = _noise(increment, w, at, direction, abs(start) + abs(float(contact_impulse @ w)))
    length = 1.0
    while length > 1e-6:
        trial = w + length * direction
        there = increment.at(trial)
        merit = increment.energy(trial, there) - float(contact_impulse @ trial)
        if merit <= start + 1e-4 * length * decrease + noise:
            return trial, there
        length *= 0.5
    raise NotConverged(
        worst_body(increment.bulk.assembly.grid, slope),
        "the line search found no step that keeps the points the right way out",
    )
