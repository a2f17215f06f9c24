"""Sums over the four nodes of the cell of each point: between nodal fields and values at the points.

`node` (n, 4) are those nodes, `weight` (n, 4) the shape functions or their derivatives there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.arrays import Array, Ints
from skmpm.compiled import compiled

ShortInts = NDArray[np.int32]

CORNERS = np.array([[0, 1, 1, 0], [0, 0, 1, 1]])
"""Corners of the reference square in the order of `ElementQuad1`, (2, 4)."""


@compiled
def interpolate(node: ShortInts, weight: Array, field: Array, out: Array) -> None:
    """Values `out` (2, n) of a nodal field (nodes, 2) at the points."""
    for p in range(node.shape[0]):
        x = y = 0.0
        for I in range(4):  # noqa: E741
            x += weight[p, I] * field[node[p, I], 0]
            y += weight[p, I] * field[node[p, I], 1]
        out[0, p], out[1, p] = x, y


@compiled
def differentiate(node: ShortInts, by_x: Array, by_y: Array, field: Array, out: Array) -> None:
    """Gradients out[i, j] = d field_i / d x_j (2, 2, n) of a nodal field (nodes, 2) at the points."""
    for p in range(node.shape[0]):
        xx = xy = yx = yy = 0.0
        for I in range(4):  # noqa: E741
            u, v = field[node[p, I], 0], field[node[p, I], 1]
            xx += by_x[p, I] * u
            xy += by_y[p, I] * u
            yx += by_x[p, I] * v
            yy += by_y[p, I] * v
        out[0, 0, p], out[0, 1, p], out[1, 0, p], out[1, 1, p] = xx, xy, yx, yy


@compiled
def add_divergence(node: ShortInts, by_x: Array, by_y: Array, volume: Array, P: Array, out: Array) -> None:
    """Add V P : grad N of all points to `out` (nodes, 2); P (2, 2, n)."""
    for p in range(node.shape[0]):
        xx, xy = volume[p] * P[0, 0, p], volume[p] * P[0, 1, p]
        yx, yy = volume[p] * P[1, 0, p], volume[p] * P[1, 1, p]
        for I in range(4):  # noqa: E741
            out[node[p, I], 0] += xx * by_x[p, I] + xy * by_y[p, I]
            out[node[p, I], 1] += yx * by_x[p, I] + yy * by_y[p, I]


@compiled
def add_affine_momentum(
    node: ShortInts, weight: Array, local: Array, cell: float, mass: Array, v: Array, C: Array, out: Array
) -> None:
    """Add m N (v + C (X - x)) of all points at `local` (2, n) in their cells to `out` (nodes, 2)."""
    for p in range(node.shape[0]):
        for I in range(4):  # noqa: E741
            n, share = node[p, I], mass[p] * weight[p, I]
            x, y = cell * (CORNERS[0, I] - local[0, p]), cell * (CORNERS[1, I] - local[1, p])
            out[n, 0] += share * (v[0, p] + C[0, 0, p] * x + C[0, 1, p] * y)
            out[n, 1] += share * (v[1, p] + C[1, 0, p] * x + C[1, 1, p] * y)


@compiled
def sum_by_body(body: Ints, values: Array, out: Array) -> None:
    """Add values (k, nodes) to those of their bodies, `out` (k, bodies)."""
    for k in range(out.shape[0]):
        for n in range(body.size):
            out[k, body[n]] += values[k, n]


@compiled
def moments_by_body(body: Ints, x: Array, mass: Array, impulse: Array, arms: Array, sums: Array) -> None:
    """Write the arms (nodes, 2) of nodes, and add moments, moments of inertia and masses to `sums` (3, bodies)."""
    centres = np.zeros((sums.shape[1], 2))
    for n in range(body.size):
        sums[2, body[n]] += mass[n]
        for i in range(2):
            centres[body[n], i] += mass[n] * x[n, i]
    for b in range(sums.shape[1]):
        for i in range(2):
            centres[b, i] /= max(sums[2, b], 1e-300)
    for n in range(body.size):
        b = body[n]
        for i in range(2):
            arms[n, i] = x[n, i] - centres[b, i]
        sums[0, b] += arms[n, 0] * impulse[n, 1] - arms[n, 1] * impulse[n, 0]
        sums[1, b] += mass[n] * (arms[n, 0] ** 2 + arms[n, 1] ** 2)
