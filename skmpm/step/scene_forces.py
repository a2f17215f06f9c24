"""The forces of a scene on bodies, as terms of a step."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.arrays import Array
from skmpm.material import is_linear, viscosity_of
from skmpm.observe import wetted_segments
from skmpm.scene import Scene, State, gravity_at, stiffness_of, varies_in_time
from skmpm.scheme import Scheme
from skmpm.step.driven import prescribed_speeds
from skmpm.step.forces import Bars, Beds, DeadLoad, FollowerPressure, ViscousBulk
from skmpm.step.terms import Configuration, Term

Ints = NDArray[np.integer]


def terms_of(scene: Scene, state: State, start: Configuration, dt: float, scheme: Scheme) -> Iterator[Term]:
    """The terms of a step of dt [s] from a state in a configuration, but for the bulk."""
    times = state.t, state.t + scheme.theta * dt
    if _viscous(scene):
        yield ViscousBulk.in_step(start, dt, scheme.theta)
    if has_gravity(scene) or scene.dead_loads:
        at_start = None if scheme.inertia else external_force(scene, state, times[0])  # only its work needs it
        yield DeadLoad(external_force(scene, state, times[1]), at_start, state.displacement)
    if scene.pressures:
        yield follower_pressure(scene, state, *times)
    yield from springs_of(scene, state, (state.t, state.t + dt), scheme.theta)


def external_force(scene: Scene, state: State, t: float) -> Array:
    """Nodal forces of gravity and dead loads at time t, (2 nodes,) [N/m]."""
    own = scene.deformable_points
    return np.asarray(state.grids.assembly.grid.interpolation.T @ forces_on_points(scene, t)[:, own].T).ravel()


def forces_on_points(scene: Scene, t: float) -> Array:
    """Gravity and dead loads at time t on the points of bodies that forces move, (2, n) [N/m]."""
    force, own = np.zeros_like(scene.initial_positions), scene.movable[scene.owner]
    if has_gravity(scene):
        force[:, own] = scene.masses[own] * gravity_at(scene, scene.initial_positions[:, own], t)
    for loaded, load in zip(scene.loaded, scene.forces(t), strict=True):
        force[:, loaded.points] += load[:, None] * loaded.share
    return force


def follower_pressure(scene: Scene, state: State, first: float, t: float) -> FollowerPressure:
    """The pressures on boundaries of a step that begins at a time `first`, with those of time t."""
    boundary = scene.outlines
    pressed = wetted_segments(scene, state)
    segments = np.concatenate(pressed)
    begin, value = (np.repeat(scene.pressure_values(at), [own.size for own in pressed]) for at in (first, t))
    c, ends = np.unique(np.stack([segments, boundary.next[segments]]), return_inverse=True)
    points = boundary.point[c]
    interpolation = sp.csr_array(state.grids.assembly.grid.interpolation[scene.among_deformable[points]])
    inside: Array = np.zeros(0)
    if not all(is_linear(material) for material in scene.materials):
        at = np.bincount(segments, value, boundary.size)
        inside = np.asarray(0.5 * (at + at[boundary.previous]))[scene.nearest_boundary[scene.deformable_points]]
    reference, assembly = state.x_anchor[:, points], state.grids.assembly
    return FollowerPressure(interpolation, reference, ends.reshape(2, -1), value, begin, assembly, inside)


def has_gravity(scene: Scene) -> bool:
    """Whether the scene has gravity."""
    return callable(scene.gravity) or bool(np.any(scene.gravity))


def equilibrium_depends_on_dt(scene: Scene) -> bool:
    """Whether the equations of a quasi-static step depend on its length.

    They do if a load or a prescribed velocity is a function of time, if anything is prescribed to move, or if a
    material is viscous (resistance 2 eta / dt). Otherwise steps of all lengths have the same solutions.
    """
    if varies_in_time(scene) or _viscous(scene):
        return True
    return any(speed > 0.0 for _, speed in prescribed_speeds(scene))


def _viscous(scene: Scene) -> bool:
    """Whether any material is viscous."""
    return any(viscosity_of(material) > 0.0 for material in scene.materials)


def springs_of(scene: Scene, state: State, times: tuple[float, float], theta: float) -> Iterator[Beds | Bars]:
    """The springs of a step between two times [s] whose forces are taken a part theta after its start."""
    beds, bars = ([i for i, ends in enumerate(scene.sprung) if ends.bed is kind] for kind in (True, False))
    if beds:
        yield _beds(scene, state, beds, times, theta)
    if bars:
        yield _bars(scene, state, bars, times, theta)


def _beds(scene: Scene, state: State, beds: list[int], times: tuple[float, float], theta: float) -> Beds:
    places = [scene.sprung[i].first for i in beds]
    points = np.concatenate([place.points for place in places])
    each = [(stiffness_of(i, scene.springs[i]), place) for i, place in zip(beds, places, strict=True)]
    stiffness = np.concatenate([k[:, None] * place.share for k, place in each], axis=1)
    rest = np.stack([_at_points(scene, beds, t) for t in times])
    start = (state.x_anchor - scene.initial_positions)[:, points]
    return Beds(stiffness, rest, theta, state.grids.assembly, scene.among_deformable[points], start)


def _at_points(scene: Scene, beds: list[int], t: float) -> Array:
    """Displacements without a force at time t of the points of beds, (2, m) [m]."""
    sizes = [scene.sprung[i].first.points.size for i in beds]
    return np.repeat(np.stack([scene.rest_of_spring(i, t) for i in beds], axis=1), sizes, axis=1)


def _bars(scene: Scene, state: State, bars: list[int], times: tuple[float, float], theta: float) -> Bars:
    joined = list[tuple[Ints, Array, int]]()  # points, their shares, the bar
    for bar, i in enumerate(bars):
        for place, sign in zip(scene.sprung[i].sets, (1.0, -1.0), strict=False):
            joined.append((scene.among_deformable[place.points], sign * place.share, bar))
    stiffness = np.array([stiffness_of(i, scene.springs[i])[0] for i in bars])
    rest = np.array([[float(scene.rest_of_spring(i, t)) for i in bars] for t in times])
    span = np.stack([scene.sprung[i].span(state.x_anchor) for i in bars])
    differences = _differences(joined, len(bars), state.grids.assembly.grid.interpolation)
    return Bars(stiffness, rest, theta, differences, span)


def _differences(ends: list[tuple[Ints, Array, int]], bars: int, N: sp.csr_array) -> sp.csr_array:
    """B (2 bars, 2 nodes), from nodal displacements to those of the first less those of the second ends."""
    points, shares = np.concatenate([end[0] for end in ends]), np.concatenate([end[1] for end in ends])
    bar = np.repeat([end[2] for end in ends], [end[0].size for end in ends])
    means = sp.csr_array((shares, (bar, points)), shape=(bars, N.shape[0]))
    return sp.csr_array(sp.kron(means @ N, np.eye(2), format="csr"))
