"""What `simulate` warns of once in a run: states in which forces may be far off."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skmpm.scene import Scene, State
from skmpm.scheme import Scheme
from skmpm.simulate.loading import SLOPE, strongest_gravity

# Of frozen contact normals, `Report.frozen_angle` [rad]: forces may be off by so much, a third of what contacts of
# R/h = 5 are (docs/limits.md).
MAX_ANGLE = 0.05

# Of gravity: error of the acceleration of a wall in a step, and so of the force on a body that it carries, over its
# weight. Where a block is shaken at 0.8 of gravity, chosen steps make it 0.4, and twice in ten periods it lifts off.
MAX_JOLT = 0.1
SHORT = 1e-2  # of a step: half of the interval over which velocities are differentiated


class NormalsWatch:
    """Finds the first step of a run in which contact normals are far from those at its end."""

    def __init__(self) -> None:
        self._warned = False

    def warning(self, state: State) -> str:
        """What to warn of at a state, once in a run; empty for nothing."""
        angle = state.report.frozen_angle
        if self._warned or angle <= MAX_ANGLE:
            return ""
        self._warned = True
        return (
            f"the step to t = {state.t:.6g} s: no equilibrium was found but with contact normals that are off by"
            f" {angle:.2g} rad on average (report.frozen_angle), and forces may be off by as much: shorter steps, or"
            " use inertia; where edges touch edges, whose normals are not unique, it need not matter"
        )


class ShakingWatch:
    """Finds the first chosen step in which what shakes under a body accelerates by other than its function of time.

    A step takes mean velocities, so that the acceleration in it is that over the mean of its length and that of the
    one before, but forces are those over its length. `times` [s] are those of the run, at which gravity is looked at.
    """

    def __init__(self, scene: Scene, scheme: Scheme, before: float, times: NDArray[np.float64] | None) -> None:
        self._before = before  # length of the step before [s]
        self._walls: list[tuple[int, Callable[[float], ArrayLike]]] = []
        if times is None or not scheme.inertia:
            return
        gravity = strongest_gravity(scene, times)
        self._weight = float(np.hypot(*gravity))
        floors = scene.normals.T @ gravity < -SLOPE * self._weight
        self._walls = [
            (i, v) for i, v in enumerate(wall.velocity for wall in scene.walls) if floors[i] and callable(v)
        ]

    def warning(self, state: State) -> str:
        """What to warn of at a state, once in a run; empty for nothing."""
        dt, before = state.report.dt, self._before
        self._before = dt
        short, middle = SHORT * dt, state.t - 0.5 * dt
        share = 0.5 * abs(before / dt - 1.0) if before else 0.0
        for i, f in self._walls:
            if share == 0.0 or not state.wall_force[i].any():
                continue
            acceleration = float(np.hypot(*np.subtract(f(middle + short), f(middle - short)))) / (2.0 * short)
            if share * acceleration > MAX_JOLT * self._weight:
                self._walls, off = [], share * acceleration / self._weight
                return (
                    f"wall {i}: at t = {state.t:.6g} s it accelerates by {acceleration:.3g} m/s2 in a chosen step,"
                    f" {dt / before:.2g} times as long as the one before: forces on what it carries are off by"
                    f" {off:.2g} of its weight, so that it may lift off or slip; give dt"
                )
        return ""
