"""Work in a step by the forces at its start."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit import Increment
from skmpm.scene import (
    PrescribedVelocities,
    Scene,
    State,
    centres,
    normal_speeds,
    velocity_at,
    with_normal_speeds,
)
from skmpm.simulate.box_motion import mean_gradient
from skmpm.simulate.driven import driving_forces
from skmpm.simulate.rigid_energy import power_of_loads
from skmpm.simulate.rigid_state import rigid_state

Array = NDArray[np.float64]


def work_at_start(scene: Scene, state: State, increment: Increment, motions: PrescribedVelocities) -> float:
    """Work of supports, walls and rigid bodies in the step with their forces at its start [J/m].

    Of free rigid bodies it is that of gravity and loads, of driven walls along their normals that of what drives
    them: contacts bear it at the end of the step, but not where it begins to act.
    """
    contacts, loads = state.contacts, -float(state.support_force.ravel() @ increment.prescribed)
    if scene.driven_walls.size:
        forces = driving_forces(scene, state.walls, state.t)
        loads += float(forces @ normal_speeds(scene, motions.walls))
        motions = replace(motions, walls=with_normal_speeds(scene, motions.walls, np.zeros(forces.size)))
    relative = _surface_velocity(scene, state, motions, 0) - _surface_velocity(scene, state, motions, 1)
    gradient = mean_gradient(state, motions, increment.dt)
    if gradient is not None:
        relative -= gradient @ contacts.image
    if scene.free_rigid.size:
        loads += power_of_loads(scene, state, rigid_state(scene, state), motions, 0.0)
    return increment.dt * float(loads - np.einsum("ik,ik->", contacts.vectors, relative))


def _surface_velocity(scene: Scene, state: State, motions: PrescribedVelocities, side: int) -> Array:
    """Prescribed velocities (2, k) [m/s] of the first or second bodies at the contacts, zero for movable ones."""
    contacts = state.contacts
    body = contacts.bodies[side]
    arm = contacts.at(side) - centres(state.x, state.mass, state.body)[:, np.maximum(body, 0)]
    prescribed = np.where(scene.movable, 0.0, motions.rigid)
    of_bodies, walls = velocity_at(arm, prescribed[:, np.maximum(body, 0)]), np.zeros_like(contacts.x)
    if motions.walls.size:
        walls = motions.walls[np.maximum(-1 - body, 0)].T
    return np.where(body >= 0, of_bodies, walls)
