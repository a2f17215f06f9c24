"""Forces of springs at a state."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array
from skmpm.scene import Scene, State, check_fits, stiffness_of


def spring_forces(scene: Scene, state: State) -> Array:
    """Forces of the springs on the points of their `where`, at the time of a state.

    Parameters
    ----------
    scene, state : a scene and its state

    Returns
    -------
    (springs, 2) [N/m]

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> bed = skmpm.Spring(lambda x: x[1] < 0, stiffness=1e3)
    >>> scene = skmpm.Scene([body], cell=4e-4, springs=[bed], gravity=(0, -9.81))
    >>> state = skmpm.step(scene, skmpm.initial(scene), 1.0, scheme=skmpm.Scheme(inertia=False))
    >>> skmpm.spring_forces(scene, state).shape
    (1, 2)
    >>> round(float(skmpm.spring_forces(scene, state)[0, 1]), 4)
    0.0308
    """
    check_fits(scene, state, "spring_forces")
    forces = [_force(scene, i, state.x, state.t) for i in range(len(scene.springs))]
    return np.array(forces).reshape(-1, 2)


def _force(scene: Scene, i: int, x: Array, t: float) -> Array:
    """Force of spring i on the points of its `where`, (2,) [N/m]: the energy that it loses by their displacement."""
    ends, k, rest = scene.sprung[i], stiffness_of(i, scene.springs[i]), scene.rest_of_spring(i, t)
    if ends.bed:
        points = ends.first.points
        stretch = x[:, points] - scene.initial_positions[:, points] - rest[:, None]
        return np.asarray((-k[:, None] * ends.first.share * stretch).sum(axis=1))
    span = ends.span(x)
    length = float(np.hypot(*span))
    return np.asarray(-k * (length - rest) * span / length) if length > 0.0 else np.zeros(2)
