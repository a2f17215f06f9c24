"""Factors of the Newton matrix that steps take over from earlier ones.

Of linear materials it is that of the same matrix. Of others it is that of an earlier configuration, turned with the
bodies, as long as iterations converge with it (`iteration.Refactorisation`). A state has what the factor follows
from; the factor itself is in memory once, however many states there are, and made again where it is not, as after a
restart: runs have the same bits.
"""

from __future__ import annotations

from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from skmpm.arrays import Bools
from skmpm.linear import Delassus
from skmpm.scene import Factored, Scene, State
from skmpm.scheme import Scheme
from skmpm.step.equations import Increment
from skmpm.step.iteration import Factor, Solution, factorise

MULTIGRID = "amg"  # its solutions for a body depend on other bodies: an operator that is made again has other bits
_Kept = tuple[Scene, Scheme, Factor, Delassus | Bools | None]
_factors: WeakKeyDictionary[Factored, _Kept] = WeakKeyDictionary()


def keep(scene: Scene, increment: Increment, solution: Solution) -> Factored | None:
    """Keep the factor of a solution, if a later step may use it; return what it follows from."""
    factor, contact = solution.factor, solution.contact
    if factor is None or not increment.keeps_factor:
        return None
    if not increment.linear and factor.solver.name == MULTIGRID:
        return None
    delassus = None if contact is None else contact.delassus
    points = delassus.known if isinstance(delassus, Delassus) else np.zeros(0, dtype=bool)
    kept = Factored(increment.theta_dt, increment.scheme.inertia, factor.displacement, factor.in_contact, points)
    _factors[kept] = (scene, increment.scheme, factor, delassus)
    return kept


def take(scene: Scene, state: State, increment: Increment) -> tuple[Factor | None, Delassus | Bools | None]:
    """The factor that a step begins with, and the Delassus operator of it, None for none.

    A factor that is not in memory, or of another scene or scheme, is made again; then the contact points whose
    responses the operator had take its place.
    """
    kept = state.factored
    if kept is None or not increment.keeps_factor:
        return None, None
    if (kept.theta_dt, kept.inertia) != (increment.theta_dt, increment.scheme.inertia):
        return None, None
    entry = _factors.pop(kept, None)
    if entry is not None and entry[0] is scene and entry[1] == increment.scheme:
        if entry[2].solver.name == MULTIGRID:
            _factors[kept] = entry
        return entry[2:]
    if not increment.scheme.inertia:  # of static steps, factors without a metric are kept
        increment = replace(increment, metric=np.zeros_like(increment.displacement_at_start))
    there = increment.bulk.at(kept.displacement)
    return factorise(increment, there, in_contact=kept.in_contact), kept.points if kept.points.size else None
