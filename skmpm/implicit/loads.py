"""Loads: dead ones, which keep their direction, and pressures on the boundary, which follow its normals.

The pressure p on a segment from boundary point a to b exerts the force p (x_b - x_a) rotated inwards, half of it on
either point: the derivative of -p A by the boundary points, with A the area that a closed outline encloses. So a
pressure all around has neither a resultant nor a moment, whatever the shape. The force belongs to the configuration
of the stresses. Its derivative is left out of the Newton matrix, which would lose its pattern: iterations converge at
the rate of the pressure over that which makes the body buckle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.implicit.budget import Budget
from skmpm.implicit.configuration import Configuration
from skmpm.implicit.terms import Path, Term

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class DeadLoad(Term):
    """Forces that do not depend on the configuration: gravity and dead loads."""

    load: Array  # (2 nodes,) or (p,) of the step [N/m]
    at_start: Array | None  # the same when a step without inertia begins [N/m]
    origin: Array  # displacement with no energy [m]
    own: slice | None = None

    def energy(self, at: Configuration) -> float:
        """Minus the work of the load from the origin [J/m]."""
        moved = at.displacement if self.own is None else at.scalars[self.own]
        return -float(self.load @ (moved - self.origin))

    def force(self, at: Configuration) -> Array:
        """Minus the load, (2 nodes,) or (p,) [N/m]."""
        return -self.load

    def budget(self, path: Path) -> Budget:
        """Its work."""
        load = self.load if self.at_start is None else 0.5 * (self.at_start + self.load)
        return Budget(external=float(load @ path.moved))


@dataclass(frozen=True)
class FollowerPressure(Term):
    """The pressures on s segments between k boundary points."""

    interpolation: sp.csr_array  # (k, nodes) from nodes to the boundary points
    reference: Array  # (2, k) positions without nodal displacement [m]
    ends: Ints  # (2, s) points at which segments start and end, the material on their left
    value: Array  # (s,) of the step [Pa]
    at_start: Array  # (s,) when it begins [Pa]

    def energy(self, at: Configuration) -> float:
        """Zero: pressures on a part of an outline have no energy."""
        return 0.0

    def force(self, at: Configuration) -> Array:
        """Minus the forces on the nodes, (2 nodes,) [N/m]."""
        return -self._exerted(at.displacement, self.value)

    def frozen(self, at: Configuration) -> Term:
        """The forces at a configuration, as a dead load."""
        load = -self.force(at)
        return DeadLoad(load, None, at.displacement)

    def budget(self, path: Path) -> Budget:
        """The work: p times the change of an area, quadratic in displacements: the force halfway gives it exactly."""
        start, end = path.start.displacement, path.end.displacement
        if path.inertia:
            exerted = self._exerted(0.5 * (start + end), self.value)
        else:
            exerted = 0.5 * (self._exerted(start, self.at_start) + self._exerted(end, self.value))
        return Budget(external=float(exerted @ path.moved))

    def _exerted(self, displacement: Array, value: Array) -> Array:
        """Nodal forces of pressures (s,) at a nodal displacement (2 nodes,), (2 nodes,) [N/m]."""
        x = self.reference + (self.interpolation @ displacement.reshape(-1, 2)).T
        along = x[:, self.ends[1]] - x[:, self.ends[0]]
        half = 0.5 * value * np.stack([-along[1], along[0]])
        count = self.reference.shape[1]
        each = [np.bincount(self.ends.ravel(), np.tile(component, 2), count) for component in half]
        return np.asarray(self.interpolation.T @ np.stack(each, axis=1)).ravel()
