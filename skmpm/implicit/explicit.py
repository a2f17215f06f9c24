"""Explicit steps: the bodies push with the stress that they have when the step begins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.bulk import Bulk, Configuration
from skmpm.material import bounded_modulus

Array = NDArray[np.float64]

GHOST_MASS = 0.05  # of density h^2: the ghost penalty on accelerations


@dataclass(frozen=True)
class StartForces:
    """The bulk of an explicit step: all forces are those of its start, accelerations bear a ghost penalty.

    Nodes that only see the edge of a point have next to no mass, and no explicit step would be short enough for
    them. The penalty adds to M what a jump of the gradient of the acceleration meets on the ghost facets, nothing for
    rigid motions and uniform strain rates (Stoter et al., Comput. Methods Appl. Mech. Eng. 412 (2023) 116074).
    It is written as a stiffness against leaving the way that v0 alone would lead.
    """

    bulk: Bulk
    start: Configuration
    internal: Array  # (2 nodes,) forces [N/m]
    flight: Array  # (2 nodes,) displacement by v0 alone [m]
    share: Array  # (nodes,) of the ghost stiffness that resists
    linear: bool = True

    @classmethod
    def of(cls, bulk: Bulk, at: Configuration, v0: Array, dt: float, ghost: float) -> StartForces:
        """The forces at a configuration, for `ghost` as in Scheme."""
        grid = bulk.assembly.grid
        share = np.zeros(grid.bodies)
        for material, points in bulk.materials if ghost > 0.0 else ():
            inertia = GHOST_MASS * material.density * (grid.cell / dt) ** 2
            share[grid.cell_body[grid.cell_of_point[points]]] = inertia / (ghost * bounded_modulus(material))
        return cls(bulk, at, bulk.force(at), at.displacement + dt * v0, share[grid.node_body])

    def at(self, displacement: Array) -> Configuration:
        """The points as they are at the start, the nodes where they are told."""
        return Configuration(displacement, self.start.F, self.start.dilatation)

    def energy(self, at: Configuration) -> float:
        """What `force` is the derivative of [J/m]."""
        moved, left = at.displacement - self.start.displacement, at.displacement - self.flight
        return float(self.internal @ moved + 0.5 * left @ self._ghost(left))

    def force(self, at: Configuration) -> Array:
        """Forces of the start and the ghost penalty's, (2 nodes,) [N/m]."""
        return self.internal + self._ghost(at.displacement - self.flight)

    def _ghost(self, left: Array) -> Array:
        return np.asarray(np.repeat(self.share, 2) * self.bulk.assembly.ghost_force(left))

    def stiffness(self, at: Configuration, *, projected: bool) -> Array:
        """That of the ghost penalty, in the pattern of A, (blocks, 2, 2) [Pa]."""
        assembly = self.bulk.assembly
        return np.asarray(np.repeat(self.share, np.diff(assembly.indptr))[:, None, None] * assembly.ghost_data)
