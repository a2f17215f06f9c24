"""Checks of the supports, loads and springs of a scene before it is simulated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skmpm.scene.model import Model
from skmpm.scene.objects import Load, Pressure, SceneError, Spring, Support, prescribed_components
from skmpm.scene.point_sets import PointSet
from skmpm.scene.springs import stiffness_of

SHORTEST = 1e-6  # [cells] bar at t = 0, which needs a direction


def check_supports(scene: Model) -> None:
    """Raise SceneError for the first error in the supports."""
    for i, support in enumerate(scene.supports):
        if not isinstance(support, Support):
            raise SceneError(f"support {i} is a {type(support).__name__}; use skmpm.Support(where, velocity=...)")
        _check_displacement(f"support {i}", support)
    holder = np.full((2, scene.offsets[-1]), -1)
    for i, (prescribed, supported) in enumerate(zip(scene.support_velocities(0.0), scene.supported, strict=True)):
        hint = "; `motion` holds rigid ones"
        _check_not_empty(f"support {i}: where", scene, supported, scene.deformable, "deformable body", hint)
        if np.isnan(prescribed).all():
            what = "velocity" if scene.supports[i].displacement is None else "displacement"
            raise SceneError(
                f"support {i}: {what} = (None, None) prescribes nothing; give a component or leave it out"
            )
        for axis in np.flatnonzero(~np.isnan(prescribed)):
            taken = supported.points[holder[axis, supported.points] >= 0]
            if taken.size:
                raise SceneError(
                    f"supports {holder[axis, taken[0]]} and {i} both hold the {'xy'[axis]} component of the point at"
                    f" {scene.initial_positions[:, taken[0]]}; let `where` of one leave it out"
                )
            holder[axis, supported.points] = i


def _check_displacement(name: str, support: Support) -> None:
    if support.displacement is None:
        return
    if not callable(support.displacement):
        raise SceneError(f"{name}: displacement = {support.displacement!r}; give a function of time t -> (x, y) [m]")
    if np.array(support.velocity, dtype=object).tolist() not in ([0.0, 0.0], (0.0, 0.0)):
        raise SceneError(f"{name}: velocity = {support.velocity} and displacement; give one of them")
    start = prescribed_components(support, 0.0, f"{name}: displacement")
    if np.nan_to_num(start).any():
        raise SceneError(f"{name}: displacement at t = 0 is {start}; give the displacement since then, zero at t = 0")


def _check_not_empty(
    name: str, scene: Model, chosen: PointSet, bodies: NDArray[np.bool_], which: str, hint: str = ""
) -> None:
    if chosen.points.size == 0:
        x = scene.initial_positions[:, bodies[scene.owner]]
        raise SceneError(
            f"{name} is true at no point of a {which}; they lie between {x.min(axis=1)} and {x.max(axis=1)},"
            f" the outermost on the boundary: allow for round-off in comparisons{hint}"
        )


def check_loads(scene: Model) -> None:
    """Raise SceneError for the first error in the loads."""
    given: Sequence[object] = scene.loads
    for i, load in enumerate(given):
        if not isinstance(load, Load | Pressure):
            what = "skmpm.Load(where, force) or skmpm.Pressure(where, value)"
            raise SceneError(f"load {i} is a {type(load).__name__}; use {what}")
    scene.forces(0.0)
    scene.pressure_values(0.0)
    dead = [i for i, load in enumerate(scene.loads) if isinstance(load, Load)]
    for i, loaded in zip(dead, scene.loaded, strict=True):
        _check_not_empty(f"load {i}: where", scene, loaded, scene.movable, "body that forces move")
    following = [i for i, load in enumerate(scene.loads) if isinstance(load, Pressure)]
    for i, segments in zip(following, scene.pressed, strict=True):
        if segments.size == 0:
            raise SceneError(
                f"load {i}: where is true at no two neighbouring boundary points of a deformable body, between which"
                " a pressure acts; give the Points an outline, and allow for round-off in comparisons"
            )


def check_springs(scene: Model) -> None:
    """Raise SceneError for the first error in the springs."""
    for i, spring in enumerate(scene.springs):
        if not isinstance(spring, Spring):
            raise SceneError(f"spring {i} is a {type(spring).__name__}; use skmpm.Spring(where, stiffness)")
        stiffness_of(i, spring)
    for i, ends in enumerate(scene.sprung):
        for name, points in (("where", ends.first), ("to", ends.second)):
            if points is not None and points.points.size == 0:
                raise SceneError(
                    f"spring {i}: {name} is true at no point of a deformable body; allow for round-off in comparisons"
                )
        if ends.second is not None and np.isin(ends.first.points, ends.second.points).any():
            raise SceneError(f"spring {i}: where and to have points in common; give two separate sets")
        if not ends.bed and np.hypot(*ends.span(scene.initial_positions)) <= SHORTEST * scene.cell:
            raise SceneError(f"spring {i}: both its ends are at the same position at t = 0; move one of them")
        scene.rest_of_spring(i, 0.0)
