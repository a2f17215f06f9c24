"""The length of steps where none is given (`simulate(..., dt=None)`).

Three distances limit a step: those that driven objects move, and bodies past each other, by their present
velocities and gravity, which are the limits of `preflight`; and, where waves set the pace (`simulate.loading`),
0.1 R, with R the radius of the smallest body, which is what `Scheme.balanced` is meant for
(docs/studies/work_precision.md); not the waves that gravity causes in bodies at rest when it begins to act. In slow
motion the limit is a displacement, so that the number of steps does not depend on the speed of a lid.

Below the limit, steps follow the number of Newton iterations: the next one is sqrt(4 / iterations) times as long, in
quasi-static steps sqrt(15 / iterations), at least half and at most twice. Contacts that rearrange take more
iterations and then shorter steps. A step that fails is repeated with a sixteenth of its length, since rearrangements
are 10 to 100 times faster than the loading.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.scene import Contacts, Scene, SceneError, State
from skmpm.scheme import Scheme
from skmpm.simulate.acceptance import max_motion
from skmpm.simulate.driven import Moving, moving
from skmpm.simulate.functions_of_time import TIMES, FunctionsOfTime
from skmpm.simulate.impacts import normal_speed, pushed_away
from skmpm.simulate.initial_state import can_touch, driven
from skmpm.simulate.loading import Loading, gravity_of, loading_of, smallest_radii

Array = NDArray[np.float64]

STROKE = 0.14  # [cells] displacement of what is driven in a step, up to which packings were verified
WAVES = 0.1  # distance of pressure waves in a step, over the radius of the smallest body
MAX_APPROACH = 0.2  # [cells] of bodies past each other, up to which collisions were verified
# Newton iterations at which the length is kept. Fifty discs, compressed slowly with friction from a solid fraction of
# 0.7 to 0.94, took 284 steps, 11 retries and 55 s with 4, 195 steps, 25 retries and 56 s with 8.
AIM = 4
MAX_CHANGE = 2.0  # of the length, from one step to the next
SAMPLES = np.linspace(0.0, 1.0, 5)  # of a step, where prescribed velocities are taken


@dataclass(frozen=True)
class Pace:
    """What limits the steps of a run."""

    loading: Loading
    radius: float  # of the smallest body [m]
    wave: float  # speed of the fastest pressure wave [m/s]
    room: float  # largest displacement of bodies past each other [m]
    functions: FunctionsOfTime

    def limit(
        self,
        scene: Scene,
        scheme: Scheme,
        t: float,
        now: Moving,
        left: float,
        *,
        forces_at: float | None = None,
        box: Array | None = None,
    ) -> float:
        """The longest step from time t, at most `left` [s].

        `forces_at` is the time of gravity, by default t, and `box` (2, 2) the edges of a periodic box, by default
        those at the start.
        """
        longest = min(left, *self._of_motion(scene, t, now, forces_at)) if scheme.inertia else left
        return _within_stroke(scene, t, self.functions.followed(t, longest, self.resolving), box)

    def _of_motion(self, scene: Scene, t: float, now: Moving, forces_at: float | None) -> list[float]:
        """What waves and the motions of bodies allow [s]."""
        limits = [_time(STROKE * scene.cell, now.speed, now.acceleration)]
        if self.loading.every_step:
            limits.append(self.resolving)
        if can_touch(scene):
            others = np.delete(scene.wall_velocities(t), scene.driven_walls, axis=0)
            speed = float(np.hypot(*np.ptp(np.concatenate([now.v, others.T], axis=1), axis=1)))
            gravity = gravity_of(scene, t if forces_at is None else forces_at)
            limits.append(_time(self.room, speed, float(np.hypot(*gravity))))
        return limits

    @property
    def resolving(self) -> float:
        """The longest step that resolves waves [s]."""
        return WAVES * self.radius / self.wave

    def during(self, scene: Scene, state: State, contacts: Contacts, length: float) -> float:
        """A length [s], or that which resolves waves if some contacts are impacts at the velocities of a state.

        Or if contacts push a body away, as one that was compressed and is released.
        """
        if length <= self.resolving:
            return length
        impact = self.loading.impact < np.inf and normal_speed(state, contacts) > self.loading.impact
        if not impact and self.loading.release < np.inf:
            criterion = (self.loading.release, self.radius / self.wave)
            impact = any(pushed_away(scene, state, t, *criterion) for t in (state.t, state.t + length))
        return self.resolving if impact else length


def moves_too_far(scene: Scene, after: State, length: float) -> bool:
    """Whether something that forces drive moves farther than `STROKE` in a step of this length [s]."""
    return moving(scene, after, after.t).speed * length > STROKE * scene.cell


def _time(distance: float, speed: float, acceleration: float) -> float:
    """The time [s] to move a distance [m] by backward Euler, the positive root of a dt^2 + v dt = distance."""
    rate = speed + float(np.sqrt(speed**2 + 4.0 * acceleration * distance))
    return 2.0 * distance / rate if rate > 0.0 else np.inf


def _within_stroke(scene: Scene, t: float, dt: float, box: Array | None) -> float:
    """The longest step from t up to dt [s] in which nothing driven moves farther than `STROKE`."""
    stroke = STROKE * scene.cell
    while True:
        times = t + SAMPLES * dt if np.isfinite(dt) else [t]
        fastest = max((speed for time in times for _, speed in driven(scene, float(time), box)), default=0.0)
        if fastest * dt <= stroke * (1.0 + 1e-9) or fastest == 0.0:
            return dt
        dt = max(0.5 * dt if np.isfinite(dt) else 0.0, stroke / fastest)


def pace_of(scene: Scene, scheme: Scheme, began: float, until: float) -> Pace:
    """What limits the steps of a run or a stage from `began` to `until` [s], wherever it was interrupted.

    Raises
    ------
    SceneError
        if only loads that are functions of time set the pace of quasi-static steps
    """
    times = np.linspace(began, until, TIMES if until > began else 1)
    functions = FunctionsOfTime.of(scene, scheme.theta, times)
    loading = loading_of(scene, times[:1] if functions.none else times)
    if functions.of_bodies and not scheme.inertia:
        raise SceneError("simulate: quasi-static steps under loads that are functions of time need dt")
    # Where something is driven, collisions of bodies that are loose between others need not be accurate.
    room = max_motion(scene) if loading.driven > 0.0 else MAX_APPROACH * scene.cell
    return Pace(loading, float(smallest_radii(scene).min()), scene.fastest_wave, room, functions)


def next_length(length: float, newton: float) -> float:
    """The length [s] after a step of another length that took so many Newton iterations, on average of its solves."""
    return float(length * np.clip(np.sqrt(AIM / max(newton, 1.0)), 1.0 / MAX_CHANGE, MAX_CHANGE))
