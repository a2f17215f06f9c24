"""The compiled loops of `body_grids` and `assembly`: over points, cells and ghost facets.

`node` (n, 4) are the nodes of the cell of each point, `weight` (n, 4) the shape functions or their derivatives there.
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


@compiled
def ghost_force(indptr: NDArray[np.int32], indices: NDArray[np.int32], data: Array, u: Array, force: Array) -> None:
    """Add G u from differences of u (nodes, 2): rows of G sum to zero, and bodies may be far from their anchor."""
    for i in range(indptr.size - 1):
        for e in range(indptr[i], indptr[i + 1]):
            j = indices[e]
            if j >= i:
                break
            x, y = data[e] * (u[j, 0] - u[i, 0]), data[e] * (u[j, 1] - u[i, 1])
            force[i, 0] += x
            force[i, 1] += y
            force[j, 0] -= x
            force[j, 1] -= y


@compiled
def ghost_energy(indptr: NDArray[np.int32], indices: NDArray[np.int32], data: Array, u: Array) -> float:
    """1/2 u' G u from differences of u (nodes, 2)."""
    total = 0.0
    for i in range(indptr.size - 1):
        for e in range(indptr[i], indptr[i + 1]):
            j = indices[e]
            if j >= i:
                break
            total += data[e] * ((u[j, 0] - u[i, 0]) ** 2 + (u[j, 1] - u[i, 1]) ** 2)
    return -0.5 * total


@compiled
def cell_ratios(cell: Ints, volume: Array, values: Array, sums: Array, ratios: Array) -> None:
    """Ratios of the sums of V values over the points of each cell, at the points; values (2, n), sums (cells, 2)."""
    for p in range(cell.size):
        sums[cell[p], 0] += volume[p] * values[0, p]
        sums[cell[p], 1] += volume[p] * values[1, p]
    for p in range(cell.size):
        ratios[p] = sums[cell[p], 0] / sums[cell[p], 1]


@compiled
def add_stiffness(
    first: int,
    last: int,
    cells: Ints,
    cell_body: Ints,
    block_of_cell: Ints,
    cell_of_point: Ints,
    gx: Array,
    gy: Array,
    volume: Array,
    C: Array,
    K: Array,
) -> None:
    """Add V grad N_I : C : grad N_J of points first:last to the blocks K (blocks, 2, 2); symmetric C (4, 4, n).

    Sums over the points of each cell of a body, cells[b]:cells[b + 1], come first, of pairs of nodes I <= J.
    """
    body, begin, sums = -1, 0, np.zeros((0, 10, 4))
    for p in range(first, last):
        if cell_body[cell_of_point[p]] != body:
            _add_to_blocks(begin, sums, block_of_cell, K)
            body = cell_body[cell_of_point[p]]
            begin, sums = cells[body], np.zeros((cells[body + 1] - cells[body], 10, 4))
        V, x, y, own, n = volume[p], gx[p], gy[p], sums[cell_of_point[p] - begin], 0
        c00, c01, c02, c03 = V * C[0, 0, p], V * C[0, 1, p], V * C[0, 2, p], V * C[0, 3, p]
        c11, c12, c13 = V * C[1, 1, p], V * C[1, 2, p], V * C[1, 3, p]
        c22, c23, c33 = V * C[2, 2, p], V * C[2, 3, p], V * C[3, 3, p]
        for I in range(4):  # noqa: E741
            xx_x, xx_y = x[I] * c00 + y[I] * c01, x[I] * c01 + y[I] * c11
            xy_x, xy_y = x[I] * c02 + y[I] * c12, x[I] * c03 + y[I] * c13
            yx_x, yx_y = x[I] * c02 + y[I] * c03, x[I] * c12 + y[I] * c13
            yy_x, yy_y = x[I] * c22 + y[I] * c23, x[I] * c23 + y[I] * c33
            for J in range(I, 4):
                own[n, 0] += xx_x * x[J] + xx_y * y[J]
                own[n, 1] += xy_x * x[J] + xy_y * y[J]
                own[n, 2] += yx_x * x[J] + yx_y * y[J]
                own[n, 3] += yy_x * x[J] + yy_y * y[J]
                n += 1
    _add_to_blocks(begin, sums, block_of_cell, K)


@compiled
def _add_to_blocks(begin: int, sums: Array, block_of_cell: Ints, K: Array) -> None:
    """Add the symmetric matrices of cells from `begin` on, of pairs of nodes I <= J in `sums` (cells, 10, 4)."""
    flat = K.reshape(-1)
    for c in range(sums.shape[0]):
        block, own, n = block_of_cell[begin + c], sums[c], 0
        for I in range(4):  # noqa: E741
            for J in range(I, 4):
                entry = flat[4 * block[I, J] : 4 * block[I, J] + 4]
                for k in range(4):
                    entry[k] += own[n, k]
                if J > I:
                    entry = flat[4 * block[J, I] : 4 * block[J, I] + 4]
                    entry[0] += own[n, 0]
                    entry[1] += own[n, 2]
                    entry[2] += own[n, 1]
                    entry[3] += own[n, 3]
                n += 1


@compiled
def scale_and_add(factor: float, K: Array, diagonal: Ints, added: Array) -> None:
    """Multiply blocks K (blocks, 2, 2) by a factor, and add `added` (nodes, 2, 2) to the `diagonal` ones."""
    flat = K.reshape(-1)
    for e in range(flat.size):
        flat[e] *= factor
    for node in range(diagonal.size):
        for i in range(2):
            for k in range(2):
                K[diagonal[node], i, k] += added[node, i, k]


@compiled
def add_rank_two(first: int, last: int, block_of_cell: Ints, vectors: Array, K: Array) -> None:
    """Add B D' + D B' of cells first:last, `vectors` (cells, 2, 4, 2), to the blocks K (blocks, 2, 2)."""
    flat = K.reshape(-1)
    for c in range(first, last):
        B, D, block = vectors[c, 0], vectors[c, 1], block_of_cell[c]
        for I in range(4):  # noqa: E741
            for J in range(4):
                entry = flat[4 * block[I, J] : 4 * block[I, J] + 4]
                entry[0] += D[I, 0] * B[J, 0] + B[I, 0] * D[J, 0]
                entry[1] += D[I, 0] * B[J, 1] + B[I, 0] * D[J, 1]
                entry[2] += D[I, 1] * B[J, 0] + B[I, 1] * D[J, 0]
                entry[3] += D[I, 1] * B[J, 1] + B[I, 1] * D[J, 1]


@compiled
def mean_dilatation_vectors(
    cell: Ints, gx: Array, gy: Array, volume: Array, slope: Array, mixed: Array, bulk: Array, rest: Array, out: Array
) -> None:
    """B and D + E B / 2 of every cell, (cells, 2, 4, 2), zero before; see `forms.mean_dilatation_stiffness`."""
    total, curvature = np.zeros(out.shape[0]), np.zeros(out.shape[0])
    for p in range(cell.size):
        c, V = cell[p], volume[p]
        total[c] += V * rest[p]
        curvature[c] += V * bulk[p]
        xx, xy, yx, yy = slope[0, p], slope[1, p], slope[2, p], slope[3, p]
        mixed_xx, mixed_xy, mixed_yx, mixed_yy = mixed[0, p], mixed[1, p], mixed[2, p], mixed[3, p]
        B, D = out[c, 0], out[c, 1]
        for I in range(4):  # noqa: E741
            x, y = V * gx[p, I], V * gy[p, I]
            B[I, 0] += xx * x + xy * y
            B[I, 1] += yx * x + yy * y
            D[I, 0] += mixed_xx * x + mixed_xy * y
            D[I, 1] += mixed_yx * x + mixed_yy * y
    for c in range(out.shape[0]):
        half, B, D = 0.5 * curvature[c] / total[c], out[c, 0], out[c, 1]
        for I in range(4):  # noqa: E741
            for i in range(2):
                D[I, i] = (D[I, i] + half * B[I, i]) / total[c]
