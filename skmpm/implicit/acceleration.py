"""Anderson acceleration of a fixed-point iteration."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ANDERSON_DEPTH = 15  # iterates in the history
ALTERNATION_PERIOD = 3  # with relaxation one step in three is accelerated: contacts change state in the others


@dataclass
class AndersonAcceleration:
    """Anderson acceleration of w -> w + direction(w) (Walker & Ni, SIAM J. Numer. Anal. 49, 2011).

    `accelerate` appends to the history; a new object starts without one.
    """

    mass: Array  # (n,) weights of the least-squares problem
    count: int = 0  # directions so far
    iterates: list[Array] = field(default_factory=list)
    directions: list[Array] = field(default_factory=list)

    def accelerate(self, w: Array, direction: Array, relaxation: float = 1.0, *, wanted: bool) -> Array | None:
        """Append w and its direction to the history; the accelerated step from w, None if it is the direction.

        It leads to the affine combination of the history whose combined direction is smallest, and from there along
        that direction, times `relaxation`. With a factor below one, only one step in `ALTERNATION_PERIOD` is
        accelerated and the others are the direction times the factor (alternating Anderson-Richardson; Pratapa,
        Suryanarayana & Pask, J. Comput. Phys. 306, 2016).
        """
        self.iterates = [*self.iterates, w][-ANDERSON_DEPTH:]
        self.directions = [*self.directions, direction][-ANDERSON_DEPTH:]
        self.count += 1
        if len(self.iterates) == 1 or not wanted:
            return None
        if relaxation < 1.0 and self.count % ALTERNATION_PERIOD:
            return relaxation * direction
        dw = np.stack([w - p for p in self.iterates[:-1]], axis=1)
        df = np.stack([direction - d for d in self.directions[:-1]], axis=1)
        root = np.sqrt(self.mass)
        weights, *_ = np.linalg.lstsq(root[:, None] * df, root * direction, rcond=1e-12)
        return np.asarray(relaxation * (direction - df @ weights) - dw @ weights)
