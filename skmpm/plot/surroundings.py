"""Walls and supports in pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from skmpm.scene import Scene, State

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

THICKNESS = 0.02  # of walls as drawn, over the larger side of the view
GREY, SUPPORT = "0.82", "#d95f02"
FAR = 0.5  # sizes of all bodies together; walls farther away are not in the picture


def view_of(state: State, x: Array) -> Array:
    """Lower left and upper right corners (2, 2) of a view of positions x (2, k) and of the walls near them."""
    low, high = x.min(axis=1), x.max(axis=1)
    size = max(float((high - low).max()), np.finfo(float).tiny)
    corners = np.array([[low[0], high[0], low[0], high[0]], [low[1], low[1], high[1], high[1]]])
    shown = [corners]
    for point, normal in zip(state.walls, state.wall_normals, strict=True):
        distance = float((normal @ (corners - point[:, None])).min())
        if distance < FAR * size:
            shown.append(corners - (distance + THICKNESS * size) * normal[:, None])
    points = np.concatenate(shown, axis=1)
    return np.stack([points.min(axis=1) - THICKNESS * size, points.max(axis=1) + THICKNESS * size])


def wall_shapes(state: State, view: Array) -> list[tuple[Array, Array]]:
    """Of each wall in the view the part of its line that other walls leave (2, 2), and a strip behind it (4, 2)."""
    thick = THICKNESS * float((view[1] - view[0]).max())
    shapes = []
    for i, (point, normal) in enumerate(zip(state.walls, state.wall_normals, strict=True)):
        along = np.array([-normal[1], normal[0]])
        planes = [(q, m) for j, (q, m) in enumerate(zip(state.walls, state.wall_normals, strict=True)) if j != i]
        planes += [(view[0], np.array([1.0, 0.0])), (view[0], np.array([0.0, 1.0]))]
        planes += [(view[1], np.array([-1.0, 0.0])), (view[1], np.array([0.0, -1.0]))]
        low, high = _range(point, along, planes)
        if high > low:
            line = point + np.outer([low, high], along)
            shapes.append((line, np.concatenate([line, line[::-1] - thick * normal])))
    return shapes


def _range(point: Array, along: Array, planes: list[tuple[Array, Array]]) -> tuple[float, float]:
    """The range of s for which point + s along lies in all half-planes (point, normal)."""
    low, high = -np.inf, np.inf
    for q, m in planes:
        slope, distance = float(m @ along), float(m @ (point - q))
        if abs(slope) < 1e-12:
            low, high = (low, high) if distance >= -1e-12 * np.hypot(*(point - q)) else (1.0, 0.0)
        elif slope > 0.0:
            low = max(low, -distance / slope)
        else:
            high = min(high, -distance / slope)
    return low, high


def draw_walls(axes: Axes, state: State, view: Array) -> None:
    """Draw the walls in a view as lines with grey strips behind them."""
    from matplotlib.collections import LineCollection, PolyCollection

    shapes = wall_shapes(state, view)
    axes.add_collection(PolyCollection([strip for _, strip in shapes], facecolors=GREY, zorder=0.5), autolim=False)
    axes.add_collection(LineCollection([line for line, _ in shapes], colors="black", linewidths=1.0, zorder=3.0))


def draw_supports(axes: Axes, scene: Scene, state: State) -> None:
    """Mark the points whose velocity supports prescribe."""
    if scene.supported:
        held = np.unique(np.concatenate([place.points for place in scene.supported]))
        axes.plot(*state.x[:, held], ".", color=SUPPORT, markersize=3.0, zorder=4.0)
