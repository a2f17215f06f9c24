"""What sets the pace of a scene, how fast things get, whether steps must resolve waves: for the report and `suggest`.

Steps must resolve waves where nothing but them takes time: bodies that fly at each other at t = 0, and what vibrates
because nothing but loads moves it. Where a wall, a support or gravity sets the pace, bodies follow it from one
equilibrium to the next, and the way per step is what counts. Where the pace is fast that limits `dt c / h`, too: to
14 at 0.01 c. At a thousandth of c and below forces are the same to 1.4e-3 whether `dt c / h` is 10 or 10,000
(`tests/verification/test_long_steps.py`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.scene import Scene, field_values
from skmpm.simulate.initial_state import can_touch, driven, fastest_wave, initial_motion

Array = NDArray[np.float64]

SEVERAL = 6  # deformable bodies from which on errors at contacts even out, as in a packing
SLOPE = 0.1  # of a wall's normal against gravity, from which on it is a floor


@dataclass(frozen=True)
class Loading:
    """How a scene goes on from t = 0."""

    kind: str  # "bending", "pressing", "impact", "packing" or "pour"
    why: str  # what shows it, as the end of a sentence
    waves: bool  # whether steps must resolve waves, if bodies have inertia
    step_control: float  # what sets it: speed of waves, of what is driven, or of what falls [m/s]
    driven: float  # fastest wall, support or rigid body [m/s]
    approach: float  # no two things pass each other faster, at t = 0 or after falling [m/s]
    fall: float  # free height [m]


def loading_of(scene: Scene) -> Loading:
    """What kind of scene it is, by what can touch, what moves at t = 0, and gravity."""
    v, _ = initial_motion(scene)
    name, prescribed = max(driven(scene), key=lambda named: named[1], default=("", 0.0))
    own = float(np.linalg.norm(v[:, scene.deformable[scene.owner]], axis=0).max())
    height = free_height(scene) if can_touch(scene) else 0.0
    fall = float(np.sqrt(2.0 * np.hypot(*gravity_of(scene)) * height))
    kind, why, step_control = _kind(scene, own, prescribed, fall, name)
    passing = np.hypot(*np.ptp(np.concatenate([v, scene.wall_velocities(0.0).T], axis=1), axis=1))
    return Loading(
        kind,
        why,
        step_control == 0.0,
        step_control or fastest_wave(scene),
        prescribed,
        float(np.hypot(passing, fall)),
        height,
    )


def _kind(scene: Scene, own: float, prescribed: float, fall: float, name: str) -> tuple[str, str, float]:
    """Kind, what shows it, and the pace that something sets [m/s]; zero where waves do."""
    several, moved = int(scene.deformable.sum()) >= SEVERAL, f"{name} moves at {prescribed:.3g} m/s"
    if not can_touch(scene):
        if prescribed > own:
            return "bending", f"nothing can touch it and {moved}", prescribed
        return "bending", "nothing can touch it and nothing is driven: it vibrates", 0.0
    if own > max(prescribed, fall) or (own > 0.0 and not several):
        return "impact", f"bodies move at {own:.3g} m/s at t = 0", 0.0
    if fall > prescribed:
        return "pour", f"gravity lets bodies fall, at up to {fall:.3g} m/s", fall
    if prescribed > 0.0:
        return "packing" if several else "pressing", moved, prescribed
    return "pressing", "bodies can touch and nothing moves at t = 0", 0.0


def gravity_of(scene: Scene) -> Array:
    """Gravity at t = 0, where it is a field its mean over deformable bodies, (2,) [m/s2]."""
    if not callable(scene.gravity):
        return np.asarray(scene.gravity, dtype=float)
    X = scene.initial_positions[:, scene.deformable[scene.owner]]
    return np.asarray(field_values("gravity(X, t) at t = 0", scene.gravity(X, 0.0), X).mean(axis=1))


def free_height(scene: Scene) -> float:
    """How far a deformable body can fall at most: to the floor, or without one to the lowest body [m]."""
    g = gravity_of(scene)
    if not g.any():
        return 0.0
    down, x = g / np.hypot(*g), scene.initial_positions
    floors = [
        normal @ (x - np.reshape(wall.point, (2, 1))) / -(normal @ down)
        for normal, wall in zip(scene.normals.T, scene.walls, strict=True)
        if normal @ down < -SLOPE
    ]
    below = np.min(floors, axis=0) if floors else (down @ x).max() - down @ x
    least = np.full(len(scene.bodies), np.inf)
    np.minimum.at(least, scene.owner, below)
    return max(0.0, float(least[scene.deformable].max()))
