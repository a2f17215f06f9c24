"""How the bodies of a periodic box move with it.

A body and its image at H k have velocities that differ by dH/dt k. So that it does not matter which of them is
followed, inertia resists changes of the velocity relative to that of the box at the centre of the body, as in the
equations of motion for homogeneous flow (SLLOD; Evans & Morriss, Statistical Mechanics of Nonequilibrium Liquids,
2008, section 6.3), and the kinetic energy is that of the relative velocities.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skmpm import outline
from skmpm.contact import recut_keys
from skmpm.scene import Contacts, Scene, State, centres, recut

Array = NDArray[np.float64]


def velocity_of_box(state: State, gradient: Array | None) -> Array:
    """Velocity of the box at the centres of the bodies, at their nodes (2 nodes,) [m/s]; zero without a box."""
    grid = state.grids.assembly.grid
    if gradient is None:
        return np.zeros(2 * grid.nodes)
    return np.asarray((gradient @ centres(state.x, state.mass, state.body))[:, grid.node_body].T.ravel())


def recut_box(scene: Scene, box: Array | None, contacts: Contacts) -> tuple[Array | None, Contacts]:
    """The least slanted edges (2, 2) [m] of the same lattice, and the contacts with keys that belong to them."""
    if box is None:
        return None, contacts
    upright, change = recut(box)
    if not change[0, 1]:
        return box, contacts
    curve = outline.curve(scene.outlines, scene.initial_positions[:, scene.outlines.point])
    return upright, replace(contacts, key=recut_keys(contacts.key, scene.outlines.size * curve.sides, change))
