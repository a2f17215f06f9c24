"""What all kinds of unknowns need to know of a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit import Inertia

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Interval:
    """A step, as the unknowns that are not on a grid see it."""

    t: float  # at which forces are taken [s]
    dt: float  # [s]
    theta: float  # Moreau-Jean parameter
    soft: float | None  # mass of an unknown in W without inertia, None with it [kg/m]
    farthest: float  # largest change of an unknown in an iteration [m/s]

    @property
    def inertial(self) -> bool:
        """Whether bodies have inertia."""
        return self.soft is None

    def inertia(self, mass: Array, v0: Array) -> Inertia:
        """Inertia of unknowns with these masses (p,) [kg/m] and velocities (p,) [m/s]."""
        farthest, theta = (np.full_like(mass, value) for value in (self.farthest, self.theta))
        if self.inertial:
            return Inertia(mass, mass, v0, theta, farthest)
        return Inertia(np.zeros_like(mass), np.full_like(mass, self.soft), v0, theta, farthest)
