"""What the pictures of a film have in common: colour scale, scale of forces, view."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.plot.fields import Field, Limits, limits_of
from skmpm.plot.snapshot import Snapshot
from skmpm.scene import view_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Style:
    """The scales and the view of a picture."""

    limits: Limits  # of the colours
    largest_force: float | None  # [N/m] drawn with the widest line; None: no forces
    view: Array  # (2, 2) lower left and upper right corners [m]


def style_of(pictures: Sequence[Snapshot], fields: Sequence[Field], *, forces: bool, limits: Limits | None) -> Style:
    """Scales and view that suit all of these pictures."""
    limits = limits_of(pictures[0], fields) if limits is None else _checked(limits)
    largest = max(float(seen.forces()[1].max(initial=0.0)) for seen in pictures) if forces else None
    views = np.stack([view_of(_shown(seen), seen.walls, seen.wall_normals) for seen in pictures])
    return Style(limits, largest, np.stack([views[:, 0].min(axis=0), views[:, 1].max(axis=0)]))


def _shown(seen: Snapshot) -> Array:
    """Positions (2, k) [m] that are in the view: those of the points, of a periodic box its corners."""
    if seen.box is None:
        return seen.x
    return np.stack([np.zeros(2), *seen.box.T, seen.box.sum(axis=1)], axis=1)


def _checked(limits: Limits) -> Limits:
    try:
        low, high = (float(value) for value in limits)
    except (TypeError, ValueError):
        low, high = 0.0, 0.0
    if not low < high:
        raise ValueError(f"plot: limits = {limits!r}; give two numbers, the lower one first")
    return low, high


def in_multiples(scale: float) -> Callable[[float, object], str]:
    """A formatter of ticks in multiples of a unit."""
    return lambda value, _: f"{round(value / scale, 9):g}"
