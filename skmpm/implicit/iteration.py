"""What the Newton iterations of all steps share: where they begin, when matrices are renewed, how they end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.bulk import Configuration
from skmpm.implicit.contact_problem import ContactProblem
from skmpm.implicit.errors import NotConverged, indefinite, worst_body
from skmpm.implicit.matrix import solver_of
from skmpm.implicit.residual import DRIFT, Increment
from skmpm.linear import Solver
from skmpm.material import determinant

Array = NDArray[np.float64]

RELAXATION = 0.5  # share of a direction that is gone once the iteration converges slowly
STALLED_RATE = 0.8  # share of the imbalance left by an iteration that tells of a contact about to snap
SLOW_RATE = 0.3  # share of the imbalance that an iteration leaves; above it acceleration and new matrices set in
LEAST_RATE = 0.05  # the best rate to count on where nothing holds bodies
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


def first_velocity(increment: Increment) -> tuple[Array, Configuration]:
    """The velocity to start from, if it turns no point inside out; else what a linear solid would do from rest."""
    w = increment.first()
    at = increment.at(w)
    if increment.material_response.linear or np.isfinite(increment.energy(w, at)):
        return w, at
    still = np.zeros_like(w)
    at = increment.at(still)
    gradient, _ = increment.gradient(still, at)
    prescribed = increment.prescribed_alone()
    linear = prescribed - solver_of(increment, at, projected=True)(
        gradient + increment.matrix(at, projected=True) @ prescribed
    )
    there = increment.at(linear)
    if np.isfinite(increment.energy(linear, there)):
        return np.asarray(linear), there
    if increment.supports is None:
        return still, at
    worst = int(np.argmin(determinant(there.F)))
    b = int(increment.grid.cell_body[increment.grid.cell_of_point[worst]])
    raise NotConverged(f"body {b}", "the supports move so far in one step that points turn inside out")


def matrix_is_due(
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


def factorised(
    increment: Increment, contact: ContactProblem | None, at: Configuration, *, projected: bool, touches: bool = False
) -> tuple[Solver, bool]:
    """A solver for the exact A if that is positive definite, else for the projected one, and which it was.

    What contacts know by the solver before is given up first: two factors need not be in memory at once.
    """
    if contact is not None:
        contact.delassus = None
    if not projected:
        try:
            return solver_of(increment, at, projected=False, touches=touches), False
        except np.linalg.LinAlgError:
            pass
    try:
        return solver_of(increment, at, projected=True), True
    except np.linalg.LinAlgError as error:
        raise indefinite(increment.grid, error) from error


def unmet_criteria(
    increment: Increment,
    contact: ContactProblem | None,
    momentum: Array,
    imbalance: float,
    residual: float,
    drift: Array,
) -> list[tuple[str, str]]:
    """The criteria of convergence that are not met, where and by how much; `momentum` (2 nodes,) is missing."""
    scheme, unmet = increment.scheme, list[tuple[str, str]]()
    if not imbalance <= scheme.newton_tol:
        size = f"momentum imbalance {imbalance:.2g} (wanted {scheme.newton_tol:g})"
        unmet.append((worst_body(increment.grid, increment.unsupported(momentum)), size))
    if contact is not None and not residual <= scheme.gap_tol:
        unmet.append((contact.worst_pair(), f"contact residual {residual:.2g} (wanted {scheme.gap_tol:g})"))
    if not drift.max() <= DRIFT:
        b = int(np.argmax(drift))
        size = f"momentum that would move it by {drift[b]:.2g} cells (wanted {DRIFT:g}) missing"
        unmet.append((f"body {b}", size))
    return unmet


def not_converged(limit: int, unmet: list[tuple[str, str]]) -> NotConverged:
    """The failure after so many iterations, with the criteria that are not met."""
    what = ", ".join(f"{problem} at {place}" for place, problem in unmet)
    return NotConverged(unmet[0][0], f"no convergence in {limit} Newton iterations: {what}")
