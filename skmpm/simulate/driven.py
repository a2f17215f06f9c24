"""The driven walls of a step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skmpm.contact import acts_at_grid_nodes
from skmpm.implicit import DrivenWalls, Increment
from skmpm.observe.regions import region
from skmpm.scene import PrescribedVelocities, Scene, SceneError, State
from skmpm.scheme import Scheme

Array = NDArray[np.float64]

# Without inertia, mass of a driven wall in W over dt^2 times the largest shear modulus of the bodies: that of the
# springs of floating bodies (`implicit.residual.SPRING_STIFFNESS`). It does not enter the balance.
RESPONSE = 1e-3
FARTHEST = 0.5  # [cells] motion of a driven wall in one iteration without inertia


def driven_walls(
    scene: Scene, state: State, increment: Increment, motions: PrescribedVelocities
) -> DrivenWalls | None:
    """The driven walls of a step; None if there are none."""
    walls = scene.driven_walls
    if walls.size == 0:
        return None
    normal, dt, theta = scene.normals.T[walls], increment.dt, increment.scheme.theta
    along = np.einsum("pi,pi->p", state.wall_velocity[walls], normal)
    inertia, forces = increment.scheme.inertia, _forces(scene, state, increment, motions)
    stiffness = RESPONSE * (theta * dt) ** 2 * max(material.lame[1] for material, _ in increment.bulk.materials)
    return DrivenWalls(
        walls=walls,
        normal=normal,
        mass=scene.wall_masses if inertia else np.zeros(walls.size),
        response=scene.wall_masses if inertia else np.full(walls.size, stiffness),
        v0=along,
        force=forces,
        prescribed=motions.walls,
        dt=dt,
        theta=theta,
        farthest=np.inf if inertia else FARTHEST * scene.cell / dt,
    )


def _forces(
    scene: Scene, state: State, increment: Increment, motions: PrescribedVelocities
) -> Callable[[Array], Array]:
    """The driving forces as a function of the velocities of the driven walls: lengths are those at the end."""
    t, walls, normals = state.t + increment.scheme.theta * increment.dt, scene.driven_walls, scene.normals

    def force(z: Array) -> Array:
        velocity = motions.walls.copy()
        velocity[walls] = z[:, None] * normals.T[walls]
        ends = state.walls + increment.dt * velocity
        return scene.driving_forces(t, region(normals, ends.T).length)

    return force


class Moving(NamedTuple):
    """What moves at the start of a step."""

    v: Array  # (2, k) of points and driven walls [m/s]
    speed: float  # of the fastest driven wall [m/s]
    acceleration: float  # the largest of driven walls [m/s2]


def moving(scene: Scene, state: State) -> Moving:
    """What moves at a state."""
    walls = scene.driven_walls
    if walls.size == 0:
        return Moving(state.v, 0.0, 0.0)
    velocity, normal = state.wall_velocity[walls], scene.normals.T[walls]
    force = scene.driving_forces(state.t, region(scene.normals, state.walls.T).length)
    net = force + np.einsum("pi,pi->p", state.wall_force[walls], normal)
    fastest = float(np.hypot(*velocity.T).max())
    return Moving(
        np.concatenate([state.v, velocity.T], axis=1), fastest, float(np.abs(net / scene.wall_masses).max())
    )


def moving_at_start(scene: Scene, v: Array) -> Moving:
    """What moves at t = 0, with points at velocities v (2, n) [m/s]; nothing presses on the walls."""
    walls = scene.driven_walls
    if walls.size == 0:
        return Moving(v, 0.0, 0.0)
    velocity, acceleration = scene.wall_velocities(0.0)[walls], _forces_at_start(scene) / scene.wall_masses
    fastest = float(np.hypot(*velocity.T).max())
    return Moving(np.concatenate([v, velocity.T], axis=1), fastest, float(np.abs(acceleration).max()))


def driven_by_force(scene: Scene) -> Iterator[tuple[str, float]]:
    """Walls driven by a force, with the speed P / (rho c) that its pressure gives to a wave in the bodies [m/s]."""
    if scene.driven_walls.size == 0:
        return
    x = scene.initial_positions
    impedance = min(np.sqrt((m.lame[0] + 2.0 * m.lame[1]) * m.density) for m in scene.materials)
    for i, force in zip(scene.driven_walls.tolist(), np.abs(_forces_at_start(scene)).tolist(), strict=True):
        width = float(np.ptp(scene.normals[0, i] * x[1] - scene.normals[1, i] * x[0]))
        yield f"wall {i} by its force", force / width / float(impedance)


def _forces_at_start(scene: Scene) -> Array:
    points = np.array([wall.point for wall in scene.walls], dtype=float).T
    return scene.driving_forces(0.0, region(scene.normals, points).length)


def check_driven(name: str, scene: Scene, scheme: Scheme) -> None:
    """Raise SceneError if a scheme cannot drive walls, or a pressure acts on a side that is not closed."""
    if scene.driven_walls.size == 0:
        return
    first = int(scene.driven_walls[0])
    if acts_at_grid_nodes(scheme.contact):
        raise SceneError(
            f"{name}: wall {first} is driven by a force, which contact = shared_grid cannot; use point_to_curve"
        )
    points = np.array([wall.point for wall in scene.walls], dtype=float).T
    length = region(scene.normals, points).length
    for i in scene.driven_walls.tolist():
        if scene.walls[i].pressure is not None and not 0.0 < length[i] < np.inf:
            raise SceneError(
                f"{name}: wall {i} has a pressure, and other walls leave it a length of {length[i]:g} m; close the"
                " box on both sides of it, or give a force"
            )
