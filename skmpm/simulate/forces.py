"""The forces of a scene on bodies, and properties of the loading that quasi-static steps need."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.implicit import Configuration, DeadLoad, FollowerPressure, Term, ViscousBulk
from skmpm.material import viscosity_of
from skmpm.scene import Scene, State, gravity_at, prescribed_motions
from skmpm.scheme import Scheme
from skmpm.simulate.springs import springs_of

Array = NDArray[np.float64]


def terms_of(scene: Scene, state: State, start: Configuration, dt: float, scheme: Scheme) -> Iterator[Term]:
    """The terms of a step of dt [s] from a state in a configuration, but for the bulk."""
    times = state.t, state.t + scheme.theta * dt
    if _viscous(scene):
        yield ViscousBulk.of(start, dt, scheme.theta)
    if has_gravity(scene) or scene.dead_loads:
        yield DeadLoad(external_force(scene, state, times[1]), _first_force(scene, state, scheme), state.displacement)
    if scene.pressures:
        yield follower_pressure(scene, state, *times)
    yield from springs_of(scene, state, (state.t, state.t + dt), scheme.theta)


def external_force(scene: Scene, state: State, t: float) -> Array:
    """Nodal forces of gravity and dead loads at time t, (2 nodes,) [N/m]."""
    own = scene.deformable_points
    return np.asarray(state.grids.assembly.grid.interpolation.T @ forces_on_points(scene, t)[:, own].T).ravel()


def _first_force(scene: Scene, state: State, scheme: Scheme) -> Array | None:
    """The forces at the start of a step, which only the work of one without inertia needs."""
    return None if scheme.inertia else external_force(scene, state, state.t)


def forces_on_points(scene: Scene, t: float) -> Array:
    """Gravity and dead loads at time t on the points of bodies that forces move, (2, n) [N/m]."""
    force, own = np.zeros_like(scene.initial_positions), scene.movable[scene.owner]
    if has_gravity(scene):
        force[:, own] = scene.masses[own] * gravity_at(scene, scene.initial_positions[:, own], t)
    for loaded, load in zip(scene.loaded, scene.forces(t), strict=True):
        force[:, loaded.points] += load[:, None] * loaded.share
    return force


def follower_pressure(scene: Scene, state: State, first: float, t: float) -> FollowerPressure:
    """The pressures on boundaries of a step that begins at a time `first`, with those of time t."""
    boundary, deformable = scene.outlines, scene.deformable[state.body]
    segments = np.concatenate(scene.pressed)
    begin, value = (np.repeat(scene.pressure_values(at), [own.size for own in scene.pressed]) for at in (first, t))
    c, ends = np.unique(np.stack([segments, boundary.next[segments]]), return_inverse=True)
    points = boundary.point[c]
    row = (np.cumsum(deformable) - 1)[points]  # among the points of deformable bodies
    interpolation = sp.csr_array(state.grids.assembly.grid.interpolation[row])
    return FollowerPressure(interpolation, state.x_anchor[:, points], ends.reshape(2, -1), value, begin)


def has_gravity(scene: Scene) -> bool:
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
    return moving or _viscous(scene)


def _viscous(scene: Scene) -> bool:
    """Whether any material is viscous."""
    return any(viscosity_of(material) > 0.0 for material in scene.materials)
