"""Parts of Newton's method: initial guess, refactorisation, line search, when it ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skmpm.arrays import Array
from skmpm.contact import acts_at_grid_nodes
from skmpm.linear import Solver
from skmpm.material import determinant
from skmpm.step.contact_problem import ContactIterate
from skmpm.step.equations import Increment
from skmpm.step.errors import StepRejected, indefinite, worst_body
from skmpm.step.matrix import check_stiffness, coupled, solver_of
from skmpm.step.rotation import MAX_DRIFT, matrix_turns, retracted, turned_solver
from skmpm.step.terms import Configuration

# The best ratio of successive out-of-balance norms that is expected with an old matrix: that of the first iteration
# of a step, in which contacts change state, may be much better than those that follow.
BEST_RATE = 0.05

# Iterations with contacts after which it is given up unless one of them came closer to convergence: two to four are
# usual; contacts that snap by a cell take 20 to 30, most of them on a plateau of up to eight.
PATIENCE = 20

# Iterations with an old matrix that take as long as a new one: of 300 free discs one iteration takes 15 to 20 ms, the
# matrix with its factors 60 to 75 ms.
WORTH = 3
MIN_STEP_LENGTH = 1e-6  # over the Newton direction
SUFFICIENT_DECREASE = 1e-4  # Armijo's constant (Nocedal & Wright, Numerical Optimization, section 3.1)


@dataclass
class Refactorisation:
    """When a new matrix pays: where one more iteration with the present one would not converge, and a new one would.

    In contact the first iteration goes with that of an earlier step, where there is one. Far from convergence, a new
    one always pays. Closer to it, rates with a new matrix are those of contacts that change state, where there are
    some: then only one that is slower than it was when it was new, or first used, is replaced. Without contact, rates
    with an old one are at most those of the iteration before: it is kept for `WORTH` more of these.
    """

    count: int = 0  # factorisations in this step; before the first the matrix is that of an earlier step
    last: int = 0  # the iteration of the last one
    rate: float = 0.0  # of that iteration

    def made(self, iteration: int) -> None:
        """Count a factorisation in an iteration."""
        self.count, self.last = self.count + 1, iteration

    def due(
        self,
        increment: Increment,
        iteration: int,
        imbalance: float,
        before: float,
        distance: float,
        *,
        in_contact: bool = True,
    ) -> bool:
        """Whether it pays before an iteration; linear materials keep their matrix.

        The out-of-balance norm, `before` that of the iteration before, predicts the next `distance` from convergence.
        """
        if increment.linear:
            return False
        if iteration == 0:
            return not in_contact
        rate = imbalance / max(before, 1e-300)
        if self.last == iteration - 1:
            self.rate = rate
        if not in_contact:
            return distance * rate**WORTH > 1.0
        far = imbalance * BEST_RATE > increment.scheme.newton_tol
        return far or (rate > self.rate and distance * max(rate, BEST_RATE) > 1.0)


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


@dataclass(frozen=True)
class Factor:
    """A factorised matrix."""

    solver: Solver
    displacement: Array  # (2 nodes,) of the configuration of the matrix [m]
    turns: bool  # whether it turns with bodies
    in_contact: bool  # whether bodies touched

    def at(self, increment: Increment, configuration: Configuration) -> Solver:
        """The solver for the matrix turned as bodies have turned since it was factorised."""
        if not self.turns or self.displacement is configuration.displacement:
            return self.solver
        return turned_solver(increment, self.solver, self.displacement, configuration.displacement)


@dataclass(frozen=True)
class Solution:
    """A converged step."""

    w: Array  # (n,) [m/s]
    contact: ContactIterate | None
    newton: int  # iterations
    factorisations: int
    residual: float  # of the contact law at the end of the step
    imbalance: float  # relative out-of-balance norm
    reaction: Array  # (2 supports,) impulses on the supports [kg m/s per m]
    factor: Factor | None  # of the last iteration
    spin: Array | float = 0.0  # (2 nodes,) velocity that w lacks for the balance of angular momentum [m/s]
    configuration: Configuration | None = (
        None  # of w but for translations of bodies, in which stresses were evaluated
    )
    solves: int = 1  # of a static step

    @property
    def contact_impulse(self) -> Array | None:
        """The contact impulse, (n,) [kg m/s per m]; None where nothing can touch."""
        return None if self.contact is None else self.contact.impulse


def admissible_guess(increment: Increment) -> tuple[Array, Configuration]:
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
    if increment.bulk.linear or np.isfinite(increment.bulk.energy(configuration)):
        return w, configuration
    rest = increment.with_scalars(np.zeros_like(increment.displacement_at_start), increment.of_scalars(w))
    configuration = increment.at(rest)
    gradient = increment.on_nodes(increment.gradient(rest, configuration)[0])
    prescribed = increment.prescribed_only()
    nodes = prescribed - solver_of(increment, configuration)(gradient + increment.matrix(configuration) @ prescribed)
    linear = increment.with_scalars(nodes, increment.of_scalars(w))
    trial = increment.at(linear)
    if np.isfinite(increment.bulk.energy(trial)):
        return linear, trial
    if increment.supports is None:
        return rest, configuration
    worst = int(np.argmin(determinant(trial.F)))
    b = int(increment.grid.cell_body[increment.grid.cell_of_point[worst]])
    raise StepRejected(f"body {b}", "the supports move so far in one step that points are inverted (det F <= 0)")


def factorise(increment: Increment, configuration: Configuration, *, in_contact: bool) -> Factor:
    """Factorise A with what `matrix.solver_of` adds."""
    try:
        solver = coupled(increment, configuration, solver_of(increment, configuration, in_contact=in_contact))
    except np.linalg.LinAlgError as error:
        raise indefinite(increment.grid, error) from error
    return Factor(solver, configuration.displacement, matrix_turns(increment), in_contact)


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
    body, impulse = worst_body(increment.grid, increment.on_nodes(free))
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
        return indefinite(increment.grid, error)
    criteria = ", ".join(f"{problem} at {where}" for where, problem in unmet)
    return StepRejected(unmet[0][0], f"no convergence in {limit} Newton iterations: {criteria}")


def move(
    increment: Increment,
    w: Array,
    configuration: Configuration,
    direction: Array,
    gradient: Array,
    contact_impulse: Array,
) -> tuple[Array, Configuration]:
    """The next w with its configuration, by a line search.

    The search is along the Newton direction, with exact rotations of bodies (`rotation`). Linear materials take the
    step without it, since no configuration is inadmissible. `gradient` (n,) is the out-of-balance impulse with
    contact.
    """
    if increment.bulk.linear:
        return w + direction, increment.at(w + direction)
    return _search(increment, w, configuration, direction, gradient, contact_impulse)


def _round_off(increment: Increment, w: Array, configuration: Configuration, direction: Array, size: float) -> float:
    """Round-off of the potential, whose terms have this size [J/m]."""
    materials = 20.0 * float(np.finfo(float).eps) * increment.modulus * float(increment.bulk.assembly.volume.sum())
    return 1e-13 * size + materials + increment.round_off(w, configuration) * float(np.linalg.norm(direction))


def _search(
    increment: Increment,
    w: Array,
    configuration: Configuration,
    direction: Array,
    gradient: Array,
    contact_impulse: Array,
) -> tuple[Array, Configuration]:
    """Armijo backtracking on the potential minus the work of the contact impulse.

    Contact at shared grid nodes is linear in the velocity: there the search is along a straight line.
    """
    at_nodes = bool(contact_impulse.any()) and acts_at_grid_nodes(increment.scheme.contact)
    decrease, terms = float(gradient @ direction), [term.frozen(configuration) for term in increment.terms]
    start = increment.energy(w, configuration, terms) - float(contact_impulse @ w)
    round_off = _round_off(increment, w, configuration, direction, abs(start) + abs(float(contact_impulse @ w)))
    length = 1.0
    while length > MIN_STEP_LENGTH:
        step = length * direction
        trial = w + step if at_nodes else retracted(increment, w, step)
        trial_configuration = increment.at(trial)
        merit = increment.energy(trial, trial_configuration, terms) - float(contact_impulse @ trial)
        if merit <= start + SUFFICIENT_DECREASE * length * decrease + round_off:
            return trial, trial_configuration
        length *= 0.5
    raise StepRejected(
        worst_body(increment.grid, increment.on_nodes(gradient))[0],
        "the line search found no step length that lowers the energy and keeps det F > 0 at all points",
    )
