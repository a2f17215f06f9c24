"""What is driven, by forces or prescribed velocities, and how fast it moves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from skmpm.arrays import Array, Ints
from skmpm.scene import (
    PrescribedVelocities,
    Scene,
    State,
    centres,
    fitted_motions,
    rigid_motion,
    support_arms,
    support_rotations,
    with_normal_speeds,
)
from skmpm.step.driven_walls import driving_forces


class Moving(NamedTuple):
    """What moves at a state."""

    v: Array  # (2, k) of points, relative to a periodic box, and driven walls [m/s]
    speed: float  # of the fastest wall, edge of the box or loaded body that forces drive [m/s]


def moving(scene: Scene, state: State) -> Moving:
    """What moves at a state; components of loaded bodies that supports hold are left out."""
    v, speeds = state.v, [_of_loaded_bodies(scene, state)]
    if state.box is not None and state.box_rate is not None and scene.periodic is not None:
        i, j = scene.periodic.components
        v = state.v - state.box_rate @ state.x
        speeds.append(np.abs(state.box_rate[i, j] * np.diag(state.box)[j]))
    if scene.driven_walls.size:
        velocity = state.wall_velocity[scene.driven_walls].T
        v = np.concatenate([v, velocity], axis=1)
        speeds.append(np.hypot(*velocity))
    return Moving(v, float(np.concatenate(speeds).max(initial=0.0)))


def _of_loaded_bodies(scene: Scene, state: State) -> Array:
    """Speeds of bodies that have loads or springs, of rigid ones also at the rims as they turn [m/s]."""
    loaded = driven_bodies(scene)
    if loaded.size == 0:
        return np.zeros(0)
    owner, mass = scene.owner, scene.masses
    motion, radius = fitted_motions(state.x, state.v, mass, owner), np.zeros(len(scene.bodies))
    np.maximum.at(radius, owner, np.hypot(*(state.x - centres(state.x, mass, owner)[:, owner])))
    rims = np.where(scene.deformable, 0.0, radius * np.abs(motion[2]))
    return np.maximum(np.hypot(*(~scene.supported_bodies * motion[:2])), rims)[loaded]


def driven_bodies(scene: Scene) -> Ints:
    """The bodies that loads, springs or gravity that is a function drive, and supports do not hold."""
    loaded = scene.loaded_bodies | (scene.movable & callable(scene.gravity))
    return np.flatnonzero(loaded & ~scene.supported_bodies.all(axis=0))


def driven_by_force(scene: Scene, t: float = 0.0) -> Iterator[tuple[str, float]]:
    """What a force or a stress drives, with the speed P / (rho c) that it gives to a wave in bodies at t [m/s]."""
    if not (scene.driven_walls.size or scene.periodic is not None or (scene.loaded and scene.free_rigid.size)):
        return
    x = scene.initial_positions
    impedance = float(min(np.sqrt((m.lame[0] + 2.0 * m.lame[1]) * m.density) for m in scene.materials))
    forces = np.abs(driving_forces(scene, scene.wall_points, t))
    for i, force in zip(scene.driven_walls.tolist(), forces.tolist(), strict=True):
        width = float(np.ptp(scene.normals[0, i] * x[1] - scene.normals[1, i] * x[0]))
        yield f"wall {i} by its force", force / width / impedance
    for loaded, load in zip(scene.loaded, scene.forces(t), strict=True):
        for b in np.intersect1d(scene.owner[loaded.points], scene.free_rigid).tolist():
            own = scene.owner[loaded.points] == b
            force, (dx, dy) = load * loaded.share[own].sum(), np.ptp(x[:, scene.owner == b], axis=1)
            if size := float(np.hypot(*force)):
                width = (abs(force[0]) * dy + abs(force[1]) * dx) / size
                yield f"body {b} by its load", size / width / impedance
    if scene.periodic is not None and scene.periodic.components.size:
        yield "the periodic box by its stress", float(np.abs(scene.periodic.stress_at(t)).max()) / impedance


def prescribed_speeds(scene: Scene, t: float = 0.0, box: Array | None = None) -> Iterator[tuple[str, float]]:
    """Walls, supports, rigid bodies and edges of the periodic box with their prescribed speeds at time t [m/s].

    The edges (2, 2) of the box are those at the start if not given. Walls that forces drive have a prescribed speed
    along their normals at t = 0 only.
    """
    walls, periodic = scene.wall_velocities(t), scene.periodic
    if t != 0.0:
        walls = with_normal_speeds(scene, walls, np.zeros(scene.driven_walls.size))
    rigid = np.zeros((3, len(scene.bodies)))
    for i, body in enumerate(scene.bodies):
        if body.motion is not None:
            rigid[:, i] = np.nan_to_num(rigid_motion(body, t, f"body {i}"))
    edges = None if periodic is None else periodic.rate_at(t) @ (periodic.box if box is None else box)
    supports = np.nan_to_num(scene.support_velocities(t))
    return _speeds(scene, walls, supports, support_rotations(scene, t), rigid, edges)


def prescribed_speeds_in_step(scene: Scene, motions: PrescribedVelocities) -> Iterator[tuple[str, float]]:
    """Walls, supports, rigid bodies and edges of the periodic box with their speeds in a step [m/s].

    Walls that forces drive have their present ones.
    """
    count, edges = 2 * len(scene.supports), None
    if motions.box is not None and motions.box_at_start is not None:
        edges = (motions.box - motions.box_at_start) / motions.dt
    supports, rotations = motions.supports[:count].reshape(-1, 2), motions.supports[count:].reshape(-1, 2).T
    return _speeds(scene, motions.walls, supports, rotations, motions.rigid, edges)


def _speeds(
    scene: Scene, walls: Array, supports: Array, rotations: Array, rigid: Array, edges: Array | None
) -> Iterator[tuple[str, float]]:
    """What is driven with its speed [m/s], by velocities of walls, supports (k, 2), rigid bodies (3, k) and edges.

    Rotations of supports are rates of cosine and sine (2, k) [1/s].
    """
    for kind, velocities in (("wall", walls), ("support", supports)):
        for i, speed in enumerate(np.hypot(*velocities.T).tolist()):
            yield f"{kind} {i}", speed
    for i, rates in zip(scene.turning.tolist(), rotations.T, strict=True):
        reach = float(np.hypot(*support_arms(scene, i, scene.supported[i].points)).max())
        yield f"the rotation of support {i}", float(np.hypot(*rates)) * reach
    for i, body in enumerate(scene.bodies):
        if body.motion is not None:
            vx, vy, spin = rigid[:, i].tolist()
            x = body.points.x
            reach = float(np.hypot(*(x - np.average(x, axis=1, weights=body.points.volume)[:, None])).max())
            yield f"rigid body {i}", float(np.hypot(vx, vy) + abs(spin) * reach)
    if edges is not None:
        yield "the periodic box", float(np.hypot(*edges).max())
