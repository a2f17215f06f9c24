"""Linear systems of Newton steps by Krylov methods: faster than sparse LU where bodies hardly couple contacts.

In steps that waves take to cross a few cells, the impulse at one contact of a body hardly moves the others. BiCGStab
(van der Vorst, SIAM J. Sci. Stat. Comput. 13, 1992) with the inverses of the blocks of each pair of bodies then takes
a dozen iterations whatever the number of bodies; in long steps it takes hundreds, which its first few show.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, gmres

from skmpm.arrays import Array
from skmpm.compiled import compiled

Ints = NDArray[np.integer]

# Of residuals, relative to those of the Newton step before: the next step reduces the rest. Of 1e-10, 1e-9 and 1e-7
# the last takes the least time, but moves bodies by 5e-10 cells; round-off leaves 1e-12 to 1e-11.
TOLERANCE = 1e-9
# Of 300 and 3,000 discs in steps of 8 us the residual falls to 1e-8 in 8 to 14 iterations, each a fortieth of the
# time of an LU; where it has not fallen to a hundredth after 6, it takes at least 30.
PROBED, PROBED_RESIDUAL, LIMIT = 6, 1e-2, 40


class NotConvergedError(RuntimeError):
    """The iteration converges too slowly."""


def by_blocks(
    A: sp.csr_array, b: Array, shift: float, label: Ints, accuracy: float = 0.0, tolerance: float = TOLERANCE
) -> Array:
    """Solve (A - shift I) x = b by BiCGStab with the inverses of the blocks of rows with the same label (m,).

    Labels are small integers. The residual is at most `tolerance` |b|, or `accuracy` if that is more.
    """
    starts = np.append(0, np.cumsum(np.bincount(label)))
    order = np.argsort(label, kind="stable")
    offsets = np.append(0, np.cumsum(np.diff(starts) ** 2))
    inverses, x, size = np.empty(offsets[-1]), np.zeros(b.size), float(np.linalg.norm(b))
    _invert(A.indptr, A.indices, A.data, label, order, starts, offsets, inverses)
    enough, probed = max(tolerance * size, accuracy), max(PROBED_RESIDUAL * size, accuracy)
    matrix, blocks = (A.indptr, A.indices, A.data), (order, starts, offsets, inverses)
    if not _bicgstab(matrix, shift, blocks, b, enough, probed, x):
        raise NotConvergedError
    return x


@compiled
def _bicgstab(
    matrix: tuple[Ints, Ints, Array],
    shift: float,
    blocks: tuple[Ints, Ints, Ints, Array],
    b: Array,
    enough: float,
    probed: float,
    x: Array,
) -> bool:
    """Add the solution to x, zero before; false where the iteration breaks down or converges too slowly."""
    n, r, p, v = b.size, b.copy(), b.copy(), np.zeros(b.size)
    y, t, z = np.empty(n), np.empty(n), np.empty(n)
    rho = alpha = omega = 1.0
    for count in range(1, LIMIT + 1):
        if _norm(r) < enough:
            return True
        before, rho = rho, _dot(b, r)
        if abs(rho) < 1e-300 or abs(omega) < 1e-300:
            return False
        if count > 1:
            beta = rho / before * (alpha / omega)
            for i in range(n):
                p[i] = r[i] + beta * (p[i] - omega * v[i])
        _apply(*blocks, p, y)
        times(*matrix, shift, y, v)
        along = _dot(b, v)
        if abs(along) < 1e-300:
            return False
        alpha = rho / along
        for i in range(n):
            r[i] -= alpha * v[i]
            x[i] += alpha * y[i]
        if _norm(r) < enough:
            return True
        _apply(*blocks, r, z)
        times(*matrix, shift, z, t)
        omega = _dot(t, r) / max(_dot(t, t), 1e-300)
        for i in range(n):
            x[i] += omega * z[i]
            r[i] -= omega * t[i]
        if count == PROBED and not _norm(r) <= probed:
            return False
    return _norm(r) < enough


@compiled
def times(indptr: Ints, indices: Ints, data: Array, shift: float, x: Array, y: Array) -> None:
    """Write (A - shift I) x to y."""
    for i in range(y.size):
        own, values = indices[indptr[i] : indptr[i + 1]], data[indptr[i] : indptr[i + 1]]
        total = 0.0
        for e in range(own.size):
            total += values[e] * x[own[e]]
        y[i] = total - shift * x[i]


@compiled
def _dot(x: Array, y: Array) -> float:
    """Scalar product."""
    total = 0.0
    for i in range(x.size):
        total += x[i] * y[i]
    return total


@compiled
def _norm(x: Array) -> float:
    """Euclidean norm."""
    return float(np.sqrt(_dot(x, x)))


def by_known_factor(
    A: sp.csr_array,
    b: Array,
    shift: float,
    rows: Ints,
    factor: Callable[[Array], Array],
    of: Ints,
    changes: int,
    accuracy: float = 0.0,
) -> Array:
    """Solve (A - shift I) x = b by GMRES with the inverse of a matrix that differs from A by few rows and columns.

    Both are parts of one system, A that of `rows` and the factorised matrix that of the rows `of`. The preconditioner
    is the identity in rows that only A has. Each of the `changes` changes the matrix by one row and one column.
    """
    every = np.zeros(int(max(rows.max(), of.max())) + 1)

    def apply(x: Array) -> Array:
        every[:] = 0.0
        every[rows] = x.ravel()
        every[of] = factor(every[of])
        return every[rows]

    inverse, restart = LinearOperator(A.shape, matvec=apply), 2 * changes + 3
    shifted = LinearOperator(A.shape, matvec=lambda x: A @ x - shift * x)
    x, failed = gmres(shifted, b, rtol=TOLERANCE, atol=accuracy, restart=restart, maxiter=2, M=inverse)
    if failed:
        raise NotConvergedError
    return np.asarray(x)


@compiled
def _invert(
    indptr: Ints, indices: Ints, data: Array, label: Ints, order: Ints, starts: Ints, offsets: Ints, inverses: Array
) -> None:
    """The inverse of each block, whose rows are order[starts[b]:starts[b + 1]]."""
    position = np.empty(label.size, dtype=np.int64)
    for b in range(starts.size - 1):
        rows = order[starts[b] : starts[b + 1]]
        size = rows.size
        for i in range(size):
            position[rows[i]] = i
        block = inverses[offsets[b] : offsets[b + 1]].reshape((size, size))
        block[:] = 0.0
        for i in range(size):
            own, values = indices[indptr[rows[i]] : indptr[rows[i] + 1]], data[indptr[rows[i]] : indptr[rows[i] + 1]]
            for e in range(own.size):
                if label[own[e]] == b:
                    block[i, position[own[e]]] = values[e]
        _invert_block(block)


@compiled
def _invert_block(A: Array) -> None:
    """Overwrite a small matrix by its inverse (Gauss and Jordan, with exchanges of rows)."""
    n = A.shape[0]
    exchanged = np.empty(n, dtype=np.int64)
    for k in range(n):
        p = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[p, k]):
                p = i
        if A[p, k] == 0.0:
            raise np.linalg.LinAlgError("Matrix is singular to machine precision.")
        exchanged[k] = p
        for j in range(n):
            A[k, j], A[p, j] = A[p, j], A[k, j]
        inverse, A[k, k] = 1.0 / A[k, k], 1.0
        pivot = A[k]
        for j in range(n):
            pivot[j] *= inverse
        for i in range(n):
            if i != k:
                row, factor = A[i], A[i, k]
                row[k] = 0.0
                for j in range(n):
                    row[j] -= factor * pivot[j]
    for k in range(n - 1, -1, -1):
        p = exchanged[k]
        for i in range(n):
            A[i, k], A[i, p] = A[i, p], A[i, k]


@compiled
def _apply(order: Ints, starts: Ints, offsets: Ints, inverses: Array, x: Array, y: Array) -> None:
    """The products of the inverses of blocks with the rows of x."""
    own = np.empty(x.size)
    for b in range(starts.size - 1):
        rows = order[starts[b] : starts[b + 1]]
        size, block = rows.size, inverses[offsets[b] : offsets[b + 1]]
        for i in range(size):
            own[i] = x[rows[i]]
        for i in range(size):
            row, total = block[i * size : (i + 1) * size], 0.0
            for j in range(size):
                total += row[j] * own[j]
            y[rows[i]] = total
