"""Explicit steps: the internal forces are those at the start of the step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.bulk import Bulk, Configuration
from skmpm.material import Points, bounded_modulus

Array = NDArray[np.float64]

GHOST_MASS = 0.05  # of density h^2: the ghost penalty on accelerations


@dataclass(frozen=True)
class ExplicitBulk:
    """The bulk of an explicit step: internal forces of its start, and a ghost penalty on accelerations.

    Nodes whose support contains only the boundary of a body have almost no mass, and no explicit step would be short
    enough for them. The penalty adds to M a term in the jumps of the acceleration gradient across the ghost facets,
    which vanishes for rigid motions and uniform strain rates (Stoter et al., Comput. Methods Appl. Mech. Eng. 412
    (2023) 116074). It is written as a stiffness against the deviation from the inertial displacement, that by v0
    alone.
    """

    bulk: Bulk
    start: Configuration
    internal: Array  # (2 nodes,) forces [N/m]
    inertial_displacement: Array  # (2 nodes,) at the end of the step, by v0 alone [m]
    ghost_scale: Array  # (nodes,) from the ghost stiffness of displacements to that of the deviation
    linear: bool = True

    @classmethod
    def of(cls, bulk: Bulk, configuration: Configuration, v0: Array, dt: float, ghost: float) -> ExplicitBulk:
        """The forces at a configuration, for `ghost` as in Scheme."""
        grid = bulk.assembly.grid
        # One factor per body keeps the matrix symmetric: of several materials the heaviest over the softest.
        density, modulus = np.zeros(grid.bodies), np.full(grid.bodies, np.inf)
        for material, points in bulk.materials if ghost > 0.0 else ():
            own = grid.cell_body[grid.cell_of_point[points]]
            density[own] = np.maximum(density[own], material.density)
            modulus[own] = np.minimum(modulus[own], ghost * bounded_modulus(material))
        ghost_scale = GHOST_MASS * density * (grid.cell / dt) ** 2 / modulus
        inertial_displacement = configuration.displacement + dt * v0
        return cls(bulk, configuration, bulk.force(configuration), inertial_displacement, ghost_scale[grid.node_body])

    def at(self, displacement: Array) -> Configuration:
        """A configuration with this nodal displacement and the deformation gradients of the start."""
        return Configuration(displacement, self.start.F, self.start.dilatation)

    def energy(self, configuration: Configuration) -> float:
        """The potential of `force` [J/m]."""
        U = configuration.displacement
        increment, deviation = U - self.start.displacement, U - self.inertial_displacement
        return float(self.internal @ increment + 0.5 * deviation @ self._ghost(deviation))

    def force(self, configuration: Configuration) -> Array:
        """Internal forces of the start and force of the ghost penalty, (2 nodes,) [N/m]."""
        return self.internal + self._ghost(configuration.displacement - self.inertial_displacement)

    def _ghost(self, deviation: Array) -> Array:
        return np.asarray(np.repeat(self.ghost_scale, 2) * self.bulk.assembly.ghost_force(deviation))

    def stiffness(self, configuration: Configuration, *, projected: Points = False) -> Array:
        """Stiffness of the ghost penalty, in the pattern of A, (blocks, 2, 2) [Pa]."""
        assembly = self.bulk.assembly
        return np.asarray(np.repeat(self.ghost_scale, np.diff(assembly.indptr))[:, None, None] * assembly.ghost_data)
