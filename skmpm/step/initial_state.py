"""The initial state, and properties of a scene at t = 0."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from skmpm.arrays import Array
from skmpm.contact import acts_at_grid_nodes
from skmpm.contact.self_contact import may_touch_itself
from skmpm.grid.transfer import to_nodes
from skmpm.material import Rigid
from skmpm.scene import (
    Contacts,
    Energy,
    Report,
    Scene,
    SceneError,
    State,
    centres,
    check_scene,
    check_walls_at_start,
    field_values,
    initial_internal,
    initial_rigid_motion,
    normal_speeds,
    prescribed_velocities,
    velocity_at,
)
from skmpm.scheme import Scheme
from skmpm.step.budget import kinetic_energy
from skmpm.step.driven_walls import check_driven
from skmpm.step.new_state import contacts_of
from skmpm.step.periodic_box import velocity_of_box
from skmpm.step.regrid import regridded_state
from skmpm.step.rigid_bodies import rigid_state
from skmpm.step.scene_forces import springs_of


def initial(scene: Scene, *, scheme: Scheme = Scheme()) -> State:  # noqa: B008
    """State at t = 0, with the contacts found there.

    Parameters
    ----------
    scene : the scene
    scheme : scheme that decides how body grids are built

    Returns
    -------
    the state at t = 0

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> floor = skmpm.Wall((0, -1e-3), (0, 1))
    >>> scene = skmpm.Scene([body], cell=4e-4, walls=[floor], gravity=(0, -9.81))
    >>> state = skmpm.initial(scene)
    >>> state.t
    0.0
    >>> round(float(1e3 * state.mass.sum()), 3)
    3.142
    """
    check_scene("initial", scene)
    check_scheme("initial", scheme)
    check_contact("initial", scene, scheme)
    check_driven("initial", scene)
    check_walls_at_start(scene)
    x, volume = scene.initial_positions.copy(), scene.initial_volumes.copy()
    body = scene.owner.copy()
    v, C = initial_motion(scene)
    rate = None if scene.periodic is None else scene.periodic.rate_at(0.0)
    if rate is not None:
        v += (rate @ centres(x, scene.densities * volume, body) * scene.movable)[:, body]
    n = x.shape[1]
    state = State(
        t=0.0,
        x=x,
        v=v,
        F=np.repeat(np.eye(2)[:, :, None], n, axis=2),
        C=C,
        stress=np.zeros((2, 2, n)),
        mass=scene.densities * volume,
        volume=volume,
        weight=volume,
        internal=initial_internal(scene),
        body=body,
        x_anchor=x,
        F_anchor=np.repeat(np.eye(2)[:, :, None], n, axis=2),
        stress_anchor=np.zeros((2, 2, n)),
        displacement=np.zeros(0),
        walls=scene.wall_points.copy(),
        wall_normals=scene.normals.T.copy(),
        wall_force=np.zeros((len(scene.walls), 2)),
        wall_velocity=scene.wall_velocities(0.0),
        support_force=np.zeros((len(scene.supports), 2)),
        support_moment=np.zeros(len(scene.supports)),
        contacts=Contacts.none(),
        report=Report(),
        box=scene.initial_box,
        box_rate=rate,
    )
    state, _ = regridded_state(scene, state, scheme)
    assembly, deformable = state.grids.assembly, scene.deformable[body]
    nodal = to_nodes(assembly, state.mass[deformable], v[:, deformable], C[:, :, deformable])
    weight = volume.copy()
    weight[deformable] = assembly.volume
    state = replace(state, weight=weight)
    report = Report(energy=_initial_energy(scene, state, nodal))
    return replace(state, contacts=_initial_contacts(scene, state, scheme), report=report)


def _initial_energy(scene: Scene, state: State, nodal: Array) -> Energy:
    """Energy of bodies with nodal velocities (2 nodes,) [m/s], relative to a periodic box, and of springs, walls."""
    kinetic = kinetic_energy(state.grids.assembly.mass, nodal - velocity_of_box(state, state.box_rate))
    springs = sum(each.stored(state.displacement, 0.0) for each in springs_of(scene, state, (0.0, 0.0), 1.0))
    kinetic += kinetic_energy(scene.wall_masses, normal_speeds(scene, state.wall_velocity))
    if scene.free_rigid.size:
        bodies = rigid_state(scene, state)
        kinetic += sum(kinetic_energy(bodies.mass, v) for v in bodies.relative(state.box_rate) * bodies.free)
    return Energy(kinetic=kinetic, springs=springs)


def _initial_contacts(scene: Scene, state: State, scheme: Scheme) -> Contacts:
    """The contacts found at t = 0, without forces."""
    if not touches(scene, state, scheme):
        return state.contacts
    # The step is so short that nothing moves and the search radius of contact detection does not grow.
    grid, v = state.grids.assembly.grid, state.v
    speed = max(float(np.abs(v).max()), float(np.abs(scene.wall_velocities(0.0)).max(initial=0.0)))
    dt = 1e-9 * scene.cell / max(speed, scene.cell)
    motions = prescribed_velocities(scene, 0.0, dt, state.box)
    linearise = scheme.contact(scene, state, grid, dt, scheme.theta, motions, scheme.inertia)
    found = linearise(np.zeros(2 * grid.nodes))
    return contacts_of(found, np.zeros_like(found.offset), dt)


def check_scheme(name: str, scheme: object) -> None:
    """Raise ValueError if scheme is not a Scheme; `name` is the calling function."""
    if not isinstance(scheme, Scheme):
        raise ValueError(f"{name}: scheme = {scheme!r}; give a Scheme, as skmpm.Scheme.fast()")


def check_contact(name: str, scene: Scene, scheme: Scheme) -> None:
    """Raise SceneError if a scene has what contacts at shared grid nodes cannot."""
    found = ["the scene has cohesion"] if scene.cohesive else []
    found += [f"wall {i} is driven by a force" for i in scene.driven_walls[:1]]
    found += [f"body {b} is a free rigid body" for b in scene.free_rigid[:1]]
    found += ["the box is periodic"] if scene.periodic is not None else []
    if found and acts_at_grid_nodes(scheme.contact):
        raise SceneError(
            f"{name}: {found[0]}, which contact = shared_grid cannot; use Scheme(contact=contact.point_to_curve)"
        )


def initial_motion(scene: Scene) -> tuple[Array, Array]:
    """Velocities (2, n) [m/s] of the points at t = 0 and their gradients (2, 2, n) [1/s], relative to the box."""
    v, C = [], []
    for b, body in enumerate(scene.bodies):
        x, weight = body.points.x, body.points.volume
        if isinstance(body.material, Rigid):
            arm = x - (x @ weight / weight.sum())[:, None]
            v.append(velocity_at(arm, initial_rigid_motion(body)[:, None]))
            C.append(np.zeros((2, 2, x.shape[1])))
            continue
        field, gradient = _field(body.velocity, x, 1e-4 * scene.cell)
        mass = scene.masses[scene.offsets[b] : scene.offsets[b + 1]]
        arm = x - (x @ mass / mass.sum())[:, None]
        v.append(field + body.spin * np.stack([-arm[1], arm[0]]))
        C.append(gradient + body.spin * np.array([[0.0, -1.0], [1.0, 0.0]])[:, :, None])
    return np.concatenate(v, axis=1), np.concatenate(C, axis=2)


def _field(velocity: object, x: Array, interval: float) -> tuple[Array, Array]:
    """A velocity field at the points and its gradient, by central differences over the interval [m]."""
    if not callable(velocity):
        value = np.asarray(velocity, dtype=float)
        return np.repeat(value[:, None], x.shape[1], axis=1), np.zeros((2, 2, x.shape[1]))
    steps = interval * np.eye(2)

    def at(y: Array) -> Array:
        return field_values("velocity(x)", velocity(y.copy()), y)  # it may work in place

    columns = [(at(x + s[:, None]) - at(x - s[:, None])) / (2.0 * interval) for s in steps]
    return at(x), np.stack(columns, axis=1)


def touches(scene: Scene, state: State, scheme: Scheme) -> bool:
    """Whether a step from this state has a contact problem: a wall, several bodies, or parts of one that may meet."""
    if scene.can_touch or not scene.folded(state.x).size:
        return scene.can_touch
    return not acts_at_grid_nodes(scheme.contact) and may_touch_itself(scene, state)
