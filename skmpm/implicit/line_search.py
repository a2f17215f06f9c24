"""How far to go along a Newton direction."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.bulk import Configuration
from skmpm.implicit.errors import NotConverged, worst_body
from skmpm.implicit.residual import Increment

Array = NDArray[np.float64]


def move(
    increment: Increment,
    w: Array,
    at: Configuration,
    direction: Array,
    mixed: tuple[Array, bool],
    slope: Array,
    contact_impulse: Array,
) -> tuple[Array, Configuration]:
    """To the next w: the accelerated step where it is admissible, else a line search along the Newton direction.

    `mixed` is the step that acceleration takes, and whether it is another than the direction.
    """
    way, accelerated = mixed
    if increment.material_response.linear:
        return w + way, increment.at(w + way)
    if accelerated:
        there = increment.at(w + way)
        # Without contact the potential must go down; with it, it is another one in every iteration.
        limit = float(np.finfo(float).max)
        if not contact_impulse.any():
            energy = increment.energy(w, at)
            limit = energy + _noise(increment, w, at, direction, abs(energy))
        if increment.energy(w + way, there) <= limit:
            return w + way, there
    return _search(increment, w, at, direction, slope, contact_impulse)


def _noise(increment: Increment, w: Array, at: Configuration, direction: Array, size: float) -> float:
    """How far the potential, of terms of this size, is known [J/m]."""
    materials = 20.0 * float(np.finfo(float).eps) * increment.modulus * float(increment.bulk.assembly.volume.sum())
    return 1e-13 * size + materials + increment.round_off(w, at) * float(np.linalg.norm(direction))


def _search(
    increment: Increment, w: Array, at: Configuration, direction: Array, slope: Array, contact_impulse: Array
) -> tuple[Array, Configuration]:
    """Backtrack from the full Newton step until the potential less the work of `push` goes down."""
    decrease = float(slope @ direction)
    start = increment.energy(w, at) - float(contact_impulse @ w)
    noise = _noise(increment, w, at, direction, abs(start) + abs(float(contact_impulse @ w)))
    length = 1.0
    while length > 1e-6:
        trial = w + length * direction
        there = increment.at(trial)
        merit = increment.energy(trial, there) - float(contact_impulse @ trial)
        if merit <= start + 1e-4 * length * decrease + noise:
            return trial, there
        length *= 0.5
    raise NotConverged(
        worst_body(increment.grid, slope),
        "the line search found no step that keeps the points the right way out",
    )
