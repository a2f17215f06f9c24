"""Explicit steps: the internal forces are those at the start of the step, and the mass is lumped.

Nodes whose support contains only the boundary of a body have almost no mass, and no explicit step would be short
enough for them. They are as heavy as 5 % of the heaviest node of their body (`Assembly.explicit_mass`), at the cost
of all others, so that A is diagonal and bodies keep their mass. Nodes then do not have the momentum of their points:
what bodies lack of momentum and angular momentum is added to the velocities at the end of the step. The velocities
that move the points, to which the contact law applies, stay as they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.compiled import compiled
from skmpm.grid import BodyGrids
from skmpm.implicit.bulk import Bulk, Configuration

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class ExplicitBulk:
    """The bulk of an explicit step: internal forces of its start, whatever the motion."""

    start: Configuration
    internal: Array  # (2 nodes,) forces [N/m]
    linear: bool = True

    @classmethod
    def of(cls, bulk: Bulk, configuration: Configuration) -> ExplicitBulk:
        """The forces at a configuration."""
        return cls(configuration, bulk.force(configuration))

    def at(self, displacement: Array) -> Configuration:
        """A configuration with this nodal displacement and the deformation gradients of the start."""
        return Configuration(displacement, self.start.F, self.start.dilatation)

    def energy(self, configuration: Configuration) -> float:
        """The potential of `force` [J/m]."""
        return float(self.internal @ (configuration.displacement - self.start.displacement))

    def force(self, configuration: Configuration) -> Array:
        """Internal forces of the start, (2 nodes,) [N/m]."""
        return self.internal


def with_momentum_of_points(
    grid: BodyGrids, x: Array, lumped: Array, v0: Array, w: Array, impulse: Array, held: Ints
) -> Array:
    """The velocity w plus rigid motions that balance momentum and angular momentum of bodies, (2 nodes,) [m/s].

    Without them m (w - v0), with the lumped mass m of the points (2 nodes,) [kg/m], is not balanced by an impulse
    (2 nodes,) [kg m/s per m] that acts at the nodes x (2, nodes) [m]. Bodies that supports hold (`held`) are left as
    they are: their reactions balance them.
    """
    end, free = w.copy(), np.ones(grid.bodies, dtype=bool)
    free[held] = False
    _balance(grid.blocks // 2, free, x, lumped[::2], v0.reshape(-1, 2), impulse.reshape(-1, 2), end.reshape(-1, 2))
    return end


@compiled
def _balance(
    begins: Ints, free: NDArray[np.bool_], x: Array, mass: Array, v0: Array, impulse: Array, v: Array
) -> None:
    """Add to v (nodes, 2) the rigid motions of bodies that balance m (v - v0) and the impulse."""
    for b in range(begins.size - 1):
        first, last = begins[b], begins[b + 1]
        total = 0.0
        for n in range(first, last):
            total += mass[n]
        if not free[b] or total == 0.0:
            continue
        centre_x = centre_y = momentum_x = momentum_y = 0.0
        for n in range(first, last):
            centre_x += mass[n] * x[0, n] / total
            centre_y += mass[n] * x[1, n] / total
            momentum_x += impulse[n, 0] - mass[n] * (v[n, 0] - v0[n, 0])
            momentum_y += impulse[n, 1] - mass[n] * (v[n, 1] - v0[n, 1])
        moment = inertia = 0.0
        for n in range(first, last):
            arm_x, arm_y = x[0, n] - centre_x, x[1, n] - centre_y
            moment += arm_x * (impulse[n, 1] - mass[n] * (v[n, 1] - v0[n, 1]))
            moment -= arm_y * (impulse[n, 0] - mass[n] * (v[n, 0] - v0[n, 0]))
            inertia += mass[n] * (arm_x**2 + arm_y**2)
        spin = moment / inertia if inertia > 0.0 else 0.0
        for n in range(first, last):
            v[n, 0] += momentum_x / total - spin * (x[1, n] - centre_y)
            v[n, 1] += momentum_y / total + spin * (x[0, n] - centre_x)
