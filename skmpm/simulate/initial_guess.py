"""Where the iteration of a quasi-static step begins: with the motion of the last step, as far as its causes go on."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from skmpm.scene import PrescribedVelocities, Scene, State, centres, velocity_at
from skmpm.simulate.box_motion import mean_gradient
from skmpm.simulate.forces import interacting_bodies
from skmpm.simulate.regrid import assembly_of

Array = NDArray[np.float64]


def continued_motion(scene: Scene, state: State, motions: PrescribedVelocities, dt: float, v0: Array) -> Array:
    """The nodal velocities v0 (2 nodes,) of the last step, of bodies that anything acts on, as far as they go on."""
    going_on = shares_that_go_on(scene, state, motions, dt)
    return v0 * np.repeat(going_on[assembly_of(state).grid.node_body], 2)


def shares_that_go_on(scene: Scene, state: State, motions: PrescribedVelocities, dt: float) -> Array:
    """The shares of the motions of bodies in the last step that go on, (bodies,); zero where nothing acts on a body.

    What is prescribed may stop, reverse or change. Bodies then do not move on as before, and an initial guess that
    does leads friction to other equilibria. The share that goes on is that of the prescribed velocities now along
    those before; all of it where nothing was prescribed to move.
    """
    now, before = (np.concatenate(each) for each in zip(*_prescribed(scene, state, motions, dt), strict=True))
    size = float(before @ before)
    share = min(max(float(now @ before) / size, 0.0), 1.0) if size > 0.0 else 1.0
    return np.where(interacting_bodies(scene, state), share, 0.0)


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
    gradient = mean_gradient(state, motions, dt)
    if gradient is not None and state.box is not None and state.box_rate is not None:
        yield (gradient @ state.box).ravel(), (state.box_rate @ state.box).ravel()
