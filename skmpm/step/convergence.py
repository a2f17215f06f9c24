"""When Newton's method has converged, when it is given up, and what it says then."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skmpm.arrays import Array
from skmpm.linear import NotPositiveDefinite
from skmpm.step.contact_problem import ContactIterate
from skmpm.step.equations import Increment
from skmpm.step.errors import StepRejected, at_node, too_few_points, worst_body
from skmpm.step.matrix import check_stiffness
from skmpm.step.rotation import MAX_DRIFT
from skmpm.step.terms import Configuration

# Iterations with contacts after which it is given up unless one of them came closer to convergence: two to four are
# usual; contacts that snap by a cell take 20 to 30, most of them on a plateau of up to eight. From 10 to 40
# tests pass.
PATIENCE = 20


@dataclass
class Persistence:
    """When an iteration is given up: after so many iterations, or so many in a row without progress."""

    most: int
    patience: int
    closest: float = np.inf  # distance from convergence
    progress: int = 0  # the iteration in which it was reached

    @classmethod
    def for_equations(cls, increment: Increment, *, in_contact: bool) -> Persistence:
        """At most `max_newton` iterations; with contacts and a mass or a metric `PATIENCE` without progress."""
        most = increment.scheme.max_newton
        return cls(most, PATIENCE if in_contact and increment.mass.any() else most)

    def ends(self, iteration: int, distance: float) -> bool:
        """Whether it ends; a full step more balances the momentum of a converged iterate."""
        if distance < self.closest:
            self.closest, self.progress = distance, iteration
        converged = distance <= 1.0
        return iteration >= self.most + converged or iteration - self.progress >= self.patience


def with_contact(increment: Increment, contact: ContactIterate, size: float) -> tuple[Array, float, float]:
    """Contact impulse (n,), residual of the contact law, and the norm of the largest term with contact."""
    impulse, round_off = contact.impulse, contact.impulse_round_off / increment.scheme.newton_tol
    return impulse, contact.residual, max(size, float(np.linalg.norm(impulse)), round_off)


def unmet_criteria(
    increment: Increment,
    contact: ContactIterate | None,
    out_of_balance: Array,
    imbalance: float,
    residual: float,
    drift: Array,
) -> list[tuple[str, str]]:
    """The convergence criteria that are not met, where and by how much; `out_of_balance` (n,)."""
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
    free = increment.on_free_dofs(out_of_balance)
    body, impulse = worst_body(increment.grid, increment.on_nodes(free), increment.displacement_at_start)
    each = np.nan_to_num(np.abs(increment.of_scalars(free)), nan=np.inf)
    if not each.size or each.max() < impulse:
        return body
    k = int(np.argmax(each))
    pressed = contact is not None and increment.of_scalars(contact.impulse)[k] != 0.0
    return increment.scalars.names[k] + ("" if pressed else ", on which no contact presses")


def not_converged(increment: Increment, limit: int, unmet: list[tuple[str, str]]) -> StepRejected:
    """The error after `limit` iterations: too few points, or else the criteria that are not met."""
    try:
        check_stiffness(increment)
    except np.linalg.LinAlgError as error:
        return too_few_points(increment.grid, error)
    (where, criteria), *others = unmet
    criteria = ", ".join([criteria, *(f"{problem} at {place}" for place, problem in others)])
    return StepRejected(where, f"no convergence in {limit} Newton iterations: {criteria}")


def not_definite(increment: Increment, configuration: Configuration, error: np.linalg.LinAlgError) -> StepRejected:
    """The error of a matrix that nothing makes definite: too few points, or else the largest stretches."""
    grid = increment.grid
    try:
        check_stiffness(increment)
    except np.linalg.LinAlgError as unstressed:
        return too_few_points(grid, unstressed)
    if not isinstance(error, NotPositiveDefinite):
        return StepRejected("all bodies", str(error))
    stretches = np.linalg.svd(configuration.F.transpose(2, 0, 1), compute_uv=False)
    strain = np.abs(np.log(stretches)).max(axis=1)
    worst = int(np.argmax(np.where(grid.cell_body[grid.cell_of_point] == error.bodies[0], strain, -1.0)))
    most, least = stretches[worst]
    return StepRejected(
        at_node(grid, int(grid.nodes_of_cell[0, grid.cell_of_point[worst]]), configuration.displacement),
        f"its matrix is not positive definite as it is deformed, with stretches of {least:.3g} and {most:.3g} here",
        "use a law that does not soften at these strains, smaller loads, or a smaller dt",
    )
