"""What `simulate` warns of once in a run: states in which forces may be far off."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skmpm.arrays import Array, Ints
from skmpm.material import is_linear, youngs_modulus
from skmpm.scene import Scene, State
from skmpm.scheme import Scheme, averages_dilatation
from skmpm.stepping.functions_of_time import Function, values_at
from skmpm.stepping.loading import SLOPE, strongest_gravity

# Mean pressure of the points of a body over its modulus. Confined on all sides, bodies with mean dilatation lose
# their resistance at 1.8 to 2.5 (`tests/verification/test_confined.py`); packings at a fraction of 0.97 have 0.13.
MAX_PRESSURE = 1.0

# Of the largest energy: what steps with theta < 1 may gain, too. Bodies of nu = 0.49 that vibrate have two to seven
# times their energy after 240 steps of theta = 1/2 with anchor = 0.1.
MAX_REGRIDDING = 0.05

# [rad] Of bodies of linear materials, which it strains by 0.00125; the strain grows with its square.
MAX_LINEAR_ROTATION = 0.05

# Of gravity: error of the acceleration of a wall in a step, and so of the force on a body that it carries, over its
# weight. Where a block is shaken at 0.8 of gravity, chosen steps make it 0.4, and twice in ten periods it lifts off.
MAX_JOLT = 0.1
SHORT = 1e-2  # of a step: half of the interval over which velocities are differentiated

# How far a wall may be from where the integral of its velocity leads: in cells, what contacts may overlap, and over
# its path. Of a seal under a lid that stops 1 to 6 % of the diameter too early or late, the force is 8 to 43 % off.
MAX_STRAY, STRAY_SHARE = 0.05, 0.01
# Of a step: where velocities are looked at for their integral.
SHARES = np.linspace(0.0625, 0.9375, 8)


Watch = Callable[[State], str]  # what to warn of at a state of a run; empty for nothing


def watches_of(scene: Scene, scheme: Scheme, state: State, times: Array | None) -> Iterator[Watch]:
    """What is asked at every state of a run that begins from a state, until it warns.

    `times` [s] are those of the run, at which gravity is looked at, where steps are chosen; None where dt is given.
    """
    moduli = _confined_moduli(scene, scheme)
    if np.isfinite(moduli).any():
        yield partial(_pressure, moduli)
    yield _regridding
    linear = np.flatnonzero([any(map(is_linear, body.materials)) for body in scene.bodies])
    if linear.size:
        yield _Rotation(linear, state)
    if times is None:
        yield _Stroke(scene, state.t)
    elif scheme.inertia:
        yield _Shaking(scene, state.report.dt, strongest_gravity(scene, times))


def first_warnings(watches: list[Watch], state: State) -> Iterator[str]:
    """The warnings at a state of watches, which are then removed from the list: each warns once in a run."""
    for watch in tuple(watches):
        if text := watch(state):
            watches.remove(watch)
            yield text


def _confined_moduli(scene: Scene, scheme: Scheme) -> Array:
    """The least modulus of each body whose volumes of cells are those at the points, (bodies,) [Pa]; inf of others.

    With moment fitting they are exact (`moment_fitting.fitted_places`), and nothing is looked at, nor are bodies
    without mean dilatation.
    """
    moduli = np.full(len(scene.bodies), np.inf)
    for b, body in enumerate(scene.bodies):
        fitted = scheme.moment_fitting and scene.outlined[b]
        if not fitted and any(averages_dilatation(scheme, material) for material in body.materials):
            moduli[b] = min(map(youngs_modulus, body.materials))
    return moduli


def _pressure(moduli: Array, state: State) -> str:
    """Find the body under the largest pressure over its modulus (bodies,) [Pa]."""
    trace = np.bincount(state.body, state.volume * (state.stress[0, 0] + state.stress[1, 1]))
    pressure = -0.5 * trace / np.bincount(state.body, state.volume) / moduli
    b = int(np.argmax(pressure))
    if pressure[b] <= MAX_PRESSURE:
        return ""
    return (
        f"body {b}: at t = {state.t:.6g} s the mean pressure in it is {pressure[b]:.2g} times its modulus; from"
        " about twice on, points of confined bodies leave the volumes of their cells, and forces are far too"
        " small: press less, or give the body an outline and use Scheme(moment_fitting=True)"
    )


def _regridding(state: State) -> str:
    """Find that new body grids have added energy, which no check of steps counts."""
    energy = state.report.energy
    share = energy.regridding / max(energy.largest, 1e-300)
    if share <= MAX_REGRIDDING:
        return ""
    return (
        f"until t = {state.t:.6g} s new body grids have added energy (Energy.regridding), {share:.2g} of the"
        " largest that bodies had: use anchor = inf, or more points in a cell"
    )


class _Rotation:
    """Finds the body of a linear material, of some, that has turned most: a rotation by a changes its area by a^2."""

    def __init__(self, linear: Ints, state: State) -> None:
        self._linear = linear
        self._anchor = state.F_anchor  # the last one
        self._before = _rotations(state.F_anchor, state.body)  # of bodies in it

    def __call__(self, state: State) -> str:
        if state.F_anchor is not self._anchor:
            self._anchor, self._before = state.F_anchor, _rotations(state.F_anchor, state.body)
        turned = np.abs(np.angle(_rotations(state.F, state.body) * self._before.conj()))
        b = int(self._linear[np.argmax(turned[self._linear])])
        if turned[b] <= MAX_LINEAR_ROTATION:
            return ""
        return (
            f"body {b}: at t = {state.t:.6g} s it has turned by {turned[b]:.2g} rad, which its linear material takes"
            f" for a strain of {0.5 * turned[b] ** 2:.2g}: use NeoHookean with the same constants"
        )


def _rotations(F: Array, body: Ints) -> NDArray[np.complexfloating]:
    """Mean rotations of bodies with deformation gradients F (2, 2, n), as complex numbers (bodies,) of any size."""
    return np.asarray(np.bincount(body, F[0, 0] + F[1, 1]) + 1j * np.bincount(body, F[1, 0] - F[0, 1]))


class _Stroke:
    """Finds what moves in steps of a given length by other than the integral of its velocity, as where that jumps.

    Steps take velocities at their middles.
    """

    def __init__(self, scene: Scene, t: float) -> None:
        self._t = t  # at the end of the step before [s]
        self._cell = scene.cell
        self._moving = _moving(scene)
        self._paths = np.zeros((3, 2, len(self._moving)))  # moved, integral, integral of the magnitude [m]

    def __call__(self, state: State) -> str:
        dt, began = state.report.dt, self._t
        self._t = state.t
        for k, (kind, i, f) in enumerate(self._moving):
            moved, path, length = self._paths[:, :, k]
            each = values_at(f, began + dt * SHARES)[:, :2]
            moved += dt * values_at(f, np.array([began + 0.5 * dt]))[0, :2]
            path += dt * each.mean(axis=0)
            length += dt * np.abs(each).mean(axis=0)
            off = np.abs(moved - path)
            if (off > np.maximum(MAX_STRAY * self._cell, STRAY_SHARE * length)).any():
                return (
                    f"{kind} {i}: at t = {state.t:.6g} s it has moved by ({moved[0]:.4g}, {moved[1]:.4g}) m, while"
                    f" the integral of its velocity is ({path[0]:.4g}, {path[1]:.4g}) m: steps take velocities at"
                    " their middles; give a dt that ends steps where the velocity jumps, or none"
                )
        return ""


def _moving(scene: Scene) -> list[tuple[str, int, Function]]:
    """What moves by a velocity that is a function of time: kind and number of walls, rigid bodies and supports."""
    named: list[tuple[str, int, Any]] = [
        *(("wall", i, _given(scene, i)) for i in range(len(scene.walls))),
        *(("body", b, body.motion) for b, body in enumerate(scene.bodies)),
        *(("support", i, held.velocity) for i, held in enumerate(scene.supports) if held.displacement is None),
    ]
    return [(kind, i, f) for kind, i, f in named if callable(f)]


def _given(scene: Scene, i: int) -> Any:
    """The velocity of a wall as far as it is given: along it, if a force drives it."""
    wall, (x, y) = scene.walls[i], scene.normals[:, i]
    velocity = wall.velocity
    if not (wall.driven and callable(velocity)):
        return velocity
    along = np.array([-y, x])
    return lambda t: along * (along @ np.asarray(velocity(t), dtype=float))


class _Shaking:
    """Finds the first chosen step in which what shakes under a body accelerates by other than its function of time.

    The velocity is constant within a step. Its jump between two steps is that of an acceleration over the mean of
    their lengths, but the inertial force is computed with the length of the second one. Looked at are walls below
    bodies and rigid bodies, if something rests on them, which presses rigid bodies along gravity (2,) [m/s2].
    """

    def __init__(self, scene: Scene, before: float, gravity: Array) -> None:
        self._before = before  # length of the step before [s]
        self._gravity, self._weight = gravity, float(np.hypot(*gravity))
        below = scene.normals.T @ gravity < -SLOPE * self._weight
        self._floors = [
            (kind, i, f) for kind, i, f in _moving(scene) if kind == "body" or (kind == "wall" and below[i])
        ]

    def __call__(self, state: State) -> str:
        dt, before = state.report.dt, self._before
        self._before = dt
        short, middle = SHORT * dt, state.t - 0.5 * dt
        share = 0.5 * abs(before / dt - 1.0) if before else 0.0
        for kind, i, velocity in self._floors if share > 0.0 else ():
            carries = state.wall_force[i].any() if kind == "wall" else state.body_force[:, i] @ self._gravity > 0.0
            if not carries:
                continue
            change = np.diff(values_at(velocity, middle + short * np.array([-1.0, 1.0])), axis=0)[0]
            acceleration = float(np.hypot(*change[:2])) / (2.0 * short)
            if share * acceleration > MAX_JOLT * self._weight:
                off = share * acceleration / self._weight
                return (
                    f"{kind} {i}: at t = {state.t:.6g} s it accelerates by {acceleration:.3g} m/s2 in a chosen"
                    f" step, {dt / before:.2g} times as long as the one before: forces on what it carries are off"
                    f" by {off:.2g} of its weight, so that it may lift off or slip; give dt"
                )
        return ""
