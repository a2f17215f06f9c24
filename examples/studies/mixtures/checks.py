"""Pressure, solid fraction and overlap of a mixture once more, by other ways than the table of the study."""

from __future__ import annotations

import numpy as np

import skmpm

Array = np.ndarray


def pressure(scene: skmpm.Scene, state: skmpm.State) -> float:
    """Mean pressure in the box [Pa]: of the points of soft discs, and of the forces around centres of rigid ones.

    The mean stress of a body at rest is the moment of the forces on its boundary over its area. `observe` takes
    branches from centre to centre instead, and no stress of points.
    """
    x, contacts = centres(state), state.contacts
    normal = contacts.normal
    force = contacts.force[0] * normal + contacts.force[1] * np.stack([-normal[1], normal[0]])
    inside = 0.0
    for body, at, sign in zip(contacts.bodies, (contacts.x, contacts.x - contacts.image), (1.0, -1.0), strict=True):
        hard = ~scene.deformable[body]
        inside += sign * float(np.sum((force * (at - x[:, body]))[:, hard]))
    soft = scene.deformable[state.body]
    inside += float((state.stress[0, 0] + state.stress[1, 1])[soft] @ state.weight[soft])
    return -inside / 2.0 / area(state)


def solid_fraction(state: skmpm.State) -> float:
    """Volumes of the points over the area of the box."""
    return float(state.volume.sum()) / area(state)


def overlap_of_rigid_discs(scene: skmpm.Scene, state: skmpm.State) -> float:
    """The largest overlap of two rigid discs [m], of the distances of their centres; zero if none touch."""
    hard = np.flatnonzero(~scene.deformable)
    radius = np.sqrt(np.bincount(state.body, state.volume)[hard] / np.pi)
    x = centres(state)[:, hard]
    first, second = np.triu_indices(hard.size, k=1)
    apart = np.linalg.solve(state.box, x[:, first] - x[:, second])
    distance = np.hypot(*(state.box @ (apart - np.rint(apart))))
    return float(np.max(radius[first] + radius[second] - distance, initial=0.0))


def centres(state: skmpm.State) -> Array:
    """Centres of mass, (2, bodies) [m]."""
    moments = np.stack([np.bincount(state.body, state.mass * x) for x in state.x])
    return np.asarray(moments / np.bincount(state.body, state.mass))


def area(state: skmpm.State) -> float:
    """Area of the box [m2]."""
    return float(abs(np.linalg.det(state.box)))
