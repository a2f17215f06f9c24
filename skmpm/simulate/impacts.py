"""Impacts: contacts whose bodies approach or leave each other fast, for their weight."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.scene import Contacts, Scene, State, centres, fitted_motions, velocity_at
from skmpm.simulate.driven import accelerations
from skmpm.simulate.loading import gravity_of

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Of gravity: net acceleration by more than this is not that of a body that settles, which is at most gravity's.
PUSHED = 2.0


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


def pushed_away(scene: Scene, state: State) -> bool:
    """Whether contacts accelerate a body without supports much more than gravity would."""
    one, two = state.contacts.bodies
    touched = np.zeros(len(scene.bodies), dtype=bool)
    touched[one], touched[two[two >= 0]] = True, True
    for place in scene.supported:
        touched[scene.owner[place.points]] = False
    touched &= scene.movable
    if not touched.any():
        return False
    net = accelerations(scene, state.x, state.t, state.contacts)[:, touched]
    return float(np.hypot(*net).max()) > PUSHED * float(np.hypot(*gravity_of(scene, state.t)))
