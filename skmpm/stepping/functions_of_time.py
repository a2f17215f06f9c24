"""Functions of time that prescribe motions and loads, and chosen steps that follow them.

A step takes one value of each: of loads that at t + theta dt, of velocities that in its middle, of displacements the
difference between its ends. Where loads change in it, and velocities or displacements are not straight in it, it is
shortened. So pulses are seen that last a sixty-fourth of a step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from skmpm.arrays import ROUND_OFF, Array
from skmpm.scene import DISPLACEMENT, LOAD, VELOCITY, Periodic, Scene, Wall, functions_of_time

Function = Callable[[float], ArrayLike]

SAMPLES = 64  # of a function: in the time of a step, and of gravity in space, three or more in a body
# Largest error of the impulse of a load in a step, over that of the largest in a run: the mean deviation from
# the value that the step takes. A ramp from zero then takes 50 steps; the velocity at its end is 1.5 % too large.
MAX_ERROR = 0.01
TIMES = 101  # of a run, at which functions of time tell how large they are


@dataclass(frozen=True)
class FunctionsOfTime:
    """The functions of time of a scene, each with the largest value of every component in a run."""

    loads: tuple[tuple[Function, Array], ...]
    velocities: tuple[tuple[Function, Array], ...]
    displacements: tuple[tuple[Function, Array], ...]
    theta: float
    of_bodies: bool  # whether some of the loads act on bodies, not on walls or a periodic box

    @classmethod
    def in_run(cls, scene: Scene, theta: float, times: Array) -> FunctionsOfTime:
        """The functions of time of a scene, and how large they are at some times of a run [s]."""
        found: dict[str, list[tuple[Function, Array]]] = {LOAD: [], VELOCITY: [], DISPLACEMENT: []}
        of_bodies = callable(scene.gravity)
        for part, kind, f in functions_of_time(scene):
            of_bodies |= kind == LOAD and not isinstance(part, Wall | Periodic)
            found[kind].append(_with_size(f, times))
        if callable(scene.gravity):
            gravity, X = scene.gravity, _some_points(scene)
            found[LOAD].append(_with_size(lambda t: gravity(X.copy(), t), times))  # the function may work in place
        return cls(tuple(found[LOAD]), tuple(found[VELOCITY]), tuple(found[DISPLACEMENT]), theta, of_bodies)

    @property
    def none(self) -> bool:
        """Whether there are none."""
        return not (self.loads or self.velocities or self.displacements)

    def followed(self, t: float, dt: float, shortest: float) -> float:
        """The longest of dt, dt / 2, ... [s] in which a step from time t follows them, at least the shortest one."""
        if self.none or not np.isfinite(dt):
            return dt
        while dt > shortest and not self._follows(t, dt):
            dt = max(0.5 * dt, shortest)
        return dt

    def _follows(self, t: float, dt: float) -> bool:
        """Whether a step from t to t + dt follows them."""
        part = np.linspace(0.0, 1.0, SAMPLES + 1)
        times = t + dt * part
        for f, size in self.loads:
            values, (taken,) = values_at(f, times), values_at(f, np.array([t + self.theta * dt]))
            away = np.abs(values - taken)
            mean = (away.sum(axis=0) - 0.5 * (away[0] + away[-1])) / SAMPLES
            if _relative(mean, values, size) > MAX_ERROR:
                return False
        for f, size in self.velocities + self.displacements:
            values = values_at(f, times)
            line = values[0] + part[:, None] * (values[-1] - values[0])
            # The mean of a parabola is off by a third of its bend. A period of a sine then takes 13 steps.
            if _relative(values - line, values, size) / 3.0 > MAX_ERROR:
                return False
        return True


def _with_size(f: Function, times: Array) -> tuple[Function, Array]:
    """A function, and the largest value of every component at some times."""
    return f, np.abs(values_at(f, times)).max(axis=0)


def _relative(error: Array, values: Array, size: Array) -> float:
    """The largest error over the largest value of its component, of those in the step and that of the run."""
    largest = np.maximum(size, np.abs(values).max(axis=0))
    largest = np.maximum(largest, ROUND_OFF * largest.max())
    return float((np.abs(error) / np.where(largest > 0.0, largest, 1.0)).max())


def values_at(f: Function, times: Array) -> Array:
    """The values of a function at some times, (times, k); components that it leaves free are zero."""
    each = [np.array(f(float(t)), dtype=float).ravel() for t in times]
    return np.asarray(np.nan_to_num(np.array(each)), dtype=np.float64)


def _some_points(scene: Scene) -> Array:
    """Positions at t = 0 of points of all bodies that forces move, (2, k) [m]."""
    bodies = np.flatnonzero(scene.movable)
    first, last = scene.offsets[bodies], scene.offsets[bodies + 1] - 1
    each = np.linspace(first, last, max(3, -(-SAMPLES // bodies.size)))
    return scene.initial_positions[:, np.unique(each.astype(np.int64))]
