"""Position, motion and inertia of free rigid bodies, from their material points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.scene import Scene, State, centres, fitted_motions
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
    bodies, owner, mass = scene.free_rigid, state.body, state.mass
    centre, total = centres(state.x, mass, owner), np.bincount(owner, mass).astype(float)
    square = ((state.x - centre[:, owner]) ** 2).sum(axis=0)
    radius = np.sqrt(np.bincount(owner, mass * square) / total)
    velocity = fitted_motions(state.x, state.v, mass, owner) * np.stack([np.ones_like(radius)] * 2 + [radius])
    return RigidState(bodies, total[bodies], radius[bodies], centre[:, bodies], velocity[:, bodies])


def _sums(body: Ints, values: Array, bodies: int) -> Array:
    """Sums of values (k,) by body, (bodies,)."""
    return np.asarray(np.bincount(body, values, bodies), dtype=np.float64)  # bincount of nothing is integer
