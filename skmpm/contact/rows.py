"""Rows of contacts as sparse matrices, and tables of contacts that are joined or chosen from.

Rows combine contact points, and have components along directions. Tables are frozen dataclasses whose fields are
arrays with one entry per item along the last axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.arrays import Array, Ints
from skmpm.compiled import compiled

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Table = TypeVar("Table", bound=DataclassInstance)


Indices = NDArray[np.integer]


def joined(parts: Sequence[Table]) -> Table:
    """Concatenate the items of several tables of the same type."""
    names = [f.name for f in fields(parts[0])]
    columns = {name: np.concatenate([getattr(part, name) for part in parts], axis=-1) for name in names}
    return type(parts[0])(**columns)


def among(table: Table, chosen: NDArray[Any]) -> Table:
    """Select items of a table by indices or a mask."""
    return type(table)(**{f.name: getattr(table, f.name)[..., chosen] for f in fields(table)})


def stacked(parts: Sequence[sp.csr_array]) -> sp.csr_array:
    """The rows of matrices one after the other."""
    rows: sp.csr_array = parts[0] if len(parts) == 1 else sp.vstack(parts, format="csr")
    return rows


def scaled(matrix: sp.csr_array, factor: Array) -> sp.csr_array:
    """The rows of a matrix times factors (rows,)."""
    data = matrix.data * np.repeat(factor, np.diff(matrix.indptr))
    return sp.csr_array((data, matrix.indices, matrix.indptr), shape=matrix.shape)


def components(matrix: sp.csr_array, *directions: Array) -> sp.csr_array:
    """Matrix (d k, 2 m) of the components along d `directions` (2, k) of the vectors that `matrix` (k, m) combines.

    The d rows of a vector follow each other.
    """
    count, k = len(directions), matrix.shape[0]
    indptr, size = np.empty(count * k + 1, dtype=matrix.indptr.dtype), 2 * count * matrix.nnz
    indices, data = np.empty(size, dtype=matrix.indices.dtype), np.empty(size)
    stacked = np.array(directions)  # in C order, whatever theirs: loops are compiled for each order
    _components(matrix.indptr, matrix.indices, matrix.data, stacked, indptr, indices, data)
    return sp.csr_array((data, indices, indptr), shape=(count * k, 2 * matrix.shape[1]))


@compiled
def _components(
    given: Indices,
    columns: Indices,
    weights: Array,
    directions: Array,
    indptr: Indices,
    indices: Indices,
    data: Array,
) -> None:
    """Write the same; directions (d, 2, k)."""
    end, row = 0, 0
    indptr[0] = 0
    for k in range(given.size - 1):
        for d in range(directions.shape[0]):
            x, y = directions[d, 0, k], directions[d, 1, k]
            for e in range(given[k], given[k + 1]):
                indices[end], indices[end + 1] = 2 * columns[e], 2 * columns[e] + 1
                data[end], data[end + 1] = x * weights[e], y * weights[e]
                end += 2
            row += 1
            indptr[row] = end


def combinations(columns: Ints, weights: Array, size: int) -> sp.csr_array:
    """Matrix (k, size) with sums of the weights (j, k) in columns (j, k) for rows; zeros are left out."""
    k = columns.shape[1]
    indptr, indices, data = np.zeros(k + 1, dtype=np.int32), np.empty(columns.size, np.int32), np.empty(columns.size)
    filled = _combinations(columns, weights, indptr, indices, data)
    return sp.csr_array((data[:filled], indices[:filled], indptr), shape=(k, size))


@compiled
def _combinations(columns: Ints, weights: Array, indptr: Indices, indices: Indices, data: Array) -> int:
    """Write the same, columns ascending, and return the number of entries."""
    end = 0
    for k in range(columns.shape[1]):
        begin = end
        for j in range(columns.shape[0]):
            column, weight = columns[j, k], weights[j, k]
            if weight == 0.0:
                continue
            at = begin
            while at < end and indices[at] < column:
                at += 1
            if at < end and indices[at] == column:
                data[at] += weight
                continue
            for e in range(end, at, -1):
                indices[e], data[e] = indices[e - 1], data[e - 1]
            indices[at], data[at] = column, weight
            end += 1
        indptr[k + 1] = end
    return end
