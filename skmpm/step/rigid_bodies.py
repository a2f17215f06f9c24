"""Free rigid bodies: three unknowns each, velocity of the centre of mass and spin times radius of gyration.

Position, motion and inertia are those of their material points. Components that are prescribed begin with their
values in the step, and nothing changes them: no load or contact acts on them, and their energy is not counted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.contact import Constraints
from skmpm.scene import PrescribedVelocities, Scene, State, centres, fitted_motions
from skmpm.step.scalar_unknowns import Entries, Interval, Unknowns
from skmpm.step.scene_forces import forces_on_points


@dataclass(frozen=True)
class DeadLoads:
    """Forces on points of n rigid bodies that keep their directions as the bodies turn."""

    resultant: Array  # (2, n) [N/m]
    moment: Array  # (n,) over radii of gyration [N/m]
    # Sum of arms times forces over radii of gyration (n,) [N/m]: what the moment loses per angle at first.
    along: Array

    def turned(self, angle: Array) -> Array:
        """Resultants and moments after the bodies have turned by some angles (n,), body after body (3 n,) [N/m]."""
        moment = np.cos(angle) * self.moment - np.sin(angle) * self.along
        return np.stack([*self.resultant, moment], axis=1).ravel()


@dataclass(frozen=True)
class RigidState:
    """The n free rigid bodies of a scene."""

    bodies: Ints  # (n,)
    mass: Array  # (n,) [kg/m]
    radius: Array  # (n,) of gyration [m]
    centre: Array  # (2, n) of mass [m]
    velocity: Array  # (3, n) of the centre, and spin times radius of gyration [m/s]
    free: Bools  # (3, n) components that are not prescribed

    def relative(self, gradient: Array | None) -> Array:
        """The velocities (3, n) less those of a periodic box with a velocity gradient (2, 2) [m/s]."""
        if gradient is None:
            return self.velocity
        return np.asarray(self.velocity - np.concatenate([gradient @ self.centre, np.zeros((1, self.bodies.size))]))

    def loads(self, scene: Scene, state: State, t: float) -> DeadLoads:
        """Gravity and dead loads of time t."""
        at = np.flatnonzero(np.isin(state.body, self.bodies))
        own = np.searchsorted(self.bodies, state.body[at])
        force = forces_on_points(scene, t)[:, at]
        arm = (state.x[:, at] - self.centre[:, own]) / self.radius[own]
        across, along = arm[0] * force[1] - arm[1] * force[0], (arm * force).sum(axis=0)
        parts = [_sums(own, part, self.bodies.size) for part in (*force, across, along)]
        return DeadLoads(np.stack(parts[:2]), *parts[2:])


def rigid_state(scene: Scene, state: State) -> RigidState:
    """The free rigid bodies of a state. Velocities and spins are those with the momenta of the points."""
    bodies, owner, mass = scene.free_rigid, state.body, state.mass
    centre, total = centres(state.x, mass, owner), np.bincount(owner, mass).astype(float)
    square = ((state.x - centre[:, owner]) ** 2).sum(axis=0)
    radius = np.sqrt(np.bincount(owner, mass * square) / total)
    velocity = fitted_motions(state.x, state.v, mass, owner) * np.stack([np.ones_like(radius)] * 2 + [radius])
    free = ~scene.held_components[:, bodies]
    return RigidState(bodies, total[bodies], radius[bodies], centre[:, bodies], velocity[:, bodies], free)


def _sums(body: Ints, values: Array, bodies: int) -> Array:
    """Sums of values (k,) by body, (bodies,)."""
    return np.asarray(np.bincount(body, values, bodies), dtype=np.float64)  # bincount of nothing is integer


@dataclass(frozen=True)
class FreeBodies(Unknowns):
    """The n free rigid bodies of a scene in one step; unknowns are body after body."""

    bodies: Ints  # (n,)
    start: RigidState  # at the start of the step
    loads: DeadLoads  # as the bodies are at the start
    first_loads: DeadLoads | None  # those when a step without inertia begins
    at_end: Array  # (3, n) prescribed components at the end of the step [m/s]; zero where free

    @staticmethod
    def in_step(
        scene: Scene, state: State, motions: PrescribedVelocities, interval: Interval, first: int
    ) -> FreeBodies:
        """The bodies of a state in a step; they keep their velocities relative to the periodic box in `motions`.

        Without inertia they begin at rest, and round ones that nothing turns do not rotate: the torque of
        discretisation errors would turn them, against nothing (`step.gauge`).
        """
        start, dt = rigid_state(scene, state), interval.dt
        velocity, gradient = interval.inertial * start.relative(state.box_rate), motions.gradient
        start.free[2] &= interval.inertial | callable(scene.gravity) | ~scene.free_to_turn[start.bodies]
        if gradient is not None:
            velocity[:2] += gradient @ start.centre
        scale = np.stack([np.ones_like(start.radius)] * 2 + [start.radius])
        given, at_end = (scale * each[:, start.bodies] for each in (motions.rigid, motions.rigid_at_end))
        velocity = np.where(start.free, velocity, given)
        loads = start.loads(scene, state, interval.t)
        at_start = None if interval.inertial else start.loads(scene, state, state.t)
        inertia = interval.inertia(np.repeat(start.mass, 3), velocity.T.ravel())
        response = inertia.response.reshape(-1, 3).copy()  # with the stiffness of loads where they resist turning
        response[:, 2] += (interval.theta * dt) ** 2 * np.maximum(loads.along, 0.0) / start.radius
        return FreeBodies(
            replace(inertia, response=response.ravel()), dt, first, scene.free_rigid, start, loads, at_start, at_end
        )

    @property
    def names(self) -> list[str]:
        """The bodies."""
        return [f"body {b}" for b in np.repeat(self.bodies, 3)]

    def load(self, z: Array) -> Array:
        """Forces of gravity and loads, (3 n,) [N/m], with the bodies turned as they are at t + theta dt."""
        return self._free * self.loads.turned(self.inertia.theta[2::3] * self.dt * self._with_spins(z)[2])

    def load_at_start(self) -> Array:
        """The forces when a step without inertia begins, (3 n,) [N/m]."""
        assert self.first_loads is not None
        return self._free * self.first_loads.turned(np.zeros(self.bodies.size))

    @property
    def _free(self) -> Bools:
        """Which of the unknowns are not prescribed, (3 n,)."""
        return self.start.free.T.ravel()

    @property
    def counted(self) -> Bools:
        """Those that are not prescribed, (3 n,)."""
        return self._free

    def motions(self, z: Array, end: Array, prescribed: PrescribedVelocities) -> PrescribedVelocities:
        """All prescribed velocities with those of the bodies."""
        rigid, at_end = prescribed.rigid.copy(), prescribed.rigid_at_end.copy()
        last = np.where(self._free, end, self.at_end.T.ravel())
        for table, values in ((rigid, z), (at_end, last)):
            table[:, self.bodies] = self._with_spins(values)
        return replace(prescribed, rigid=rigid, rigid_at_end=at_end)

    def _with_spins(self, z: Array) -> Array:
        """Velocities and angular velocities (3, n) [m/s, rad/s]."""
        v = z.reshape(-1, 3).T
        return np.stack([v[0], v[1], v[2] / self.start.radius])

    def carried(self, translation: Array) -> Array:
        """The velocities (2, bodies) at their centres, (3 n,)."""
        own = translation[:, self.bodies]
        return np.asarray(self._free * np.stack([*own, np.zeros_like(own[0])], axis=1).ravel())

    def _on_side(self, constraints: Constraints, side: int) -> tuple[Ints, Ints]:
        """The contacts with one of these on one side, (c,), and which of these it is, (c,)."""
        number = np.full(int(max(constraints.bodies.max(initial=0), self.bodies.max())) + 1, -1)
        number[self.bodies] = np.arange(self.bodies.size)
        members = constraints.bodies[side]
        body = np.where(members < 0, -1, number[np.maximum(members, 0)])
        contact = np.flatnonzero(body >= 0)
        return contact, body[contact]

    def spins(self, constraints: Constraints, side: int) -> Entries:
        """From z to the angular velocities of the bodies on one side of the contacts [rad/s], k rows."""
        k, body = self._on_side(constraints, side)
        return Entries(self.start.free[2, body] / self.start.radius[body], k, self.first + 3 * body + 2)

    def turning(self, z: Array, constraints: Constraints, impulses: Array) -> tuple[Array, Entries]:
        """Virials (n,) of the impulses [kg m2/s per m], and from z to the angular velocities [rad/s], n rows."""
        each, virial = np.arange(self.bodies.size), np.zeros(self.bodies.size)
        for side, sign in ((0, 1.0), (1, -1.0)):
            k, body = self._on_side(constraints, side)
            arm = self._arms(z, constraints, side, k, body)
            virial += sign * _sums(body, (arm * impulses[:, k]).sum(axis=0), each.size)
        return virial, Entries(self.start.free[2] / self.start.radius, each, self.first + 3 * each + 2)

    def _arms(self, z: Array, constraints: Constraints, side: int, k: Ints, body: Ints) -> Array:
        """Arms (2, c) of contacts k with some of the bodies on one side, about centres at the end of the step [m]."""
        centre = self.start.centre + self.dt * self._with_spins(z)[:2]
        at = constraints.x[:, k] - (constraints.image[:, k] if side else 0.0)
        return np.asarray(at - centre[:, body])

    def rows(self, z: Array, constraints: Constraints, directions: Sequence[Array]) -> Entries:
        """From z to relative velocities, d k rows, about the centres at the end of the step."""
        row, column, data = [], [], []
        for side, sign in ((0, 1.0), (1, -1.0)):
            k, body = self._on_side(constraints, side)
            arm = self._arms(z, constraints, side, k, body) / self.start.radius[body]
            for i, direction in enumerate(directions):
                d = direction[:, k]
                each = np.stack([d[0], d[1], arm[0] * d[1] - arm[1] * d[0]]) * self.start.free[:, body]
                row.append(np.tile(len(directions) * k + i, 3))
                column.append((3 * body + np.arange(3)[:, None]).ravel())
                data.append(sign * each.ravel())
        return Entries(np.concatenate(data), np.concatenate(row), self.first + np.concatenate(column))
