"""What all kinds of unknowns need to know of a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Interval:
    """A step, as the unknowns that are not on a grid see it."""

    t: float  # at which forces are taken [s]
    dt: float  # [s]
    soft: float | None  # mass of an unknown in W without inertia, None with it [kg/m]
    farthest: float  # largest change of an unknown in an iteration [m/s]

    def mass(self, mass: Array) -> Array:
        """Masses in the balance (p,) [kg/m]."""
        return mass if self.soft is None else np.zeros_like(mass)

    def response(self, mass: Array) -> Array:
        """Masses in W (p,) [kg/m]."""
        return mass if self.soft is None else np.full_like(mass, self.soft)
