"""When Newton's method has converged, when it is given up, and what it says then."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skmpm.arrays import Array
from skmpm.linear import NotPositiveDefinite
from skmpm.step.contact_problem import ContactIterate
from skmpm.step.equations import Increment
from skmpm.step.errors import StepRejected, at_point, too_few_points, worst_body
from skmpm.step.matrix import check_stiffness
from skmpm.step.rotation import MAX_DRIFT
from skmpm.step.terms import Configuration

# Iterations with contacts, and a mass or a metric, after which it is given up unless one of them came closer to
# convergence: two to four are usual; contacts that snap by a cell take 20 to 30, most of them on a plateau of up to
# eight. From 10 to 40 tests pass.
PATIENCE = 20


@dataclass
class Persistence:
    """When an iteration is given up: after so many iterations, or so many in a row without progress."""

    most: int
    patience: int
    closest: float = np.inf  # distance from convergence
    progress: int = 0  # the iteration in which it was reached

    def ends(self, iteration: int, distance: float) -> bool:
        """Whether it ends; a full step more balances the momentum of a converged iterate."""
        if distance < self.closest:
            self.closest, self.progress = distance, iteration
        converged = distance <= 1.0
        return iteration >= self.most + converged or iteration - self.progress >= self.patience


@dataclass(frozen=True)
class Balance:
    """The residuals of the momentum balance and of the contact law at an iterate, with its contact impulses."""

    gradient: Array  # out-of-balance impulse without contact (n,) [kg m/s per m]
    contact_impulse: Array  # (n,)
    contact: float  # residual of the contact law
    norm: float  # out-of-balance norm over the largest term
    distance: float  # from convergence: the larger of both residuals over their tolerances

    @staticmethod
    def at(increment: Increment, w: Array, configuration: Configuration, contact: ContactIterate | None) -> Balance:
        """The residuals at a velocity w (n,) with its configuration and contact problem."""
        scheme = increment.scheme
        gradient, size = increment.gradient(w, configuration)
        impulse, residual = np.zeros_like(gradient), 0.0
        if contact is not None:
            impulse, residual = contact.impulse, contact.residual
            size = max(size, float(np.linalg.norm(impulse)), contact.impulse_round_off / scheme.newton_tol)
        norm = float(np.linalg.norm(increment.on_free_dofs(gradient - impulse)))
        norm = norm / size if size > 0.0 else 0.0
        return Balance(gradient, impulse, residual, norm, max(norm / scheme.newton_tol, residual / scheme.gap_tol))

    @property
    def out_of_balance(self) -> Array:
        """The out-of-balance impulse, (n,) [kg m/s per m]."""
        return self.gradient - self.contact_impulse


def _largest(increment: Increment, contact: ContactIterate | None, out_of_balance: Array) -> str:
    """The body with the largest out-of-balance impulse, or what has no grid and a larger one."""
    free = increment.on_free_dofs(out_of_balance)
    body, impulse = worst_body(increment.grid, increment.on_nodes(free), increment.displacement_at_start)
    each = np.nan_to_num(np.abs(increment.of_scalars(free)), nan=np.inf)
    if not each.size or each.max() < impulse:
        return body
    k = int(np.argmax(each))
    pressed = contact is not None and increment.of_scalars(contact.impulse)[k] != 0.0
    return increment.scalars.names[k] + ("" if pressed else ", on which no contact presses")


def not_converged(
    increment: Increment, contact: ContactIterate | None, balance: Balance, limit: int, drift: Array
) -> StepRejected:
    """The error after `limit` iterations: too few points, or else the criteria that are not met, and by how much."""
    if few := _too_few_points(increment):
        return few
    scheme, unmet = increment.scheme, list[tuple[str, str]]()
    if not balance.norm <= scheme.newton_tol:
        size = f"out-of-balance force {balance.norm:.2g} (tolerance {scheme.newton_tol:g})"
        unmet.append((_largest(increment, contact, balance.out_of_balance), size))
    if contact is not None and not balance.contact <= scheme.gap_tol:
        unmet.append((contact.worst_pair(), f"contact residual {balance.contact:.2g} (tolerance {scheme.gap_tol:g})"))
    if not drift.max() <= MAX_DRIFT:
        b = int(np.argmax(drift))
        size = f"out-of-balance momentum that moves it by {drift[b]:.2g} cells (tolerance {MAX_DRIFT:g})"
        unmet.append((f"body {b}", size))
    (where, criteria), *others = unmet
    criteria = ", ".join([criteria, *(f"{problem} at {place}" for place, problem in others)])
    return StepRejected(where, f"no convergence in {limit} Newton iterations: {criteria}")


def not_definite(increment: Increment, configuration: Configuration, error: np.linalg.LinAlgError) -> StepRejected:
    """The error of a matrix that nothing makes definite: too few points, or else the largest stretches."""
    grid = increment.grid
    if few := _too_few_points(increment):
        return few
    if not isinstance(error, NotPositiveDefinite):
        return StepRejected("all bodies", str(error))
    stretches = np.linalg.svd(configuration.F.transpose(2, 0, 1), compute_uv=False)
    strain = np.abs(np.log(stretches)).max(axis=1)
    worst = int(np.argmax(np.where(grid.cell_body[grid.cell_of_point] == error.bodies[0], strain, -1.0)))
    most, least = stretches[worst]
    return StepRejected(
        at_point(grid, worst, configuration.displacement),
        f"its matrix is not positive definite as it is deformed, with stretches of {least:.3g} and {most:.3g} here",
        "use a law that does not soften at these strains, or smaller loads",
    )


def _too_few_points(increment: Increment) -> StepRejected | None:
    """The error of a matrix that is indefinite even free of stress; None if it is definite."""
    try:
        check_stiffness(increment)
    except np.linalg.LinAlgError as error:
        return too_few_points(increment.grid, error)
    return None
