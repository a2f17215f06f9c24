"""The contact network in pictures."""

from __future__ import annotations

from math import floor, log10
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from skmpm.plot.snapshot import Snapshot
from skmpm.plot.style import Style
from skmpm.units import prefixed

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

COLOUR = "#b2182b"
# [pt] line of the largest force in a picture of one body, divided by the square root of their number, and in any: a
# fifth of a disc in one of 300.
WIDEST_OF_ONE, WIDEST = 60.0, 6.0


def draw_forces(axes: Axes, seen: Snapshot, largest: float, offset: Array) -> None:
    """Draw lines as wide as the normal forces between bodies, the widest for the force `largest` [N/m].

    They are displaced by an offset (2,) [m].
    """
    from matplotlib.collections import LineCollection

    lines, forces = seen.forces()
    widths = _width(seen, forces, largest)
    options: dict[str, Any] = {"colors": COLOUR, "capstyle": "round", "alpha": 0.85, "zorder": 3.5}
    axes.add_collection(LineCollection(list(lines + offset), linewidths=widths, **options))


def add_key(axes: Axes, seen: Snapshot, style: Style) -> None:
    """Add the width of the line of a round force above the axes, on the left."""
    from matplotlib.lines import Line2D

    largest = style.largest_force
    assert largest
    power = 10.0 ** floor(log10(largest))
    force = max(factor * power for factor in (1.0, 2.0, 5.0) if factor * power <= largest * (1.0 + 1e-9))
    scale, unit = prefixed("N/m", force, style.units)
    width = float(_width(seen, np.array(force), largest))
    line = Line2D([], [], color=COLOUR, linewidth=width, solid_capstyle="butt")
    place: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.2}
    axes.legend([line], [f"normal force {force / scale:g} {unit}"], frameon=False, **place)


def _width(seen: Snapshot, force: Array, largest: float) -> Array:
    """Widths of lines [pt] of forces, which pull where they are negative: then they have none."""
    widest = min(WIDEST, WIDEST_OF_ONE / float(np.sqrt(seen.deformable.size)))
    return np.asarray(widest * np.maximum(force, 0.0) / max(largest, np.finfo(float).tiny))
