"""The Delassus operator H A^-1 H^T, body by body or by solves with columns of all bodies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.linear.solver import Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Squares = Callable[[int, int, Array, Ints], Array]


@dataclass(frozen=True)
class _Rows:
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


def _rows(blocks: Ints, H: sp.csr_array) -> _Rows:
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
    return _Rows(H.shape[0], filled[order], ends, first[order], dof, entry, chosen.data)


def by_body(blocks: Ints, H: sp.csr_array, squares: Squares) -> sp.csr_array:
    """H A^-1 H^T, dense within a body, from the blocks `squares(start, stop, H_b^T, first)` of the bodies.

    Each row of H touches one body. The columns of H_b^T are sorted by the index `first` of their first non-zero.
    """
    rows = _rows(blocks, H)
    entries, sizes = np.searchsorted(rows.entry, rows.ends), np.diff(rows.ends)
    count = np.zeros(rows.size, dtype=np.int64)
    count[rows.row] = np.repeat(sizes, sizes)
    begins = np.append(0, np.cumsum(count))
    data, column = np.empty(begins[-1]), np.empty(begins[-1], dtype=np.int32)
    for b in np.flatnonzero(sizes).tolist():
        start, stop, size = int(blocks[b]), int(blocks[b + 1]), sizes[b]
        in_body, entries_of_body = slice(rows.ends[b], rows.ends[b + 1]), slice(entries[b], entries[b + 1])
        right = np.zeros((stop - start, size), order="F")
        local = rows.local[rows.entry[entries_of_body]]
        right[rows.dof[entries_of_body] - start, local] = rows.value[entries_of_body]
        block = squares(start, stop, right, rows.first[in_body] - start)
        ascending = np.argsort(rows.row[in_body])
        row = rows.row[in_body][ascending]
        position = begins[row][:, None] + np.arange(size)
        data[position], column[position] = block[ascending][:, ascending], row
    return sp.csr_array((data, column, begins.astype(np.int32)), shape=(rows.size, rows.size))


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
