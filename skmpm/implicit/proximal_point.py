"""Quasi-static steps with neutral rigid-body modes: out-of-balance forces and the proximal point method.

A rigid-body mode is neutral if neither supports nor contacts give it stiffness, as the sliding of a box between
smooth plates. Newton's method with springs in A alone leaves the same out-of-balance force along it in every
iteration, and the body drifts. A proximal term then replaces the springs,

    grad E + weight (w - centre) = theta H^T r,

which has one solution nearby. The inner iterations are Newton's, for one centre; in an outer iteration the centre
moves to their solution (Rockafellar, SIAM J. Control Optim. 14, 1976), with Anderson acceleration while the proximal
force is not negligible. Along other modes that force decreases by a constant factor per outer iteration; along
neutral modes bodies stay in place, and the proximal force is their out-of-balance force. If unloaded bodies drift on
their springs, because the contacts have more negative stiffness than the springs resist, the iteration restarts with
the proximal term.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.acceleration import AndersonAcceleration
from skmpm.implicit.bulk import Configuration
from skmpm.implicit.contact_problem import ContactIterate
from skmpm.implicit.floating import NEGLIGIBLE_RESULTANT, FloatingBodies, excess_cells, limited, negligible
from skmpm.implicit.iteration import SLOW_RATE, Refactorisation, out_of_balance_norm, with_contact
from skmpm.implicit.remedies import Remedies
from skmpm.implicit.residual import Increment
from skmpm.linear import Solver

Array = NDArray[np.float64]

PROXIMAL_STIFFNESS = 1.0  # over the shear modulus of a body; with 0.4, bodies that stand on corners are pushed away
# Of proximal forces in successive outer iterations along modes that are not neutral, at that stiffness.
PROXIMAL_FORCE_RATIO = 0.3
INNER_TOLERANCE = 0.1  # out-of-balance force of the inner iterations over the proximal force
MAX_SPRING_MOTION = 1.0  # [cells] of unloaded bodies on springs outside the prescribed range; 0.5 does as well
MAX_CENTRE_SHIFT = 0.1  # [cells] of the proximal centre beyond the solution, by acceleration


@dataclass(frozen=True)
class OutOfBalance:
    """Out-of-balance impulses at an iterate, [kg m/s per m]."""

    iteration: int
    gradient: Array  # (2 nodes,) without contact, with the proximal force
    contact_impulse: Array  # (2 nodes,)
    residual: float  # of the contact law
    size: float  # norm of the largest term
    relative: float  # norm over size, with the proximal force
    without_proximal: float  # norm over size, without the proximal force


@dataclass
class Iterate:
    """The state of the Newton iteration."""

    increment: Increment
    contact: ContactIterate
    bodies: FloatingBodies
    w: Array
    configuration: Configuration
    solver: Solver | None
    remedies: Remedies
    centre_acceleration: AndersonAcceleration  # of the proximal centre
    refactorisation: Refactorisation = field(default_factory=Refactorisation)
    before: float = np.inf  # relative out-of-balance norm of the previous iteration
    centre_iteration: int = 0  # the iteration in which the proximal centre was set
    outer_iterations: int = 0

    @property
    def proximal_impulse(self) -> Array:
        """Impulse of the proximal force, (2 nodes,) [kg m/s per m]."""
        return self.increment.mass * (self.w - self.increment.inertial_velocity)


def evaluate(iterate: Iterate, iteration: int) -> OutOfBalance:
    """Evaluate the out-of-balance impulses at w with the known contact impulses."""
    increment = iterate.increment
    gradient, size = increment.gradient(iterate.w, iterate.configuration)
    if iteration > 0:  # it begins linearised about the initial guess
        iterate.contact = iterate.contact.at(iterate.w)
    contact_impulse, residual, size = with_contact(increment, iterate.contact, size)
    return _out_of_balance(iterate, iteration, gradient, contact_impulse, residual, size)


def _out_of_balance(
    iterate: Iterate, iteration: int, gradient: Array, contact_impulse: Array, residual: float, size: float
) -> OutOfBalance:
    proximal, without = iterate.proximal_impulse, gradient - contact_impulse
    norms = (out_of_balance_norm(iterate.increment, iterate.contact, g) for g in (without, without - proximal))
    relative = (norm / size if size > 0.0 else 0.0 for norm in norms)
    return OutOfBalance(iteration, gradient, contact_impulse, residual, size, *relative)


def converged(iterate: Iterate, balance: OutOfBalance) -> bool:
    """Whether forces balance, up to small proximal forces along neutral modes, and contacts satisfy their law."""
    tol = iterate.increment.scheme.newton_tol
    if balance.iteration == 0 or balance.residual > iterate.increment.scheme.gap_tol:
        return False
    return balance.without_proximal <= tol or (balance.relative <= tol and _neutral(iterate))


def _neutral(iterate: Iterate) -> bool:
    """Whether the proximal force is small and along neutral modes.

    Along other modes it has decreased to `newton_tol` after sufficiently many outer iterations.
    """
    if iterate.increment.proximal is None:
        return False
    decrease = iterate.increment.scheme.newton_tol / NEGLIGIBLE_RESULTANT
    sufficient = iterate.outer_iterations >= np.log(decrease) / np.log(PROXIMAL_FORCE_RATIO)
    return bool(sufficient and _small_resultants(iterate, iterate.proximal_impulse))


def _small_resultants(iterate: Iterate, impulse: Array) -> bool:
    """Whether the resultants of an impulse (2 nodes,) are small beside the forces on every body."""
    resultants = iterate.bodies.modes.T @ iterate.increment.without_gauge_torque(impulse)
    return negligible(iterate.increment, iterate.contact, iterate.bodies, resultants)


def update_proximal_term(iterate: Iterate, balance: OutOfBalance) -> OutOfBalance:
    """Introduce the proximal term or move its centre where either is due; the out-of-balance impulses then."""
    increment, contact = iterate.increment, iterate.contact
    if increment.proximal is not None:
        tol = increment.scheme.newton_tol
        solved = balance.relative <= max(tol, INNER_TOLERANCE * balance.without_proximal)
        wanted = solved and not (balance.without_proximal <= tol or _neutral(iterate))
        return _move_centre(iterate, balance) if wanted and balance.iteration > iterate.centre_iteration else balance
    slow = balance.iteration > 2 and balance.relative > SLOW_RATE * iterate.before
    neutral = slow and (balance.relative < iterate.before or contact.stiffness_failures > 0)
    if neutral and _small_resultants(iterate, balance.gradient - balance.contact_impulse):
        return _replace_springs(iterate, balance)
    return balance


def drifts_on_springs(iterate: Iterate) -> bool:
    """Whether unloaded bodies drift although they have springs, which resist less than contacts soften."""
    if iterate.increment.proximal is not None or iterate.bodies.loaded:
        return False
    return bool(excess_cells(iterate.increment, iterate.bodies, iterate.w).max() > MAX_SPRING_MOTION)


def restart(iterate: Iterate, start: tuple[Array, Configuration], iteration: int) -> OutOfBalance:
    """Restart from the initial guess with a proximal term for the springs; the out-of-balance impulses there."""
    iterate.w, iterate.configuration = start
    iterate.contact = iterate.contact.with_frozen_geometry(None)
    return _replace_springs(iterate, evaluate(iterate, iteration))


def _replace_springs(iterate: Iterate, balance: OutOfBalance) -> OutOfBalance:
    """Replace the springs by a proximal term about w, without frozen geometry; the out-of-balance impulses then."""
    iterate.solver = None
    iterate.contact = iterate.contact.without_delassus().with_frozen_geometry(None)
    return _set_centre(iterate, balance, iterate.w)


def _set_centre(iterate: Iterate, balance: OutOfBalance, centre: Array) -> OutOfBalance:
    """Set the proximal centre and restart the acceleration; the out-of-balance impulses then."""
    iterate.increment = iterate.increment.with_proximal_centre(centre, PROXIMAL_STIFFNESS)
    iterate.remedies.restart()
    iterate.before, iterate.centre_iteration = np.inf, balance.iteration
    gradient, _ = iterate.increment.gradient(iterate.w, iterate.configuration)
    known = balance.contact_impulse, balance.residual, balance.size
    return _out_of_balance(iterate, balance.iteration, gradient, *known)


def _move_centre(iterate: Iterate, balance: OutOfBalance) -> OutOfBalance:
    """Move the proximal centre to w, or beyond by acceleration; the out-of-balance impulses then.

    Frozen contact geometry belongs to an earlier centre: kept, it would displace bodies in every outer iteration.
    """
    increment, w = iterate.increment, iterate.w
    iterate.outer_iterations += 1
    iterate.contact = iterate.contact.with_frozen_geometry(None)
    shift = w - increment.inertial_velocity
    accelerated = iterate.outer_iterations > 2 and not _small_resultants(iterate, iterate.proximal_impulse)
    step = iterate.centre_acceleration.accelerate(increment.inertial_velocity, shift, wanted=accelerated)
    beyond = None if step is None else limited(increment, iterate.bodies, w, step - shift, MAX_CENTRE_SHIFT)
    return _set_centre(iterate, balance, w if beyond is None else w + beyond)
