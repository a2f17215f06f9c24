"""What surrounds bodies in pictures: contact forces, walls and supports."""

from __future__ import annotations

from math import floor, log10
from typing import TYPE_CHECKING, Any

import numpy as np

from skmpm.arrays import Array
from skmpm.outline.images import lattice_vectors
from skmpm.plot.fields import Style
from skmpm.plot.snapshot import Snapshot
from skmpm.representation import prefixed
from skmpm.scene import box_corners, wall_lines

if TYPE_CHECKING:
    from matplotlib.axes import Axes


COLOUR = "#b2182b"
# [pt] line of the largest force in a picture of one body, divided by the square root of their number, and in any: a
# fifth of a disc in one of 300.
WIDEST_OF_ONE, WIDEST = 60.0, 6.0
THICKNESS = 0.02  # of walls as drawn, over the larger side of the view
GREY, SUPPORT = "0.82", "#d95f02"
FADED = 0.7  # opacity of what covers images outside of a periodic box


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


def draw_walls(axes: Axes, seen: Snapshot, view: Array) -> None:
    """Draw the walls in a view as lines with grey strips behind them."""
    from matplotlib.collections import LineCollection, PolyCollection

    lines, walls = wall_lines(seen.walls, seen.wall_normals, view)
    behind = -THICKNESS * float((view[1] - view[0]).max()) * seen.wall_normals[walls][:, None]
    strips = np.concatenate([lines, lines[:, ::-1] + behind], axis=1)
    axes.add_collection(PolyCollection(list(strips), facecolors=GREY, zorder=0.5), autolim=False)
    axes.add_collection(LineCollection(list(lines), colors="black", linewidths=1.0, zorder=3.0))


def draw_supports(axes: Axes, seen: Snapshot) -> None:
    """Mark the points whose velocity supports prescribe."""
    if seen.held.size:
        axes.plot(*seen.x[:, seen.held], ".", color=SUPPORT, markersize=3.0, zorder=4.0)


def offsets(seen: Snapshot, view: Array) -> list[Array]:
    """Displacements (2,) [m] of all images of the bodies that are in a view: zero, and in a periodic box others."""
    here = np.zeros(2)
    if seen.box is None:
        return [here]
    low, high = seen.x.min(axis=1), seen.x.max(axis=1)
    around = (seen.box @ lattice_vectors(np.ones(seen.box.shape[1], dtype=np.int64))).T
    return [here, *(k for k in around if k.any() and (low + k < view[1]).all() and (high + k > view[0]).all())]


def draw_box(axes: Axes, seen: Snapshot, view: Array) -> None:
    """Draw the edges of the periodic box, and fade what lies outside of it."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    if seen.box is None:
        return
    low, high = view
    at = box_corners(seen.box, view.T).T
    edges = np.concatenate([at, at[:1]])
    around = np.array([low, (low[0], high[1]), high, (high[0], low[1]), low])
    outside = Path.make_compound_path(Path(around, closed=True), Path(edges, closed=True))
    axes.add_patch(PathPatch(outside, facecolor="white", edgecolor="none", alpha=FADED, zorder=3.8))
    axes.plot(*edges.T, color="black", linewidth=1.0, linestyle="--", zorder=3.9)
