"""Prescribed velocities: those of walls, rigid bodies and supports, evaluated once in a step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skmpm.scene.input import Input
from skmpm.scene.model import Model
from skmpm.scene.objects import SceneError
from skmpm.scene.periodic import deformed
from skmpm.scene.rigid_motion import rigid_motion
from skmpm.scene.supports import support_velocities

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PrescribedVelocities:
    """The prescribed velocities of one step [m/s], in its middle but where they say so.

    Those of what forces move, which the step finds, take their places once they are known.
    """

    walls: Array  # (walls, 2)
    rigid: Array  # (3, bodies) of rigid bodies, with angular velocity [rad/s]; zero for deformable and free ones
    rigid_at_end: Array  # (3, bodies) the same at the end of the step
    supports: Array  # (2 supports,) zero where free
    walls_at_end: Array  # (walls, 2) the same as `walls`, but for driven walls
    dt: float  # of the step [s]
    box: Array | None = None  # (2, 2) edges of the periodic box at the end of the step [m]
    box_at_start: Array | None = None  # (2, 2) the same at its start [m]

    @property
    def fastest(self) -> float:
        """The largest component of a velocity of walls, rigid bodies and supports [m/s]."""
        return max(float(np.abs(each).max(initial=0.0)) for each in (self.walls, self.rigid[:2], self.supports))

    @property
    def gradient(self) -> Array | None:
        """Mean velocity gradient (2, 2) [1/s] of the box over its edges at the start; None without a box."""
        return self._gradient(self.box_at_start)

    @property
    def gradient_at_end(self) -> Array | None:
        """The same mean velocity of the edges over the edges at the end, (2, 2) [1/s]."""
        return self._gradient(self.box)

    def _gradient(self, edges: Array | None) -> Array | None:
        if self.box is None or self.box_at_start is None or edges is None:
            return None
        return np.asarray((self.box - self.box_at_start) @ np.linalg.inv(edges) / self.dt)


def prescribed_velocities(scene: Model, t: float, dt: float, box: Array | None = None) -> PrescribedVelocities:
    """The prescribed velocities of a step from t to t + dt [s], with the edges `box` of a periodic box at its start.

    Components of the motion of the box that a stress determines are zero.

    Raises
    ------
    SceneError
        if one is unclear or not finite
    """
    middle, periodic = t + 0.5 * dt, scene.periodic
    at_end = None
    if periodic is not None and box is not None:
        still = np.zeros(periodic.components.shape[1])
        at_end = deformed(box, periodic.rate_at(middle), dt, periodic.components, still)
    walls = scene.wall_velocities(middle)
    rigid, supports = (_rigid(scene, middle), _rigid(scene, t + dt)), _supports(scene, t, dt)
    return PrescribedVelocities(walls, *rigid, supports, walls, dt, at_end, box)


def prescribed_motions(scene: Input) -> list[Any]:
    """What prescribes the motion of rigid bodies, walls, supports and box: constants and functions of time."""
    rate = () if scene.periodic is None else (scene.periodic.rate,)
    box = [each if callable(each) else np.ravel(np.asarray(each, dtype=float)) for each in rate]
    motions = [body.motion for body in scene.bodies if body.motion is not None]
    walls, supports = [wall.velocity for wall in scene.walls], [support.prescribed for support in scene.supports]
    return [*motions, *walls, *supports, *box]


def _rigid(scene: Model, t: float) -> Array:
    velocity = np.zeros((3, len(scene.bodies)))
    for b in np.flatnonzero(~scene.movable).tolist():
        velocity[:, b] = rigid_motion(scene.bodies[b], t, f"body {b}")
    return velocity


def _supports(scene: Model, t: float, dt: float) -> Array:
    velocity = support_velocities(scene, t, dt)
    changed = np.flatnonzero((np.isnan(velocity) != scene.free_components).any(axis=1))
    if changed.size:
        raise SceneError(
            f"support {changed[0]}: velocity at t = {t + 0.5 * dt:.6g} s is {velocity[changed[0]]}, at t = 0"
            f" {support_velocities(scene, 0.0)[changed[0]]} (nan: None); a component is free always or never"
        )
    return np.nan_to_num(velocity).ravel()
