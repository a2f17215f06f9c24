"""Pressure, solid fraction and overlap of a mixture once more, by other ways than the table of the study."""

from __future__ import annotations

import numpy as np

import skmpm


def pressure(scene: skmpm.Scene, state: skmpm.State) -> float:
    """Mean pressure in the box [Pa]: of the points of soft discs, and of the forces around centres of rigid ones.

    The mean stress of a body at rest is the moment of the forces on its boundary over its area. `observe` takes
    branches from centre to centre instead, and no stress of points.
    """
    x, contacts = state.centres, state.contacts
    inside = 0.0
    for side, (body, sign) in enumerate(zip(contacts.bodies, (1.0, -1.0), strict=True)):
        hard = ~scene.deformable[body]
        inside += sign * float(np.sum((contacts.vectors * (contacts.at(side) - x[:, body]))[:, hard]))
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
    x = state.centres[:, hard]
    first, second = np.triu_indices(hard.size, k=1)
    apart = np.linalg.solve(state.box, x[:, first] - x[:, second])
    distance = np.hypot(*(state.box @ (apart - np.rint(apart))))
    return float(np.max(radius[first] + radius[second] - distance, initial=0.0))


def area(state: skmpm.State) -> float:
    """Area of the box [m2]."""
    return float(abs(np.linalg.det(state.box)))
