"""Anderson acceleration of a fixed-point iteration."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ANDERSON_DEPTH = 15  # iterates in the history
PULAY_PERIOD = 3  # with relaxation every third step is accelerated: contacts find their states in the steps between


@dataclass
class Mixing:
    """Anderson acceleration of w -> w + direction(w) (Walker & Ni, SIAM J. Numer. Anal. 49, 2011)."""

    mass: Array  # (n,) weights of the least-squares problem
    depth: int = ANDERSON_DEPTH
    count: int = 0  # directions so far
    points: list[Array] = field(default_factory=list)
    directions: list[Array] = field(default_factory=list)

    def mixed(self, w: Array, direction: Array, relaxation: float, *, wanted: bool) -> tuple[Array, bool]:
        """The accelerated step from w if `wanted`, else the direction, and whether the two differ.

        The step leads to the affine combination of the history whose combined direction is smallest, and on along
        that direction by the `relaxation` factor. With a factor below one, accelerated and plain steps alternate
        (Pratapa, Suryanarayana & Pask, J. Comput. Phys. 306, 2016).
        """
        self.points, self.directions = (
            [*self.points, w][-self.depth :],
            [*self.directions, direction][-self.depth :],
        )
        self.count += 1
        if len(self.points) == 1 or not wanted:
            return direction, False
        if relaxation < 1.0 and self.count % PULAY_PERIOD:
            return relaxation * direction, True
        dw = np.stack([w - p for p in self.points[:-1]], axis=1)
        df = np.stack([direction - d for d in self.directions[:-1]], axis=1)
        root = np.sqrt(self.mass)
        weights, *_ = np.linalg.lstsq(root[:, None] * df, root * direction, rcond=1e-12)
        return np.asarray(relaxation * (direction - df @ weights) - dw @ weights), True
