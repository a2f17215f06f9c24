"""Bodies of many shapes, and stacks of them."""

from __future__ import annotations

from collections.abc import Callable

import meshio
import numpy as np
from geometry import edges_of

import skmpm


def shape_of(shape: str, aspect: float, spacing: float) -> skmpm.Points:
    """The points of a body about the origin, of half a width of one."""
    if shape in ("disc", "ellipse"):
        round_ = skmpm.disc((0.0, 0.0), 1.0, spacing=spacing)
        scale = np.array([[1.0], [aspect]])
        return skmpm.Points(scale * round_.x, aspect * round_.volume, round_.outline)
    if shape == "box":
        return skmpm.box((-1.0, -aspect), (2.0, 2.0 * aspect), spacing=spacing)
    return _meshed(*CONCAVE[shape](spacing))


def _meshed(x: np.ndarray, y: np.ndarray, kept: np.ndarray) -> skmpm.Points:
    """Points of a mesh of the kept cells of a lattice with nodes x, y (n + 1, m + 1)."""
    number = np.arange(x.size).reshape(x.shape)
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1)[kept]
    nodes = np.stack([x.ravel(), y.ravel(), 0.0 * x.ravel()], axis=1)
    _, first, index = np.unique(np.round(nodes, 9), axis=0, return_index=True, return_inverse=True)
    return skmpm.from_mesh(meshio.Mesh(nodes[first], [("quad", index.ravel()[quads])]))


def _lattice(kept: list[str], spacing: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A picture of squares, from top to bottom, on [-1, 1]."""
    picture = np.array([[c == "#" for c in row] for row in kept[::-1]]).T
    fine = max(1, round(2.0 / (picture.shape[0] * 1.6 * spacing)))
    axes = np.linspace(-1.0, 1.0, picture.shape[0] * fine + 1)
    x, y = np.meshgrid(axes, axes, indexing="ij")
    return x, y, np.kron(picture, np.ones((fine, fine), dtype=bool))


def _arc(start: float, end: float, spacing: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A ring from one angle to another, radii 0.55 to 1."""
    around = max(12, round((end - start) / (1.6 * spacing)))
    r, phi = np.meshgrid(
        np.linspace(0.55, 1.0, max(1, round(0.45 / (1.6 * spacing))) + 1),
        np.linspace(start, end, around + 1),
        indexing="ij",
    )
    return r * np.cos(phi), r * np.sin(phi), np.ones((r.shape[0] - 1, around), dtype=bool)


def _dumbbell(spacing: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A bar that is thin in the middle."""
    along, across = max(6, round(2.0 / (1.6 * spacing))), max(1, round(0.8 / (1.6 * spacing)))
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, along + 1), np.linspace(-1.0, 1.0, across + 1), indexing="ij")
    return x, y * (0.25 + 0.35 * x**2), np.ones((along, across), dtype=bool)


CONCAVE: dict[str, Callable] = {
    "L": lambda spacing: _lattice(["#..", "#..", "###"], spacing),
    "plus": lambda spacing: _lattice([".#.", "###", ".#."], spacing),
    "C": lambda spacing: _arc(0.5, 2.0 * np.pi - 0.5, spacing),
    "annulus": lambda spacing: _arc(0.0, 2.0 * np.pi, spacing),
    "dumbbell": _dumbbell,
}


def stacked(shapes: list[tuple[skmpm.Points, float, float]], gap: float) -> list[skmpm.Points]:
    """Shapes, each turned by an angle [rad], shifted from the one before and let down on all until a gap is left."""
    placed: list[skmpm.Points] = []
    at = 0.0
    for points, angle, shift in shapes:
        cos, sin = np.cos(angle), np.sin(angle)
        x = np.array([[cos, -sin], [sin, cos]]) @ points.x
        at += shift
        x[0] += at - 0.5 * (x[0].min() + x[0].max())
        loops = [x[:, loop] for loop in points.outline]
        way = min([float(x[1].min())] + [_drop(loops, [q.x[:, k] for k in q.outline]) for q in placed])
        x[1] -= way - (gap if placed else 0.0)
        placed.append(skmpm.Points(x, points.volume, points.outline))
    return placed


def _drop(upper: list[np.ndarray], lower: list[np.ndarray]) -> float:
    """How far loops may fall on others from far above, counted from where they are."""
    ways = [np.inf]
    for points, loops, sign in ((upper, lower, 1.0), (lower, upper, -1.0)):
        x = np.concatenate(points, axis=1)
        a, b = (ends[:, :, None] for ends in edges_of(loops))
        spans = (np.minimum(a[0], b[0]) <= x[0]) & (x[0] <= np.maximum(a[0], b[0])) & (a[0] != b[0])
        share = (x[0] - a[0]) / np.where(a[0] == b[0], 1.0, b[0] - a[0])
        apart = sign * (x[1] - (a[1] + share * (b[1] - a[1])))
        ways.append(float(np.where(spans, apart, np.inf).min(initial=np.inf)))
    return min(ways)
