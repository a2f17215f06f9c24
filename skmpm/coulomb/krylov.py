"""Linear systems of Newton steps by Krylov methods: faster than sparse LU.

A contact couples with all others of its two bodies, so that the matrix consists of dense squares that overlap. Its
LU without fill (ILU(0): Meijerink & van der Vorst, Math. Comput. 31 (1977) 148-162) keeps most of the coupling that
fill would carry: BiCGStab (van der Vorst, SIAM J. Sci. Stat. Comput. 13, 1992) then takes two to ten iterations,
whether waves cross a body in a step or not. Rigid motions of bodies that hardly resist them couple all contacts:
there it takes too many, and LU is faster.
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
# Of those that an iteration has left at its limit, or where many contacts change their states: the next step begins
# with them.
ROUGH_TOLERANCE = 1e-4
LIMIT = 25  # iterations, each a fortieth of the time of an LU of 300 discs


class NotConvergedError(RuntimeError):
    """The iteration converges too slowly."""


def by_incomplete_factor(
    A: sp.csr_array,
    b: Array,
    shift: float,
    tolerance: float = TOLERANCE,
    negative: int | None = None,
) -> Array:
    """Solve (A - shift I) x = b by BiCGStab with the incomplete factors of A, whose columns ascend.

    The iteration ends where the residual is at most `tolerance` |b|, or after `LIMIT` steps. NotConvergedError is
    raised if a pivot vanishes, if fewer than `negative` are negative, so that A seems to have fewer negative
    eigenvalues, or if the residual is larger than `ROUGH_TOLERANCE` |b| in the end.
    """
    data, diagonal, x = A.data.copy(), np.zeros(b.size, dtype=np.int64), np.zeros(b.size)
    matrix, factors = (A.indptr, A.indices, A.data), (A.indptr, A.indices, data, diagonal)
    size = float(np.linalg.norm(b))
    if not _eliminate(*factors) or np.count_nonzero(data[diagonal] < 0.0) < (negative or 0):
        raise NotConvergedError
    if not _bicgstab(matrix, shift, factors, b, tolerance * size, LIMIT, x) <= ROUGH_TOLERANCE * size:
        raise NotConvergedError
    return x


@compiled
def _eliminate(indptr: Ints, indices: Ints, data: Array, diagonal: Ints) -> bool:
    """Overwrite a matrix by L and U in its pattern, and find its diagonal, that of U; false if a pivot vanishes.

    Rows of contacts between the same bodies have the same columns: up to four of them are eliminated side by side.
    """
    n, most = diagonal.size, 0
    for i in range(n):
        most = max(most, indptr[i + 1] - indptr[i])
    place, rows = np.full(n, -1, dtype=np.int32), np.zeros((most, 4))  # of columns; entries of four rows
    first = 0
    while first < n:
        begin, size = indptr[first], indptr[first + 1] - indptr[first]
        count = _same_columns(indptr, indices, first)
        for e in range(size):
            place[indices[begin + e]] = e
            for r in range(4):
                rows[e, r] = data[begin + r * size + e] if r < count else 0.0
        before = place[first]  # number of columns left of the diagonal
        for e in range(before):
            k, own = indices[begin + e], rows[e]
            for r in range(4):
                own[r] /= data[diagonal[k]]
            a, b, c, d = own[0], own[1], own[2], own[3]
            right, values = indices[diagonal[k] + 1 : indptr[k + 1]], data[diagonal[k] + 1 : indptr[k + 1]]
            for f in range(right.size):
                at = place[right[f]]
                if at >= 0:
                    value, row = values[f], rows[at]
                    row[0] -= a * value
                    row[1] -= b * value
                    row[2] -= c * value
                    row[3] -= d * value
        for r in range(count):
            for q in range(r):
                rows[before + q, r] /= rows[before + q, q]
                for e in range(before + q + 1, size):
                    rows[e, r] -= rows[before + q, r] * rows[e, q]
            if rows[before + r, r] == 0.0:
                return False
            diagonal[first + r] = begin + r * size + before + r
            for e in range(size):
                data[begin + r * size + e] = rows[e, r]
        for e in range(size):
            place[indices[begin + e]] = -1
        first += count
    return True


@compiled
def _same_columns(indptr: Ints, indices: Ints, first: int) -> int:
    """How many rows from one on, up to four, have its columns."""
    begin, size, count = indptr[first], indptr[first + 1] - indptr[first], 1
    while count < 4 and first + count < indptr.size - 1:
        other = indptr[first + count]
        if indptr[first + count + 1] - other != size:
            return count
        for e in range(size):
            if indices[begin + e] != indices[other + e]:
                return count
        count += 1
    return count


@compiled
def _solve(indptr: Ints, indices: Ints, data: Array, diagonal: Ints, b: Array, x: Array) -> None:
    """Write the solution for these factors to x."""
    for i in range(b.size):
        own, values = indices[indptr[i] : diagonal[i]], data[indptr[i] : diagonal[i]]
        total = b[i]
        for e in range(own.size):
            total -= values[e] * x[own[e]]
        x[i] = total
    for i in range(b.size - 1, -1, -1):
        own, values = indices[diagonal[i] + 1 : indptr[i + 1]], data[diagonal[i] + 1 : indptr[i + 1]]
        total = x[i]
        for e in range(own.size):
            total -= values[e] * x[own[e]]
        x[i] = total / data[diagonal[i]]


@compiled
def _bicgstab(
    matrix: tuple[Ints, Ints, Array],
    shift: float,
    factors: tuple[Ints, Ints, Array, Ints],
    b: Array,
    enough: float,
    limit: int,
    x: Array,
) -> float:
    """Add the solution to x, zero before, and return the norm of its residual, after at most `limit` steps."""
    n, r, p, v = b.size, b.copy(), b.copy(), np.zeros(b.size)
    y, t, z = np.empty(n), np.empty(n), np.empty(n)
    rho = alpha = omega = 1.0
    for count in range(1, limit + 1):
        if _norm(r) <= enough:
            break
        before, rho = rho, _dot(b, r)
        if abs(rho) < 1e-300 or abs(omega) < 1e-300:
            break
        if count > 1:
            beta = rho / before * (alpha / omega)
            for i in range(n):
                p[i] = r[i] + beta * (p[i] - omega * v[i])
        _solve(*factors, p, y)
        times(*matrix, shift, y, v)
        along = _dot(b, v)
        if abs(along) < 1e-300:
            break
        alpha = rho / along
        for i in range(n):
            r[i] -= alpha * v[i]
            x[i] += alpha * y[i]
        if _norm(r) <= enough:
            break
        _solve(*factors, r, z)
        times(*matrix, shift, z, t)
        omega = _dot(t, r) / max(_dot(t, t), 1e-300)
        for i in range(n):
            x[i] += omega * z[i]
            r[i] -= omega * t[i]
    return _norm(r)


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
    x, failed = gmres(shifted, b, rtol=TOLERANCE, restart=restart, maxiter=2, M=inverse)
    if failed:
        raise NotConvergedError
    return np.asarray(x)
