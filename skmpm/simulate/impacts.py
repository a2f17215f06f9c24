"""Impacts: contacts whose bodies approach or leave each other fast, for their weight."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.scene import Contacts, State, centres, fitted_motions, velocity_at

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


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
