"""Gauge condition for bodies whose material can turn inside their shape at no cost.

Of a round body of isotropic material, the deformations x(X) and x(Q X), Q any rotation of the reference body, have
the same energy and the same outline. Without friction the material may therefore turn inside a shape that stays, as
the membrane of a tank-treading cell does (Keller & Skalak, J. Fluid Mech. 120 (1982) 27-47): the velocity is
F (e_z x X), which no frictionless contact opposes. At equal shape such states are one and the same physical state,
and one condition per body selects one of them: that its angular momentum does not change, s^T M (w - v0) = 0, s the
rigid rotation about its centre of mass. For a round body that is the balance of angular momentum, since frictionless
contacts exert no moment on it. For a pressed one its multiplier vanishes in the continuum too, since the equations
are invariant along the mode, and s is not orthogonal to it. On a grid the multiplier is the torque of discretisation
errors, which Newton's method would otherwise balance by large rotations: the stiffness of the mode is zero but for
such errors.

Where the pressure is so high, or the step so long, that inertia does not resist the rotation, and in quasi-static
steps, the spin at the start of the step is dropped, s^T M w = 0, and the condition does no work.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from skmpm.arrays import ROUND_OFF, Array, Bools
from skmpm.grid import BodyGrids
from skmpm.scene import Scene, State
from skmpm.scheme import Scheme
from skmpm.step.forces import DeadLoad
from skmpm.step.terms import ENERGY_TOLERANCE, Term

# [rad] Largest rotation in a step of other bodies with the condition: it keeps the angular momentum about the centre
# at the start of the step, so that the energy of rotation grows by a quarter of the square of this angle, half of the
# tolerance.
MAX_ANGLE = float(np.sqrt(2.0 * ENERGY_TOLERANCE))


@dataclass(frozen=True)
class Gauge:
    """The condition s^T M (w - v0) = 0 for some bodies, with v0 the initial guess."""

    grid: BodyGrids
    rotation: Array  # (2 nodes,) s [m]; zero in other bodies
    mass: Array  # (2 nodes,) lumped [kg/m]
    dropped: Bools  # (bodies,) whose spin is dropped

    @cached_property
    def _inertia(self) -> Array:
        """Moments of inertia s^T M s, (bodies,) [kg m]; one for bodies without the condition."""
        inertia = self._sums(self.rotation * self.mass * self.rotation)
        return np.where(inertia > 0.0, inertia, 1.0)

    @property
    def bodies(self) -> Bools:
        """Which bodies have the condition, (bodies,)."""
        return np.asarray(self._sums(np.abs(self.rotation)) > 0.0)

    @property
    def momentum(self) -> Array:
        """The vector m = M s, (2 nodes,) [kg]."""
        return self.mass * self.rotation

    def _sums(self, values: Array) -> Array:
        """Sums (bodies,) of values (2 nodes,)."""
        return np.asarray(self.grid.sums((values[::2] + values[1::2])[None])[0])

    def _spread(self, values: Array | Bools) -> Array:
        """Values of bodies (bodies,) at their nodes, (2 nodes,)."""
        return np.repeat(values[self.grid.node_body], 2)

    def initial_guess(self, w: Array) -> Array:
        """The velocity (2 nodes,) without the spin that is dropped."""
        return np.asarray(w - self.rotation * self._spread(self.dropped * self.spin(w)))

    def spin(self, w: Array) -> Array:
        """Angular velocities (bodies,) [rad/s] at the velocity (2 nodes,), zero for bodies without the condition."""
        return np.asarray(self._sums(self.momentum * w) / self._inertia)

    def among(self, bodies: Bools) -> Gauge:
        """The condition for those of the bodies in a mask (bodies,)."""
        return replace(self, rotation=self.rotation * self._spread(bodies))

    def moments(self, force: Array) -> Array:
        """Moments (bodies,) [N m/m] of a force (2 nodes,), zero for bodies without the condition."""
        return self._sums(self.rotation * force)

    def without_torque(self, impulse: Array) -> Array:
        """The impulse (2 nodes,) without the multiplier of the condition, which is its torque."""
        return np.asarray(impulse - self.momentum * self._spread(self.moments(impulse) / self._inertia))


def gauge_condition(
    scene: Scene, state: State, v0: Array, terms: Sequence[Term], dt: float, scheme: Scheme
) -> Gauge | None:
    """The condition on the rotation of round bodies that friction acts on nowhere; None where there are none.

    In quasi-static steps these bodies do not rotate: nothing determines a rotation of theirs. In dynamic steps the
    condition holds for bodies in contact in long steps, in which waves cross their radius: shorter ones resolve
    impacts and rotations. A body under pressure p that rotates by phi while its loads keep their directions loses the
    energy p V phi^2, with 2 p V the virial of its contact forces. From dt^2 2 p V = J on that exceeds its rotational
    energy, so that inertia resists no rotation, and its spin is dropped. Under less pressure it is kept, and bodies
    that spin fast do not have the condition, nor do those on which gravity, one of the `terms`, has a moment. `v0`
    (2 nodes,) [m/s] are the velocities at the start of the step.
    """
    interval = scheme.theta * dt
    if scheme.inertia:
        held = scene.indifferent_to_rotation & (interval > scene.crossing_times) & _touching(scene, state)
    else:  # any frictional wall may come into contact in the step
        held = scene.free_to_turn
    held = held & scene.deformable
    if not held.any():
        return None
    grid, mass = state.grids.assembly.grid, state.grids.assembly.mass
    arm = grid.arms(grid.at(state.displacement), mass[::2]) * held[grid.node_body]
    dropped = _unstable(state, interval) if scheme.inertia else held
    gauge = Gauge(grid, np.stack([-arm[1], arm[0]], axis=1).ravel(), mass, dropped)
    if callable(scene.gravity):
        for load in (term.load for term in terms if isinstance(term, DeadLoad)):
            gauge = gauge.among(~_turned(gauge, load))
    return gauge.among(dropped | (interval * np.abs(gauge.spin(v0)) < MAX_ANGLE))


def _turned(gauge: Gauge, force: Array) -> Bools:
    """Bodies on which a force (2 nodes,) [N/m] has a moment about the centre of mass, (bodies,)."""
    of_sizes = replace(gauge, rotation=np.abs(gauge.rotation)).moments(np.abs(force))
    return np.asarray(np.abs(gauge.moments(force)) > ROUND_OFF * of_sizes)


def _touching(scene: Scene, state: State) -> Bools:
    """Bodies with a contact, that touch no wall with friction and cannot in a step, (bodies,)."""
    count, farthest = len(scene.bodies), scene.max_motion
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
    centre = state.centres
    arm = state.x - centre[:, state.body]
    inertia = np.bincount(state.body, state.mass * (arm**2).sum(axis=0), count)
    virial, force = np.zeros(count), state.contacts.vectors
    for end, sign in enumerate((-1.0, 1.0)):
        side = state.contacts.bodies[end]
        on = np.flatnonzero(side >= 0)
        lever = state.contacts.at(end)[:, on] - centre[:, side[on]]
        virial += np.bincount(side[on], sign * np.einsum("ik,ik->k", force[:, on], lever), count)
    return np.asarray(dt**2 * virial > inertia)
