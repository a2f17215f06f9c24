"""H A^-1 H', what contact sees of the bodies."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.linear.solver import Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def _split(blocks: Ints, H: sp.csr_array) -> tuple[Any, ...]:
    """Entries of H by body: (body, dof, local row, value) and each body's rows as (offsets, rows)."""
    entries = H.tocoo()
    body = np.searchsorted(blocks, entries.col, side="right") - 1
    key = body.astype(np.int64) * H.shape[0] + entries.row
    keys, local = np.unique(key, return_inverse=True)
    offsets = np.searchsorted(keys, np.arange(blocks.size) * H.shape[0])
    return body, entries.col, local - offsets[body], entries.data, offsets, keys % max(H.shape[0], 1)


def by_body(blocks: Ints, H: sp.csr_array, squares: Callable[[int, int, Array], Array]) -> sp.csr_array:
    """Sum of the bodies' dense H_b A_b^-1 H_b', computed by `squares(start, stop, H_b')`."""
    body, dof, local, value, offsets, rows = _split(blocks, H)
    order = np.argsort(body, kind="stable")
    dof, local, value = dof[order], local[order], value[order]
    ends = np.searchsorted(body[order], np.arange(blocks.size))
    data, row, column = [], [], []
    for b in np.flatnonzero(np.diff(offsets)):
        start, stop, mine = int(blocks[b]), int(blocks[b + 1]), slice(ends[b], ends[b + 1])
        right = np.zeros((stop - start, offsets[b + 1] - offsets[b]), order="F")
        right[dof[mine] - start, local[mine]] = value[mine]
        data.append(squares(start, stop, right).ravel())
        here = rows[offsets[b] : offsets[b + 1]]
        row.append(np.repeat(here, here.size))
        column.append(np.tile(here, here.size))
    return _collect(data, row, column, H.shape[0])


def by_columns(solve: Solver, blocks: Ints, H: sp.csr_array) -> sp.csr_array:
    """H A^-1 H' by solving for one row of every body at a time: rows of different bodies share a right side."""
    body, dof, local, value, offsets, rows = _split(blocks, H)
    data, row, column = [], [], []
    count = np.diff(offsets)
    for j in range(int(count.max(initial=0))):
        chosen = local == j
        b = np.zeros(H.shape[1])
        b[dof[chosen]] = value[chosen]
        product = np.bincount(offsets[body] + local, value * solve(b)[dof], rows.size)
        has = count > j
        source = np.repeat(np.where(has, rows[np.minimum(offsets[:-1] + j, rows.size - 1)], 0), count)
        kept = np.repeat(has, count)
        data.append(product[kept])
        row.append(rows[kept])
        column.append(source[kept])
    return _collect(data, row, column, H.shape[0])


def _collect(data: list[Any], row: list[Any], column: list[Any], size: int) -> sp.csr_array:
    if not data:
        return sp.csr_array((size, size))
    entries = (np.concatenate(data), (np.concatenate(row), np.concatenate(column)))
    return sp.csr_array(sp.coo_array(entries, shape=(size, size)).tocsr())
