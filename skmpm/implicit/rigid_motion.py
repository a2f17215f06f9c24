"""Rigid motions of bodies, and the resultants that cause them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.grid import BodyGrids
from skmpm.implicit.residual import Increment

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RigidMotion:
    """Two translations and the rotation of each body at the start of a step; spins are times radii of gyration."""

    grid: BodyGrids
    mass: Array  # lumped (nodes,) [kg/m]
    arm: Array  # from the centre of mass (2, nodes) [m]
    total: Array  # masses (bodies,) [kg/m]
    radius: Array  # of gyration (bodies,) [m]
    turns: NDArray[np.bool_]  # (bodies,) whether anything resists rotations

    @staticmethod
    def of(increment: Increment) -> RigidMotion:
        """That of the bodies of a step; those on the gauge turn freely."""
        grid, mass = increment.grid, increment.bulk.assembly.mass[::2]
        arm = grid.arms(grid.position + increment.start.reshape(-1, 2).T, mass)
        radius = np.maximum(grid.radii_of_gyration(arm, mass), 1e-300)
        turns = np.ones(grid.bodies, dtype=bool) if increment.gauge is None else ~increment.gauge.bodies
        return RigidMotion(grid, mass, arm, np.maximum(grid.sums(mass[None])[0], 1e-300), radius, turns)

    def resultants(self, impulse: Array) -> Array:
        """Two components of nodal impulses (2 nodes,), and the moment over the radius of gyration, (3, bodies)."""
        x, y = impulse.reshape(-1, 2).T
        out = self.grid.sums(np.stack([x, y, self.arm[0] * y - self.arm[1] * x]))
        out[2] *= self.turns / self.radius
        return out

    def velocity(self, w: Array) -> Array:
        """The mean velocities of bodies and their spins, (3, bodies) [m/s], from nodal velocities (2 nodes,)."""
        return np.asarray(self.resultants(np.repeat(self.mass, 2) * w) / self.total)

    def at_nodes(self, velocity: Array) -> Array:
        """The nodal velocities (2 nodes,) [m/s] of motions (3, bodies) [m/s]."""
        x, y, spin = velocity[:, self.grid.node_body]
        spin = spin / self.radius[self.grid.node_body]
        return np.stack([x - spin * self.arm[1], y + spin * self.arm[0]], axis=1).ravel()

    def at_surface(self, velocity: Array) -> Array:
        """The speeds of surfaces, those of discs, by motions (3, bodies), (bodies,) [m/s]."""
        return np.asarray(np.hypot(velocity[0], velocity[1]) + np.sqrt(2.0) * np.abs(velocity[2]))
