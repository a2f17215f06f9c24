"""Warning about soft round bodies that stop on gentle slopes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from skmpm.contact import acts_at_grid_nodes
from skmpm.contact.closest_points import LIGHT
from skmpm.preflight.limit import rounded_down
from skmpm.preflight.metrics import SceneMetrics
from skmpm.scene import Scene
from skmpm.scheme import Scheme
from skmpm.simulate.loading import gravity_of

WIDE = 1.3  # [cells] half-width from which on the boundary points in contact average their chords out; test_rolling
STEEP = np.radians(6.0)  # slope from which on discs roll to 12 % at any width


def rolling_warnings(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Iterator[str]:
    """Bodies on a gentle slope whose contacts under their own weight are too wide to glide and too narrow to average.

    A contact of a half-width of more than `LIGHT` segments acts at boundary points, so that the body stands on the
    chords between them. The half-width is that of Hertz's theory for a disc on a plane.
    """
    gravity = gravity_of(scene)
    weight = float(np.hypot(*gravity))
    if not (scheme.inertia and weight > 0.0 and _gently_sloped(scene, gravity)) or acts_at_grid_nodes(scheme.contact):
        return
    for b in np.flatnonzero(scene.round).tolist():
        if not scene.deformable[b]:
            continue
        R = metrics.resolution[np.searchsorted(metrics.own, b)] * metrics.cell
        segment = 2.0 * np.pi * R / max(map(len, scene.bodies[b].points.outline))
        own = slice(scene.offsets[b], scene.offsets[b + 1])
        density = float(np.average(scene.densities[own], weights=scene.initial_volumes[own]))
        half_width = 2.0 * R * np.sqrt(density * weight * R * scene.compliance[b])
        if half_width > LIGHT * segment and half_width < WIDE * metrics.cell:
            yield (
                f"body {b}: its weight widens contacts to {half_width / segment:.2g} boundary segments on either"
                f" side; discs rolled on slopes of 1 degree up to {LIGHT:g}, wider contacts stopped them below 6"
                f" degrees; use a stiffer material or, to average over segments,"
                f" cell = {rounded_down(half_width / WIDE)} m or less"
            )
            return


def _gently_sloped(scene: Scene, gravity: NDArray[np.float64]) -> bool:
    """Whether a frictional wall is inclined against gravity, but less than `STEEP`."""
    friction = np.array([scene.frictions.at_wall(i).max() for i in range(len(scene.walls))])
    along = np.abs(gravity[0] * scene.normals[1] - gravity[1] * scene.normals[0])
    across = -gravity @ scene.normals
    return bool(np.any((friction > 0.0) & (along > 1e-9 * across) & (along < np.tan(STEEP) * across)))
