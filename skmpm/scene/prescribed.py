"""What is prescribed at a time: gravity, velocities of walls, rigid bodies and supports.

Rigid motions, prescribed or fitted to points, are a translation and a rotation about the centre of mass. Walls that
forces drive have a velocity that is unknown along their normals and given across them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skmpm.arrays import Array, Ints
from skmpm.scene.layout import Layout
from skmpm.scene.model import Model
from skmpm.scene.objects import Body, rigid_motion
from skmpm.scene.periodic import deformed
from skmpm.scene.point_sets import support_rotations
from skmpm.values import SceneError, field_values, motion


def gravity_at(scene: Layout, X: Array, t: float) -> Array:
    """Gravity at undeformed positions X (2, n) at time t, (2, n) [m/s2]; SceneError if a field of it is wrong."""
    if not callable(scene.gravity):
        return np.broadcast_to(np.asarray(scene.gravity, dtype=float)[:, None], X.shape)
    return field_values(f"gravity(X, t) at t = {t:.6g} s", scene.gravity(X.copy(), t), X)  # it may work in place


def initial_rigid_motion(body: Body) -> Array:
    """Velocity of the centre of mass and angular velocity of a rigid body at t = 0, (3,) [m/s, rad/s]."""
    given = rigid_motion(body, 0.0, "body")
    return np.where(np.isnan(given), np.append(motion(body.velocity, 0.0, "body: velocity"), body.spin), given)


def velocity_at(arm: Array, motions: Array) -> Array:
    """Velocities (2, k) [m/s] at arms (2, k) [m] from the centres of bodies that move as (3, k)."""
    return np.asarray(motions[:2] + motions[2] * np.stack([-arm[1], arm[0]]))


def mean_velocity(arm: Array, motions: Array, dt: float) -> Array:
    """Displacements in a step over its length, (2, k) [m/s], of points that keep their distance from the centre."""
    angle = dt * motions[2]
    sine, less = np.sin(angle), -2.0 * np.sin(0.5 * angle) ** 2  # the latter is cos - 1
    turned = np.stack([less * arm[0] - sine * arm[1], sine * arm[0] + less * arm[1]])
    return np.asarray(motions[:2] + turned / dt)


def centres(x: Array, mass: Array, owner: Ints) -> Array:
    """Centres of mass of all bodies, (2, bodies) [m], from points x (2, n) [m]."""
    total = np.bincount(owner, mass)
    return np.stack([np.bincount(owner, mass * component) / total for component in x])


def fitted_motions(x: Array, v: Array, mass: Array, owner: Ints) -> Array:
    """Mean velocities and spins of all bodies, (3, bodies), from points at x with velocities v (2, n).

    They have the momentum and angular momentum of the points. Of displacements they are displacements and angles.
    """
    arm, mean = x - centres(x, mass, owner)[:, owner], centres(v, mass, owner)
    moment = np.bincount(owner, mass * (arm[0] * v[1] - arm[1] * v[0]))
    return np.stack([*mean, moment / np.bincount(owner, mass * (arm**2).sum(axis=0))])


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


@dataclass(frozen=True)
class PrescribedVelocities:
    """The prescribed velocities of one step [m/s], in its middle but where they say so.

    Those of what forces move, which the step finds, take their places once they are known.
    """

    walls: Array  # (walls, 2)
    rigid: Array  # (3, bodies) of rigid bodies, with angular velocity [rad/s]; zero where free, and of others
    rigid_at_end: Array  # (3, bodies) the same at the end of the step
    supports: Array  # (2 supports,) zero where free; then rates of cosine and sine [1/s] of those that turn
    walls_at_end: Array  # (walls, 2) the same as `walls`, but for driven walls
    dt: float  # of the step [s]
    box: Array | None = None  # (2, 1) or (2, 2) edges of the periodic box at the end of the step [m]
    box_at_start: Array | None = None  # the same at its start [m]

    @property
    def gradient(self) -> Array | None:
        """Mean velocity gradient (2, 2) [1/s] of the box over its edges at the start; None without a box."""
        return self._gradient(self.box_at_start)

    @property
    def gradient_at_end(self) -> Array | None:
        """The mean velocity of the edges of the box over the edges at the end, (2, 2) [1/s]."""
        return self._gradient(self.box)

    def _gradient(self, edges: Array | None) -> Array | None:
        if self.box is None or self.box_at_start is None or edges is None:
            return None
        return np.asarray((self.box - self.box_at_start) @ np.linalg.pinv(edges) / self.dt)


def prescribed_velocities(scene: Model, t: float, dt: float, box: Array | None = None) -> PrescribedVelocities:
    """The prescribed velocities of a step from t to t + dt [s], with the edges `box` of a periodic box at its start.

    Components of the motion of the box that a stress determines are zero.

    Raises
    ------
    SceneError
        if one is unclear or not finite
    """
    middle, periodic = t + 0.5 * dt, scene.periodic
    at_end = None
    if periodic is not None and box is not None:
        still = np.zeros(periodic.components.shape[1])
        at_end = deformed(box, periodic.rate_at(middle), dt, periodic.components, still)
    walls = scene.wall_velocities(middle)
    rigid, supports = (_rigid(scene, middle), _rigid(scene, t + dt)), _supports(scene, t, dt)
    return PrescribedVelocities(walls, *rigid, supports, walls, dt, at_end, box)


def _rigid(scene: Model, t: float) -> Array:
    velocity = np.zeros((3, len(scene.bodies)))
    for b in np.flatnonzero(scene.held_components.any(axis=0)).tolist():
        velocity[:, b] = rigid_motion(scene.bodies[b], t, f"body {b}")
        if (np.isnan(velocity[:, b]) == scene.held_components[:, b]).any():
            raise SceneError(
                f"body {b}: motion at t = {t:.6g} s is {velocity[:, b]} (nan: None), with other components than at"
                " t = 0; a component is free always or never"
            )
    return np.nan_to_num(velocity)


def _supports(scene: Model, t: float, dt: float) -> Array:
    velocity = scene.support_velocities(t, dt)
    changed = np.flatnonzero((np.isnan(velocity) != scene.free_components).any(axis=1))
    if changed.size:
        raise SceneError(
            f"support {changed[0]}: velocity at t = {t + 0.5 * dt:.6g} s is {velocity[changed[0]]}, at t = 0"
            f" {scene.support_velocities(0.0)[changed[0]]} (nan: None); a component is free always or never"
        )
    return np.concatenate([np.nan_to_num(velocity).ravel(), support_rotations(scene, t, dt).T.ravel()])
