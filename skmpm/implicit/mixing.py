"""Anderson acceleration of an iteration."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ANDERSON_DEPTH = 15  # directions that acceleration remembers
PULAY_PERIOD = 3  # of directions one is accelerated where the iteration overshoots: between them contacts settle


@dataclass
class Mixing:
    """Anderson acceleration of w -> w + direction(w) (Walker & Ni, SIAM J. Numer. Anal. 49, 2011)."""

    mass: Array  # (n,) weighs the directions
    depth: int = ANDERSON_DEPTH
    count: int = 0  # of directions so far
    points: list[Array] = field(default_factory=list)
    directions: list[Array] = field(default_factory=list)

    def mixed(self, w: Array, direction: Array, share: float, *, wanted: bool) -> tuple[Array, bool]:
        """If wanted, the direction to the combination of all points so far whose combined direction is the smallest.

        Of that combined direction it goes a `share`: all of it, or less where the iteration overshoots. Then it
        also alternates with plain steps (Pratapa, Suryanarayana & Pask, J. Comput. Phys. 306, 2016). Also returns
        whether the direction is another than the one given.
        """
        self.points, self.directions = (
            [*self.points, w][-self.depth :],
            [*self.directions, direction][-self.depth :],
        )
        self.count += 1
        if len(self.points) == 1 or not wanted:
            return direction, False
        if share < 1.0 and self.count % PULAY_PERIOD:
            return share * direction, True
        dw = np.stack([w - p for p in self.points[:-1]], axis=1)
        df = np.stack([direction - d for d in self.directions[:-1]], axis=1)
        root = np.sqrt(self.mass)
        weights, *_ = np.linalg.lstsq(root[:, None] * df, root * direction, rcond=1e-12)
        return np.asarray(share * (direction - df @ weights) - dw @ weights), True
