"""What part of the walls is drawn and recorded: that near the bodies, up to other walls."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array, Ints

MARGIN = 0.02  # of a view around what is in it, over the larger side of the view
FAR = 0.5  # sizes of all bodies together; walls farther away are not in the view


def view_of(x: Array, walls: Array, normals: Array) -> Array:
    """Lower left and upper right corners (2, 2) [m] of a view of positions x (2, n) and of the walls near them.

    Walls are given by their points (w, 2) [m] and unit normals (w, 2), which point to the bodies.
    """
    low, high = x.min(axis=1), x.max(axis=1)
    size = max(float((high - low).max()), np.finfo(float).tiny)
    corners = np.array([[low[0], high[0], low[0], high[0]], [low[1], low[1], high[1], high[1]]])
    shown = [corners]
    for point, normal in zip(walls, normals, strict=True):
        distance = float((normal @ (corners - point[:, None])).min())
        if distance < FAR * size:
            shown.append(corners - (distance + MARGIN * size) * normal[:, None])
    points = np.concatenate(shown, axis=1)
    return np.stack([points.min(axis=1) - MARGIN * size, points.max(axis=1) + MARGIN * size])


def wall_lines(walls: Array, normals: Array, view: Array) -> tuple[Array, Ints]:
    """Lines (k, 2, 2) [m] of walls in a view (2, 2), which end at other walls, and the walls (k,) that they show.

    The body side of a wall is on the left of its line.
    """
    sides = [(view[0], np.array([1.0, 0.0])), (view[0], np.array([0.0, 1.0]))]
    sides += [(view[1], np.array([-1.0, 0.0])), (view[1], np.array([0.0, -1.0]))]
    planes, lines, found = list(zip(walls, normals, strict=True)), [], []
    for w, (point, normal) in enumerate(planes):
        along = np.array([normal[1], -normal[0]])
        low, high = _range(point, along, planes[:w] + planes[w + 1 :] + sides)
        if high > low:
            lines.append(point + np.outer([low, high], along))
            found.append(w)
    return np.reshape(lines, (-1, 2, 2)), np.array(found, dtype=np.int64)


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
