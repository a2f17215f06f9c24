"""Quasi-static steps with neutral rigid-body modes: out-of-balance forces and the proximal point method.

Newton's method with springs in A alone leaves the same out-of-balance force in every iteration along a mode that the
contacts leave neutral, and the bodies drift. A proximal term then replaces the springs,

    grad E + drag (w - point) = theta H' r,

which has one solution nearby, and the proximal point follows that solution (Rockafellar, SIAM J. Control Optim. 14,
1976), with Anderson acceleration while the drag forces count. Along other modes the drag force decreases by a
constant factor from point to point; along neutral modes bodies stay in place, and the drag is their out-of-balance
force. If unloaded bodies slide away on their springs, because contacts soften more than these resist, the iteration
restarts with the proximal term.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.bulk import Configuration
from skmpm.implicit.contact_problem import ContactProblem
from skmpm.implicit.floating import NEGLIGIBLE_RESULTANT, FloatingBodies, excess_cells, limited, negligible
from skmpm.implicit.iteration import SLOW_RATE, with_contact
from skmpm.implicit.mixing import Mixing
from skmpm.implicit.residual import Increment
from skmpm.linear import Solver

Array = NDArray[np.float64]

DRAG_STIFFNESS = 1.0  # over the shear modulus of a body; with 0.4, bodies that stand on corners are pushed away
DRAG_DECREASE = 0.3  # of the drag force along modes that are not neutral, from point to point, at that stiffness
POINT_TOLERANCE = 0.1  # over the drag force: how far the solution for a proximal point converges
MAX_SPRING_MOTION = 1.0  # [cells] of unloaded bodies on springs beyond what is prescribed; 0.5 does as well
MAX_POINT_SHIFT = 0.1  # [cells] of a proximal point by acceleration, beyond the solution


@dataclass(frozen=True)
class OutOfBalance:
    """Out-of-balance impulses at an iterate, [kg m/s per m]."""

    iteration: int
    gradient: Array  # (2 nodes,) without contact, with the drag
    contact_impulse: Array  # (2 nodes,)
    residual: float  # of the contact law
    size: float  # norm of the largest term
    relative: float  # norm over size, with the drag
    without_drag: float  # norm over size, without the drag


@dataclass
class Iterate:
    """The state of the Newton iteration."""

    increment: Increment
    contact: ContactProblem
    bodies: FloatingBodies
    w: Array
    at: Configuration
    solver: Solver | None
    mixing: Mixing  # of the Newton iteration
    point_mixing: Mixing  # of the proximal points
    projected: bool = False
    factorisations: int = 0
    relaxation: float = 1.0  # factor on accelerated steps
    before: float = np.inf  # relative out-of-balance norm of the previous iteration
    point_iteration: int = 0  # the iteration in which the proximal point was set
    points: int = 0  # proximal points so far

    def restart_mixing(self) -> None:
        """Forget the history of the acceleration."""
        self.mixing = Mixing(self.increment.bulk.assembly.mass)

    @property
    def drag_impulse(self) -> Array:
        """Impulse of the drag, (2 nodes,) [kg m/s per m]."""
        return self.increment.mass * (self.w - self.increment.predictor)


def measured(iterate: Iterate, iteration: int) -> OutOfBalance:
    """The out-of-balance impulses at w with the known contact impulses."""
    increment, contact = iterate.increment, iterate.contact
    gradient, size = increment.gradient(iterate.w, iterate.at)
    contact_impulse, residual, size = with_contact(increment, contact, iterate.w, size)
    return _out_of_balance(iterate, iteration, gradient, contact_impulse, residual, size)


def _out_of_balance(
    iterate: Iterate, iteration: int, gradient: Array, contact_impulse: Array, residual: float, size: float
) -> OutOfBalance:
    drag, free = iterate.drag_impulse, iterate.increment.on_free_dofs
    norms = (float(np.linalg.norm(free(g - contact_impulse))) for g in (gradient, gradient - drag))
    relative = (norm / size if size > 0.0 else 0.0 for norm in norms)
    return OutOfBalance(iteration, gradient, contact_impulse, residual, size, *relative)


def converged(iterate: Iterate, now: OutOfBalance) -> bool:
    """Whether forces balance, up to small drag forces along neutral modes, and contacts satisfy their law."""
    tol = iterate.increment.scheme.newton_tol
    if now.iteration == 0 or now.residual > iterate.increment.scheme.gap_tol:
        return False
    return now.without_drag <= tol or (now.relative <= tol and _neutral(iterate))


def _neutral(iterate: Iterate) -> bool:
    """Whether the drag force is small and along neutral modes, after points enough that all other has vanished."""
    if iterate.increment.proximal is None:
        return False
    points = np.log(iterate.increment.scheme.newton_tol / NEGLIGIBLE_RESULTANT) / np.log(DRAG_DECREASE)
    return bool(iterate.points >= points and _small_resultants(iterate, iterate.drag_impulse))


def _small_resultants(iterate: Iterate, impulse: Array) -> bool:
    """Whether the resultants of an impulse (2 nodes,) are small beside the forces on every body."""
    resultants = iterate.bodies.modes.T @ impulse
    return negligible(iterate.increment, iterate.contact, iterate.bodies, resultants)


def with_proximal_term(iterate: Iterate, now: OutOfBalance) -> OutOfBalance:
    """The out-of-balance impulses after the proximal term is introduced, or its point moved, where either is due."""
    increment, contact = iterate.increment, iterate.contact
    if increment.proximal is not None:
        tol = increment.scheme.newton_tol
        solved = now.relative <= max(tol, POINT_TOLERANCE * now.without_drag)
        wanted = solved and not (now.without_drag <= tol or _neutral(iterate))
        return _next_point(iterate, now) if wanted and now.iteration > iterate.point_iteration else now
    slow = now.iteration > 2 and now.relative > SLOW_RATE * iterate.before
    neutral = slow and (now.relative < iterate.before or contact.stiffness_failures > 0)
    if neutral and _small_resultants(iterate, now.gradient - now.contact_impulse):
        return _with_drag(iterate, now)
    return now


def slides_away(iterate: Iterate) -> bool:
    """Whether springs fail to hold unloaded bodies, because contacts soften more than the springs resist."""
    if iterate.increment.proximal is not None or iterate.bodies.loaded:
        return False
    return bool(excess_cells(iterate.increment, iterate.bodies, iterate.w).max() > MAX_SPRING_MOTION)


def restarted(iterate: Iterate, start: tuple[Array, Configuration], iteration: int) -> OutOfBalance:
    """The out-of-balance impulses at the start of the iteration, with a drag instead of the springs."""
    iterate.w, iterate.at = start
    iterate.contact.frozen = None
    return _with_drag(iterate, measured(iterate, iteration))


def _with_drag(iterate: Iterate, now: OutOfBalance) -> OutOfBalance:
    """The out-of-balance impulses with a drag at w instead of the springs, and with the current contact geometry."""
    iterate.solver = iterate.contact.delassus = iterate.contact.frozen = None
    iterate.contact.stiffness_failures = 0
    return _with_point(iterate, now, iterate.w)


def _with_point(iterate: Iterate, now: OutOfBalance, point: Array) -> OutOfBalance:
    """The out-of-balance impulses with a proximal point, for which the acceleration restarts."""
    iterate.increment = iterate.increment.with_proximal_point(point, DRAG_STIFFNESS)
    iterate.relaxation = 1.0
    iterate.restart_mixing()
    iterate.before, iterate.point_iteration = np.inf, now.iteration
    gradient, _ = iterate.increment.gradient(iterate.w, iterate.at)
    return _out_of_balance(iterate, now.iteration, gradient, now.contact_impulse, now.residual, now.size)


def _next_point(iterate: Iterate, now: OutOfBalance) -> OutOfBalance:
    """The out-of-balance impulses with the proximal point at w, or beyond by acceleration while drag forces count.

    Frozen contact geometry is that of an earlier point, where it would push bodies on from point to point.
    """
    increment, w = iterate.increment, iterate.w
    iterate.points += 1
    iterate.contact.frozen, iterate.contact.stiffness_failures = None, 0
    shift = w - increment.predictor
    accelerated = iterate.points > 2 and not _small_resultants(iterate, iterate.drag_impulse)
    mixed, _ = iterate.point_mixing.mixed(increment.predictor, shift, 1.0, wanted=accelerated)
    beyond = limited(increment, iterate.bodies, w, mixed - shift, MAX_POINT_SHIFT) if accelerated else None
    return _with_point(iterate, now, w if beyond is None else w + beyond)
