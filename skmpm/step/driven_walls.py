"""Walls that forces drive: their forces and pressures, and their motions as unknowns of a step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from skmpm.arrays import Array
from skmpm.contact import Constraints
from skmpm.observe.regions import region
from skmpm.scene import (
    PrescribedVelocities,
    Scene,
    SceneError,
    State,
    normal_speeds,
    with_normal_speeds,
)
from skmpm.step.scalar_unknowns import Entries, Interval, Unknowns


def driving_forces(scene: Scene, walls: Array, t: float) -> Array:
    """Driving forces at time t with walls through some points (walls, 2) [m], (p,) [N/m]."""
    return scene.driving_forces(t, region(scene.normals, walls.T, scene.initial_box).length)


def check_driven(name: str, scene: Scene) -> None:
    """Raise SceneError if a pressure acts on a side that is not closed."""
    if scene.driven_walls.size == 0:
        return
    length = region(scene.normals, scene.wall_points.T, scene.initial_box).length
    for i in scene.driven_walls.tolist():
        if scene.walls[i].pressure is not None and not 0.0 < length[i] < np.inf:
            raise SceneError(
                f"{name}: wall {i} has a pressure, and other walls leave it a length of {length[i]:g} m; close the"
                " box on both sides of it, or give a force"
            )


@dataclass(frozen=True)
class DrivenWalls(Unknowns):
    """The p walls of a scene that a force drives, in one step."""

    scene: Scene
    points: Array  # (walls, 2) of all walls at the start of the step [m]
    velocity: Array  # (walls, 2) that are given [m/s]
    start: float  # when the step begins [s]
    t: float  # at which forces are taken [s]

    @staticmethod
    def in_step(scene: Scene, state: State, interval: Interval, first: int) -> DrivenWalls:
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

    def rows(self, z: Array, constraints: Constraints, directions: Sequence[Array]) -> Entries:
        """From z to relative velocities, d k rows: a wall that moves along its normal closes its contacts."""
        contact, wall = np.nonzero(constraints.bodies[1][:, None] == -1 - self.scene.driven_walls)
        d, normal = len(directions), constraints.normal[:, contact]
        closing = [-(each[:, contact] * normal).sum(axis=0) for each in directions]
        row = (d * contact + np.arange(d)[:, None]).ravel()
        return Entries(np.concatenate(closing), row, self.first + np.tile(wall, d))
