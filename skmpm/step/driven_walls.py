"""Walls driven by a force: one unknown each, their velocity along the normal. Across it they move as given."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from skmpm.arrays import Array
from skmpm.contact import Constraints
from skmpm.scene import PrescribedVelocities, Scene, State, normal_speeds, with_normal_speeds
from skmpm.step.driven import driving_forces
from skmpm.step.scalar_unknowns import Interval, Unknowns


@dataclass(frozen=True)
class DrivenWalls(Unknowns):
    """The p walls of a scene that a force drives, in one step."""

    scene: Scene
    points: Array  # (walls, 2) of all walls at the start of the step [m]
    velocity: Array  # (walls, 2) that are given [m/s]
    start: float  # when the step begins [s]
    t: float  # at which forces are taken [s]

    @staticmethod
    def of(scene: Scene, state: State, interval: Interval, first: int) -> DrivenWalls:
        """The walls of a state in a step."""
        v0 = normal_speeds(scene, state.wall_velocity)
        inertia = interval.inertia(scene.wall_masses, v0)
        velocity = scene.wall_velocities(state.t + 0.5 * interval.dt)
        return DrivenWalls(inertia, interval.dt, first, scene, state.walls, velocity, state.t, interval.t)

    @property
    def names(self) -> list[str]:
        """The walls."""
        return [f"wall {i}" for i in self.scene.driven_walls]

    def load(self, z: Array) -> Array:
        """Forces towards the bodies, (p,) [N/m]: those of pressures act on lengths at the end of the step."""
        ends = self.points + self.dt * with_normal_speeds(self.scene, self.velocity, z)
        return driving_forces(self.scene, ends, self.t)

    def load_at_start(self) -> Array:
        """The forces when the step begins, (p,) [N/m]."""
        return driving_forces(self.scene, self.points, self.start)

    def motions(self, z: Array, end: Array, prescribed: PrescribedVelocities) -> PrescribedVelocities:
        """All prescribed velocities with those of the walls."""
        walls, at_end = (with_normal_speeds(self.scene, prescribed.walls, v) for v in (z, end))
        return replace(prescribed, walls=walls, walls_at_end=at_end)

    def rows(self, z: Array, constraints: Constraints) -> sp.csr_array:
        """J (k, p) or (2 k, p): a wall that moves along its normal closes its contacts."""
        contact, wall = np.nonzero(constraints.bodies[1][:, None] == -1 - self.scene.driven_walls)
        step = 2 if constraints.tangential else 1
        shape = (step * constraints.size, self.scene.driven_walls.size)
        return sp.csr_array((np.full(contact.size, -1.0), (step * contact, wall)), shape=shape)
