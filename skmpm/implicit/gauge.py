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

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from skmpm.grid import BodyGrids

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Gauge:
    """The condition s^T M (w - v0) = 0 for some bodies, with v0 the initial guess."""

    grid: BodyGrids
    rotation: Array  # (2 nodes,) s [m]; zero in other bodies
    mass: Array  # (2 nodes,) lumped [kg/m]
    dropped: NDArray[np.bool_]  # (bodies,) whose spin is dropped

    @cached_property
    def _inertia(self) -> Array:
        """Moments of inertia s^T M s, (bodies,) [kg m]; one for bodies without the condition."""
        inertia = self._sums(self.rotation * self.mass * self.rotation)
        return np.where(inertia > 0.0, inertia, 1.0)

    @property
    def bodies(self) -> NDArray[np.bool_]:
        """Which bodies have the condition, (bodies,)."""
        return np.asarray(self._sums(np.abs(self.rotation)) > 0.0)

    @property
    def momentum(self) -> Array:
        """The vector m = M s, (2 nodes,) [kg]."""
        return self.mass * self.rotation

    def _sums(self, values: Array) -> Array:
        """Sums (bodies,) of values (2 nodes,)."""
        return np.asarray(self.grid.sums((values[::2] + values[1::2])[None])[0])

    def _spread(self, values: Array | NDArray[np.bool_]) -> Array:
        """Values of bodies (bodies,) at their nodes, (2 nodes,)."""
        return np.repeat(values[self.grid.node_body], 2)

    def initial_guess(self, w: Array) -> Array:
        """The velocity (2 nodes,) without the spin that is dropped."""
        return np.asarray(w - self.rotation * self._spread(self.dropped * self.spin(w)))

    def spin(self, w: Array) -> Array:
        """Angular velocities (bodies,) [rad/s] at the velocity (2 nodes,), zero for bodies without the condition."""
        return np.asarray(self._sums(self.momentum * w) / self._inertia)

    def among(self, bodies: NDArray[np.bool_]) -> Gauge:
        """The condition for those of the bodies in a mask (bodies,)."""
        return replace(self, rotation=self.rotation * self._spread(bodies))

    def moments(self, force: Array) -> Array:
        """Moments (bodies,) [N m/m] of a force (2 nodes,), zero for bodies without the condition."""
        return self._sums(self.rotation * force)

    def without_torque(self, impulse: Array) -> Array:
        """The impulse (2 nodes,) without the multiplier of the condition, which is its torque."""
        return np.asarray(impulse - self.momentum * self._spread(self.moments(impulse) / self._inertia))


def gauge_of(grid: BodyGrids, x: Array, mass: Array, bodies: NDArray[np.bool_], dropped: NDArray[np.bool_]) -> Gauge:
    """The condition for the bodies of a mask (bodies,), with nodes at x (2, nodes) [m]."""
    arm = grid.arms(x, mass[::2]) * bodies[grid.node_body]
    return Gauge(grid, np.stack([-arm[1], arm[0]], axis=1).ravel(), mass, dropped)
