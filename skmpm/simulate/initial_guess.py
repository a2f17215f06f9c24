"""Where a step without inertia begins: bodies that supports hold go on as far as what is prescribed does."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from skmpm.scene import PrescribedVelocities, Scene, State, centres, velocity_at
from skmpm.scheme import Scheme
from skmpm.simulate.grid_to_points import velocity_at_start

Array = NDArray[np.float64]


def continued_motion(scene: Scene, state: State, motions: PrescribedVelocities, dt: float, scheme: Scheme) -> Array:
    """The nodal velocities (2 nodes,) of the last step as far as they go on; zero of bodies that may move freely.

    What is prescribed may stop, reverse or change: the share that goes on is that of the prescribed velocities now
    along those before. An initial guess that goes on regardless leads friction to other equilibria, as loose bodies
    that go on lead packings.
    """
    grid, supports = state.grids.assembly.grid, state.grids.supports
    if supports is None or not supports.holds.any():
        return np.zeros(2 * grid.nodes)
    now, before = (np.concatenate(each) for each in zip(*_prescribed(scene, state, motions, dt), strict=True))
    size = float(before @ before)
    share = min(max(float(now @ before) / size, 0.0), 1.0) if size > 0.0 else 1.0
    return share * np.repeat(supports.holds[grid.node_body], 2) * velocity_at_start(scene, state, scheme)


def _prescribed(
    scene: Scene, state: State, motions: PrescribedVelocities, dt: float
) -> Iterator[tuple[Array, Array]]:
    """Velocities in this step and in the last one of what has a prescribed motion [m/s]."""
    yield motions.walls.ravel(), state.wall_velocity.ravel()
    each = zip(scene.supported, motions.supports.reshape(-1, 2), scene.free_components, strict=True)
    for place, velocity, free in each:
        yield velocity[~free], state.v[:, place.points].mean(axis=1)[~free]
    held = np.flatnonzero(~scene.movable).tolist()
    centre = centres(state.x, state.mass, state.body) if held else np.zeros((2, 0))
    for b in held:
        own = slice(scene.offsets[b], scene.offsets[b + 1])
        arm = state.x[:, own] - centre[:, b : b + 1]
        points = np.sqrt(arm.shape[1])
        yield velocity_at(arm, motions.rigid[:, b : b + 1]).ravel() / points, state.v[:, own].ravel() / points
    gradient = motions.gradient
    if gradient is not None and state.box is not None and state.box_rate is not None:
        yield (gradient @ state.box).ravel(), (state.box_rate @ state.box).ravel()
