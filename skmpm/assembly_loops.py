"""The loops of `assembly` over points, cells and ghost facets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.compiled import compiled

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


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
    block_of_cell: Ints,
    cell_of_point: Ints,
    gx: Array,
    gy: Array,
    volume: Array,
    C: Array,
    K: Array,
) -> None:
    """Add V grad N_I : C : grad N_J of points first:last to the blocks K (blocks, 2, 2); symmetric C (4, 4, n)."""
    for p in range(first, last):
        V, x, y, block = volume[p], gx[p], gy[p], block_of_cell[cell_of_point[p]]
        for i in range(2):
            for k in range(i, 2):
                xx, xy = V * C[2 * i, 2 * k, p], V * C[2 * i, 2 * k + 1, p]
                yx, yy = V * C[2 * i + 1, 2 * k, p], V * C[2 * i + 1, 2 * k + 1, p]
                for I in range(4):  # noqa: E741
                    by_x, by_y = x[I] * xx + y[I] * yx, x[I] * xy + y[I] * yy
                    for J in range(4):
                        value = by_x * x[J] + by_y * y[J]
                        K[block[I, J], i, k] += value
                        if i < k:
                            K[block[J, I], k, i] += value


@compiled
def add_rank_two(block_of_cell: Ints, vectors: Array, K: Array) -> None:
    """Add B D' + D B' of every cell, `vectors` (cells, 2, 4, 2), to the blocks K (blocks, 2, 2)."""
    for c in range(block_of_cell.shape[0]):
        B, D = vectors[c, 0], vectors[c, 1]
        for I in range(4):  # noqa: E741
            for J in range(4):
                block = block_of_cell[c, I, J]
                for i in range(2):
                    for k in range(2):
                        K[block, i, k] += D[I, i] * B[J, k] + B[I, i] * D[J, k]


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
        for I in range(4):  # noqa: E741
            x, y = V * gx[p, I], V * gy[p, I]
            for i in range(2):
                out[c, 0, I, i] += slope[2 * i, p] * x + slope[2 * i + 1, p] * y
                out[c, 1, I, i] += mixed[2 * i, p] * x + mixed[2 * i + 1, p] * y
    for c in range(out.shape[0]):
        half = 0.5 * curvature[c] / total[c]
        for I in range(4):  # noqa: E741
            for i in range(2):
                out[c, 1, I, i] = (out[c, 1, I, i] + half * out[c, 0, I, i]) / total[c]
