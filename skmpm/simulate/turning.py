"""The bodies whose material can turn inside their shape at no cost, and whose rotation the step does not resolve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit import DeadLoad, Gauge, Term, gauge_of
from skmpm.scene import Scene, State, centres
from skmpm.scheme import Scheme
from skmpm.simulate.acceptance import max_motion

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

UNSTABLE = 0.75  # dt^2 virial / J of a body from which on its spin is dropped; at 1, inertia resists no rotation
# [rad] Largest rotation in a step of other bodies with the condition: it keeps the angular momentum about the centre
# at the start of the step, so that the energy of rotation grows by a quarter of the square of this angle, which is
# below the tolerance of the energy check (`simulate.acceptance`).
MAX_ANGLE = 1e-3
NO_MOMENT = 1e-9  # moment of a force over the sum of its parts: round-off of a force that is uniform


def gauge_condition(
    scene: Scene, state: State, v0: Array, terms: Sequence[Term], dt: float, scheme: Scheme
) -> Gauge | None:
    """The condition on the rotation of round bodies that friction acts on nowhere; None where there are none.

    In quasi-static steps these bodies do not rotate: nothing determines a rotation of theirs. In dynamic steps the
    condition holds for bodies in contact in long steps, in which waves cross their radius: shorter ones resolve
    impacts and rotations. A body under pressure p that rotates by phi while its loads keep their directions loses the
    energy p V phi^2, with 2 p V the virial of its contact forces. From dt^2 2 p V = J on that exceeds its rotational
    energy, and its spin is dropped; under less pressure it is kept, and bodies that spin fast do not have the
    condition, nor do those on which gravity, one of the `terms`, has a moment. `v0` (2 nodes,) [m/s] are the
    velocities at the start of the step.
    """
    interval = scheme.theta * dt
    if scheme.inertia:
        held = scene.indifferent_to_rotation & (interval > scene.crossing_times) & _touching(scene, state)
    else:  # any frictional wall may come into contact in the step
        held = scene.free_to_turn
    if not held.any():
        return None
    assembly = state.grids.assembly
    x = assembly.grid.position + state.displacement.reshape(-1, 2).T
    dropped = _unstable(state, interval) if scheme.inertia else held
    gauge = gauge_of(assembly.grid, x, assembly.mass, held, dropped=dropped)
    if callable(scene.gravity):
        for load in (term.load for term in terms if isinstance(term, DeadLoad)):
            gauge = gauge.among(~_turned(gauge, load))
    return gauge.among(dropped | (interval * np.abs(gauge.spin(v0)) < MAX_ANGLE))


def _turned(gauge: Gauge, force: Array) -> Bools:
    """Bodies on which a force (2 nodes,) [N/m] has a moment about the centre of mass, (bodies,)."""
    of_sizes = replace(gauge, rotation=np.abs(gauge.rotation)).moments(np.abs(force))
    return np.asarray(np.abs(gauge.moments(force)) > NO_MOMENT * of_sizes)


def _touching(scene: Scene, state: State) -> Bools:
    """Bodies with a contact, that touch no wall with friction and cannot in a step, (bodies,)."""
    count, farthest = len(scene.bodies), max_motion(scene)
    touching, bodies = np.zeros(count, dtype=bool), state.contacts.bodies
    touching[bodies[bodies >= 0]] = True
    for i, point in enumerate(state.walls):
        walls = np.stack([np.arange(count), np.full(count, -1 - i)])
        frictional = scene.frictions.between(walls) > 0.0
        if frictional.any():
            gap = state.wall_normals[i] @ (state.x - point[:, None])
            touching[state.body[(gap < farthest) & frictional[state.body]]] = False
    return touching


def _unstable(state: State, dt: float) -> Bools:
    """Bodies whose rotation is unstable under their last contact forces in steps of dt, (bodies,)."""
    count = int(state.body.max()) + 1
    centre = centres(state.x, state.mass, state.body)
    arm = state.x - centre[:, state.body]
    inertia = np.bincount(state.body, state.mass * (arm**2).sum(axis=0), count)
    virial, force = np.zeros(count), state.contacts.vectors
    for end, sign in enumerate((-1.0, 1.0)):
        side = state.contacts.bodies[end]
        on = np.flatnonzero(side >= 0)
        lever = state.contacts.at(end)[:, on] - centre[:, side[on]]
        virial += np.bincount(side[on], sign * np.einsum("ik,ik->k", force[:, on], lever), count)
    return np.asarray(dt**2 * virial > UNSTABLE * inertia)
