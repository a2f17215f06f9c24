"""What drives a scene, how fast, and whether steps must resolve waves: for chosen steps, `preflight`, `suggest`.

Steps must resolve waves where these alone set the time scale: for bodies that collide with initial velocities, and
for bodies that vibrate because nothing but loads moves them. Where a wall, a support or gravity sets the time scale,
bodies follow from one equilibrium to the next, and the displacement per step is limited. For fast driving that also
limits `dt c / h`: to 14 at 0.01 c. At a thousandth of c and below forces are the same to 1.4e-3 whether `dt c / h` is
10 or 10,000 (`tests/verification/test_long_steps.py`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from skmpm.arrays import ROUND_OFF, Array
from skmpm.scene import Scene, centres, gravity_at
from skmpm.step.driven import driven_by_force, prescribed_speeds
from skmpm.step.initial_state import initial_motion

SEVERAL = 6  # bodies that forces move, from which on errors at contacts average out, as in a packing
SLOPE = 0.1  # component of a wall's normal against gravity from which on the wall is a floor


@dataclass(frozen=True)
class Loading:
    """What drives a scene, and how fast."""

    kind: str  # "bending", "pressing", "impact", "packing" or "pour"
    why: str  # the reason, as a clause
    waves: bool  # whether steps must resolve waves, if bodies have inertia
    speed: float  # that limits the time step: of waves, of the driven object, or of falling bodies [m/s]
    driven: float  # fastest wall, support or rigid body [m/s]
    approach: float  # bound on relative velocities, at t = 0 or after falling [m/s]
    fall: float  # free height [m]


def loading_of(scene: Scene, times: Iterable[float] = (0.0,), inertia: bool = True) -> Loading:
    """The kind of a scene, from possible contacts, initial velocities, prescribed ones at some times, and gravity.

    Without inertia bodies have no velocities of their own and do not fall.
    """
    times = tuple(times)
    v, _ = initial_motion(scene)
    strongest = strongest_gravity(scene, times)
    # At the start where loads or springs act, too: what these cause when gravity has been applied is to be resolved.
    g = gravity_of(scene, times[0]) if scene.loads or scene.springs else strongest
    every = (named for t in times for moved in (driven_by_force, prescribed_speeds) for named in moved(scene, t))
    name, prescribed = max(every, key=lambda named: named[1], default=("", 0.0))
    own = float(np.linalg.norm(v[:, scene.movable[scene.owner]], axis=0).max()) if inertia else 0.0
    height = free_height(scene, g) if scene.can_touch else 0.0
    fall = float(np.sqrt(2.0 * np.hypot(*g) * height))
    drop = fall if inertia and fall > settling(scene, g) else 0.0
    kind, why, speed = _kind(scene, own, prescribed, drop, name)
    ends = np.stack([v.min(axis=1), v.max(axis=1)])
    passing = max(np.hypot(*np.ptp(np.concatenate([ends, scene.wall_velocities(t)]), axis=0)) for t in times)
    return Loading(
        kind,
        why,
        speed == 0.0,
        speed or scene.fastest_wave,
        prescribed,
        float(np.hypot(passing, fall)),
        height,
    )


def several(scene: Scene) -> bool:
    """Whether as many bodies as in a packing are moved by forces."""
    return int(scene.movable.sum()) >= SEVERAL


def _kind(scene: Scene, own: float, prescribed: float, fall: float, name: str) -> tuple[str, str, float]:
    """Kind, reason, and the speed that limits the time step [m/s]; zero where waves do."""
    many, moved = several(scene), f"{name} moves at {prescribed:.3g} m/s"
    if not scene.can_touch:
        if prescribed > own:
            return "bending", f"nothing can touch it and {moved}", prescribed
        return "bending", "nothing can touch it and nothing is driven", 0.0
    if own > max(prescribed, fall) or (own > 0.0 and not many):
        return "impact", f"bodies move at {own:.3g} m/s at t = 0", 0.0
    if fall > prescribed:
        return "pour", f"gravity lets bodies fall, at up to {fall:.3g} m/s", fall
    if prescribed > 0.0:
        return "packing" if many else "pressing", moved, prescribed
    return "pressing", "bodies can touch and nothing moves at t = 0", 0.0


def settling(scene: Scene, g: Array) -> float:
    """Speed g L / c at which a body of height L settles by its own weight when gravity g (2,) is switched on [m/s].

    A fall that ends slower, from less than half of rho g L^2 / (lambda + 2 mu), moves it less than that.
    """
    along, start = g @ scene.initial_positions, scene.offsets[:-1]
    height = np.maximum.reduceat(along, start) - np.minimum.reduceat(along, start)
    return float(height[scene.deformable].max()) / scene.fastest_wave


def gravity_of(scene: Scene, t: float = 0.0) -> Array:
    """Gravity at time t, (2,) [m/s2]; of a field, its mean over the points of bodies that forces move."""
    if not callable(scene.gravity):
        return np.asarray(scene.gravity, dtype=float)
    return np.asarray(gravity_at(scene, scene.initial_positions[:, scene.movable[scene.owner]], t).mean(axis=1))


def strongest_gravity(scene: Scene, times: Iterable[float]) -> Array:
    """The first gravity as large as the largest at some times, (2,) [m/s2]; one that is ramped is zero at t = 0."""
    if not callable(scene.gravity):
        return gravity_of(scene)
    each = np.array([gravity_of(scene, t) for t in times])
    size = np.hypot(*each.T)
    return np.asarray(each[np.argmax(size >= (1.0 - ROUND_OFF) * size.max())])


def free_height(scene: Scene, g: Array) -> float:
    """Largest height that a body which forces move can fall: to the floor, or without one to the lowest body [m].

    `g` (2,) is gravity [m/s2].
    """
    if not g.any():
        return 0.0
    down, x = g / np.hypot(*g), scene.initial_positions
    floors = [
        normal @ (x - np.reshape(wall.point, (2, 1))) / -(normal @ down)
        for normal, wall in zip(scene.normals.T, scene.walls, strict=True)
        if normal @ down < -SLOPE
    ]
    below = np.min(floors, axis=0) if floors else (down @ x).max() - down @ x
    least = np.minimum.reduceat(below, scene.offsets[:-1])
    return max(0.0, float(least[scene.movable].max()))


def smallest_radii(scene: Scene) -> Array:
    """Radii of the deformable bodies [m]: twice their smallest radii of gyration, which is a disc's radius."""
    x, volume, body = scene.initial_positions, scene.initial_volumes, scene.owner
    arm = x - centres(x, volume, body)[:, body]
    xx, xy, yy = centres(np.stack([arm[0] ** 2, arm[0] * arm[1], arm[1] ** 2]), volume, body)  # means, as centres are
    least = 0.5 * (xx + yy) - np.hypot(0.5 * (xx - yy), xy)
    return np.asarray(2.0 * np.sqrt(least[scene.deformable]))
