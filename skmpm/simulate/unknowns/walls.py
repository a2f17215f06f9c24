"""Walls driven by a force: one unknown each, their velocity along the normal."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.contact import Constraints
from skmpm.implicit import Inertia
from skmpm.observe.regions import region
from skmpm.scene import PrescribedVelocities, Scene, State
from skmpm.simulate.unknowns.interval import Interval

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class DrivenWalls:
    """The p walls of a scene that a force drives, in one step."""

    scene: Scene
    points: Array  # (walls, 2) of all walls at the start of the step [m]
    velocity: Array  # (walls, 2) of those that are not driven [m/s]
    inertia: Inertia
    t: float  # at which forces are taken [s]
    dt: float

    @staticmethod
    def of(scene: Scene, state: State, interval: Interval) -> DrivenWalls:
        """The walls of a state in a step."""
        walls = scene.driven_walls
        v0 = np.einsum("pi,ip->p", state.wall_velocity[walls], scene.normals[:, walls])
        return DrivenWalls(
            scene,
            state.walls,
            scene.wall_velocities(state.t + 0.5 * interval.dt),
            interval.inertia(scene.wall_masses, v0),
            interval.t,
            interval.dt,
        )

    @property
    def names(self) -> list[str]:
        """The walls."""
        return [f"wall {i}" for i in self.scene.driven_walls]

    def _velocities(self, z: Array, others: Array) -> Array:
        walls, velocity = self.scene.driven_walls, others.copy()
        velocity[walls] = z[:, None] * self.scene.normals.T[walls]
        return velocity

    def load(self, z: Array) -> Array:
        """Forces towards the bodies, (p,) [N/m]: those of pressures act on lengths at the end of the step."""
        ends = self.points + self.dt * self._velocities(z, self.velocity)
        return self.scene.driving_forces(self.t, region(self.scene.normals, ends.T).length)

    def motions(self, z: Array, end: Array, prescribed: PrescribedVelocities) -> PrescribedVelocities:
        """All prescribed velocities with those of the walls."""
        walls, at_end = (self._velocities(v, prescribed.walls) for v in (z, end))
        return replace(prescribed, walls=walls, walls_at_end=at_end)

    def carried(self, translation: Array) -> Array:
        """Nothing, (p,)."""
        return np.zeros_like(self.inertia.v0)

    def rows(self, z: Array, constraints: Constraints) -> sp.csr_array:
        """J (k, p) or (2 k, p): a wall that moves along its normal closes its contacts."""
        contact, wall = np.nonzero(constraints.bodies[1][:, None] == -1 - self.scene.driven_walls)
        step = 2 if constraints.tangential else 1
        shape = (step * constraints.size, self.scene.driven_walls.size)
        return sp.csr_array((np.full(contact.size, -1.0), (step * contact, wall)), shape=shape)
