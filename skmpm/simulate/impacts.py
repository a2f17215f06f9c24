"""Impacts: contacts whose bodies approach or leave each other fast, for their weight."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.scene import Contacts, Scene, State, centres, fitted_motions, velocity_at
from skmpm.simulate.driven import accelerations, contact_resultants, free_components
from skmpm.simulate.loading import gravity_of

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Of gravity: net accelerations up to this are those of a body that settles, under up to twice its weight.
PUSHED = 2.0
ONE_SIDED = 0.5  # share of the forces of contacts on a body that nothing balances from which on it is released


def normal_speed(state: State, contacts: Contacts) -> float:
    """Largest normal speed at contacts that bear a force, of bodies that move like rigid ones as in a state [m/s]."""
    pressed = contacts.force[0] > 0.0
    if not pressed.any():
        return 0.0
    (one, two), normal = contacts.bodies[:, pressed], contacts.normal[:, pressed]
    motions = fitted_motions(state.x, state.v, state.mass, state.body)
    centre, wall = centres(state.x, state.mass, state.body), two < 0

    def velocity(body: Ints, at: Array) -> Array:
        return velocity_at(at[:, pressed] - centre[:, body], motions[:, body])

    of_second = velocity(np.maximum(two, 0), contacts.at(1))
    of_second[:, wall] = state.wall_velocity[-1 - two[wall]].T
    approach = (normal * (velocity(one, contacts.at(0)) - of_second)).sum(axis=0)
    return float(np.abs(approach).max())


def pushed_away(scene: Scene, state: State, t: float, speed: float, time: float) -> bool:
    """Whether contacts push a body away, as one that was compressed, with the loads of time t.

    They do if at least half of their forces on it are unbalanced, if they accelerate it more than gravity does and to
    more than `speed` [m/s] in a `time` [s], and if in that time they stop what it approaches with. Components that
    supports hold do not count.
    """
    contacts, bodies = state.contacts, len(scene.bodies)
    if contacts.gap.size == 0:
        return False
    (one, two), each = contacts.bodies, np.hypot(*contacts.vectors)
    size = np.bincount(one, each, bodies) + np.bincount(np.maximum(two, 0), each * (two >= 0), bodies)
    components = free_components(scene)
    free = scene.movable & (size > 0.0) & components.any(axis=0)
    if not free.any():
        return False
    net, mass = accelerations(scene, state.x, t, contacts), np.bincount(scene.owner, scene.masses, bodies)
    resultant, velocity = contact_resultants(contacts, bodies), centres(state.v, scene.masses, scene.owner)
    net, resultant = components * net, components * resultant
    along = mass * (net * resultant).sum(axis=0) > ONE_SIDED * np.hypot(*resultant) * size
    weight = max(float(np.hypot(*gravity_of(scene, each))) for each in (0.0, t))
    gained = time * np.hypot(*net)
    away = (velocity * resultant).sum(axis=0) >= -gained * np.hypot(*resultant)
    fast = gained > max(speed, PUSHED * weight * time)
    return bool((free & along & away & fast).any())
