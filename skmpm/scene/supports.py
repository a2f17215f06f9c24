"""The points that supports hold, and the velocities that they prescribe."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.scene.layout import Layout
from skmpm.scene.objects import Support, prescribed_components
from skmpm.scene.point_sets import PointSet, matching

Array = NDArray[np.float64]


def supported_points(scene: Layout, i: int, support: Support) -> PointSet:
    """The points whose velocity support i prescribes, with equal shares."""
    points = matching(scene, f"support {i}: where", support.where)
    return PointSet(points, np.full(points.size, 1.0 / max(points.size, 1)))


def support_velocities(scene: Layout, t: float, dt: float | None = None) -> Array:
    """Velocities of supports in a step from t to t + dt [s], (supports, 2) [m/s], nan where free.

    They are the prescribed ones in its middle, and mean ones of prescribed displacements. Without dt they are those
    at t, where displacements are differentiated over the time in which waves cross a cell, which steps do not
    resolve.

    Raises
    ------
    SceneError
        if one is invalid
    """
    interval, middle = (scene.cell / scene.fastest_wave, t) if dt is None else (dt, t + 0.5 * dt)
    each = np.empty((len(scene.supports), 2))
    for i, support in enumerate(scene.supports):
        if support.displacement is None:
            each[i] = prescribed_components(support, middle, f"support {i}: velocity")
        else:
            name = f"support {i}: displacement"
            start, end = (prescribed_components(support, time, name) for time in (t, t + interval))
            each[i] = (end - start) / interval
    return each
