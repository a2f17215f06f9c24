"""What the pictures of a film have in common: colour scale, scale of forces, view."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.plot.fields import Field, Limits, limits_of
from skmpm.plot.snapshot import Snapshot
from skmpm.scene import view_of
from skmpm.units import UNITS, prefixed

Array = NDArray[np.float64]
View = tuple[Limits, Limits]


@dataclass(frozen=True)
class Style:
    """The scales and the view of a picture."""

    limits: Limits  # of the colours
    largest_force: float | None  # [N/m] drawn with the widest line; None: no forces
    view: Array  # (2, 2) lower left and upper right corners [m]
    units: tuple[str, ...]  # multiples of units to be shown, as "mm"


def style_of(
    pictures: Sequence[Snapshot],
    fields: Sequence[Field],
    *,
    forces: bool,
    limits: Limits | None,
    view: View | None,
    units: Sequence[str],
) -> Style:
    """Scales and view that suit all of these pictures."""
    names = (units,) if isinstance(units, str) else tuple(units)
    if strange := [name for name in names if not any(prefixed(unit, 1.0, [name])[1] == name for unit in UNITS)]:
        raise ValueError(f"plot: units has {strange[0]!r}; give multiples of {', '.join(UNITS)}, as ('mm', 'kPa')")
    limits = limits_of(pictures[0], fields) if limits is None else _checked(limits, "limits")
    largest = max(float(seen.forces()[1].max(initial=0.0)) for seen in pictures) if forces else None
    if view is None:
        views = np.stack([view_of(_shown(seen), seen.walls, seen.wall_normals) for seen in pictures])
        corners = np.stack([views[:, 0].min(axis=0), views[:, 1].max(axis=0)])
    else:
        corners = np.array([_checked(view[axis], "view") for axis in (0, 1)]).T
    return Style(limits, largest, corners, names)


def _shown(seen: Snapshot) -> Array:
    """Positions (2, k) [m] that are in the view: those of the points, of a periodic box its corners."""
    if seen.box is None:
        return seen.x
    return np.stack([np.zeros(2), *seen.box.T, seen.box.sum(axis=1)], axis=1)


def _checked(limits: Limits, name: str) -> Limits:
    try:
        low, high = (float(value) for value in limits)
    except (TypeError, ValueError):
        low, high = 0.0, 0.0
    if not low < high:
        raise ValueError(f"plot: {name} = {limits!r}; give two numbers, the lower one first")
    return low, high


def in_multiples(scale: float) -> Callable[[float, object], str]:
    """A formatter of ticks in multiples of a unit."""
    return lambda value, _: f"{round(value / scale, 9):g}"


def scale_of(field: Field, style: Style) -> tuple[float, str]:
    """Scale and label of a colour bar."""
    scale, unit = prefixed(field.unit, max(map(abs, style.limits)), style.units)
    return scale, f"{field.name} [{unit}]" if unit else field.name
