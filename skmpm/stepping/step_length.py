"""The length of steps where none is given (`simulate(..., dt=None)`).

Two distances limit a step, that by which driven objects move and that of bodies past each other: the limits of
`preflight`. They are asked before it, with present velocities, and after it, with those at its end: a step that moves
something too far is repeated. In slow motion the limit is a displacement, so that the number of steps does not depend
on the speed of a lid.

The energy that a step loses limits it as well. Backward Euler loses 1/2 |v1 - v0|_M^2; of that the part of the
rigid motions of bodies and walls counts, since vibrations within bodies die anyway. It may be `LOSS` of the largest
energy so far: impacts are resolved, and what swings or slides. A free fall loses nothing, since gravity does as much
work more, and neither does a wall that nothing but its force moves.
Where many bodies are driven or fall, impacts are so many that their errors average out, and losses do not count.

Below the limit, steps follow the number of Newton iterations: the next one is sqrt(4 / iterations) times as long, in
quasi-static steps by the mean of the solves, at least half and at most twice. Contacts that rearrange take more
iterations and then shorter steps. A step that fails is repeated with a sixteenth of its length, since rearrangements
are 10 to 100 times faster than the loading.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from skmpm.arrays import Array
from skmpm.scene import Scene, SceneError, State, centres, fitted_motions, normal_speeds
from skmpm.scheme import Scheme
from skmpm.step.driven import driven_bodies, driven_by_force, moving, prescribed_speeds
from skmpm.step.driven_walls import driving_forces
from skmpm.stepping.functions_of_time import TIMES, FunctionsOfTime
from skmpm.stepping.loading import gravity_of, settling, several, smallest_radii, strongest_gravity

STROKE = 0.14  # [cells] displacement of what is driven in a step, up to which packings were verified
WAVES = 0.1  # distance of pressure waves in a step, over the radius of the smallest body
MAX_APPROACH = 0.2  # [cells] of bodies past each other, up to which collisions were verified
FLIGHT = 0.5  # [cells] the same of many bodies that fall, where they meet no others
# Newton iterations at which the length is kept. Fifty discs, compressed slowly with friction from a solid fraction of
# 0.7 to 0.94, took 284 steps, 11 retries and 55 s with 4, 195 steps, 25 retries and 56 s with 8.
AIM = 4
MAX_CHANGE = 2.0  # of the length, from one step to the next
LOSS = 1e-5  # of the largest energy so far: 1/2 |v1 - v0|^2 in a step, which backward Euler loses
VIBRATIONS = 1e-3  # share that counts of what velocities within bodies lose: vibrations die anyway
TWICE = 2.0  # over the step that loses as much as it may: a longer one is repeated
BELOW = 0.9  # of the longest step that is allowed, where one was too long or loses as much as it may
SLACK = 1e-3  # over distances: how much too far a step may move things without being repeated
REST = 0.01  # [cells] height of a bounce that need not be accurate; gaps are found a quarter of a cell ahead
SAMPLES = np.linspace(0.0, 1.0, 5)  # of a step, where prescribed velocities are taken


@dataclass(frozen=True)
class Pace:
    """What limits the steps of a run."""

    resolving: float  # the longest step that resolves waves [s]; losses limit no shorter ones
    inertia: bool  # whether velocities of bodies limit steps
    forced: bool  # whether other forces than gravity move anything with inertia: the first step resolves waves
    longest: float  # that is allowed [s]
    losses: bool  # whether the energy that steps lose limits them
    negligible: float  # energy [J/m] below which losses do not matter
    room: float  # largest displacement of bodies past others that they may meet in the step [m]
    flight: float  # and past all others [m]
    driven: bool  # whether anything is
    functions: FunctionsOfTime

    def limit(self, scene: Scene, state: State, left: float) -> float:
        """The longest step from a state, at most `left` [s], by the present velocities."""
        t, longest, first = state.t, min(left, self.longest), state.step_control.chosen == 0.0
        falls = first or self.driven or self.functions.loads  # else what rests goes on resting
        fall = float(np.hypot(*gravity_of(scene, t))) if falls else 0.0
        longest = min(longest, self.by_motion(scene, state, state, fall))
        longest = min(longest, self.resolving) if first and self.forced else longest
        return _within_stroke(scene, t, self.functions.followed(t, longest, self.resolving), state.box)

    def by_motion(self, scene: Scene, before: State, after: State, fall: float = 0.0) -> float:
        """The longest step [s] that moves nothing too far from a state, with the velocities of a later one.

        Bodies may accelerate by `fall` [m/s2] past others.
        """
        if not self.inertia:
            return np.inf
        now = moving(scene, after)
        turning = float(np.hypot(*np.ptp(now.v, axis=1)))
        limits = [_time(STROKE * scene.cell, now.speed, 0.0), _time(scene.max_motion, turning, 0.0)]
        if scene.can_touch:
            limits.append(_time(self.flight, relative_speed(scene, after.t, now.v), fall))
            if self.room < self.flight:
                gaps, speeds = _meeting(scene, before, after.v, self.flight)
                limits.append(_time(self.room + gaps, speeds, fall).min(initial=np.inf))
        return min(map(float, limits))

    def by_loss(self, scene: Scene, before: State, after: State) -> float:
        """The step [s] that loses as much energy as it may, from a step of another length."""
        length = after.report.dt
        largest = after.report.energy.largest
        if not self.losses or largest <= self.negligible:
            return np.inf
        lost = _lost(scene, before, after)
        allowed = max(LOSS * largest, 0.5 * scene.mass * _driven_at(scene, after.t, after.box) ** 2)
        return max(self.resolving, length * float(np.sqrt(allowed / max(lost, 1e-300))))


def _driven_at(scene: Scene, t: float, box: Array | None = None) -> float:
    """The speed of the fastest thing that moves as prescribed at time t, or that a force gives to waves [m/s]."""
    every = (*prescribed_speeds(scene, t, box), *driven_by_force(scene, t))
    return max((speed for _, speed in every), default=0.0)


def _lost(scene: Scene, before: State, after: State) -> float:
    """Energy [J/m] that backward Euler loses in a step by changes of velocities, but for free fall and free walls.

    All of it counts by which rigid motions change, and a share of that of points. As a body turns, velocities of its
    points change by omega^2 r dt, too, unless it is rigid.
    """
    mass, owner, bodies, dt = scene.masses, scene.owner, len(scene.bodies), after.report.dt
    fall = dt * gravity_of(scene, after.t)[:, None]
    own, of_points = scene.movable[owner], _square(after.v - before.v, fall)
    one, two = (fitted_motions(state.x, state.v, mass, owner) for state in (before, after))
    arm = after.x - centres(after.x, mass, owner)[:, owner]
    inertia = np.bincount(owner, mass * (arm**2).sum(axis=0), bodies)
    turning = np.where(scene.deformable, dt * two[2] ** 2, 0.0)
    of_bodies = np.bincount(owner, mass, bodies) * _square(two[:2] - one[:2], fall)
    of_bodies += inertia * ((two[2] - one[2]) ** 2 + turning**2)
    of_bodies = of_bodies[scene.movable].sum() + VIBRATIONS * (mass[own] @ of_points[own])
    return 0.5 * float(of_bodies + _of_walls(scene, before, after))


def _of_walls(scene: Scene, before: State, after: State) -> float:
    """Masses of driven walls times squares of their changes of velocity, beside those by what drives them [J/m]."""
    if scene.driven_walls.size == 0:
        return 0.0
    change = normal_speeds(scene, after.wall_velocity) - normal_speeds(scene, before.wall_velocity)
    free = after.report.dt * driving_forces(scene, after.walls, after.t) / scene.wall_masses
    return float(scene.wall_masses @ _square(change[None], free[None]))


def _square(change: Array, fall: Array) -> Array:
    """Squares (k,) of changes of velocities (2, k), or of what they are beside those of a free fall."""
    return np.asarray(np.minimum((change**2).sum(axis=0), ((change - fall) ** 2).sum(axis=0)))


def relative_speed(scene: Scene, t: float, v: Array) -> float:
    """A bound on speeds of bodies past each other, and to or from walls, from velocities v (2, k) [m/s].

    What slides along a wall, or flies beside one, comes no closer to anything else if it is alone.
    """
    given = np.delete(np.arange(len(scene.walls)), scene.driven_walls)
    normal, walls = scene.normals[:, given], scene.wall_velocities(t)[given].T
    to_walls = np.abs(normal.T @ v - (normal * walls).sum(axis=0)[:, None])
    alone = len(scene.bodies) == 1 and scene.driven_walls.size == 0 and scene.periodic is None
    between = 0.0 if alone else float(np.hypot(*np.ptp(np.concatenate([v, walls], axis=1), axis=1)))
    return max(between, float(to_walls.max(initial=0.0)))


def _meeting(scene: Scene, before: State, v: Array, room: float) -> tuple[Array, Array]:
    """Gaps between bodies and to walls [m] that may close in a step, and bounds on the speeds at which they do [m/s].

    Points move at v (2, n) from their positions before. No body moves by more than `room` [m], and walls stand still.
    """
    owner, mass, x = scene.owner, scene.masses, before.x
    centre, velocity = centres(x, mass, owner), centres(v, mass, owner)
    reach, own = np.zeros((2, len(scene.bodies)))
    np.maximum.at(reach, owner, np.hypot(*(x - centre[:, owner])))
    np.maximum.at(own, owner, np.hypot(*(v - velocity[:, owner])))
    i, j = KDTree(centre.T).query_pairs(2.0 * (reach.max() + room), output_type="ndarray").T
    between = np.hypot(*(centre[:, i] - centre[:, j])) - reach[i] - reach[j]
    relative = np.hypot(*(velocity[:, i] - velocity[:, j])) + own[i] + own[j]
    to_walls = scene.normals.T @ x - (scene.normals.T * before.walls).sum(axis=1)[:, None]
    gaps, speeds = np.append(between, to_walls), np.append(relative, -scene.normals.T @ v)
    near = gaps < 2.0 * room
    return np.maximum(gaps[near], 0.0), np.maximum(speeds[near], 0.0)


def _time(distance: Array | float, speed: Array | float, acceleration: float) -> Array:
    """The time [s] to move a distance [m] by backward Euler, the positive root of a dt^2 + v dt = distance."""
    rate = speed + np.sqrt(np.square(speed) + 4.0 * acceleration * np.asarray(distance))
    return np.where(rate > 0.0, 2.0 * np.asarray(distance) / np.maximum(rate, 1e-300), np.inf)


def _within_stroke(scene: Scene, t: float, dt: float, box: Array | None) -> float:
    """The longest step from t up to dt [s] in which nothing driven moves farther than `STROKE`."""
    stroke = STROKE * scene.cell
    while True:
        times = t + SAMPLES * dt if np.isfinite(dt) else [t]
        speeds = (speed for time in times for _, speed in prescribed_speeds(scene, float(time), box))
        fastest = max(speeds, default=0.0)
        if fastest * dt <= stroke * (1.0 + 1e-9) or fastest == 0.0:
            return dt
        dt = max(0.5 * dt if np.isfinite(dt) else 0.0, stroke / fastest)


def pace_of(
    scene: Scene,
    scheme: Scheme,
    began: float,
    until: float,
    *,
    max_dt: float | None = None,
    waves: bool | None = None,
) -> Pace:
    """What limits the steps of a run or a stage from `began` to `until` [s], wherever it was interrupted.

    With `waves` all steps resolve waves; if that is False, no loss of energy limits them. `max_dt` [s] does.

    Raises
    ------
    SceneError
        if only loads that are functions of time set the pace of quasi-static steps
    """
    times = np.linspace(began, until, TIMES if until > began else 1)
    functions = FunctionsOfTime.in_run(scene, scheme.theta, times)
    if functions.of_bodies and not scheme.inertia:
        raise SceneError(
            "simulate: quasi-static steps under loads, springs or gravity that are functions of time need dt"
        )
    looked_at = times[:1] if functions.none else times
    driven_at = max(_driven_at(scene, float(t)) for t in looked_at)
    gravity = strongest_gravity(scene, looked_at)
    many = several(scene) and (driven_at > 0.0 or bool(gravity.any()))
    losses = scheme.inertia and (not many if waves is None else waves)
    # Where something is driven, the flight of bodies that are loose between others need not be accurate.
    room = scene.max_motion if driven_at > 0.0 else MAX_APPROACH * scene.cell
    falls = not (losses or driven_at > 0.0 or scene.periodic is not None)
    # What loads and springs cause is to be followed, however small beside what gravity does.
    weight = np.zeros(2) if scene.loads or scene.springs else gravity
    resolving = WAVES * float(smallest_radii(scene).min()) / scene.fastest_wave
    return Pace(
        resolving,
        scheme.inertia,
        scheme.inertia and bool(driven_bodies(scene).size or scene.driven_walls.size or scene.stressed),
        min(np.inf if max_dt is None else max_dt, resolving if waves else np.inf),
        losses,
        scene.mass * float(0.5 * settling(scene, weight) ** 2 + np.hypot(*weight) * REST * scene.cell),
        room,
        max(room, FLIGHT * scene.cell) if falls else room,
        driven_at > 0.0,
        functions,
    )


def next_length(length: float, newton: float) -> float:
    """The length [s] after a step of another length that took so many Newton iterations, on average of its solves."""
    return float(length * np.clip(np.sqrt(AIM / max(newton, 1.0)), 1.0 / MAX_CHANGE, MAX_CHANGE))
