"""Work of supports, and at contacts of what is prescribed to move: walls, rigid bodies, images of a periodic box.

What forces drive moves with the unknowns: contacts transfer energy between these, and do no work.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skmpm.contact import Constraints, acts_at_grid_nodes
from skmpm.implicit import ContactIterate, End, Increment
from skmpm.scene import (
    PrescribedVelocities,
    Scene,
    State,
    centres,
    mean_velocity,
    velocity_at,
    with_normal_speeds,
)

Array = NDArray[np.float64]


def work_at_contacts(scene: Scene, state: State, increment: Increment, contact: ContactIterate, end: End) -> float:
    """Work at contacts in the step, by its impulses [J/m]."""
    constraints, held = contact.constraints, contact.constraints
    if scene.free_rigid.size:
        prescribed = ~scene.movable[scene.outlines.body]
        held = replace(constraints, rigid=constraints.rigid * prescribed[:, None])
    relative = constraints.components(held.prescribed)
    if scene.driven_walls.size:
        relative = relative + constraints.components(_of_driven_walls(scene, end.motions, constraints))
    if not acts_at_grid_nodes(increment.scheme.contact):
        relative = relative + _passing(scene, state, increment, constraints, end)
    return -float(end.impulses @ relative)


def _of_driven_walls(scene: Scene, motions: PrescribedVelocities, constraints: Constraints) -> Array:
    """Velocities along their normals of the driven walls at contacts, zero at others, (2, k) [m/s]."""
    across = with_normal_speeds(scene, motions.walls, np.zeros(scene.driven_walls.size))
    wall = np.where(constraints.bodies[1] < 0, -1 - constraints.bodies[1], 0)
    return np.where(constraints.bodies[1] < 0, (motions.walls - across)[wall].T, 0.0)


def _passing(scene: Scene, state: State, increment: Increment, constraints: Constraints, end: End) -> Array | float:
    """Relative velocities, rows of H, with which bodies of prescribed motion that turn pass their contacts [m/s].

    Their material points move along the chords of their arcs. Contacts stay in place while these pass, so their work
    is that of the velocities at the end of the step.
    """
    turning = ~scene.deformable & ~scene.movable & (end.motions.rigid[2] != 0.0)
    if not turning.any() or constraints.size == 0:
        return 0.0
    boundary, dt = scene.outlines, increment.dt
    arm = state.x[:, boundary.point] - centres(state.x, state.mass, state.body)[:, boundary.body]
    motions = end.motions.rigid[:, boundary.body] * turning[boundary.body]
    chord = mean_velocity(arm, motions, dt)
    passing = velocity_at(arm + dt * (chord - motions[:2]), motions) - chord
    return constraints.components((constraints.difference @ passing.T).T)


def work_at_start(scene: Scene, state: State, increment: Increment, motions: PrescribedVelocities) -> float:
    """Work of supports and at contacts in the step, with their forces at its start [J/m]."""
    contacts, of_supports = state.contacts, -float(state.support_force.ravel() @ increment.prescribed)
    relative = _surface_velocity(scene, state, motions, 0) - _surface_velocity(scene, state, motions, 1)
    gradient = motions.gradient
    if gradient is not None:
        relative -= gradient @ contacts.image
    return increment.dt * float(of_supports - np.einsum("ik,ik->", contacts.vectors, relative))


def _surface_velocity(scene: Scene, state: State, motions: PrescribedVelocities, side: int) -> Array:
    """Prescribed velocities (2, k) [m/s] of the first or second bodies at the contacts, zero for movable ones."""
    contacts = state.contacts
    body = contacts.bodies[side]
    arm = contacts.at(side) - centres(state.x, state.mass, state.body)[:, np.maximum(body, 0)]
    prescribed = np.where(scene.movable, 0.0, motions.rigid)
    of_bodies, walls = velocity_at(arm, prescribed[:, np.maximum(body, 0)]), np.zeros_like(contacts.x)
    if motions.walls.size:
        still = with_normal_speeds(scene, motions.walls, np.zeros(scene.driven_walls.size))
        walls = still[np.maximum(-1 - body, 0)].T
    return np.where(body >= 0, of_bodies, walls)
