"""Warnings about thin parts of bodies of several materials."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from skmpm.points import Points
from skmpm.preflight.limit import Limit, below, rounded_down
from skmpm.preflight.metrics import SceneMetrics
from skmpm.scene import Scene
from skmpm.scheme import Scheme

LAYER = Limit(4.0, "interfaces inside cells cost up to 9 % with 8 cells a layer, twice that with 4")  # test_composite
ON_LINE = 1e-9  # [cells] of round-off of a point on a grid line


def layer_warnings(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Iterator[str]:
    """Groups of points that are thin and share cells with another one; interfaces on grid lines cost nothing.

    The thickness is twice the largest distance of one of its points from another group or the boundary; of boundary
    points alone it is their area over their length.
    """
    h = metrics.cell
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
            thickness = 2.0 * float(np.max(distance)) / h
            if thickness == 0.0:
                thickness = float(points.volume[own].sum() / _boundary_length(points, own)) / h
            if below(thickness, LAYER):
                who = f"body {b}: group {name!r} is about {thickness:.2g} cells thick and shares cells with others"
                remedy = (
                    f"use interfaces on grid lines, or cell = {rounded_down(thickness / LAYER.value * h)} m or less"
                )
                yield f"{who}; {LAYER.where}; {remedy}"


def shares_cells(x: NDArray[np.float64], own: NDArray[np.bool_]) -> bool:
    """Whether a cell holds points x (2, n) [cells] of a group and others."""
    cells = np.floor(x + ON_LINE).astype(np.int64)
    _, of = np.unique(cells, axis=1, return_inverse=True)
    inside, outside = (np.bincount(of.ravel(), mask) > 0 for mask in (own, ~own))
    return bool((inside & outside).any())


def _boundary_length(points: Points, own: NDArray[np.bool_]) -> float:
    """Half the lengths of the segments at boundary points of a group (n,) [m]."""
    half = np.zeros(points.size)
    for loop in points.outline:
        length = np.hypot(*(points.x[:, np.roll(loop, -1)] - points.x[:, loop]))
        half[loop] += 0.5 * (length + np.roll(length, 1))
    return float(half[own].sum())
