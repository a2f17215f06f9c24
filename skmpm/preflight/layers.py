"""Thin parts of bodies of several materials."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from skmpm.arrays import Array, Bools
from skmpm.points import Points
from skmpm.scene import Scene

ON_LINE = 1e-9  # [cells] of round-off of a point on a grid line


def thin_groups(scene: Scene) -> tuple[list[str], list[float]]:
    """Names and thicknesses [cells] of groups that share cells with others; interfaces on grid lines cost nothing.

    The thickness is twice the largest distance of one of its points from another group or the boundary; of boundary
    points alone it is their area over their length.
    """
    names, cells, h = list[str](), list[float](), scene.cell
    for b in np.flatnonzero(scene.composite).tolist():
        points = scene.bodies[b].points
        group = np.asarray(points.group)
        for name in np.unique(group).tolist():
            own = group == name
            if not shares_cells(points.x / h, own):
                continue
            boundary = [points.x[:, loop] for loop in points.outline]
            around = np.concatenate([points.x[:, ~own], *boundary], axis=1)
            distance, _ = KDTree(around.T).query(points.x[:, own].T)
            thickness = 2.0 * float(np.max(distance))
            names.append(f"group {name!r} of body {b}")
            cells.append((thickness or float(points.volume[own].sum() / _boundary_length(points, own))) / h)
    return names, cells


def shares_cells(x: Array, own: Bools) -> bool:
    """Whether a cell holds points x (2, n) [cells] of a group and others."""
    cells = np.floor(x + ON_LINE).astype(np.int64)
    _, of = np.unique(cells, axis=1, return_inverse=True)
    inside, outside = (np.bincount(of.ravel(), mask) > 0 for mask in (own, ~own))
    return bool((inside & outside).any())


def _boundary_length(points: Points, own: Bools) -> float:
    """Half the lengths of the segments at boundary points of a group (n,) [m]."""
    half = np.zeros(points.size)
    for loop in points.outline:
        length = np.hypot(*(points.x[:, np.roll(loop, -1)] - points.x[:, loop]))
        half[loop] += 0.5 * (length + np.roll(length, 1))
    return float(half[own].sum())
