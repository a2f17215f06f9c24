"""Impacts: contacts whose bodies approach or leave each other fast, for their weight."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.scene import Contacts, State

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def normal_speed(state: State, contacts: Contacts) -> float:
    """Largest normal speed at contacts that bear a force, of bodies that move like rigid ones as in a state [m/s]."""
    pressed = contacts.force[0] > 0.0
    if not pressed.any():
        return 0.0
    (one, two), normal = contacts.bodies[:, pressed], contacts.normal[:, pressed]
    mass = np.bincount(state.body, state.mass)
    x, v = (np.stack([np.bincount(state.body, state.mass * c) / mass for c in a]) for a in (state.x, state.v))
    arm, relative = state.x - x[:, state.body], state.v - v[:, state.body]
    moment = np.bincount(state.body, state.mass * (arm[0] * relative[1] - arm[1] * relative[0]))
    spin = moment / np.bincount(state.body, state.mass * (arm**2).sum(axis=0))

    def velocity(body: Ints, at: Array) -> Array:
        arm = at[:, pressed] - x[:, body]
        return np.asarray(v[:, body] + spin[body] * np.stack([-arm[1], arm[0]]))

    of_second, wall = velocity(np.maximum(two, 0), contacts.at(1)), two < 0
    of_second[:, wall] = state.wall_velocity[-1 - two[wall]].T
    approach = (normal * (velocity(one, contacts.at(0)) - of_second)).sum(axis=0)
    return float(np.abs(approach).max())
