"""The factorised Newton matrix of a step: when it is made, kept for later steps, turned and replaced.

A step in contact begins with the factor of an earlier one, turned with the bodies. Of linear materials it is that of
the same matrix. A state has what the factor follows from; the factor itself is in memory once, however many states
there are, and made again where it is not, as after a restart: runs have the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np

from skmpm.arrays import Array, Bools
from skmpm.linear import Delassus, Solver
from skmpm.scene import Factored, Scene, State
from skmpm.scheme import Scheme
from skmpm.step.convergence import not_definite
from skmpm.step.equations import Increment
from skmpm.step.matrix import coupled, solver_of
from skmpm.step.rotation import matrix_turns, turned_solver
from skmpm.step.terms import Configuration

# The best ratio of successive out-of-balance norms that is expected with an old matrix: that of the first iteration
# of a step, in which contacts change state, may be much better than those that follow (test_implicit).
BEST_RATE = 0.05

# Iterations with an old matrix that take as long as a new one: of 300 free discs one iteration takes 15 to 20 ms, the
# matrix with its factors 60 to 75 ms (test_implicit).
WORTH = 3

MULTIGRID = "amg"  # its solutions for a body depend on other bodies: an operator that is made again has other bits


@dataclass(frozen=True)
class Factor:
    """A factorised matrix, with the responses of contact points to it that were found so far."""

    solver: Solver
    displacement: Array  # (2 nodes,) of the configuration of the matrix [m]
    turns: bool  # whether it turns with bodies
    in_contact: bool  # whether bodies touched
    delassus: Delassus | None = None  # None before the first contact
    points: Bools | None = None  # (m,) contact points that are in it from the beginning; None for none

    def at(self, increment: Increment, configuration: Configuration) -> Solver:
        """The solver for the matrix turned as bodies have turned since it was factorised."""
        if not self.turns or self.displacement is configuration.displacement:
            return self.solver
        return turned_solver(increment, self.solver, self.displacement, configuration.displacement)


def factorise(increment: Increment, configuration: Configuration, *, in_contact: bool) -> Factor:
    """Factorise A with what `matrix.solver_of` adds."""
    try:
        solver = coupled(increment, configuration, solver_of(increment, configuration, in_contact=in_contact))
    except np.linalg.LinAlgError as error:
        raise not_definite(increment, configuration, error) from error
    return Factor(solver, configuration.displacement, matrix_turns(increment), in_contact)


@dataclass
class Refactorisation:
    """When a new matrix pays: where one more iteration with the present one would not converge, and a new one would.

    In contact the first iteration goes with the matrix of an earlier step, where there is one. Far from convergence a
    new one always pays. Closer to it, contacts that change state slow down iterations with any matrix. Then the
    present one is replaced if iterations are slower than the first one with it. Without contact it is kept if `WORTH`
    more iterations as good as the last one converge.
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


_Kept = tuple[Scene, Scheme, Factor]
_factors: WeakKeyDictionary[Factored, _Kept] = WeakKeyDictionary()


def keep(scene: Scene, increment: Increment, factor: Factor | None, *, touches: bool) -> Factored | None:
    """Keep the last factor of a step, if a later step may use it; return what it follows from.

    Responses of contact points are left out where nothing `touches`.
    """
    if factor is None or not increment.keeps_factor:
        return None
    if not increment.linear and factor.solver.name == MULTIGRID:
        return None
    if not touches:
        factor = replace(factor, delassus=None, points=None)
    points = np.zeros(0, dtype=bool) if factor.delassus is None else factor.delassus.known
    kept = Factored(increment.theta_dt, increment.scheme.inertia, factor.displacement, factor.in_contact, points)
    _factors[kept] = (scene, increment.scheme, factor)
    return kept


def take(scene: Scene, state: State, increment: Increment) -> Factor | None:
    """The factor that a step begins with, None for none.

    One that is not in memory, or of another scene or scheme, is made again, for the contact points whose responses it
    had.
    """
    kept = state.factored
    if kept is None:
        return None
    entry = _factors.pop(kept, None)
    if not increment.keeps_factor or (kept.theta_dt, kept.inertia) != (increment.theta_dt, increment.scheme.inertia):
        return None
    if entry is not None and entry[0] is scene and entry[1] == increment.scheme:
        if entry[2].solver.name == MULTIGRID:
            _factors[kept] = entry
        return entry[2]
    if not increment.scheme.inertia:  # of static steps, factors without a metric are kept
        increment = replace(increment, metric=np.zeros_like(increment.displacement_at_start))
    there = increment.bulk.at(kept.displacement)
    again = factorise(increment, there, in_contact=kept.in_contact)
    return replace(again, points=kept.points if kept.points.size else None)
