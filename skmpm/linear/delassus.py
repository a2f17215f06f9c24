"""The Delassus operator of boundary points: their velocities under impulses on them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.arrays import Array, Bools
from skmpm.compiled import compiled
from skmpm.linear.solver import Solver
from skmpm.parallel import over_bodies

Ints = NDArray[np.integer]


@dataclass(frozen=True)
class Delassus:
    """S = R A^-1 R^T of the contact points (boundary points or grid nodes), R = kron(base, I), for a factorised A.

    From iterate to iterate constraints combine different contact points, while these points and A stay the same. S
    consists of one square for every body. It is computed for the contact points of a body in use, and computed again
    when constraints use others. With `whole` it is computed for all contact points of a body at once, so that S does
    not depend, not even by round-off, on earlier contacts.

    Attributes
    ----------
    solver : the factorised A
    base : (m, nodes)
    owner : (m,) body of each contact point
    whole : whether S has all contact points of a body at once
    squares : S of the contact points in `known`, body after body, each row after row
    known : (m,) whether S contains the contact point
    """

    solver: Solver
    base: sp.csr_array
    owner: Ints
    whole: bool
    squares: Array
    known: Bools

    @staticmethod
    def with_factor(
        solver: Solver, base: sp.csr_array, owner: Ints, points: Bools | None = None, *, whole: bool = False
    ) -> Delassus:
        """The Delassus operator for a solver, with S of some contact points (m,), by default of none."""
        none = Delassus(solver, base, owner, whole, np.zeros(0), np.zeros(base.shape[0], dtype=bool))
        return none if points is None else none._with(points)

    def between(self, left: sp.csr_array, right: sp.csr_array) -> tuple[sp.csr_array, Delassus]:
        """The product left S right^T for constraints `left` and `right` on the contact points, both (k, 2 m).

        Also returns the operator with S of all contact points in these constraints.
        """
        wanted = np.zeros_like(self.known)
        wanted[left.indices // 2] = wanted[right.indices // 2] = True
        found = self._with(wanted)
        return _product(left, found.squares, right, np.repeat(np.where(found.known, self.owner, -1), 2)), found

    def _with(self, wanted: Bools) -> Delassus:
        """The operator with S of these contact points (m,), too."""
        responding = np.diff(self.base.indptr) > 0  # points of rigid bodies do not respond
        new = np.flatnonzero(wanted & responding & ~self.known)
        if new.size == 0:
            return self
        again = np.zeros(int(self.owner.max()) + 1, dtype=bool)
        again[self.owner[new]] = True
        known = self.known.copy()
        known[new] = True
        if self.whole:
            known |= again[self.owner] & responding
        squares = np.empty(int(self._sizes(known).sum()))
        chosen = np.repeat(again, self._sizes(known))
        squares[chosen] = self._of(np.flatnonzero(known & again[self.owner]))
        squares[~chosen] = self.squares[np.repeat(~again, self._sizes(self.known))]
        return replace(self, squares=squares, known=known)

    def _sizes(self, known: Bools) -> Ints:
        """Entries of the square of each body for known contact points (m,), (bodies,)."""
        return np.asarray((2 * np.bincount(self.owner[known], minlength=int(self.owner.max()) + 1)) ** 2)

    def _of(self, points: Ints) -> Array:
        """The squares of some contact points."""
        points = points[np.argsort(self.owner[points], kind="stable")]
        rows = self.base[np.repeat(points, 2)]
        component = np.repeat(np.tile([0, 1], points.size), np.diff(rows.indptr))
        R = sp.csr_array(
            (rows.data, 2 * rows.indices + component, rows.indptr), shape=(2 * points.size, 2 * rows.shape[1])
        )
        return _squares(self.solver.delassus(R), np.repeat(self.owner[points], 2))


def _squares(S: sp.csr_array, body: Ints) -> Array:
    """The squares of the bodies of the rows of S (k,), which ascend, each row after row.

    Rows of points that supports hold are empty.
    """
    count = np.bincount(body)
    if S.nnz == int((count**2).sum()):
        return np.asarray(S.data)
    begins, first = (np.append(0, np.cumsum(sizes)) for sizes in (count**2, count))
    row = np.repeat(np.arange(body.size), np.diff(S.indptr))
    b = body[row]
    squares = np.zeros(begins[-1])
    squares[begins[b] + (row - first[b]) * count[b] + S.indices - first[b]] = S.data
    return squares


def _product(left: sp.csr_array, squares: Array, right: sp.csr_array, owner: Ints) -> sp.csr_array:
    """The product left S right^T of rows that touch at most two bodies each, columns ascending; S is symmetric.

    `owner` (2 m,) is the body of every row of S, -1 where there is none. The products of a body are dense.
    """
    bodies = int(owner.max(initial=-1)) + 1
    pairs = [_bodies_of_rows(rows.indptr, rows.indices, owner) for rows in (left, right)]
    (points, of_left, of_right) = (_by_body(of, bodies) for of in (owner[:, None], *pairs))
    begins = np.append(0, np.cumsum(np.diff(of_left[0]) * np.diff(of_right[0])))
    square_begins, blocks = np.append(0, np.cumsum(np.diff(points[0]) ** 2)), np.zeros(begins[-1])
    arguments = (
        *(left.indptr, left.indices, left.data, square_begins, squares, right.indptr, right.indices, right.data),
        *(owner, *points, *of_left, *of_right, begins, blocks),
    )
    over_bodies(lambda first, last: _products(first, last, *arguments), begins)
    most = int(np.append(np.diff(of_right[0]), 0)[pairs[0]].sum())  # -1, no body, is the last: none
    indptr, indices, data = np.zeros(left.shape[0] + 1, np.int32), np.empty(most, np.int32), np.empty(most)
    filled = _merge(pairs[0], *of_right, begins, blocks, indptr, indices, data)
    return sp.csr_array((data[:filled], indices[:filled], indptr), shape=(left.shape[0], right.shape[0]))


def _by_body(bodies: Ints, count: int) -> tuple[Ints, Ints]:
    """Offsets (count + 1,) and the rows that touch each body, ascending, body after body."""
    number = np.bincount(bodies[bodies >= 0], minlength=count)
    begins, rows = np.append(0, np.cumsum(number)), np.empty(int(number.sum()), dtype=np.int64)
    _rows_by_body(bodies, begins, rows)
    return begins, rows


@compiled
def _bodies_of_rows(indptr: Ints, indices: Ints, owner: Ints) -> NDArray[np.int64]:
    """The two bodies that each row touches, the smaller first, -1 where there are fewer, (k, 2)."""
    found = np.full((indptr.size - 1, 2), -1)
    for i in range(indptr.size - 1):
        for e in range(indptr[i], indptr[i + 1]):
            b = owner[indices[e]]
            if b >= 0 and b != found[i, 0] and b != found[i, 1]:
                if found[i, 1] >= 0:
                    raise ValueError("a row touches more than two bodies")
                found[i, 0], found[i, 1] = (
                    (b, found[i, 0]) if found[i, 0] < 0 or b < found[i, 0] else (found[i, 0], b)
                )
    return found


@compiled
def _rows_by_body(bodies: Ints, begins: Ints, rows: Ints) -> None:
    """The rows that touch each body, ascending, body after body."""
    filled = begins.copy()
    for i in range(bodies.shape[0]):
        for b in bodies[i]:
            if b >= 0:
                rows[filled[b]] = i
                filled[b] += 1


@compiled
def _products(
    first: int,
    last: int,
    left_indptr: Ints,
    left_indices: Ints,
    left: Array,
    square_begins: Ints,
    squares: Array,
    right_indptr: Ints,
    right_indices: Ints,
    right: Array,
    owner: Ints,
    point_begins: Ints,
    points: Ints,
    left_begins: Ints,
    left_rows: Ints,
    right_begins: Ints,
    right_rows: Ints,
    begins: Ints,
    blocks: Array,
) -> None:
    """Dense products of the rows that touch a body with its part of S, from blocks[begins[body]], which is zero."""
    position = np.empty(owner.size, dtype=np.int64)
    for body in range(first, last):
        own = points[point_begins[body] : point_begins[body + 1]]
        rows, columns = left_rows[left_begins[body] : left_begins[body + 1]], right_rows[right_begins[body] :]
        width = right_begins[body + 1] - right_begins[body]
        if rows.size == 0 or width == 0:
            continue
        for k in range(own.size):
            position[own[k]] = k
        S = squares[square_begins[body] : square_begins[body + 1]].reshape((own.size, own.size))
        turned, total = np.empty((own.size, width)), np.empty(own.size)
        for j in range(width):
            total[:] = 0.0
            for e in range(right_indptr[columns[j]], right_indptr[columns[j] + 1]):
                if owner[right_indices[e]] == body:
                    _add(right[e], S[position[right_indices[e]]], total)
            for k in range(own.size):
                turned[k, j] = total[k]
        block = blocks[begins[body] : begins[body + 1]].reshape((rows.size, width))
        for i in range(rows.size):
            for e in range(left_indptr[rows[i]], left_indptr[rows[i] + 1]):
                if owner[left_indices[e]] == body:
                    _add(left[e], turned[position[left_indices[e]]], block[i])


@compiled
def _add(factor: float, x: Array, y: Array) -> None:
    """Add factor x to y."""
    for k in range(y.size):
        y[k] += factor * x[k]


@compiled
def _merge(
    bodies: Ints,
    right_begins: Ints,
    right_rows: Ints,
    begins: Ints,
    blocks: Array,
    indptr: Ints,
    indices: Ints,
    data: Array,
) -> int:
    """Write the sums of the products of both bodies of each row, columns ascending; return the number of entries."""
    filled, end = np.zeros(begins.size, dtype=np.int64), 0
    for i in range(bodies.shape[0]):
        a, b = bodies[i, 0], bodies[i, 1]
        first, last = (right_begins[a], right_begins[a + 1]) if a >= 0 else (0, 0)
        other, stop = (right_begins[b], right_begins[b + 1]) if b >= 0 else (0, 0)
        at = begins[a] + filled[a] * (last - first) - first
        and_at = begins[b] + filled[b] * (stop - other) - other
        while first < last or other < stop:
            j = right_rows[first] if first < last else right_rows[other]
            if other < stop:
                j = min(j, right_rows[other])
            total = 0.0
            if first < last and right_rows[first] == j:
                total += blocks[at + first]
                first += 1
            if other < stop and right_rows[other] == j:
                total += blocks[and_at + other]
                other += 1
            indices[end], data[end] = j, total
            end += 1
        indptr[i + 1] = end
        filled[a] += 1
        filled[b] += 1
    return end
