"""How what has no grid moves in a step, and how far contact looks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skmpm.arrays import Array, Ints
from skmpm.outline.images import Images
from skmpm.scene import PrescribedVelocities, Scene, State, mean_velocity

# [cells]; a point that approaches further within a Newton iteration is detected in the next one (test_contact).
DETECTION_DISTANCE = 0.25


def contact_reach(scene: Scene) -> float:
    """Largest gap of a detected contact [m]."""
    return max(DETECTION_DISTANCE * scene.cell, scene.cohesion_range if scene.cohesive else 0.0)


@dataclass(frozen=True)
class Motion:
    """How what has no grid moves in a step."""

    dt: float  # [s]
    points: Array  # (2, m) displacements of the boundary points of rigid bodies, zero for others [m]
    walls: Array  # (2, walls, 2) points of the walls at the start, and their displacements [m]
    box: tuple[Array, Array] | None  # edges (2, 1) or (2, 2) of the periodic box at the start and at the end [m]

    @staticmethod
    def prescribed(scene: Scene, state: State, motions: PrescribedVelocities, dt: float) -> Motion:
        """The motion by prescribed velocities, or by those found for what forces drive."""
        box = None if state.box is None or motions.box is None else (state.box, motions.box)
        walls = np.stack([state.walls, dt * motions.walls])
        return Motion(dt, dt * rigid_velocities(scene, state, motions.rigid, dt), walls, box)

    def change_of_box_velocity(self, state: State) -> Array | float:
        """What a change of the rate of the periodic box adds to velocities in this step, (2, n) [m/s].

        Bodies move with the box at their centres: then all images of a body have the same motion in the box.
        """
        if self.box is None or state.box_rate is None:
            return 0.0
        change = self._stretch(*self.box) / self.dt - state.box_rate
        return np.asarray((change @ state.centres)[:, state.body])

    def largest(self, moved: Array, start: Array) -> float:
        """The largest displacement of boundary points, from `start` by `moved` (2, m) [m].

        In a periodic box without walls it is relative to the box and to the mean, since images move with the bodies.
        """
        if self.box is not None and moved.size and not self.walls.size:
            moved = moved - self._stretch(*self.box) @ start
            moved = moved - moved.mean(axis=1, keepdims=True)
        return float(np.hypot(*moved).max(initial=0.0))

    @staticmethod
    def _stretch(before: Array, after: Array) -> Array:
        """Displacement gradient (2, 2) of the periodic box in the step."""
        return np.asarray((after - before) @ np.linalg.pinv(before))

    def lattice_vectors(self, k: Ints, end: int) -> Array:
        """Vectors (2, c) [m] of k (edges, c) at the start (0) or the end (1) of the step; zero without a box."""
        return np.zeros((2, k.shape[1])) if self.box is None else np.asarray(self.box[end] @ k)

    def of_surfaces(self, surfaces: Images, moved: Array) -> Array:
        """Displacements of all surfaces, images included, from those of the boundary points of bodies (2, m) [m]."""
        return surfaces.at(moved, None if self.box is None else self.box[1] - self.box[0])


def rigid_velocities(scene: Scene, state: State, rigid: Array, dt: float) -> Array:
    """Mean velocities of the boundary points of rigid bodies in the step, zero for others, (2, m) [m/s]."""
    boundary = scene.outlines
    if scene.deformable.all():
        return np.zeros((2, boundary.size))
    velocity = rigid[:2, boundary.body]
    if rigid[2].any():
        arm = state.x[:, boundary.point] - state.centres[:, boundary.body]
        velocity = mean_velocity(arm, rigid[:, boundary.body], dt)
    return velocity
