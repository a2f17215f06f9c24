"""State at the end of a step: from the grid to points, walls and contacts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from skmpm.arrays import Array, Bools
from skmpm.contact import Constraints
from skmpm.contact.closest_points import lasting_force
from skmpm.grid.transfer import to_points
from skmpm.material import determinant, product
from skmpm.scene import (
    Contacts,
    Derived,
    PrescribedVelocities,
    Scene,
    State,
    mean_velocity,
    support_angle,
    velocity_at,
)
from skmpm.step.end import End
from skmpm.step.equations import Increment
from skmpm.step.factor import keep
from skmpm.step.newton import Solution
from skmpm.step.periodic_box import recut_box
from skmpm.step.terms import Configuration


def end_state(scene: Scene, state: State, increment: Increment, solution: Solution, end: End) -> State:
    """The state at the end of the step; positions and velocities follow the contact-corrected nodal field."""
    motions = end.motions
    dt, own, prescribed = increment.dt, scene.deformable_points, ~scene.deformable[state.body]
    bulk, grid, configuration = increment.bulk, increment.grid, end.configuration

    J, (v, C) = determinant(configuration.F), to_points(grid, increment.on_nodes(end.velocity))
    F = configuration.F if bulk.F_anchor is None else product(configuration.F, bulk.F_anchor)
    x, v, F, C, stress, weight = (
        _with_points(old, own, new)
        for old, new in (
            (state.x, state.x_anchor[:, own] + grid.at_points(configuration.displacement)),
            (state.v, v),
            (state.F, F),
            (state.C, C),
            (state.stress, bulk.cauchy(configuration)),
            (state.weight, bulk.assembly.volume * J),
        )
    )
    if prescribed.any():
        x[:, prescribed], v[:, prescribed] = _rigid_points(state, motions, prescribed, dt)
    contacts, wall_force = _contacts(scene, state.contacts, solution, end, increment)
    box, contacts = recut_box(scene, motions.box, contacts)
    return replace(
        state,
        t=state.t + dt,
        x=x,
        v=v,
        F=F,
        C=C,
        stress=stress,
        volume=scene.initial_volumes * determinant(F),
        weight=weight,
        internal=state.internal if end.internal is None else _with_points(state.internal, own, end.internal),
        displacement=configuration.displacement,
        nodal_velocity=increment.on_nodes(end.velocity),
        walls=state.walls + dt * motions.walls,
        wall_force=wall_force,
        wall_velocity=motions.walls_at_end,
        support_force=end.reaction[: 2 * len(scene.supports)].reshape(-1, 2) / dt,
        support_moment=_support_moments(scene, state.t + dt, end.reaction / dt),
        contacts=contacts,
        box=box,
        box_rate=motions.gradient_at_end,
        factored=keep(scene, increment, solution.factor, touches=solution.contact is not None),
        derived=_reusable(scene, state, increment, configuration),
    )


def _support_moments(scene: Scene, t: float, reaction: Array) -> Array:
    """Moments on supports that turn about their centres, zero for others, (supports,) [N].

    Reactions to cosine and sine are sums of scalar and vector products of the arms at t = 0 with the forces.
    """
    moments = np.zeros(len(scene.supports))
    for i, (along, across) in zip(scene.turning.tolist(), reaction[2 * moments.size :].reshape(-1, 2), strict=True):
        angle = support_angle(scene.supports[i], t, i)
        moments[i] = np.cos(angle) * across - np.sin(angle) * along
    return moments


def _with_points(old: Array, own: Bools | slice, new: Array) -> Array:
    """Values (..., n) of all points, `new` at those of index `own`, which are all if that is a slice."""
    if isinstance(own, slice):
        return new
    values = old.copy()
    values[..., own] = new
    return values


def _rigid_points(state: State, motions: PrescribedVelocities, prescribed: Bools, dt: float) -> tuple[Array, Array]:
    """Positions and velocities (2, k) of the points of rigid bodies at the end of the step."""
    body, now = state.body[prescribed], state.x[:, prescribed]
    centre = state.centres[:, body]
    x = now + dt * mean_velocity(now - centre, motions.rigid[:, body], dt)
    ahead = centre + dt * motions.rigid[:2, body]
    return x, velocity_at(x - ahead, motions.rigid_at_end[:, body])


def _reusable(scene: Scene, state: State, increment: Increment, end: Configuration) -> Derived:
    """The derived data with the configuration, which the next step begins with.

    Materials with memory answer a configuration differently in that step, which begins with other variables.
    """
    kept = end if increment.bulk.internal is None else None
    of_materials = (increment.scheme.mean_dilatation, scene.materials_by_group)
    return replace(state.grids, configuration=kept, of_materials=of_materials)


def _contacts(
    scene: Scene, before: Contacts, solution: Solution, end: End, increment: Increment
) -> tuple[Contacts, Array]:
    """The contacts with their forces (2, k), and the forces on the walls, (walls, 2) [N/m]."""
    wall_force = np.zeros((len(scene.walls), 2))
    if solution.contact is None:
        return Contacts.none(), wall_force
    constraints = solution.contact.constraints
    contacts = contacts_of(constraints, end.impulses, increment.dt)
    on_wall = constraints.bodies[1] < 0
    np.add.at(wall_force, -1 - constraints.bodies[1, on_wall], -contacts.vectors[:, on_wall].T)
    if increment.scheme.inertia:
        courant = increment.dt * scene.fastest_wave / scene.cell
        contacts = replace(contacts, lasting_force=lasting_force(before, contacts, courant))
    return contacts, wall_force


def contacts_of(constraints: Constraints, impulses: Array, dt: float) -> Contacts:
    """The contacts of constraints, with the forces of their impulses."""
    return Contacts(
        constraints.bodies,
        constraints.x,
        constraints.normal,
        constraints.forces(impulses, dt),
        constraints.gap,
        constraints.key,
        constraints.point,
        constraints.image,
    )
