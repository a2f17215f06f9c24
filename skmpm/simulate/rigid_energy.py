"""Energies of what forces move and has no grid: free rigid bodies and driven walls."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit import Budget, End, Increment, Solution
from skmpm.scene import PrescribedVelocities, Scene, State, centres, mean_velocity, normal_speeds, velocity_at
from skmpm.simulate.box_motion import mean_gradient
from skmpm.simulate.rigid_state import RigidState, kinetic_energy, rigid_state

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]


def own_energies(
    scene: Scene, state: State, increment: Increment, solution: Solution, end: End, after: State
) -> Iterator[Budget]:
    """The energies of a solved step, and the work that the budget of bodies on grids lacks.

    That takes what free bodies and driven walls do at contacts for work of prescribed motions.
    """
    if scene.free_rigid.size:
        yield _free_bodies(scene, state, increment, solution, end, after)
    if scene.driven_walls.size and increment.scheme.inertia:
        yield _driven_walls(scene, state, end, after)


def own_kinetic_energy(scene: Scene, state: State) -> float:
    """Kinetic energy of the free rigid bodies, relative to a periodic box, and of the driven walls [J/m]."""
    return _kinetic_of_free_bodies(scene, state) + _kinetic_of_walls(scene, state)


def _driven_walls(scene: Scene, state: State, end: End, after: State) -> Budget:
    """Those of walls: what drives and contacts transfer is the change of momentum times the mean velocity."""
    velocities = (state.wall_velocity, end.motions.walls, after.wall_velocity)
    before, mean, last = (normal_speeds(scene, v) for v in velocities)
    work = float(scene.wall_masses @ ((last - before) * mean))
    kinetic = np.array([_kinetic_of_walls(scene, each) for each in (state, after)])
    return Budget(kinetic=kinetic, external=work)


def _kinetic_of_walls(scene: Scene, state: State) -> float:
    """Kinetic energy of the driven walls of a state by their motion along their normals [J/m]."""
    return 0.5 * float(scene.wall_masses @ normal_speeds(scene, state.wall_velocity) ** 2)


def _free_bodies(
    scene: Scene, state: State, increment: Increment, solution: Solution, end: End, after: State
) -> Budget:
    """Those of free rigid bodies; the work is of gravity and loads, of the box and at contacts."""
    start, own, motions, dt = rigid_state(scene, state), scene.free_rigid, end.motions, increment.dt
    last = _with_radius(motions.rigid_at_end[:, own], start.radius)
    gradient = mean_gradient(state, motions, dt)
    before, relative = (
        _relative(start.velocity, start.centre, state.box_rate),
        _relative(last, start.centre, gradient),
    )
    work = dt * power_of_loads(scene, state, start, motions, increment.scheme.theta * dt)
    is_free = scene.movable & ~scene.deformable
    work += _at_contacts(scene, state, solution, end, lambda arm, motion: mean_velocity(arm, motion, dt), is_free)
    kinetic = _kinetic_of_free_bodies(scene, after)
    if gradient is not None:
        work -= float(start.mass @ ((relative - before)[:2] * (gradient @ start.centre)).sum(axis=0))
        work += kinetic - kinetic_energy(start.mass, relative)  # the velocity of the box is another one there
    return Budget(kinetic=np.array([kinetic_energy(start.mass, before), kinetic]), external=work)


def _kinetic_of_free_bodies(scene: Scene, state: State) -> float:
    """Kinetic energy of the free rigid bodies of a state, relative to a periodic box [J/m]."""
    if scene.free_rigid.size == 0:
        return 0.0
    bodies = rigid_state(scene, state)
    return kinetic_energy(bodies.mass, _relative(bodies.velocity, bodies.centre, state.box_rate))


def power_of_loads(
    scene: Scene, state: State, start: RigidState, motions: PrescribedVelocities, after: float
) -> float:
    """Power of gravity and loads on the free rigid bodies, by the forces `after` a time [s] in a step [W/m]."""
    own = motions.rigid[:, scene.free_rigid]
    forces = start.loads(scene, state, state.t + after).turned(after * own[2])
    return float(forces @ _with_radius(own, start.radius).T.ravel())


def _relative(velocity: Array, centre: Array, gradient: Array | None) -> Array:
    """Velocities (3, n) of bodies relative to those of the box at their centres (2, n)."""
    if gradient is None:
        return velocity
    return np.concatenate([velocity[:2] - gradient @ centre, velocity[2:]])


def _with_radius(motions: Array, radius: Array) -> Array:
    """Velocities and angular velocities (3, n) with spins times radii of gyration (n,) [m/s]."""
    return np.stack([motions[0], motions[1], motions[2] * radius])


def work_of_turning(scene: Scene, state: State, solution: Solution, end: End, dt: float) -> float:
    """What bodies of prescribed motion that turn do at contacts, over what the budget takes for it [J/m].

    It takes the displacement of their material points, along the chords of their arcs. Contacts stay in place while
    these pass, so their work is that of the velocities at the end of the step.
    """
    held = ~scene.deformable & ~scene.movable & (end.motions.rigid[2] != 0.0)
    if not held.any():
        return 0.0

    def passing(arm: Array, motions: Array) -> Array:
        chord = mean_velocity(arm, motions, dt)
        return velocity_at(arm + dt * (chord - motions[:2]), motions) - chord

    return -_at_contacts(scene, state, solution, end, passing, held)


def _at_contacts(
    scene: Scene, state: State, solution: Solution, end: End, velocity: Callable[[Array, Array], Array], own: Bools
) -> float:
    """Work of contact impulses on some bodies (bodies,), whose points have velocities by arm and motion [J/m]."""
    contact, boundary = solution.contact, scene.outlines
    if contact is None or contact.constraints.size == 0:
        return 0.0
    body = boundary.body
    arm = state.x[:, boundary.point] - centres(state.x, state.mass, state.body)[:, body]
    moved = velocity(arm, end.motions.rigid[:, body]) * own[body]
    relative = (contact.constraints.difference @ moved.T).T
    return float(end.impulses @ contact.constraints.components(relative))
