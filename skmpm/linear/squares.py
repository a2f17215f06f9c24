"""Rows of the Delassus operator of bodies whose factor is that of `cholesky`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.compiled import compiled
from skmpm.linear.cholesky import PANEL, WIDEST, copy_panel

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


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
