"""The springs of a scene in a step: their equations, their energy, and where they are refused."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.implicit import Increment, Springs
from skmpm.scene import Scene, State, rest_in_step, spring_energy, stiffness_of, work_of_ends
from skmpm.simulate.regrid import assembly_of

Array = NDArray[np.float64]
Ints = NDArray[np.integer]


def springs_of(scene: Scene, state: State, dt: float, theta: float) -> Springs | None:
    """The springs of a step with the ends that they have a part theta after its start; None without springs."""
    if not scene.springs:
        return None
    assembly, number = assembly_of(state), np.cumsum(scene.deformable[state.body]) - 1
    N, moved = assembly.grid.interpolation, state.x_anchor - scene.initial_positions
    points, stiffness, start = [np.zeros(0, dtype=np.int64)], [np.zeros((2, 0))], [np.zeros((2, 0))]
    ends_of_bars: list[tuple[Ints, Array, int]] = []  # points, their shares and the bar
    span, bar_stiffness, length = [np.zeros((0, 2))], [0.0][:0], [0.0][:0]
    for i, (spring, ends) in enumerate(zip(scene.springs, scene.sprung, strict=True)):
        k, rest, first = stiffness_of(i, spring), rest_in_step(scene, i, (state.t, state.t + dt), theta), ends.first
        if ends.bed:
            points.append(number[first.points])
            stiffness.append(k[:, None] * first.share)
            start.append(moved[:, first.points] - rest[:, None])
            continue
        ends_of_bars.append((number[first.points], first.share, len(length)))
        if ends.second is not None:
            ends_of_bars.append((number[ends.second.points], -ends.second.share, len(length)))
        span.append(ends.span(state.x_anchor)[None])
        bar_stiffness.append(float(k[0]))
        length.append(float(rest))
    return Springs(
        assembly,
        np.concatenate(points),
        np.concatenate(stiffness, axis=1),
        np.concatenate(start, axis=1),
        _differences(ends_of_bars, len(length), N),
        np.concatenate(span),
        np.array(bar_stiffness, dtype=float),
        np.array(length, dtype=float),
    )


def _differences(ends: list[tuple[Ints, Array, int]], bars: int, N: sp.csr_array) -> sp.csr_array:
    """B (2 bars, 2 nodes), from nodal displacements to those of the first less those of the second ends."""
    if not ends:
        return sp.csr_array((0, 2 * N.shape[1]))
    points, shares = np.concatenate([end[0] for end in ends]), np.concatenate([end[1] for end in ends])
    bar = np.repeat([end[2] for end in ends], [end[0].size for end in ends])
    means = sp.csr_array((shares, (bar, points)), shape=(bars, N.shape[0]))
    return sp.csr_array(sp.kron(means @ N, np.eye(2), format="csr"))


def energies(
    scene: Scene, before: Array, after: Array, t: float, increment: Increment
) -> tuple[tuple[float, float], float]:
    """Energy of the springs before and after a step with points at (2, n), and work of their moving ends [J/m].

    With inertia the work is that of the forces in the balance, without of the mean of both ends of the step.
    """
    dt, theta = increment.dt, increment.scheme.theta
    stored = spring_energy(scene, before, t), spring_energy(scene, after, t + dt)
    if increment.scheme.inertia:
        at = before + theta * (after - before)
        return stored, work_of_ends(scene, at, (t, t + dt), theta)
    return stored, 0.5 * sum(work_of_ends(scene, x, (t, t + dt), end) for x, end in ((before, 0.0), (after, 1.0)))
