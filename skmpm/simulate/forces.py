"""External forces, gravity and loads, and properties of the loading that quasi-static steps need."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.implicit import FollowerPressure
from skmpm.material import viscosity_of
from skmpm.scene import Scene, State, gravity_at, prescribed_motions
from skmpm.simulate.regrid import assembly_of

Array = NDArray[np.float64]


def external_force(scene: Scene, state: State, t: float) -> Array:
    """Nodal forces of gravity and dead loads at time t, (2 nodes,) [N/m]."""
    assembly = assembly_of(state)
    if not (_has_gravity(scene) or scene.dead_loads):
        return np.zeros(2 * assembly.grid.nodes)
    at_points, own = np.zeros_like(state.x), scene.deformable_points
    if _has_gravity(scene):
        at_points[:, own] = state.mass[own] * gravity_at(scene, scene.initial_positions[:, own], t)
    add_dead_loads(scene, t, at_points)
    return np.asarray(assembly.grid.interpolation.T @ at_points[:, own].T).ravel()


def add_dead_loads(scene: Scene, t: float, at_points: Array) -> None:
    """Add the dead loads at time t to forces on points (2, n) [N/m]."""
    for loaded, force in zip(scene.loaded, scene.forces(t), strict=True):
        at_points[:, loaded.points] += force[:, None] * loaded.share


def follower_pressure(scene: Scene, state: State, t: float) -> FollowerPressure | None:
    """The pressures on boundaries at time t; None if there are none."""
    if not scene.pressures:
        return None
    boundary, deformable = scene.outlines, scene.deformable[state.body]
    segments = np.concatenate(scene.pressed)
    value = np.repeat(scene.pressure_values(t), [own.size for own in scene.pressed])
    c, ends = np.unique(np.stack([segments, boundary.next[segments]]), return_inverse=True)
    points = boundary.point[c]
    row = (np.cumsum(deformable) - 1)[points]  # among the points of deformable bodies
    interpolation = sp.csr_array(assembly_of(state).grid.interpolation[row])
    return FollowerPressure(interpolation, state.x_anchor[:, points], ends.reshape(2, -1), value)


def _has_gravity(scene: Scene) -> bool:
    """Whether the scene has gravity."""
    return callable(scene.gravity) or bool(np.any(scene.gravity))


def equilibrium_depends_on_dt(scene: Scene) -> bool:
    """Whether the equations of a quasi-static step depend on its length.

    They do if a load or a prescribed velocity is a function of time, if anything is prescribed to move, or if a
    material is viscous (resistance 2 eta / dt). Otherwise steps of all lengths have the same solutions.
    """
    loads = [*(load.force for load in scene.dead_loads), *(pressure.value for pressure in scene.pressures)]
    driving = [f for wall in scene.walls for f in (wall.force, wall.pressure)]
    motions, ends = prescribed_motions(scene), [spring.rest for spring in scene.springs]
    stress = None if scene.periodic is None else scene.periodic.stress
    if any(callable(f) for f in (scene.gravity, *loads, *driving, *ends, *motions, stress)):
        return True
    moving = any(v for motion in motions for v in motion if v is not None)
    return moving or any(viscosity_of(material) > 0.0 for material in scene.materials)
