"""Prescribed velocities: those of walls, rigid bodies and supports, evaluated once in a step."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from skmpm.material import Rigid
from skmpm.scene.objects import SceneError, prescribed_components
from skmpm.scene.rigid_motion import rigid_motion

if TYPE_CHECKING:
    from skmpm.scene.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PrescribedVelocities:
    """The prescribed velocities of one step [m/s], in its middle but where they say so."""

    walls: Array  # (walls, 2)
    rigid: Array  # (3, bodies) of rigid bodies, with angular velocity [rad/s]; zero for those with unknowns
    rigid_at_end: Array  # (3, bodies) the same at the end of the step
    supports: Array  # (2 supports,) zero where free

    def with_walls(self, walls: NDArray[np.int64], velocity: Array) -> PrescribedVelocities:
        """The same with the velocities of some walls (k,) taken from those of all, (walls, 2)."""
        if walls.size == 0:
            return self
        mixed = self.walls.copy()
        mixed[walls] = velocity[walls]
        return replace(self, walls=mixed)


def prescribed_velocities(scene: Scene, t: float, dt: float) -> PrescribedVelocities:
    """The prescribed velocities of a step from t to t + dt [s]; SceneError where one is unclear or not finite."""
    middle = t + 0.5 * dt
    return PrescribedVelocities(
        scene.wall_velocities(middle),
        _rigid(scene, middle),
        _rigid(scene, t + dt),
        _supports(scene, t, dt),
    )


def prescribed_motions(scene: Scene) -> list[Any]:
    """What prescribes the motion of rigid bodies, walls and supports: constants and functions of time."""
    motions = [body.prescribed for body in scene.bodies if isinstance(body.material, Rigid)]
    return [*motions, *(wall.velocity for wall in scene.walls), *(support.prescribed for support in scene.supports)]


def support_velocities(scene: Scene, t: float, dt: float | None = None) -> Array:
    """Velocities of supports in a step from t to t + dt [s], (supports, 2) [m/s], nan where free.

    They are the prescribed ones in its middle, and mean ones of prescribed displacements. Without dt they are those
    at t, where displacements are differentiated over the time in which waves cross a cell, which steps do not
    resolve.

    Raises
    ------
    SceneError
        if one is invalid
    """
    interval, middle = (scene.cell / scene.fastest_wave, t) if dt is None else (dt, t + 0.5 * dt)
    each = np.empty((len(scene.supports), 2))
    for i, support in enumerate(scene.supports):
        if support.displacement is None:
            each[i] = prescribed_components(support, middle, f"support {i}: velocity")
        else:
            name = f"support {i}: displacement"
            start, end = (prescribed_components(support, time, name) for time in (t, t + interval))
            each[i] = (end - start) / interval
    return each


def _rigid(scene: Scene, t: float) -> Array:
    velocity = np.zeros((3, len(scene.bodies)))
    for b in np.flatnonzero(~scene.deformable).tolist():
        velocity[:, b] = rigid_motion(scene.bodies[b], t, f"body {b}")
    return velocity


def _supports(scene: Scene, t: float, dt: float) -> Array:
    velocity = scene.support_velocities(t, dt)
    changed = np.flatnonzero((np.isnan(velocity) != scene.free_components).any(axis=1))
    if changed.size:
        raise SceneError(
            f"support {changed[0]}: velocity at t = {t + 0.5 * dt:.6g} s is {velocity[changed[0]]}, at t = 0"
            f" {scene.support_velocities(0.0)[changed[0]]} (nan: None); a component is free always or never"
        )
    return np.nan_to_num(velocity).ravel()
