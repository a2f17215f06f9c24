"""How a scene lies on the grid: turned and shifted, so that no result depends on the axes."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Placement:
    """Turn of a wall or line of centres against the x axis [rad], and offset [cells]."""

    turn: float
    offset: tuple[float, float]


ALIGNED = Placement(0.0, (0.0, 0.0))


def at_random(count, seed):
    """Placements of any turn and offset."""
    draw = np.random.default_rng(seed)
    return [Placement(draw.uniform(0.0, 2.0 * np.pi), tuple(draw.uniform(0.0, 1.0, 2))) for _ in range(count)]
