"""The Delassus operator H A^-1 H^T, body by body, or by solves with columns of all bodies.

Bodies whose factor is that of `cholesky` have compiled loops of their own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from skmpm.arrays import Array, Ints
from skmpm.compiled import compiled
from skmpm.linear.cholesky import PANEL, WIDEST, copy_panel
from skmpm.linear.solver import Solver


@compiled
def squares(
    begin: int,
    end: int,
    bands: Array,
    offsets: Ints,
    blocks: Ints,
    reach: Ints,
    ends: Ints,
    first: Ints,
    entries: Ints,
    dof: Ints,
    value: Array,
    out: Array,
    begins: Ints,
) -> None:
    """Z^T Z of every body, Z = L^-1 H_b^T, one after the other in `out`, which is zero."""
    for body in range(begin, end):
        start, n, m = blocks[body], blocks[body + 1] - blocks[body], ends[body + 1] - ends[body]
        if m == 0:
            continue
        Z, active = np.zeros((m + -m % PANEL, n)), np.zeros(n, dtype=np.int64)  # its rows are columns of L^-1 H^T
        for j in range(m):
            row = ends[body] + j
            for e in range(entries[row], entries[row + 1]):
                Z[j, dof[e] - start] = value[e]
            active[first[row] - start] = j + 1
        for i in range(1, n):
            active[i] = max(active[i], active[i - 1])
        band = bands[offsets[body] : offsets[body + 1]]
        _forward(band, band.size // n, reach[start // 2 : (start + n) // 2], Z, active)
        _write_square(
            Z, first[ends[body] : ends[body + 1]] - start, out[begins[body] : begins[body + 1]].reshape((m, m))
        )


@compiled
def _write_square(Z: Array, first: Ints, square: Array) -> None:
    """Write Z Z^T, two rows of it and PANEL columns at once; row j of Z has entries from first[j] on."""
    m, values = first.size, np.empty((2, PANEL))
    for j in range(0, m, 2):
        p, q = Z[j, first[j] :], Z[j + 1, first[j] :]
        for k in range(0, min(j + 2, m), PANEL):
            w, x, y, z = Z[k, first[j] :], Z[k + 1, first[j] :], Z[k + 2, first[j] :], Z[k + 3, first[j] :]
            a = b = c = d = e = f = g = h = 0.0
            for i in range(p.size):
                a += p[i] * w[i]
                b += p[i] * x[i]
                c += p[i] * y[i]
                d += p[i] * z[i]
                e += q[i] * w[i]
                f += q[i] * x[i]
                g += q[i] * y[i]
                h += q[i] * z[i]
            values[0, 0], values[0, 1], values[0, 2], values[0, 3] = a, b, c, d
            values[1, 0], values[1, 1], values[1, 2], values[1, 3] = e, f, g, h
            for row in range(min(2, m - j)):
                for column in range(min(PANEL, j + row + 1 - k)):
                    square[j + row, k + column] = square[k + column, j + row] = values[row, column]


@compiled
def _forward(band: Array, height: int, ends: Ints, Z: Array, active: Ints) -> None:
    """Forward substitution in the rows of Z, two at once; unknown i is filled in the first active[i] of them."""
    n, panel = Z.shape[1], np.empty(PANEL * WIDEST)
    full = n - n % PANEL
    for begin in range(0, full, PANEL):
        some, a, size = active[begin + PANEL - 1], begin * height, ends[begin // 2 + 1] - begin - PANEL
        b, c, d = a + height, a + 2 * height, a + 3 * height
        if some == 0:
            continue
        copy_panel(band, height, a, size, panel)
        ba, ca, da, cb, db, dc = band[a + 1], band[a + 2], band[a + 3], band[b + 1], band[b + 2], band[c + 1]
        ra, rb, rc, rd = 1.0 / band[a], 1.0 / band[b], 1.0 / band[c], 1.0 / band[d]
        for k in range(0, some, 2):
            for row in range(k, k + 2):
                own = Z[row, begin : begin + PANEL]
                own[0] *= ra
                own[1] = rb * (own[1] - ba * own[0])
                own[2] = rc * (own[2] - ca * own[0] - cb * own[1])
                own[3] = rd * (own[3] - da * own[0] - db * own[1] - dc * own[2])
            e, f, g, h = Z[k, begin], Z[k, begin + 1], Z[k, begin + 2], Z[k, begin + 3]
            p, q, r, s = Z[k + 1, begin], Z[k + 1, begin + 1], Z[k + 1, begin + 2], Z[k + 1, begin + 3]
            upper, lower = Z[k, begin + PANEL :], Z[k + 1, begin + PANEL :]
            for i in range(size):
                w, x, y, z = panel[i], panel[i + WIDEST], panel[i + 2 * WIDEST], panel[i + 3 * WIDEST]
                upper[i] -= e * w + f * x + g * y + h * z
                lower[i] -= p * w + q * x + r * y + s * z
    for i in range(full, n):
        for k in range(active[n - 1]):
            for j in range(full, i):
                Z[k, i] -= band[j * height + i - j] * Z[k, j]
            Z[k, i] /= band[i * height]


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
