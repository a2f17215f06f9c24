"""Pressure on the boundary of bodies, which follows its normals.

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

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class FollowerPressure:
    """The pressures on s segments between k boundary points."""

    interpolation: sp.csr_array  # (k, nodes) from nodes to the boundary points
    reference: Array  # (2, k) positions without nodal displacement [m]
    ends: Ints  # (2, s) points at which segments start and end, the material on their left
    value: Array  # (s,) [Pa]

    def force(self, displacement: Array) -> Array:
        """Nodal forces at a nodal displacement, both (2 nodes,), [N/m]."""
        x = self.reference + (self.interpolation @ displacement.reshape(-1, 2)).T
        along = x[:, self.ends[1]] - x[:, self.ends[0]]
        half = 0.5 * self.value * np.stack([-along[1], along[0]])
        count = self.reference.shape[1]
        each = [np.bincount(self.ends.ravel(), np.tile(component, 2), count) for component in half]
        return np.asarray(self.interpolation.T @ np.stack(each, axis=1)).ravel()
