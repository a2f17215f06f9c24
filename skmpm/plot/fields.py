"""What the colours of a picture mean, and what the pictures of a film have in common.

Films share colours, the scale of forces and the view.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from numbers import Real

import numpy as np
from numpy.typing import NDArray

from skmpm.arrays import Array
from skmpm.plot import fringes
from skmpm.plot.snapshot import Snapshot
from skmpm.representation import UNITS, prefixed
from skmpm.scene import box_corners, view_of

Limits = tuple[float, float]

SEQUENTIAL, DIVERGING, LIGHT = "viridis", "RdBu_r", "gray"
OUTLIERS = 1.0  # [%] of points beyond each end of the colour scale: those beside corners would set it alone
# Of compression: where tension is less, pressures have a sequential map, since a little tension is mostly noise.
SIGNED = 0.25
UNIT_OF = {"pressure": "Pa", "mises": "Pa", "displacement": "m", "speed": "m/s", "plastic strain": ""}
NEEDS = {
    "von Mises stress": "; the equivalent stress needs `stress_zz` of the materials",
    "plastic strain": "; it needs a material that yields, as ElastoPlastic",
}
FROM_ZERO = ("displacement", "speed", "plastic strain")  # are not negative
NAMES = ", ".join([*UNIT_OF, "body", "fringes"])
View = tuple[Limits, Limits]


@dataclass(frozen=True, eq=False)
class Field:
    """Values by point, and the name and unit of their colour bar; no values: one colour for each body."""

    values: Array | None  # (n,)
    name: str
    unit: str
    order: Array | None = None  # (2, n) of fringes, whose light the values are
    from_zero: bool = False  # whether colours begin at zero


def field_of(
    seen: Snapshot, colour: str | NDArray[np.floating], label: str = "", fringe: float | None = None
) -> Field:
    """The field that is named or given, by point (n,) or by body (bodies,)."""
    if isinstance(colour, str) and colour == "fringes":
        return _known(seen, _fringes(seen, fringe))
    named = _named(seen, colour) if isinstance(colour, str) else None
    if fringe is not None:
        raise ValueError(f"plot: fringe = {fringe!r} is for colour = 'fringes'; leave it out")
    if named is not None:
        return _known(seen, named)
    values, n, bodies = np.asarray(colour), seen.owner.size, seen.deformable.size
    if values.shape not in ((n,), (bodies,)) or values.dtype.kind not in "fiub":
        raise ValueError(
            f"plot: colour is an array of {values.dtype} of shape {values.shape}; give numbers by point ({n},) or by"
            f" body ({bodies},), or one of {NAMES}"
        )
    values = values.astype(np.float64)
    return _known(seen, Field(values if values.size == n else values[seen.owner], label, ""))


def _fringes(seen: Snapshot, fringe: object) -> Field:
    """The light of a photoelastic experiment; ValueError if the fringe value is not greater than zero."""
    difference = fringes.stress_differences(seen)
    if not isinstance(fringe, Real) or not 0.0 < float(fringe) < np.inf:
        largest = float(np.hypot(*difference).max(initial=0.0))
        raise ValueError(
            f"plot: fringe = {fringe!r}; give the difference of principal stresses of one fringe [Pa], of which the"
            f" largest in this state is {largest:.3g} Pa"
        )
    value = float(fringe)
    (scale, unit), order = prefixed("Pa", value), difference / value
    return Field(fringes.light(order), f"light, a fringe for each {value / scale:.4g} {unit}", "", order)


def _known(seen: Snapshot, field: Field) -> Field:
    """The field; ValueError if it has no value at any point of a deformable body."""
    own = np.zeros(0) if field.values is None else field.values[seen.inside_deformable]
    if own.size and not np.isfinite(own).any():
        where = NEEDS.get(field.name, "")
        name = field.name or "colour"
        raise ValueError(f"plot: {name} is nan or inf at every point{where}; colour by another field")
    return field


def _named(seen: Snapshot, name: str) -> Field:
    if name == "body":
        return Field(None, name, "")
    if name not in UNIT_OF:
        raise ValueError(f"plot: colour = {name!r}; use one of {NAMES}, or an array by point or by body")
    shown = "von Mises stress" if name == "mises" else name
    return Field(seen.fields[name](), shown, UNIT_OF[name], from_zero=name in FROM_ZERO)


def limits_of(seen: Snapshot, fields: Sequence[Field]) -> Limits:
    """Limits of a colour scale for several states: the range without outliers, of points of deformable bodies."""
    values = _shown_values(seen, fields)
    if values.size == 0 or fields[0].order is not None:
        return 0.0, 1.0
    low, high = np.percentile(values, (OUTLIERS, 100.0 - OUTLIERS)).tolist()
    if fields[0].from_zero or (fields[0].unit and -SIGNED * high <= low <= 0.0 <= high):
        low = 0.0
    elif low < 0.0 < high:
        low, high = -max(-low, high), max(-low, high)
    return (low, high) if high > low else (low, low + (abs(low) or 1.0))


def _colour_map(field: Field, limits: Limits) -> str:
    """The colour map: grey for light, diverging where the limits are those of signed values."""
    if field.order is not None:
        return LIGHT
    return DIVERGING if limits[0] == -limits[1] else SEQUENTIAL


def _shown_values(seen: Snapshot, fields: Sequence[Field]) -> Array:
    """The known values of points of deformable bodies."""
    parts = [field.values[seen.inside_deformable] for field in fields if field.values is not None]
    return np.concatenate([part[np.isfinite(part)] for part in parts]) if parts else np.zeros(0)


def _beyond(seen: Snapshot, fields: Sequence[Field], limits: Limits) -> str:
    """Which ends of the colour scale values exceed, in matplotlib's words."""
    values = _shown_values(seen, fields)
    ends = bool((values < limits[0]).any()), bool((values > limits[1]).any())
    return {(False, False): "neither", (True, False): "min", (False, True): "max"}.get(ends, "both")


@dataclass(frozen=True)
class Style:
    """The scales and the view of a picture."""

    limits: Limits  # of the colours
    colours: str  # the colour map
    beyond: str  # ends of the colours that values exceed, in matplotlib's words
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
    colours, ends = _colour_map(fields[0], limits), _beyond(pictures[0], fields, limits)
    return Style(limits, colours, ends, largest, corners, names)


def _shown(seen: Snapshot) -> Array:
    """Positions (2, k) [m] that are in the view: those of the points, of a periodic box its corners."""
    if seen.box is None:
        return seen.x
    return box_corners(seen.box, seen.x)


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
