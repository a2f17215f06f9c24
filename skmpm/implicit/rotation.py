"""The matrix of bodies that have turned since it was factorised.

The energy of a body does not change when it rotates. So its matrix turns with it, A -> R A R^T, and one that was
factorised at an earlier iterate serves after any rotation (corotational formulation: Felippa & Haugen, Comput.
Methods Appl. Mech. Eng. 194 (2005) 2285-2335). Without that, the old rotation stretches the body: a rotation by 0.01
rad that follows one of 0.01 rad strains it by 1e-4, in loose packings far more than contact forces do.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.configuration import Configuration
from skmpm.implicit.residual import Increment
from skmpm.linear import Rotated, Solver

Array = NDArray[np.float64]


def matrix_turns(increment: Increment) -> bool:
    """Whether A turns with bodies: supports have directions that stay, and some terms."""
    return increment.supports is None and all(term.turns for term in increment.terms)


def turned_solver(increment: Increment, solver: Solver, old: Configuration, new: Configuration) -> Rotated:
    """The solver for A at the old configuration, turned as bodies have turned on the way to the new one.

    Rotations are those that fit best by mass. Bodies on the gauge do not turn.
    """
    grid, weight = increment.grid, increment.bulk.assembly.lumped[::2]
    a, b = (grid.arms(grid.position + c.displacement.reshape(-1, 2).T, weight) for c in (old, new))
    moments = grid.sums(np.stack([weight * (a[0] * b[1] - a[1] * b[0]), weight * (a * b).sum(axis=0)]))
    angle = np.arctan2(moments[0], moments[1])
    if increment.gauge is not None:
        angle[increment.gauge.bodies] = 0.0
    return Rotated(solver, grid.node_body, angle)
