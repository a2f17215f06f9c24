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
from skmpm.implicit.failure import NotConverged
from skmpm.implicit.floating import (
    NEGLIGIBLE,
    Floating,
    check_near,
    explained,
    floating,
    landed,
    near,
    negligible,
)
from skmpm.implicit.increment import Increment
from skmpm.implicit.newton import CAUTION, SLOW, STUCK, Mixing, Solution
from skmpm.implicit.touching import Timer, Touching
from skmpm.linear import Solver

Array = NDArray[np.float64]

FIRM = 1.0  # of its shear modulus: the drag that holds a body; tips that rest on each other push it away with 0.4
LEFT = 0.3  # by which an anchor lessens what is not neutral, for bodies as stiff as their drag
CLOSELY = 0.1  # of the drag that is there, to which the solution is found before the anchor follows
PATIENT = 8  # iterations for an anchor before contact normals are kept
SHIFT = 0.1  # [cells] that the acceleration moves an anchor


@dataclass(frozen=True)
class Balance:
    """What an iteration finds at w, impulses in [kg/s m/s]."""

    iteration: int
    gradient: Array  # (2 nodes,) with the drag
    push: Array  # (2 nodes,) of contacts
    residual: float  # of the contact law
    size: float  # of the largest term
    imbalance: float  # over that, with the drag
    true: float  # over that, without


@dataclass
class Search:
    """Where the iteration stands."""

    step: Increment
    touching: Touching
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


def advance(step: Increment, touching: Touching | None, kept: Solver | None, timer: Timer) -> Solution:
    """Solve one step; `newton.advance` but where only contact holds bodies of a quasi-static step.

    Raises
    ------
    NotConverged
        where there is no equilibrium, which is found out before the first iteration as far as contacts can tell, or
        none is found
    """
    if touching is None or not step.floats.any():
        return newton.advance(step, touching, kept, timer)
    bodies = floating(step, touching)
    first = landed(step, touching, bodies)
    try:
        return _settled(step, touching, bodies, newton._first(step) if first is None else first, kept, timer)
    except NotConverged as error:
        raise explained(step, touching, bodies, error) from error


def _settled(
    step: Increment, touching: Touching, bodies: Floating, w: Array, kept: Solver | None, timer: Timer
) -> Solution:
    """Newton from w."""
    mass = step.bulk.assembly.mass
    search = Search(step, touching, bodies, w, step.at(w), kept, Mixing(mass), Mixing(mass))
    for iteration in range(step.scheme.max_newton + 1):
        now = _measured(search, iteration)
        check_near(step, bodies, search.w)
        if _balanced(search, now):
            return _solution(search, now)
        _iterate(search, _anchored(search, now), timer)
    missing, still = now.gradient - now.push, np.zeros(step.bulk.assembly.sheets.bodies)
    unmet = newton._unmet(step, touching, missing, now.true, now.residual, still)
    raise newton._stopped(step.scheme.max_newton, unmet)


def _measured(search: Search, iteration: int) -> Balance:
    """The balance at w with the impulses known so far."""
    step, touching = search.step, search.touching
    gradient, size = step.gradient(search.w, search.at)
    push, residual = touching.measure(search.w)
    size = max(size, float(np.linalg.norm(push)), touching.round_off / step.scheme.newton_tol)
    return _balance(step, search.w, iteration, gradient, push, residual, size)


def _balance(
    step: Increment, w: Array, iteration: int, gradient: Array, push: Array, residual: float, size: float
) -> Balance:
    drag = step.mass * (w - step.rest)
    left = (float(np.linalg.norm(step.unsupported(e - push))) for e in (gradient, gradient - drag))
    return Balance(iteration, gradient, push, residual, size, *(e / size if size > 0.0 else 0.0 for e in left))


def _balanced(search: Search, now: Balance) -> bool:
    """Whether forces balance but for what is neutral and small, and contacts obey their law."""
    tol = search.step.scheme.newton_tol
    if now.iteration == 0 or now.residual > search.step.scheme.gap_tol:
        return False
    return now.true <= tol or (now.imbalance <= tol and _held(search))


def _held(search: Search) -> bool:
    """Whether what the drag bears is neutral and small; anchors have followed until all else has vanished."""
    if search.step.held is None:
        return False
    wanted = np.log(search.step.scheme.newton_tol / NEGLIGIBLE) / np.log(LEFT)
    return bool(search.anchors >= wanted and _small(search, search.step.mass * (search.w - search.step.rest)))


def _small(search: Search, imbalance: Array) -> bool:
    """Whether what an imbalance (2 nodes,) has along rigid motions is a small share of the forces on every body."""
    return negligible(search.step, search.touching, search.bodies, search.bodies.motions.T @ imbalance)


def _solution(search: Search, now: Balance) -> Solution:
    """The solution that the search has found; factors with a drag are not those of another step."""
    step, w = search.step, search.w
    reaction = step.reaction(now.gradient - step.mass * (w - step.rest) - now.push)
    solver = search.solver if step.held is None else None
    return Solution(w, search.touching, now.iteration, search.factorised, now.residual, now.true, reaction, solver)


def _anchored(search: Search, now: Balance) -> Balance:
    """The balance once the drag, where motions are neutral, is set or its anchor has followed the solution."""
    step, touching = search.step, search.touching
    if step.held is not None:
        tol = step.scheme.newton_tol
        there = now.imbalance <= max(tol, CLOSELY * now.true) and not (now.true <= tol or _held(search))
        return _followed(search, now) if there and now.iteration > search.began else now
    slow = now.iteration > 2 and now.imbalance > SLOW * search.before
    stays = slow and (now.imbalance < search.before or touching.lost > 0)
    if stays and _small(search, now.gradient - now.push):
        search.solver = touching.response = touching.settled = None
        touching.lost = 0
        return _renewed(search, now, search.w)
    return now


def _renewed(search: Search, now: Balance, anchor: Array) -> Balance:
    """The balance with a drag and its new anchor, for which the acceleration starts again."""
    search.step = search.step.holding(anchor, FIRM)
    search.mixing, search.share = Mixing(search.step.bulk.assembly.mass), 1.0
    search.before, search.began = np.inf, now.iteration
    gradient, _ = search.step.gradient(search.w, search.at)
    return _balance(search.step, search.w, now.iteration, gradient, now.push, now.residual, now.size)


def _followed(search: Search, now: Balance) -> Balance:
    """The balance once the anchor has moved to w, or to where forces that are left seem to vanish."""
    step, w = search.step, search.w
    search.anchors += 1
    moved, small = w - step.rest, _small(search, step.mass * (w - step.rest))
    wanted = search.anchors > 2 and not small
    mixed = search.anchoring.mixed(step.rest, moved, 1.0, wanted=wanted)
    return _renewed(search, now, w + near(step, search.bodies, w, mixed - moved, SHIFT) if wanted else w)


def _iterate(search: Search, now: Balance, timer: Timer) -> None:
    """One Newton iteration."""
    step, touching = search.step, search.touching
    slow, late = now.imbalance > SLOW * search.before, now.imbalance > STUCK * search.before
    stuck = late and now.iteration > search.began + (2 if step.held is None else PATIENT)
    aged = newton._late(step, touching, now.iteration, now.imbalance, search.before)
    if search.solver is None or (aged and not step.answer.linear):
        search.solver = touching.response = None
        search.solver, search.projected = newton._factorised(
            step, search.at, search.projected and now.imbalance > 0.01
        )
        search.factorised += 1
        timer.lap("factorisation")
    search.share = CAUTION if stuck else search.share
    if touching.settled is None and (touching.lost > 0 or stuck):
        touching.settled, search.mixing, search.share = touching.rows, Mixing(step.bulk.assembly.mass), 1.0
    search.before = np.inf if step.held is not None and now.iteration == search.began else now.imbalance
    direction, push = touching.solve(search.solver, now.gradient)
    mixed = search.mixing.mixed(search.w, direction, search.share, wanted=slow)
    whole, direction = mixed is direction, near(step, search.bodies, search.w, direction)
    mixed = direction if whole else near(step, search.bodies, search.w, mixed)
    search.w, search.at = newton._move(step, search.w, search.at, direction, mixed, now.gradient - push, push)
    timer.lap("bulk")
