"""Rigid motion of bodies, prescribed or fitted: translation, and rotation about the centre of mass."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.scene.objects import Body, SceneError, motion, numbers

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def rigid_motion(body: Body, t: float, name: str) -> Array:
    """Prescribed velocity of the centre of mass and angular velocity of a rigid body at time t, (3,) [m/s, rad/s].

    Those at t = 0 of a free one.
    """
    if body.motion is None:
        return np.append(motion(body.velocity, t, f"{name}: velocity"), body.spin)
    called = callable(body.motion)
    name = f"{name}: motion at t = {t:.6g} s" if called else f"{name}: motion"
    remedy = "give three finite numbers (vx, vy, spin), or no motion for a body that forces move"
    value = body.motion(t) if callable(body.motion) else body.motion
    array = numbers(name, value, remedy)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise SceneError(f"{name} = {value!r}; {remedy}")
    return array


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
    arm, total = x - centres(x, mass, owner)[:, owner], np.bincount(owner, mass)
    mean = [np.bincount(owner, mass * component) / total for component in v]
    moment = np.bincount(owner, mass * (arm[0] * v[1] - arm[1] * v[0]))
    return np.stack([*mean, moment / np.bincount(owner, mass * (arm**2).sum(axis=0))])
