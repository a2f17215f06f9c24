"""Cholesky factors L in bands and their substitutions: the loops of `band`.

A body has n unknowns, two a node, and n columns of `height` entries: entry (i, j) of L is band[j height + i - j].
Rows of nodes differ in length, and entries of L lie between the diagonal and the last row that A reaches from their
column or from one before it, `ends` (nodes,). Only these are computed, PANEL columns at a time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.arrays import Array, Bools, Ints
from skmpm.compiled import compiled, compiled_in_order

PANEL = 4  # columns of L that are eliminated at once, those of two nodes
WIDEST = 4160  # rows of a panel; no power of two, with which its columns would share lines of the cache


@compiled_in_order
def factorise(
    first: int,
    last: int,
    bands: Array,
    offsets: Ints,
    chosen: Bools,
    indptr: NDArray[np.integer],
    indices: NDArray[np.integer],
    data: Array,
    blocks: Ints,
    ends: Ints,
    failed: Bools,
) -> None:
    """Overwrite the bands of the chosen bodies among first:last by the factors of their blocks of A."""
    for body in range(first, last):
        n = blocks[body + 1] - blocks[body]
        if not chosen[body] or n == 0:
            continue
        start, band = blocks[body] // 2, bands[offsets[body] : offsets[body + 1]]
        own, height, panel = ends[start : start + n // 2], band.size // n, np.empty(PANEL * WIDEST)
        _fill(start, n // 2, indptr, indices, data, height, band)
        for begin in range(0, n, PANEL):
            size, end = min(PANEL, n - begin), own[min(begin // 2 + 1, n // 2 - 1)]
            if not _eliminate(band, height, begin, size):
                failed[body] = True
                break
            if size == PANEL:
                _eliminate_below(band, height, begin, end - begin, panel)
                _subtract(band, height, begin + PANEL, end - begin - PANEL, panel)


@compiled
def _fill(
    start: int,
    nodes: int,
    indptr: NDArray[np.integer],
    indices: NDArray[np.integer],
    data: Array,
    height: int,
    band: Array,
) -> None:
    """Write the lower triangle of a body's block of A, whose first node is `start`, to its band.

    Entries beyond the profile are zero, too: states keep factors, and the same run leads to the same bits.
    """
    band[:] = 0.0
    for node in range(nodes):
        row = start + node
        for e in range(indptr[row], indptr[row + 1]):
            column = indices[e]
            if column <= row:
                at = 2 * (column - start) * height + 2 * (row - column)
                band[at] = data[e, 0, 0]
                band[at + 1] = data[e, 1, 0]
                band[at + height] = data[e, 1, 1]
                if column < row:
                    band[at + height - 1] = data[e, 0, 1]


@compiled_in_order
def _eliminate(band: Array, height: int, begin: int, size: int) -> bool:
    """Overwrite the triangle on the diagonal of a panel by that of L; False where a pivot is not positive."""
    for j in range(begin, begin + size):
        for i in range(j, begin + size):
            for k in range(begin, j):
                band[j * height + i - j] -= band[k * height + i - k] * band[k * height + j - k]
        pivot = band[j * height]
        if not pivot > 0.0:
            return False
        band[j * height] = np.sqrt(pivot)
        for i in range(j + 1, begin + size):
            band[j * height + i - j] /= band[j * height]
    return True


@compiled
def copy_panel(band: Array, height: int, at: int, size: int, panel: Array) -> None:
    """Copy the rows below the triangle of the panel that begins at band[at], column by column."""
    for column in range(PANEL):
        begin, to = at + column * height + PANEL - column, column * WIDEST
        for i in range(size):
            panel[to + i] = band[begin + i]


@compiled
def _eliminate_below(band: Array, height: int, begin: int, rows: int, panel: Array) -> None:
    """Overwrite the rows of a panel below its triangle by those of L, and copy them to `panel`, column by column."""
    size, a = rows - PANEL, begin * height
    b, c, d = a + height, a + 2 * height, a + 3 * height
    copy_panel(band, height, a, size, panel)
    ba, ca, da, cb, db, dc = band[a + 1], band[a + 2], band[a + 3], band[b + 1], band[b + 2], band[c + 1]
    ra, rb, rc, rd = 1.0 / band[a], 1.0 / band[b], 1.0 / band[c], 1.0 / band[d]
    for i in range(size):
        w = ra * panel[i]
        x = rb * (panel[i + WIDEST] - ba * w)
        y = rc * (panel[i + 2 * WIDEST] - ca * w - cb * x)
        z = rd * (panel[i + 3 * WIDEST] - da * w - db * x - dc * y)
        panel[i], panel[i + WIDEST], panel[i + 2 * WIDEST], panel[i + 3 * WIDEST] = w, x, y, z
    for column in range(PANEL):
        at, begin = a + column * height + PANEL - column, column * WIDEST
        for i in range(size):
            band[at + i] = panel[begin + i]


@compiled
def _subtract(band: Array, height: int, begin: int, rows: int, panel: Array) -> None:
    """Subtract X X^T from the columns at `begin`, where X are the rows in `panel`; two columns at once."""
    for k in range(0, rows, 2):
        own, at, size = panel[k:], (begin + k) * height, rows - k - 1
        a, b, c, d = own[0], own[WIDEST], own[2 * WIDEST], own[3 * WIDEST]
        band[at] -= a * a + b * b + c * c + d * d
        own, left, right = own[1:], band[at + 1 : at + 1 + size], band[at + height : at + height + size]
        e, f, g, h = own[0], own[WIDEST], own[2 * WIDEST], own[3 * WIDEST]
        for i in range(size):
            w, x, y, z = own[i], own[i + WIDEST], own[i + 2 * WIDEST], own[i + 3 * WIDEST]
            left[i] -= a * w + b * x + c * y + d * z
            right[i] -= e * w + f * x + g * y + h * z


@compiled
def solve(first: int, last: int, bands: Array, offsets: Ints, blocks: Ints, ends: Ints, x: Array) -> None:
    """Overwrite right-hand sides x (k, n) by (L L^T)^-1 x in the bodies first:last where they are not zero."""
    for body in range(first, last):
        band, n = bands[offsets[body] : offsets[body + 1]], blocks[body + 1] - blocks[body]
        reach = ends[blocks[body] // 2 : blocks[body + 1] // 2]
        for k in range(x.shape[0]):
            own = x[k, blocks[body] : blocks[body + 1]]
            if own.any():
                _substitute(band, band.size // n, reach, own)


@compiled
def _substitute(band: Array, height: int, ends: Ints, x: Array) -> None:
    """Forward and back substitution in place, PANEL columns of L at once where there are as many."""
    n = x.size
    full = n - n % PANEL
    for j in range(0, full, PANEL):
        a = j * height
        b, c, d = a + height - 1, a + 2 * (height - 1), a + 3 * (height - 1)  # band[b + i] is entry (j + i, j + 1)
        x0 = x[j] / band[a]
        x1 = (x[j + 1] - band[a + 1] * x0) / band[b + 1]
        x2 = (x[j + 2] - band[a + 2] * x0 - band[b + 2] * x1) / band[c + 2]
        x3 = (x[j + 3] - band[a + 3] * x0 - band[b + 3] * x1 - band[c + 3] * x2) / band[d + 3]
        x[j], x[j + 1], x[j + 2], x[j + 3] = x0, x1, x2, x3
        size = ends[j // 2 + 1] - j - PANEL
        p, q, r, s, y = band[a + PANEL :], band[b + PANEL :], band[c + PANEL :], band[d + PANEL :], x[j + PANEL :]
        for i in range(size):
            y[i] -= p[i] * x0 + q[i] * x1 + r[i] * x2 + s[i] * x3
    for j in range(full, n):
        x[j] /= band[j * height]
        for i in range(1, n - j):
            x[j + i] -= band[j * height + i] * x[j]
    for j in range(n - 1, full - 1, -1):
        for i in range(1, n - j):
            x[j] -= band[j * height + i] * x[j + i]
        x[j] /= band[j * height]
    for j in range(full - PANEL, -1, -PANEL):
        a = j * height
        b, c, d = a + height - 1, a + 2 * (height - 1), a + 3 * (height - 1)
        s0, s1, s2, s3 = x[j], x[j + 1], x[j + 2], x[j + 3]
        size = ends[j // 2 + 1] - j - PANEL
        p, q, r, s, y = band[a + PANEL :], band[b + PANEL :], band[c + PANEL :], band[d + PANEL :], x[j + PANEL :]
        for i in range(size):
            s0 -= p[i] * y[i]
            s1 -= q[i] * y[i]
            s2 -= r[i] * y[i]
            s3 -= s[i] * y[i]
        x3 = s3 / band[d + 3]
        x2 = (s2 - band[c + 3] * x3) / band[c + 2]
        x1 = (s1 - band[b + 2] * x2 - band[b + 3] * x3) / band[b + 1]
        x0 = (s0 - band[a + 1] * x1 - band[a + 2] * x2 - band[a + 3] * x3) / band[a]
        x[j], x[j + 1], x[j + 2], x[j + 3] = x0, x1, x2, x3
