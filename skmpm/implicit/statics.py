"""Newton for quasi-static steps in which nothing but contact holds bodies.

Springs in A, and in A only, bound an iteration. Where contacts leave a motion of bodies neutral they do not stop it:
the same imbalance remains in every iteration and the bodies drift. Then a drag replaces the springs,

    grad E + drag (w - anchor) = theta H' r,

which has one solution nearby; the anchor follows the solution (a proximal point method; Rockafellar, SIAM J. Control
Optim. 14, 1976), with Anderson's acceleration where forces are left that count. What is not neutral converges by a
constant factor from anchor to anchor; what is neutral stays where it is, and its drag is what it lacks to balance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit import newton
from skmpm.implicit.bulk import Configuration
from skmpm.implicit.contact_problem import ContactProblem, Timer
from skmpm.implicit.errors import NotConverged
from skmpm.implicit.floating import (
    NEGLIGIBLE,
    Floating,
    check_near,
    explained,
    floating,
    landed,
    near,
    negligible,
    turned,
)
from skmpm.implicit.iteration import (
    RELAXATION,
    SLOW_RATE,
    STALLED_RATE,
    Solution,
    factorised,
    first_velocity,
    matrix_is_due,
    not_converged,
    unmet_criteria,
)
from skmpm.implicit.line_search import move
from skmpm.implicit.mixing import Mixing
from skmpm.implicit.residual import Increment
from skmpm.linear import Solver

Array = NDArray[np.float64]

DRAG_SHARE = (
    1.0  # of its shear modulus: the drag that holds a body; tips that rest on each other push it away with 0.4
)
ANCHOR_RATE = 0.3  # by which an anchor lessens what is not neutral, for bodies as stiff as their drag
ANCHOR_TOLERANCE = 0.1  # of the drag that is there, to which the solution is found before the anchor follows
ITERATIONS_PER_ANCHOR = 8  # iterations for an anchor before contact normals are kept
MAX_ANCHOR_SHIFT = 0.1  # [cells] that the acceleration moves an anchor
TURNED = 2e-3  # of half the sum of a body's forces, a thousandth of the sum: moment that kept normals may make


@dataclass(frozen=True)
class Balance:
    """What an iteration finds at w, impulses in [kg/s m/s]."""

    iteration: int
    gradient: Array  # (2 nodes,) with the drag
    contact_impulse: Array  # (2 nodes,) of contacts
    residual: float  # of the contact law
    size: float  # of the largest term
    imbalance: float  # over that, with the drag
    true: float  # over that, without


@dataclass
class Search:
    """Where the iteration stands."""

    increment: Increment
    contact: ContactProblem
    bodies: Floating
    w: Array
    at: Configuration
    solver: Solver | None
    mixing: Mixing
    anchoring: Mixing  # of the anchors
    projected: bool = False
    factorised: int = 0
    share: float = 1.0  # of an accelerated direction
    before: float = np.inf  # imbalance of the iteration before
    began: int = 0  # the iteration in which the anchor was set
    anchors: int = 0


def advance(increment: Increment, contact: ContactProblem | None, kept: Solver | None, timer: Timer) -> Solution:
    """Solve one step; `newton.advance` but where only contact holds bodies of a quasi-static step.

    Raises
    ------
    NotConverged
        where there is no equilibrium, which is found out before the first iteration as far as contacts can tell, or
        none is found
    """
    if contact is None or not increment.floats.any():
        return newton.advance(increment, contact, kept, timer)
    constraints = contact.linearise(increment.prescribed_alone())
    bodies = floating(increment, constraints)
    first = landed(increment, contact, bodies, constraints)
    try:
        start = first_velocity(increment) if first is None else (first, increment.at(first))
        return _newton(increment, contact, bodies, start, kept, timer)
    except NotConverged as error:
        raise explained(increment, contact, bodies, error) from error


def _newton(
    increment: Increment,
    contact: ContactProblem,
    bodies: Floating,
    start: tuple[Array, Configuration],
    kept: Solver | None,
    timer: Timer,
) -> Solution:
    """Newton from a velocity and the configuration that it leads to."""
    mass = increment.bulk.assembly.mass
    search = Search(increment, contact, bodies, *start, kept, Mixing(mass), Mixing(mass))
    for iteration in range(increment.scheme.max_newton + 1):
        now = _measured(search, iteration)
        check_near(increment, bodies, search.w)
        if _balanced(search, now):
            if turned(search.increment, search.contact, search.bodies, search.w).max() <= TURNED:
                return _solution(search, now)
            now = _resettled(search, iteration)
        _iterate(search, _anchored(search, now), timer)
    raise not_converged(increment.scheme.max_newton, _unmet(search, now))


def _unmet(search: Search, now: Balance) -> list[tuple[str, str]]:
    """The criteria of convergence that are not met, where and by how much."""
    missing, still = now.gradient - now.contact_impulse, np.zeros(search.increment.grid.bodies)
    unmet = unmet_criteria(search.increment, search.contact, missing, now.true, now.residual, still)
    left = turned(search.increment, search.contact, search.bodies, search.w)
    if not left.max() <= TURNED:
        what = f"contacts that snap, whose moment is {left.max():.2g} of the forces (wanted {TURNED:g})"
        unmet.append((f"body {search.bodies.bodies[np.argmax(left)]}", what))
    return unmet


def _measured(search: Search, iteration: int) -> Balance:
    """The balance at w with the impulses known so far."""
    increment, contact = search.increment, search.contact
    gradient, size = increment.gradient(search.w, search.at)
    contact_impulse, residual = contact.measure(search.w)
    size = max(size, float(np.linalg.norm(contact_impulse)), contact.round_off / increment.scheme.newton_tol)
    return _balance(increment, search.w, iteration, gradient, contact_impulse, residual, size)


def _balance(
    increment: Increment,
    w: Array,
    iteration: int,
    gradient: Array,
    contact_impulse: Array,
    residual: float,
    size: float,
) -> Balance:
    drag = increment.mass * (w - increment.rest)
    left = (float(np.linalg.norm(increment.unsupported(e - contact_impulse))) for e in (gradient, gradient - drag))
    return Balance(
        iteration, gradient, contact_impulse, residual, size, *(e / size if size > 0.0 else 0.0 for e in left)
    )


def _balanced(search: Search, now: Balance) -> bool:
    """Whether forces balance but for what is neutral and small, and contacts obey their law."""
    tol = search.increment.scheme.newton_tol
    if now.iteration == 0 or now.residual > search.increment.scheme.gap_tol:
        return False
    return now.true <= tol or (now.imbalance <= tol and _held(search))


def _held(search: Search) -> bool:
    """Whether what the drag bears is neutral and small; anchors have followed until all else has vanished."""
    if search.increment.proximal is None:
        return False
    wanted = np.log(search.increment.scheme.newton_tol / NEGLIGIBLE) / np.log(ANCHOR_RATE)
    return bool(
        search.anchors >= wanted and _small(search, search.increment.mass * (search.w - search.increment.rest))
    )


def _small(search: Search, imbalance: Array) -> bool:
    """Whether what an imbalance (2 nodes,) has along rigid motions is a small share of the forces on every body."""
    return negligible(search.increment, search.contact, search.bodies, search.bodies.motions.T @ imbalance)


def _resettled(search: Search, iteration: int) -> Balance:
    """The balance once the contacts act along the normals and at the places of now, which are kept in their turn."""
    search.contact.frozen = search.contact.present
    search.mixing, search.before = Mixing(search.increment.bulk.assembly.mass), np.inf
    return _measured(search, iteration)


def _solution(search: Search, now: Balance) -> Solution:
    """The solution that the search has found; factors with a drag are not those of another step."""
    increment, w = search.increment, search.w
    reaction = increment.reaction(now.gradient - increment.mass * (w - increment.rest) - now.contact_impulse)
    solver = search.solver if increment.proximal is None else None
    return Solution(w, search.contact, now.iteration, search.factorised, now.residual, now.true, reaction, solver)


def _anchored(search: Search, now: Balance) -> Balance:
    """The balance once the drag, where motions are neutral, is set or its anchor has followed the solution."""
    increment, contact = search.increment, search.contact
    if increment.proximal is not None:
        tol = increment.scheme.newton_tol
        there = now.imbalance <= max(tol, ANCHOR_TOLERANCE * now.true) and not (now.true <= tol or _held(search))
        return _followed(search, now) if there and now.iteration > search.began else now
    slow = now.iteration > 2 and now.imbalance > SLOW_RATE * search.before
    stays = slow and (now.imbalance < search.before or contact.rejected > 0)
    if stays and _small(search, now.gradient - now.contact_impulse):
        search.solver = contact.delassus = contact.frozen = None
        contact.rejected = 0
        return _renewed(search, now, search.w)
    return now


def _renewed(search: Search, now: Balance, anchor: Array) -> Balance:
    """The balance with a drag and its new anchor, for which the acceleration starts again."""
    search.increment = search.increment.holding(anchor, DRAG_SHARE)
    search.mixing, search.share = Mixing(search.increment.bulk.assembly.mass), 1.0
    search.before, search.began = np.inf, now.iteration
    gradient, _ = search.increment.gradient(search.w, search.at)
    return _balance(search.increment, search.w, now.iteration, gradient, now.contact_impulse, now.residual, now.size)


def _followed(search: Search, now: Balance) -> Balance:
    """The balance once the anchor has moved to w, or to where forces that are left seem to vanish."""
    increment, w = search.increment, search.w
    search.anchors += 1
    moved, small = w - increment.rest, _small(search, increment.mass * (w - increment.rest))
    wanted = search.anchors > 2 and not small
    mixed, _ = search.anchoring.mixed(increment.rest, moved, 1.0, wanted=wanted)
    return _renewed(
        search, now, w + near(increment, search.bodies, w, mixed - moved, MAX_ANCHOR_SHIFT) if wanted else w
    )


def _iterate(search: Search, now: Balance, timer: Timer) -> None:
    """One Newton iteration."""
    increment, contact = search.increment, search.contact
    slow, late = now.imbalance > SLOW_RATE * search.before, now.imbalance > STALLED_RATE * search.before
    stuck = late and now.iteration > search.began + (2 if increment.proximal is None else ITERATIONS_PER_ANCHOR)
    aged = matrix_is_due(increment, contact, now.iteration, now.imbalance, search.before)
    if search.solver is None or (aged and not increment.material_response.linear):
        search.solver, projected = None, search.projected and now.imbalance > 0.01
        search.solver, search.projected = factorised(increment, contact, search.at, projected=projected)
        search.factorised += 1
        timer.lap("factorisation")
    search.share = RELAXATION if stuck else search.share
    if contact.frozen is None and (contact.rejected > 0 or stuck):
        contact.frozen, search.mixing, search.share = contact.constraints, Mixing(increment.bulk.assembly.mass), 1.0
    search.before = np.inf if increment.proximal is not None and now.iteration == search.began else now.imbalance
    direction, contact_impulse = contact.solve(search.solver, now.gradient)
    way, accelerated = search.mixing.mixed(search.w, direction, search.share, wanted=slow)
    direction = near(increment, search.bodies, search.w, direction)
    mixed = near(increment, search.bodies, search.w, way) if accelerated else direction, accelerated
    search.w, search.at = move(
        increment, search.w, search.at, direction, mixed, now.gradient - contact_impulse, contact_impulse
    )
    timer.lap("bulk")
