"""H A^-1 H', what contact sees of the bodies."""

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
    """The rows of H that touch a body, body after body, those of a body by their first unknown."""

    size: int  # of all rows of H
    row: Ints  # (k,) their numbers in H
    ends: Ints  # (bodies + 1,) the first row of each body
    first: Ints  # (k,) first unknown
    dof: Ints  # (entries,) row after row
    entry: Ints  # (entries,) the row, of the k, of each
    value: Array

    @cached_property
    def local(self) -> Ints:
        """Number of each row (k,) within its body."""
        return np.arange(self.row.size) - np.repeat(self.ends[:-1], np.diff(self.ends))


def _rows(blocks: Ints, H: sp.csr_array) -> _Rows:
    H = H.sorted_indices()
    count = np.diff(H.indptr)
    filled = np.flatnonzero(count)
    first, last = H.indices[H.indptr[filled]].astype(np.int64), H.indices[H.indptr[filled + 1] - 1]
    body = np.searchsorted(blocks, first, side="right") - 1
    if np.any(last >= blocks[body + 1]):
        raise ValueError("a row of H touches two bodies; give one row for each")
    order = np.lexsort((first, body))
    ends = np.searchsorted(body[order], np.arange(blocks.size))
    chosen = sp.csr_array(H[filled[order]])
    entry = np.repeat(np.arange(order.size), count[filled[order]])
    dof = chosen.indices.astype(np.int64)
    return _Rows(H.shape[0], filled[order], ends, first[order], dof, entry, chosen.data)


def by_body(blocks: Ints, H: sp.csr_array, squares: Squares) -> sp.csr_array:
    """H A^-1 H', dense within a body, by `squares(start, stop, H_b', first)`; rows of H touch one body each.

    Columns of H_b' are sorted by the first row `first` where they are not zero.
    """
    rows = _rows(blocks, H)
    entries, sizes = np.searchsorted(rows.entry, rows.ends), np.diff(rows.ends)
    count = np.zeros(rows.size, dtype=np.int64)
    count[rows.row] = np.repeat(sizes, sizes)
    begins = np.append(0, np.cumsum(count))
    data, column = np.empty(begins[-1]), np.empty(begins[-1], dtype=np.int32)
    for b in np.flatnonzero(sizes).tolist():
        start, stop, size = int(blocks[b]), int(blocks[b + 1]), sizes[b]
        own, mine = slice(rows.ends[b], rows.ends[b + 1]), slice(entries[b], entries[b + 1])
        right = np.zeros((stop - start, size), order="F")
        right[rows.dof[mine] - start, rows.local[rows.entry[mine]]] = rows.value[mine]
        block = squares(start, stop, right, rows.first[own] - start)
        ascending = np.argsort(rows.row[own])
        here = rows.row[own][ascending]
        place = begins[here][:, None] + np.arange(size)
        data[place], column[place] = block[ascending][:, ascending], here
    return sp.csr_array((data, column, begins.astype(np.int32)), shape=(rows.size, rows.size))


def by_columns(solve: Solver, blocks: Ints, H: sp.csr_array) -> sp.csr_array:
    """The same by solving for one row of every body at a time: rows of different bodies share a right side."""
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
