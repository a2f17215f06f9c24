"""Position, motion and inertia of free rigid bodies, from their material points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.scene import Scene, State
from skmpm.simulate.forces import forces_on_points

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


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
    bodies = scene.free_rigid
    at = np.flatnonzero(np.isin(state.body, bodies))
    own, m, x, v = np.searchsorted(bodies, state.body[at]), state.mass[at], state.x[:, at], state.v[:, at]

    def total(values: Array) -> Array:
        return _sums(own, values, bodies.size)

    mass = total(m)
    centre, velocity = (np.stack([total(m * a[0]), total(m * a[1])]) / mass for a in (x, v))
    arm = x - centre[:, own]
    inertia, momentum = total(m * (arm**2).sum(axis=0)), total(m * (arm[0] * v[1] - arm[1] * v[0]))
    radius = np.sqrt(inertia / mass)
    return RigidState(bodies, mass, radius, centre, np.stack([*velocity, momentum / inertia * radius]))


def kinetic_energy(mass: Array, velocity: Array) -> float:
    """Of bodies of masses (n,) with velocities and spins times radii of gyration (3, n) [J/m]."""
    return 0.5 * float(mass @ (velocity**2).sum(axis=0))


def _sums(body: Ints, values: Array, bodies: int) -> Array:
    """Sums of values (k,) by body, (bodies,)."""
    return np.asarray(np.bincount(body, values, bodies), dtype=np.float64)  # bincount of nothing is integer
