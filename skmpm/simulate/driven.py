"""What forces drive, walls, edges of a periodic box and loaded bodies: how fast it moves before a step."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skmpm.contact import acts_at_grid_nodes
from skmpm.observe.regions import region
from skmpm.scene import (
    Contacts,
    Scene,
    SceneError,
    State,
    centres,
    fitted_motions,
    forces_of_springs,
)
from skmpm.scheme import Scheme
from skmpm.simulate.forces import forces_on_points

Array = NDArray[np.float64]

NOTHING = np.zeros((2, 0))


class Moving(NamedTuple):
    """What moves at the start of a step."""

    v: Array  # (2, k) of points, relative to a periodic box, and driven walls [m/s]
    speed: float  # of the fastest wall, edge of the box or loaded body [m/s]
    accelerations: Array  # (2, q) of these, and of the rims of loaded rigid bodies as they turn [m/s2]
    x: Array = NOTHING  # (2, n) positions of points; none where bodies move by what drives them [m]

    @property
    def acceleration(self) -> float:
        """The largest of them [m/s2]."""
        return float(np.hypot(*self.accelerations).max(initial=0.0))

    def held_further(self, now: Moving, before: Moving, growth: float) -> Moving:
        """The same at the end of a step, with contacts that go on to hold what they held in the last one.

        All are with the forces of contacts now: `before` at the start of the last step, so that what forces gained
        since, less the acceleration now, is what contacts took up in it. They may take up `growth` times as much.
        """
        gained, last = (
            np.hypot(*change)
            for change in (self.accelerations - now.accelerations, now.accelerations - before.accelerations)
        )
        held = growth * np.maximum(last - np.hypot(*now.accelerations), 0.0)
        share = np.clip(held / np.where(gained > 0.0, gained, 1.0), 0.0, 1.0)
        return self._replace(accelerations=self.accelerations - share * (self.accelerations - now.accelerations))


def moving(scene: Scene, state: State, t: float) -> Moving:
    """What moves at a state, with the forces of time t [s] that are functions of time."""
    return _with_loaded_bodies(scene, _moving(scene, state, t), state.x, state.v, t, state.contacts)


def _moving(scene: Scene, state: State, t: float) -> Moving:
    """The same without loaded bodies."""
    if state.box is not None:
        return _moving_with_box(scene, state, t)
    walls = scene.driven_walls
    if walls.size == 0:
        return Moving(state.v, 0.0, NOTHING, state.x)
    velocity, normal = state.wall_velocity[walls], scene.normals.T[walls]
    force = driving_forces(scene, state.walls, t)
    net = force + np.einsum("pi,pi->p", state.wall_force[walls], normal)
    fastest = float(np.hypot(*velocity.T).max())
    every = np.concatenate([state.v, velocity.T], axis=1)
    return Moving(every, fastest, net / scene.wall_masses * scene.normals[:, walls])


def _moving_with_box(scene: Scene, state: State, t: float) -> Moving:
    """What moves in a periodic box, with the speed and the acceleration of the edges that a stress moves."""
    assert scene.periodic is not None and state.box is not None and state.box_rate is not None
    relative, (i, j) = state.v - state.box_rate @ state.x, scene.periodic.components
    if i.size == 0:
        return Moving(relative, 0.0, NOTHING)
    length, mass = np.diag(state.box)[j], scene.periodic.mass or scene.mass
    pressed = np.einsum("qk,qk->q", state.contacts.vectors[i], state.contacts.image[j])
    force = abs(float(np.linalg.det(state.box))) * scene.periodic.stress_at(t) - pressed
    speed = float(np.abs(state.box_rate[i, j] * length).max())
    return Moving(relative, speed, np.stack([force / length / mass, np.zeros(i.size)]))


def _with_loaded_bodies(
    scene: Scene, others: Moving, x: Array, v: Array, t: float, contacts: Contacts | None = None
) -> Moving:
    """What moves, with bodies that have loads or springs, whose points move at v from x (2, n).

    Components of bodies that supports hold are left out. Gravity that is a function is a load of all bodies.
    """
    free = free_components(scene)
    loaded = _loaded(scene) & free.any(axis=0)
    if not loaded.any():
        return others
    external = _external(scene, x, t)
    own = (free * _accelerations(scene, external, contacts))[:, loaded]
    speed = float(np.hypot(*(free * centres(v, scene.masses, scene.owner))[:, loaded]).max())
    rigid = loaded & ~scene.deformable
    if rigid.any():
        turning, rim = (each[rigid] for each in _rims(scene, x, v, external, contacts))
        speed, own = max(speed, turning.max()), np.concatenate([own, np.stack([rim, np.zeros_like(rim)])], axis=1)
    return others._replace(
        speed=max(others.speed, speed), accelerations=np.concatenate([others.accelerations, own], axis=1)
    )


def falling(scene: Scene, state: State) -> float:
    """The largest acceleration of a body by all forces on it, in components that no support holds [m/s2]."""
    net = _accelerations(scene, _external(scene, state.x, state.t), state.contacts)
    return float(np.hypot(*(free_components(scene) * net)[:, scene.movable]).max(initial=0.0))


def _accelerations(scene: Scene, external: Array, contacts: Contacts | None) -> Array:
    """The same, with the forces on points by all but contacts (2, n) [N/m]."""
    bodies = len(scene.bodies)
    force: Array = np.stack([np.bincount(scene.owner, component, bodies) for component in external])
    if contacts is not None:
        force = force + contact_resultants(contacts, bodies)
    return force / np.bincount(scene.owner, scene.masses, bodies)


def _rims(scene: Scene, x: Array, v: Array, external: Array, contacts: Contacts | None) -> tuple[Array, Array]:
    """Speeds and accelerations of the points of bodies farthest from their centres as these turn, (bodies,) each.

    The bodies turn as rigid ones under the forces on points by all but contacts (2, n) [N/m], and under those of
    contacts, in m/s and m/s2.
    """
    owner, mass, bodies = scene.owner, scene.masses, len(scene.bodies)
    centre = centres(x, mass, owner)
    arm, radius = x - centre[:, owner], np.zeros(bodies)
    np.maximum.at(radius, owner, np.hypot(*arm))
    moment = np.asarray(np.bincount(owner, _cross(arm, external), bodies), dtype=np.float64)
    if contacts is not None:
        first, second = (contacts.at(side) - centre[:, np.maximum(contacts.bodies[side], 0)] for side in (0, 1))
        pushed = contacts.vectors
        moment = moment + _on_bodies(contacts, _cross(first, pushed), _cross(second, pushed), bodies)
    inertia = np.bincount(owner, mass * (arm**2).sum(axis=0), bodies)
    return radius * np.abs(fitted_motions(x, v, mass, owner)[2]), radius * moment / inertia


def contact_resultants(contacts: Contacts, bodies: int) -> Array:
    """Resultants of the forces of contacts on bodies, (2, bodies) [N/m]."""
    return np.stack([_on_bodies(contacts, pushed, pushed, bodies) for pushed in contacts.vectors])


def _on_bodies(contacts: Contacts, first: Array, second: Array, bodies: int) -> Array:
    """Sums (bodies,) of what contacts do to their first bodies, less what their forces would do to the second."""
    one, two = contacts.bodies
    of_second = np.bincount(np.maximum(two, 0), second * (two >= 0), bodies)  # negative: walls
    return np.asarray(np.bincount(one, first, bodies) - of_second, dtype=np.float64)


def _cross(arm: Array, force: Array) -> Array:
    return np.asarray(arm[0] * force[1] - arm[1] * force[0])


def free_components(scene: Scene) -> NDArray[np.bool_]:
    """Which components of the motions of bodies no support holds, (2, bodies)."""
    found = np.ones((2, len(scene.bodies)), dtype=bool)
    for free, supporting in zip(found, scene.supporting, strict=True):
        free[scene.owner[supporting >= 0]] = False
    return found


def _loaded(scene: Scene) -> NDArray[np.bool_]:
    """Which bodies have loads or springs, (bodies,)."""
    loaded = scene.movable & callable(scene.gravity)
    springs = [place for ends in scene.sprung for place in ends.sets]
    for place in (*scene.loaded, *springs):
        loaded[scene.owner[place.points]] = True
    for segments in scene.pressed:
        loaded[scene.outlines.body[segments]] = True
    return loaded


def _external(scene: Scene, x: Array, t: float) -> Array:
    """Forces of loads, springs and gravity at time t on points at x (2, n), (2, n) [N/m]."""
    each = forces_of_springs(scene, x, t) + forces_on_points(scene, t)
    for segments, pressure in zip(scene.pressed, scene.pressure_values(t), strict=True):
        ends = scene.outlines.point[segments], scene.outlines.point[scene.outlines.next[segments]]
        along = x[:, ends[1]] - x[:, ends[0]]
        for k, force_on_first in enumerate((-along[1], along[0])):
            np.add.at(each[k], ends[0], pressure * force_on_first)
    return each


def moving_at_start(scene: Scene, v: Array) -> Moving:
    """What moves at t = 0, with points at velocities v (2, n) [m/s]; nothing is in contact."""
    return _with_loaded_bodies(scene, _moving_at_start(scene, v), scene.initial_positions, v, 0.0)


def _moving_at_start(scene: Scene, v: Array) -> Moving:
    """The same without loaded bodies."""
    walls, periodic = scene.driven_walls, scene.periodic
    if periodic is not None and periodic.components.size:
        length = np.diag(periodic.box)[periodic.components[1]]
        force = np.abs(periodic.stress_at(0.0)) * periodic.width * periodic.height / length
        return Moving(v, 0.0, np.stack([force, np.zeros(force.size)]) / (periodic.mass or scene.mass))
    if walls.size == 0:
        return Moving(v, 0.0, NOTHING, scene.initial_positions)
    velocity = scene.wall_velocities(0.0)[walls]
    acceleration = driving_forces(scene, _points(scene), 0.0) / scene.wall_masses
    fastest = float(np.hypot(*velocity.T).max())
    return Moving(np.concatenate([v, velocity.T], axis=1), fastest, acceleration * scene.normals[:, walls])


def driven_by_force(scene: Scene, t: float = 0.0) -> Iterator[tuple[str, float]]:
    """What a force or a stress drives, with the speed P / (rho c) that it gives to a wave in bodies at t [m/s]."""
    if not (scene.driven_walls.size or scene.periodic is not None):
        return
    x = scene.initial_positions
    impedance = float(min(np.sqrt((m.lame[0] + 2.0 * m.lame[1]) * m.density) for m in scene.materials))
    forces = np.abs(driving_forces(scene, _points(scene), t))
    for i, force in zip(scene.driven_walls.tolist(), forces.tolist(), strict=True):
        width = float(np.ptp(scene.normals[0, i] * x[1] - scene.normals[1, i] * x[0]))
        yield f"wall {i} by its force", force / width / impedance
    if scene.periodic is not None and scene.periodic.components.size:
        yield "the periodic box by its stress", float(np.abs(scene.periodic.stress_at(t)).max()) / impedance


def driving_forces(scene: Scene, walls: Array, t: float) -> Array:
    """Driving forces at time t with walls through some points (walls, 2) [m], (p,) [N/m]."""
    return scene.driving_forces(t, region(scene.normals, walls.T).length)


def _points(scene: Scene) -> Array:
    """Points of the walls at t = 0, (walls, 2) [m]."""
    return np.array([wall.point for wall in scene.walls], dtype=float).reshape(-1, 2)


def check_driven(name: str, scene: Scene, scheme: Scheme) -> None:
    """Raise SceneError if a scheme cannot drive walls, or a pressure acts on a side that is not closed."""
    if (scene.has_scalar_unknowns or scene.periodic is not None) and acts_at_grid_nodes(scheme.contact):
        what = "the box is periodic"
        if scene.free_rigid.size:
            what = f"body {scene.free_rigid[0]} is a free rigid body"
        if scene.driven_walls.size:
            what = f"wall {scene.driven_walls[0]} is driven by a force"
        raise SceneError(f"{name}: {what}, which contact = shared_grid cannot; use point_to_curve")
    if scene.driven_walls.size == 0:
        return
    length = region(scene.normals, _points(scene).T).length
    for i in scene.driven_walls.tolist():
        if scene.walls[i].pressure is not None and not 0.0 < length[i] < np.inf:
            raise SceneError(
                f"{name}: wall {i} has a pressure, and other walls leave it a length of {length[i]:g} m; close the"
                " box on both sides of it, or give a force"
            )
