"""Walls driven by a force: one unknown each, their velocity along the normal.

A wall of mass m under a force F towards the bodies, which press on it by f_n, obeys m (v1 - v0) = dt (F - sum f_n),
in the velocity z = theta v1 + (1 - theta) v0 that moves it

    m (z - v0) = theta (dt F - sum r_n).

The unknown is eliminated from the contact problem: impulses determine z, and the wall adds theta / m to the entries
of W between its contacts. So F is exact at the end of the step, whatever the stiffness of what it presses on. Without
inertia m = 0 in this balance, and `response` takes its place in W, as springs do for floating bodies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.contact import Constraints

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class DrivenWalls:
    """The p walls of a scene that a force drives, in one step."""

    walls: Ints  # (p,) their indices
    normal: Array  # (p, 2) unit, towards the bodies
    mass: Array  # (p,) in the balance, zero without inertia [kg/m]
    response: Array  # (p,) in W [kg/m]
    v0: Array  # (p,) at the start of the step [m/s]
    force: Callable[[Array], Array]  # z (p,) [m/s] -> towards the bodies (p,) [N/m]
    prescribed: Array  # (walls, 2) velocities of all walls; not used for these [m/s]
    dt: float
    theta: float
    farthest: float  # largest change of z in an iteration [m/s]

    def velocities(self, z: Array) -> Array:
        """Velocities of all walls, (walls, 2) [m/s]."""
        velocities = self.prescribed.copy()
        velocities[self.walls] = z[:, None] * self.normal
        return velocities

    def end_velocities(self, z: Array) -> Array:
        """Velocities of all walls at the end of the step, (walls, 2) [m/s]."""
        return self.velocities(self.v0 + (z - self.v0) / self.theta)

    def on_contacts(self, constraints: Constraints) -> sp.csr_array:
        """From values of the walls (p,) to the rows of contacts, (k, p) or (2 k, p): one in normal rows."""
        found = constraints.bodies[1][:, None] == -1 - self.walls
        contact, wall = np.nonzero(found)
        rows = 2 * contact if constraints.tangential else contact
        size = (2 if constraints.tangential else 1) * constraints.size
        return sp.csr_array((np.ones(rows.size), (rows, wall)), shape=(size, self.walls.size))

    def imbalance(self, z: Array, constraints: Constraints, r: Array) -> Array:
        """Out-of-balance impulse of the walls under contact impulses r, (p,) [kg m/s per m]."""
        pressed = self.on_contacts(constraints).T @ r
        return np.asarray(self.theta * (self.dt * self.force(z) - pressed) - self.mass * (z - self.v0))

    def change(self, z: Array, constraints: Constraints, r: Array) -> Array:
        """The change of z that balances contact impulses r, (p,) [m/s]."""
        return np.asarray(self.imbalance(z, constraints, r) / self.response)

    def moved(self, z: Array, constraints: Constraints, r: Array) -> Array:
        """The velocities that balance contact impulses r, at most `farthest` from z, (p,) [m/s]."""
        return np.asarray(z + np.clip(self.change(z, constraints, r), -self.farthest, self.farthest))

    def compliance(self, constraints: Constraints) -> sp.csr_array:
        """What the walls add to W, in the rows of the contacts."""
        rows = self.on_contacts(constraints)
        return sp.csr_array(rows @ sp.diags_array(self.theta / self.response) @ rows.T)

    def size(self, z: Array) -> float:
        """The norm of the impulses of the driving forces [kg m/s per m]."""
        return self.theta * self.dt * float(np.linalg.norm(self.force(z)))
