"""Walls and supports in pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from skmpm.plot.snapshot import Snapshot
from skmpm.scene import wall_lines

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

THICKNESS = 0.02  # of walls as drawn, over the larger side of the view
GREY, SUPPORT = "0.82", "#d95f02"


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
