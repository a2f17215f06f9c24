"""What helps quasi-static iterations that converge slowly: acceleration, relaxation, frozen contact geometry.

Not those with inertia: affine combinations of rotated bodies stretch them, by more than light contacts do, and
stiffness of contact that failed in one iteration is tried again in the next.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.acceleration import AndersonAcceleration
from skmpm.implicit.contact_problem import ContactIterate

Array = NDArray[np.float64]

RELAXATION = 0.5  # factor on accelerated steps once the iteration has stalled


@dataclass
class Remedies:
    """The remedies of one iteration, which it changes in place."""

    mass: Array  # (2 nodes,)
    acceleration: AndersonAcceleration = field(init=False)
    relaxation: float = 1.0

    def __post_init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Accelerate without the iterations so far, which were others."""
        self.acceleration = AndersonAcceleration(self.mass)

    def restart(self) -> None:
        """Begin anew: without the iterations so far, and without relaxation."""
        self.forget()
        self.relaxation = 1.0

    def frozen(self, contact: ContactIterate, stalled: bool) -> ContactIterate:
        """The contact problem, with the geometry frozen once the iteration stalls or its stiffness fails."""
        self.relaxation = RELAXATION if stalled else self.relaxation
        if contact.frozen is not None or not (stalled or contact.stiffness_failures > 0):
            return contact
        self.restart()
        return contact.with_frozen_geometry(contact.constraints)

    def accelerated(self, w: Array, direction: Array, slow: bool) -> Array | None:
        """The step instead of the direction, if there is one."""
        return self.acceleration.accelerate(w, direction, self.relaxation, wanted=slow)
