"""Parts of Newton's method for dynamic and quasi-static steps: initial guess, refactorisation, convergence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.bulk import Configuration
from skmpm.implicit.contact_problem import ContactIterate
from skmpm.implicit.errors import StepRejected, indefinite, worst_body
from skmpm.implicit.matrix import solver_of, with_bars
from skmpm.implicit.momentum import MAX_DRIFT
from skmpm.implicit.residual import Increment
from skmpm.linear import Solver
from skmpm.material import determinant
from skmpm.scene import PrescribedVelocities

Array = NDArray[np.float64]

# Rates are ratios of successive out-of-balance norms.
SLOW_RATE = 0.3  # above it, steps are accelerated and the matrix is refactorised
STALLED_RATE = 0.8  # above it, the iteration has stalled, as near a limit point of the contacts
MIN_RATE = 0.05  # the best expected of the next iteration with an old matrix where bodies rotate freely
REFACTORISE_ABOVE = 20.0  # out-of-balance norm over `newton_tol`: below it, iterations with the old matrix cost less
# The same after the first iteration of a dynamic step, unless all contacts are frictionless: below it, one iteration
# with a new matrix usually converges; above it, the old matrix is kept unless that iteration was slow, since its
# rate, with contacts that change state, does not predict the next one.
REFACTORISE_AT_ONCE = 500.0


@dataclass(frozen=True)
class Solution:
    """A converged step."""

    w: Array  # (2 nodes,) [m/s]
    contact: ContactIterate | None
    newton: int  # iterations
    factorisations: int
    residual: float  # of the contact law at the end of the step
    imbalance: float  # relative out-of-balance norm
    reaction: Array  # (2 supports,) impulses on the supports [kg m/s per m]
    solver: Solver | None  # of the last iteration
    spin: Array | float = 0.0  # (2 nodes,) velocity that w lacks for the balance of angular momentum [m/s]

    @property
    def contact_impulse(self) -> Array | None:
        """The contact impulse at the nodes, (2 nodes,) [kg m/s per m]; None where nothing can touch."""
        return None if self.contact is None else self.contact.impulse

    def motions(self, prescribed: PrescribedVelocities) -> PrescribedVelocities:
        """All prescribed velocities, with those that the step has found for what forces move."""
        contact = self.contact
        if contact is None or contact.problem.unknowns is None:
            return prescribed
        return contact.problem.unknowns.motions(contact.z)


def first_velocity(increment: Increment) -> tuple[Array, Configuration]:
    """The velocity at which Newton's method starts, with its configuration.

    It is the initial guess; if that inverts a point (det F <= 0) of a nonlinear material, the solution without
    contact of the equations linearised about rest; and if that inverts a point too, rest.

    Raises
    ------
    StepRejected
        instead of a start from rest in scenes with supports, whose prescribed velocities exclude it
    """
    w = increment.initial_guess()
    configuration = increment.at(w)
    if increment.material_response.linear or np.isfinite(increment.energy(w, configuration)):
        return w, configuration
    rest = np.zeros_like(w)
    configuration = increment.at(rest)
    gradient, _ = increment.gradient(rest, configuration)
    prescribed = increment.prescribed_only()
    linear = prescribed - solver_of(increment, configuration, projected=True)(
        gradient + increment.matrix(configuration, projected=True) @ prescribed
    )
    trial = increment.at(linear)
    if np.isfinite(increment.energy(linear, trial)):
        return np.asarray(linear), trial
    if increment.supports is None:
        return rest, configuration
    worst = int(np.argmin(determinant(trial.F)))
    b = int(increment.grid.cell_body[increment.grid.cell_of_point[worst]])
    raise StepRejected(f"body {b}", "the supports move so far in one step that points are inverted (det F <= 0)")


def needs_refactorisation(
    increment: Increment, contact: ContactIterate | None, iteration: int, imbalance: float, before: float
) -> bool:
    """Whether the matrix must be refactorised, as one more iteration with the old one would not converge.

    The out-of-balance norm `imbalance` after that iteration is predicted from its rate to the previous one, `before`.
    Without friction or inertia bodies rotate and move more, so that matrices become outdated sooner: there no rate
    below `MIN_RATE` is expected.
    """
    tol = increment.scheme.newton_tol
    if iteration == 0:
        return True
    if imbalance <= REFACTORISE_ABOVE * tol:
        return False
    frictionless = contact is not None and contact.constraints.size > 0 and not contact.constraints.tangential
    steady = increment.scheme.inertia and not frictionless
    if iteration == 1 and steady and imbalance > REFACTORISE_AT_ONCE * tol:
        return imbalance > SLOW_RATE * before
    rate = max(imbalance / max(before, 1e-300), 0.0 if steady else MIN_RATE)
    return rate > SLOW_RATE or imbalance * rate > tol


def factorise(increment: Increment, contact: ContactIterate | None, configuration: Configuration) -> Solver:
    """Factorise A or, if no modification of it by `matrix.solver_of` is positive definite, the projected A."""
    in_contact = contact is not None and contact.constraints.size > 0
    try:
        return with_bars(increment, configuration, solver_of(increment, configuration, in_contact=in_contact))
    except np.linalg.LinAlgError:
        pass
    try:
        return with_bars(increment, configuration, solver_of(increment, configuration, projected=True))
    except np.linalg.LinAlgError as error:
        raise indefinite(increment.grid, error) from error


def with_contact(increment: Increment, contact: ContactIterate, size: float) -> tuple[Array, float, float]:
    """Contact impulse (2 nodes,), residual of the contact law, and the norm of the largest term with contact."""
    impulse, unknowns = contact.impulse, contact.problem.unknowns
    round_off = contact.impulse_round_off / increment.scheme.newton_tol
    driving = 0.0 if unknowns is None else unknowns.size(contact.z)
    return impulse, contact.residual, max(size, float(np.linalg.norm(impulse)), round_off, driving)


def out_of_balance_norm(increment: Increment, contact: ContactIterate | None, out_of_balance: Array) -> float:
    """The norm of an out-of-balance impulse (2 nodes,) with contact, and of those of scalar unknowns."""
    nodes = float(np.linalg.norm(increment.on_free_dofs(out_of_balance)))
    return nodes if contact is None else float(np.hypot(nodes, np.linalg.norm(contact.scalar_imbalance)))


def unmet_criteria(
    increment: Increment,
    contact: ContactIterate | None,
    out_of_balance: Array,
    imbalance: float,
    residual: float,
    drift: Array,
) -> list[tuple[str, str]]:
    """The convergence criteria that are not met, where and by how much; `out_of_balance` (2 nodes,)."""
    scheme, unmet = increment.scheme, list[tuple[str, str]]()
    if not imbalance <= scheme.newton_tol:
        size = f"out-of-balance force {imbalance:.2g} (tolerance {scheme.newton_tol:g})"
        unmet.append((_largest(increment, contact, out_of_balance), size))
    if contact is not None and not residual <= scheme.gap_tol:
        unmet.append((contact.worst_pair(), f"contact residual {residual:.2g} (tolerance {scheme.gap_tol:g})"))
    if not drift.max() <= MAX_DRIFT:
        b = int(np.argmax(drift))
        size = f"out-of-balance momentum that moves it by {drift[b]:.2g} cells (tolerance {MAX_DRIFT:g})"
        unmet.append((f"body {b}", size))
    return unmet


def _largest(increment: Increment, contact: ContactIterate | None, out_of_balance: Array) -> str:
    """The body with the largest out-of-balance impulse, or what has no grid and a larger one."""
    body, impulse = worst_body(increment.grid, increment.on_free_dofs(out_of_balance))
    unknowns = None if contact is None else contact.problem.unknowns
    if contact is None or unknowns is None:
        return body
    size, name = unknowns.worst(contact.z, contact.constraints, contact.r)
    return body if size < impulse else name


def not_converged(limit: int, unmet: list[tuple[str, str]]) -> StepRejected:
    """The error after `limit` iterations, with the criteria that are not met."""
    criteria = ", ".join(f"{problem} at {where}" for where, problem in unmet)
    return StepRejected(unmet[0][0], f"no convergence in {limit} Newton iterations: {criteria}")
