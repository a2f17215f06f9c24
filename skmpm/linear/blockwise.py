"""The Delassus operator H A^-1 H^T, body by body or by solves with columns of all bodies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.compiled import compiled
from skmpm.linear.solver import Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Rows:
    """The non-zero rows of H, sorted by body and, within a body, by first unknown."""

    size: int  # number of rows of H
    row: Ints  # (k,) index in H
    ends: Ints  # (bodies + 1,) first of the k rows of each body
    first: Ints  # (k,) first unknown of each row
    dof: Ints  # (entries,) unknown of each entry, row after row
    entry: Ints  # (entries,) which of the k rows each entry belongs to
    value: Array  # (entries,)

    @cached_property
    def local(self) -> Ints:
        """Index of each row within its body, (k,)."""
        return np.arange(self.row.size) - np.repeat(self.ends[:-1], np.diff(self.ends))


Squares = Callable[[Rows, Array, Ints], None]


def _rows(blocks: Ints, H: sp.csr_array) -> Rows:
    H = H.sorted_indices()
    count = np.diff(H.indptr)
    filled = np.flatnonzero(count)
    first, last = H.indices[H.indptr[filled]].astype(np.int64), H.indices[H.indptr[filled + 1] - 1]
    body = np.searchsorted(blocks, first, side="right") - 1
    if np.any(last >= blocks[body + 1]):
        raise ValueError("a row of H touches two bodies; split it into one row per body")
    order = np.lexsort((first, body))
    ends = np.searchsorted(body[order], np.arange(blocks.size))
    chosen = sp.csr_array(H[filled[order]])
    entry = np.repeat(np.arange(order.size), count[filled[order]])
    dof = chosen.indices.astype(np.int64)
    return Rows(H.shape[0], filled[order], ends, first[order], dof, entry, chosen.data)


def by_body(blocks: Ints, H: sp.csr_array, squares: Squares) -> sp.csr_array:
    """H A^-1 H^T, dense within a body, from the dense blocks that `squares(rows, out, begins)` writes.

    Each row of H touches one body. Block b begins at `begins[b]` in `out`; its rows and columns are the rows of H on
    that body in the order of their first non-zero.
    """
    rows = _rows(blocks, H)
    sizes = np.diff(rows.ends)
    begins = np.append(0, np.cumsum(sizes**2))
    dense = np.zeros(begins[-1])
    squares(rows, dense, begins)
    count = np.zeros(rows.size, dtype=np.int64)
    count[rows.row] = np.repeat(sizes, sizes)
    indptr = np.append(0, np.cumsum(count))
    data, indices = np.empty(begins[-1]), np.empty(begins[-1], dtype=np.int32)
    _sorted(rows.row, rows.ends, begins, dense, indptr, data, indices)
    return sp.csr_array((data, indices, indptr.astype(np.int32)), shape=(rows.size, rows.size))


@compiled
def _sorted(row: Ints, ends: Ints, begins: Ints, dense: Array, indptr: Ints, data: Array, indices: Ints) -> None:
    """Copy dense blocks into the rows of a CSR matrix, columns ascending."""
    for b in range(ends.size - 1):
        size, own = ends[b + 1] - ends[b], row[ends[b] : ends[b + 1]]
        order = np.argsort(own)
        columns = own[order]
        for i in order:
            source, target = begins[b] + i * size, indptr[own[i]]
            values, entries, column = dense[source : source + size], data[target:], indices[target:]
            for k in range(size):
                entries[k], column[k] = values[order[k]], columns[k]


def by_columns(solve: Solver, blocks: Ints, H: sp.csr_array) -> sp.csr_array:
    """H A^-1 H^T by solves for one row of every body at a time: rows of different bodies share a right-hand side."""
    rows = _rows(blocks, H)
    count = np.diff(rows.ends)
    of_entry = rows.local[rows.entry]
    data, row, column = [np.zeros(0)], [rows.row[:0]], [rows.row[:0]]
    for j in range(int(count.max(initial=0))):
        chosen = of_entry == j
        b = np.zeros(H.shape[1])
        b[rows.dof[chosen]] = rows.value[chosen]
        products = rows.value * solve(b)[rows.dof]
        kept = np.repeat(count > j, count)
        data.append(np.bincount(rows.entry, products, rows.row.size).astype(np.float64)[kept])
        row.append(rows.row[kept])
        column.append(np.repeat(rows.row[rows.local == j], count[count > j]))
    entries = (np.concatenate(data), (np.concatenate(row), np.concatenate(column)))
    return sp.csr_array(sp.coo_array(entries, shape=(rows.size, rows.size)).tocsr())
