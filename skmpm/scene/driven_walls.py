"""Velocities of walls that forces drive: unknown along their normals, given across them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.scene.layout import Layout

Array = NDArray[np.float64]


def normal_speeds(scene: Layout, velocity: Array) -> Array:
    """Velocities of the p driven walls along their normals from those of all walls (walls, 2), (p,) [m/s]."""
    walls = scene.driven_walls
    return np.asarray(np.einsum("pi,ip->p", velocity[walls], scene.normals[:, walls]))


def with_normal_speeds(scene: Layout, velocity: Array, speeds: Array) -> Array:
    """Velocities of all walls (walls, 2) with others of the driven ones along their normals (p,) [m/s]."""
    out = velocity.copy()
    change = speeds - normal_speeds(scene, velocity)
    out[scene.driven_walls] += change[:, None] * scene.normals.T[scene.driven_walls]
    return out
