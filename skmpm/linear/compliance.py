"""H A^-1 H', what contact sees of the bodies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.linear.solver import Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Squares = Callable[[int, int, Array, Ints], Array]


@dataclass(frozen=True)
class _Parts:
    """The parts of rows that belong to one body each, body after body, those of a body by their first unknown."""

    row: Ints  # (parts,)
    ends: Ints  # (bodies + 1,) first part of each body
    first: Ints  # (parts,) first unknown
    dof: Ints  # (entries,) part after part
    part: Ints
    value: Array

    @property
    def local(self) -> Ints:
        """Number of each part (parts,) within its body."""
        return np.arange(self.row.size) - np.repeat(self.ends[:-1], np.diff(self.ends))


def _parts(blocks: Ints, H: sp.csr_array) -> _Parts:
    H = H.sorted_indices()
    dof = H.indices.astype(np.int64)
    row = np.repeat(np.arange(H.shape[0]), np.diff(H.indptr))
    body = np.searchsorted(blocks, dof, side="right") - 1
    begins = np.ones(dof.size, dtype=bool)
    begins[1:] = (row[1:] != row[:-1]) | (body[1:] != body[:-1])
    start = np.flatnonzero(begins)
    order = np.lexsort((dof[start], body[start]))
    number = np.empty_like(order)
    number[order] = np.arange(order.size)
    ends = np.searchsorted(body[start[order]], np.arange(blocks.size))
    part = number[np.cumsum(begins) - 1]
    by_part = np.argsort(part, kind="stable")
    return _Parts(row[start[order]], ends, dof[start[order]], dof[by_part], part[by_part], H.data[by_part])


def by_body(blocks: Ints, H: sp.csr_array, squares: Squares) -> sp.csr_array:
    """Sum of the bodies' dense H_b A_b^-1 H_b' by `squares(start, stop, H_b', first)`.

    Columns of H_b' are sorted by the first row `first` where they are not zero.
    """
    parts = _parts(blocks, H)
    local, entries = parts.local, np.searchsorted(parts.part, parts.ends)
    data, row, column = [], [], []
    for b in np.flatnonzero(np.diff(parts.ends)).tolist():
        start, stop = int(blocks[b]), int(blocks[b + 1])
        own, mine = slice(parts.ends[b], parts.ends[b + 1]), slice(entries[b], entries[b + 1])
        here = parts.row[own]
        right = np.zeros((stop - start, here.size), order="F")
        right[parts.dof[mine] - start, local[parts.part[mine]]] = parts.value[mine]
        data.append(squares(start, stop, right, parts.first[own] - start).ravel())
        row.append(np.repeat(here, here.size))
        column.append(np.tile(here, here.size))
    return _collect(data, row, column, H.shape[0])


def by_columns(solve: Solver, blocks: Ints, H: sp.csr_array) -> sp.csr_array:
    """H A^-1 H' by solving for one row of every body at a time: rows of different bodies share a right side."""
    parts = _parts(blocks, H)
    local, count = parts.local, np.diff(parts.ends)
    of_entry = local[parts.part]
    data: list[Array] = []
    row: list[Ints] = []
    column: list[Ints] = []
    for j in range(int(count.max(initial=0))):
        chosen = of_entry == j
        b = np.zeros(H.shape[1])
        b[parts.dof[chosen]] = parts.value[chosen]
        products = parts.value * solve(b)[parts.dof]
        kept = np.repeat(count > j, count)
        data.append(np.bincount(parts.part, products, parts.row.size).astype(np.float64)[kept])
        row.append(parts.row[kept])
        column.append(np.repeat(parts.row[local == j], count[count > j]))
    return _collect(data, row, column, H.shape[0])


def _collect(data: list[Array], row: list[Ints], column: list[Ints], size: int) -> sp.csr_array:
    if not data:
        return sp.csr_array((size, size))
    entries = (np.concatenate(data), (np.concatenate(row), np.concatenate(column)))
    return sp.csr_array(sp.coo_array(entries, shape=(size, size)).tocsr())
