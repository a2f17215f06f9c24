"""What a user gives of a scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skmpm.scene.objects import Body, Load, Pressure, Spring, Support, Wall
from skmpm.scene.periodic import Periodic

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Input:
    """The fields of `Scene`, where they are described."""

    bodies: Sequence[Body]
    cell: float = field(kw_only=True)
    walls: Sequence[Wall] = field(default=(), kw_only=True)
    supports: Sequence[Support] = field(default=(), kw_only=True)
    loads: Sequence[Load | Pressure] = field(default=(), kw_only=True)
    springs: Sequence[Spring] = field(default=(), kw_only=True)
    friction: float | Mapping[Any, float] = field(default=0.0, kw_only=True)
    cohesion: float = field(default=0.0, kw_only=True)
    cohesion_range: float = field(default=0.0, kw_only=True)
    overlap: float = field(default=0.0, kw_only=True)
    gravity: ArrayLike | Callable[[Array, float], ArrayLike] = field(default=(0.0, 0.0), kw_only=True)
    periodic: Periodic | None = field(default=None, kw_only=True)
