"""A state without some bodies, and contacts numbered anew when bodies or walls go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from skmpm import outline
from skmpm.arrays import Ints
from skmpm.scene.contact_keys import ContactKeys, first_keys, guard_keys
from skmpm.scene.scene import Scene
from skmpm.scene.state import Contacts, State

PER_POINT = (
    *("x", "v", "F", "C", "stress", "mass", "volume", "weight"),
    *("x_anchor", "F_anchor", "stress_anchor"),
)
GONE = np.iinfo(np.int64).min


def of_bodies(scene: Scene, new_scene: Scene, state: State, bodies: Ints) -> State:
    """The points and grids of the bodies (k,) of a scene that a new one keeps, numbered as there.

    Bodies have grids of their own, so that they stay as they are when others go.
    """
    points, unknowns = np.isin(state.body, bodies), np.repeat(np.isin(_nodes(scene, state), bodies), 2)
    return replace(
        state,
        **{name: getattr(state, name)[..., points] for name in PER_POINT},
        internal=state.internal[: new_scene.internal_variables, points],
        body=new_scene.owner,
        displacement=state.displacement[unknowns[: state.displacement.size]],
        nodal_velocity=state.nodal_velocity[unknowns[: state.nodal_velocity.size]],
        wetted=state.wetted[:, np.isin(scene.outlines.body, bodies)] if state.wetted.size else state.wetted,
        factored=None,
        derived=None,
    )


def _nodes(scene: Scene, state: State) -> Ints:
    """The body of each grid node of a state, (nodes,)."""
    if state.derived is not None:
        return state.derived.assembly.grid.node_body
    return scene.body_grids(state.x_anchor).node_body


def renumbered(scene: Scene, new_scene: Scene, contacts: Contacts, bodies: Ints, walls: Ints) -> Contacts:
    """The contacts of the bodies and walls that a new scene keeps, with their numbers in it.

    `bodies` (bodies,) and `walls` (walls,) are those of the new scene by their numbers in the old one, walls that are
    new -1.
    """
    number = np.full(len(scene.bodies) + len(scene.walls), GONE)  # those of walls at the end, as they are negative
    number[bodies] = np.arange(bodies.size)
    number[-1 - walls[walls >= 0]] = -1 - np.flatnonzero(walls >= 0)
    both, point = number[contacts.bodies], np.cumsum(np.isin(scene.owner, bodies)) - 1
    at_points = contacts.point >= 0
    key = np.where(at_points, _keys(scene, new_scene, contacts, bodies, both[1]), contacts.key)
    now = replace(contacts, bodies=both, point=np.where(at_points, point[contacts.point], -1), key=key)
    return now.among((both != GONE).all(axis=0))


def _keys(scene: Scene, new_scene: Scene, contacts: Contacts, bodies: Ints, second: Ints) -> Ints:
    """The keys of contacts (k,) in the new scene, where their second bodies are `second` (k,)."""
    kept = np.isin(scene.outlines.body, bodies)
    if not kept.size:
        return contacts.key
    (was, old), (now, new) = (_numbers(each) for each in (scene, new_scene))
    point, side = np.cumsum(kept) - 1, np.zeros(old.sides, dtype=np.int64)
    side[was[kept]] = now
    key = first_keys(contacts.key)
    i, on, code = old.parts(key)
    at_wall = new.at_walls(-1 - second, point[old.points_at_walls(key)])
    key = np.where(contacts.bodies[1] < 0, at_wall, new.between(point[i], side[on], code))
    return np.where(contacts.key < 0, guard_keys(key), key)


def _numbers(scene: Scene) -> tuple[Ints, ContactKeys]:
    """The side that each boundary segment belongs to, (m,), and the identities of contacts."""
    boundary, box = scene.outlines, scene.initial_box
    curve = outline.curve(boundary, scene.initial_positions[:, boundary.point])
    return curve.side, ContactKeys(boundary.size, curve.sides, 0 if box is None else box.shape[1])
