"""The energy budget of a step: a sum over its terms, motion, contacts, and the work of what is prescribed to move.

What forces drive moves with the unknowns: contacts transfer energy between these, and do no work.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from skmpm.arrays import ROUND_OFF, Array
from skmpm.contact import Constraints, acts_at_grid_nodes
from skmpm.contact.motion import rigid_velocities
from skmpm.scene import (
    PrescribedVelocities,
    Scene,
    State,
    mean_velocity,
    support_angle,
    velocity_at,
    with_normal_speeds,
)
from skmpm.step.contact_problem import ContactIterate
from skmpm.step.end import End
from skmpm.step.equations import Increment
from skmpm.step.newton import Solution
from skmpm.step.terms import Budget, Path


def budget_of(scene: Scene, state: State, increment: Increment, solution: Solution, end: End, after: State) -> Budget:
    """The energy budget of a solved step, the sum of those of its terms."""
    scheme, contact = increment.scheme, solution.contact
    stressed = end.configuration if scheme.theta == 1.0 else increment.at(solution.w)
    theta = scheme.theta if scheme.inertia else None
    path = Path(increment.at_start, stressed, end.configuration, theta, end.internal)
    work = -float(end.reaction @ increment.prescribed)
    if contact is not None:
        work += work_at_contacts(scene, state, increment, contact, end)
    at_start = partial(work_at_start, scene, state, increment, end.motions)
    total = Budget(external=path.mean(lambda at, part: work if part else at_start()))
    if scheme.inertia:
        total += _of_motion(state, increment, end, after)
    if contact is not None:
        total += _of_contacts(increment, contact)
    for term in increment.terms:
        total += term.budget(path)
    return _as_reported(total, state.report.energy.elastic)


def _as_reported(budget: Budget, elastic: float) -> Budget:
    """The budget with the elastic energy of the last report where a state from a file evaluates it again."""
    first = budget.elastic[0]
    if abs(first - elastic) > ROUND_OFF * abs(elastic):
        return budget
    return replace(budget, elastic=np.array([elastic, budget.elastic[1]]))


def _of_motion(state: State, increment: Increment, end: End, after: State) -> Budget:
    """Kinetic energies, relative to a periodic box, which works on bodies that move to where it moves otherwise."""
    mass, v0, v1 = _counted(increment), increment.v0, end.velocity
    gradient = end.motions.gradient
    if gradient is None or after.box_rate is None:
        kinetic, work = np.array([kinetic_energy(mass, v) for v in (v0, v1)]), 0.0
        swing = float(kinetic[1] - 0.5 * kinetic.sum())
    else:
        of_box, there = (
            increment.of_bodies(rate @ each.centres) for rate, each in ((gradient, state), (after.box_rate, after))
        )
        kinetic = np.array([kinetic_energy(mass, v) for v in (v0 - of_box, v1 - there)])
        at_rate = kinetic_energy(mass, v1 - of_box)
        work = float(kinetic[1]) - at_rate - float((mass * (v1 - v0)) @ of_box)
        swing = 0.5 * (at_rate - kinetic[0])
    return Budget(kinetic=kinetic, external=work, swing=0.0 if increment.scheme.theta == 1.0 else swing)


def kinetic_energy(mass: Array, v: Array) -> float:
    """Kinetic energy of velocities (n,) with masses (n,) [J/m]."""
    return 0.5 * float(v @ (mass * v))


def _counted(increment: Increment) -> Array:
    """The masses (n,) [kg/m] but those of the edges of a periodic box, and of prescribed motions of rigid bodies."""
    mass = increment.mass.copy()
    for kind in increment.scalars.kinds:
        increment.of_scalars(mass)[kind.own] *= kind.counted
    return mass


def _of_contacts(increment: Increment, contact: ContactIterate) -> Budget:
    """What contacts store, lose and tolerate."""
    constraints, r, dt = contact.constraints, contact.r, increment.dt
    rounding = float(increment.bulk.assembly.mass.sum()) * contact.problem.speed_round_off**2
    if constraints.size == 0:
        return Budget(rounding=rounding)
    k = int(np.argmax(constraints.pushed_out))
    works = (constraints.lifted(r, dt) * contact.u).reshape(constraints.size, -1).sum(axis=1)
    return Budget(
        push_out=float(constraints.forces(r, dt)[0] @ constraints.pushed_out),
        cohesion=-float(constraints.tensile_strength @ constraints.opening),
        tolerated=float(np.maximum(works, 0.0).sum()),
        rounding=rounding,
        overlap=float(constraints.pushed_out[k]),
        overlapping=constraints.bodies[:, k],
    )


def work_at_contacts(scene: Scene, state: State, increment: Increment, contact: ContactIterate, end: End) -> float:
    """Work at contacts in the step, by its impulses [J/m]."""
    constraints, held = contact.constraints, contact.constraints
    if scene.free_rigid.size:
        given = end.motions.rigid * scene.held_components
        held = replace(constraints, rigid=rigid_velocities(scene, state, given, increment.dt).T)
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
    turning = scene.held_components[2] & (end.motions.rigid[2] != 0.0)
    if not turning.any() or constraints.size == 0:
        return 0.0
    boundary, dt = scene.outlines, increment.dt
    arm = state.x[:, boundary.point] - state.centres[:, boundary.body]
    motions = end.motions.rigid[:, boundary.body] * turning[boundary.body]
    chord = mean_velocity(arm, motions, dt)
    passing = velocity_at(arm + dt * (chord - motions[:2]), motions) - chord
    return constraints.components((constraints.difference @ passing.T).T)


def work_at_start(scene: Scene, state: State, increment: Increment, motions: PrescribedVelocities) -> float:
    """Work of supports and at contacts in the step, with their forces at its start [J/m]."""
    contacts, moved = state.contacts, increment.prescribed[: state.support_force.size]
    of_supports = -float(state.support_force.ravel() @ moved)
    for i in scene.turning.tolist():
        start, end = (support_angle(scene.supports[i], t, i) for t in (state.t, state.t + increment.dt))
        of_supports -= float(state.support_moment[i]) * (end - start) / increment.dt
    relative = _surface_velocity(scene, state, motions, 0) - _surface_velocity(scene, state, motions, 1)
    gradient = motions.gradient
    if gradient is not None:
        relative -= gradient @ contacts.image
    return increment.dt * float(of_supports - np.einsum("ik,ik->", contacts.vectors, relative))


def _surface_velocity(scene: Scene, state: State, motions: PrescribedVelocities, side: int) -> Array:
    """Prescribed velocities (2, k) [m/s] of the first or second bodies at the contacts, zero for movable ones."""
    contacts = state.contacts
    body = contacts.bodies[side]
    arm = contacts.at(side) - state.centres[:, np.maximum(body, 0)]
    prescribed = motions.rigid * scene.held_components
    of_bodies, walls = velocity_at(arm, prescribed[:, np.maximum(body, 0)]), np.zeros_like(contacts.x)
    if motions.walls.size:
        still = with_normal_speeds(scene, motions.walls, np.zeros(scene.driven_walls.size))
        walls = still[np.maximum(-1 - body, 0)].T
    return np.where(body >= 0, of_bodies, walls)
