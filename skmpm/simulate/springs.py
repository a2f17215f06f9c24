"""The springs of a scene in a step."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.implicit import Bars, Beds
from skmpm.scene import Scene, State, stiffness_of

Array = NDArray[np.float64]
Ints = NDArray[np.integer]


def springs_of(scene: Scene, state: State, times: tuple[float, float], theta: float) -> Iterator[Beds | Bars]:
    """The springs of a step between two times [s] whose forces are taken a part theta after its start."""
    beds, bars = ([i for i, ends in enumerate(scene.sprung) if ends.bed is kind] for kind in (True, False))
    if beds:
        yield _beds(scene, state, beds, times, theta)
    if bars:
        yield _bars(scene, state, bars, times, theta)


def _beds(scene: Scene, state: State, beds: list[int], times: tuple[float, float], theta: float) -> Beds:
    places = [scene.sprung[i].first for i in beds]
    points, number = np.concatenate([place.points for place in places]), _among_deformable(scene, state)
    each = [(stiffness_of(i, scene.springs[i]), place) for i, place in zip(beds, places, strict=True)]
    stiffness = np.concatenate([k[:, None] * place.share for k, place in each], axis=1)
    rest = np.stack([_at_points(scene, beds, t) for t in times])
    start = (state.x_anchor - scene.initial_positions)[:, points]
    return Beds(stiffness, rest, theta, state.grids.assembly, number[points], start)


def _at_points(scene: Scene, beds: list[int], t: float) -> Array:
    """Displacements without a force at time t of the points of beds, (2, m) [m]."""
    sizes = [scene.sprung[i].first.points.size for i in beds]
    return np.repeat(np.stack([scene.rest_of_spring(i, t) for i in beds], axis=1), sizes, axis=1)


def _bars(scene: Scene, state: State, bars: list[int], times: tuple[float, float], theta: float) -> Bars:
    number, joined = _among_deformable(scene, state), list[tuple[Ints, Array, int]]()  # points, their shares, the bar
    for bar, i in enumerate(bars):
        for place, sign in zip(scene.sprung[i].sets, (1.0, -1.0), strict=False):
            joined.append((number[place.points], sign * place.share, bar))
    stiffness = np.array([stiffness_of(i, scene.springs[i])[0] for i in bars])
    rest = np.array([[float(scene.rest_of_spring(i, t)) for i in bars] for t in times])
    span = np.stack([scene.sprung[i].span(state.x_anchor) for i in bars])
    differences = _differences(joined, len(bars), state.grids.assembly.grid.interpolation)
    return Bars(stiffness, rest, theta, differences, span)


def _among_deformable(scene: Scene, state: State) -> Ints:
    """The number of each point among those of deformable bodies, (n,)."""
    return np.asarray(np.cumsum(scene.deformable[state.body]) - 1)


def _differences(ends: list[tuple[Ints, Array, int]], bars: int, N: sp.csr_array) -> sp.csr_array:
    """B (2 bars, 2 nodes), from nodal displacements to those of the first less those of the second ends."""
    points, shares = np.concatenate([end[0] for end in ends]), np.concatenate([end[1] for end in ends])
    bar = np.repeat([end[2] for end in ends], [end[0].size for end in ends])
    means = sp.csr_array((shares, (bar, points)), shape=(bars, N.shape[0]))
    return sp.csr_array(sp.kron(means @ N, np.eye(2), format="csr"))
