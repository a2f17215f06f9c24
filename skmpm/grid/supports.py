"""Supports without Lagrange multipliers: elimination of unknowns by the constraints G v = B v_prescribed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpstrf
from scipy.sparse.csgraph import connected_components, reverse_cuthill_mckee

from skmpm.arrays import Array, Bools, Ints
from skmpm.linear import Linear, Solver

# Pivots of G'G below this fraction of the largest belong to nearly redundant constraints. At 1e-2 a cantilever at 45
# degrees to the grid is 1.3 % too stiff instead of 4 % with all constraints (docs/developers/architecture.md).
PIVOT_TOLERANCE = 1e-2
# Cells between free points and the nodes inside of a held area that move as it is prescribed. Nearer ones follow from
# the constraints, which leave out those that are nearly redundant.
LAYERS = 3
NO_ENTRY = 1e-13  # entries of the elimination matrices below this, of order one otherwise, are dropped


@dataclass(frozen=True)
class Elimination:
    """The solutions of G v = B p for prescribed velocities p (k,): v = T y + prescription p for any y (n,)."""

    T: sp.csr_array  # (n, n) identity on the remaining unknowns, with empty columns for the eliminated ones
    prescription: sp.csr_array  # (n, k)
    fixed: Ints  # the eliminated unknowns
    holds: Bools  # (bodies,) whether the constraints suppress all rigid motions of the body

    def admissible(self, v: Array, prescribed: Array) -> Array:
        """The velocity (n,) that equals v in the remaining unknowns and obeys the prescribed velocities (k,)."""
        return np.asarray(self.T @ v + self.prescription @ prescribed)

    def factorised(self, linear: Linear, A: sp.bsr_array, blocks: Ints, rigid_motions: Array) -> Solver:
        """The solver `linear` for A on the remaining unknowns; raises LinAlgError if `linear` does."""
        motions = rigid_motions.copy()
        motions[self.fixed] = 0.0
        reduced, order = self.reduced(A, blocks)
        return Supported(sp.csr_array(self.T[:, order]), linear(reduced, blocks, motions[order]))

    def reduced(self, A: sp.bsr_array, blocks: Ints) -> tuple[sp.bsr_array, Ints]:
        """A on the remaining unknowns, which are ordered (n,) within bodies to keep the band narrow.

        Bodies without supports keep their blocks and the order of their unknowns.
        """
        supported = np.zeros(blocks.size - 1, dtype=bool)
        supported[np.searchsorted(blocks, self.fixed, side="right") - 1] = True
        own = np.repeat(supported, np.diff(blocks) // 2)
        held = np.flatnonzero(np.repeat(own, 2))
        part, remaining = _of_nodes(A, own).tocsr(), self.T[held][:, held]
        diagonal = np.zeros(A.shape[0])
        diagonal[self.fixed] = A.diagonal().mean()
        reduced = (sp.csr_array(remaining.T @ part @ remaining) + sp.diags_array(diagonal[held])).tobsr((2, 2))
        order = narrowing(reduced, np.append(0, np.cumsum(np.diff(blocks)[supported])))
        every = np.arange(A.shape[0])
        if order is not None:
            reduced = sp.csr_array(reduced.tocsr()[order][:, order]).tobsr((2, 2))
            every[held] = held[order]
        return _with_nodes(A, own, reduced), every


def _of_nodes(A: sp.bsr_array, own: Bools) -> sp.bsr_array:
    """The rows and columns of A of some nodes (nodes,), which no entry couples with others."""
    entries, number = np.repeat(own, np.diff(A.indptr)), np.cumsum(own) - 1
    indptr = np.append(0, np.cumsum(np.diff(A.indptr)[own]))
    size = 2 * int(own.sum())
    return sp.bsr_array((A.data[entries], number[A.indices[entries]], indptr), shape=(size, size))


def _with_nodes(A: sp.bsr_array, own: Bools, part: sp.bsr_array) -> sp.bsr_array:
    """A with these rows and columns of some nodes (nodes,)."""
    count, nodes = np.diff(A.indptr), np.flatnonzero(own)
    others = np.repeat(~own, count)
    count[own] = np.diff(part.indptr)
    indptr = np.append(0, np.cumsum(count))
    data, indices = np.empty((indptr[-1], 2, 2)), np.empty(indptr[-1], dtype=A.indices.dtype)
    there = np.repeat(own, count)
    data[there], indices[there] = part.data, nodes[part.indices]
    data[~there], indices[~there] = A.data[others], A.indices[others]
    return sp.bsr_array((data, indices, indptr), shape=A.shape)


def narrowing(A: sp.bsr_array, blocks: Ints) -> Ints | None:
    """An order of the unknowns (n,) within bodies that reduces the bandwidth of A, or None if none is found.

    Elimination couples the unknowns along a supported edge, which widens the band if the rows of nodes cross this
    edge. The reverse Cuthill-McKee algorithm (George, 1971) orders the remaining unknowns.
    """
    nodes = A.shape[0] // 2
    pattern = sp.csr_array((np.ones(A.indices.size), A.indices, A.indptr), shape=(nodes, nodes))
    order = reverse_cuthill_mckee(pattern, symmetric_mode=True).astype(np.int64)
    body = np.searchsorted(blocks, 2 * np.arange(nodes), side="right")
    order = order[np.argsort(body[order], kind="stable")]
    position = np.empty(nodes, dtype=np.int64)
    position[order] = np.arange(nodes)
    row = np.repeat(np.arange(nodes), np.diff(A.indptr))
    if np.abs(position[row] - position[A.indices]).max() >= np.abs(row - A.indices).max():
        return None
    return np.stack([2 * order, 2 * order + 1], axis=1).ravel()


@dataclass(frozen=True)
class Supported:
    """A solver whose solutions obey the homogeneous constraints of the supports."""

    T: sp.csr_array
    inner: Solver

    @property
    def name(self) -> str:
        """Name of the solver for the remaining unknowns."""
        return self.inner.name

    def __call__(self, b: Array, /) -> Array:
        """T (T'AT)^-1 T' b."""
        return np.asarray(self.T @ self.inner(self.T.T @ b))

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """H T (T'AT)^-1 T'H'."""
        return self.inner.delassus(sp.csr_array(H @ self.T))


def inner_nodes(interpolation: sp.csr_array, held: Bools) -> Bools:
    """Nodes that move held points (points,) alone and lie more than `LAYERS` cells away from all others, (nodes,)."""
    moves = sp.csr_array(
        (np.ones(interpolation.nnz), interpolation.indices, interpolation.indptr), interpolation.shape
    )
    near = np.asarray(moves.T @ ~held) > 0.0
    for _ in range(LAYERS):
        near = np.asarray(moves.T @ (moves @ near)) > 0.0
    return np.asarray(moves.T @ held > 0.0) & ~near


def eliminate(
    G: sp.csr_array, B: sp.csr_array, known: sp.csr_array, blocks: Ints, rigid_motions: Array
) -> Elimination:
    """Eliminate unknowns by the constraints G v = B p, with G (m, n), B (m, k) and prescribed velocities p (k,).

    The rows of `known` (n, k) that have entries are unknowns inside of held areas, `known` p.

    Constraints may be redundant, as those of many points in one cell are. A Cholesky factorisation of G'G with
    diagonal pivoting (LAPACK pstrf) selects the unknowns to eliminate, largest weights first, and stops where the
    remaining constraints are nearly redundant. Otherwise a boundary at an angle to the grid would fix all nodes of
    the cells it cuts (Bechet, Moes & Wohlmuth, IJNME 78, 2009), and a cantilever at 45 degrees to the grid would be
    4 % too stiff at 8 cells over its depth (docs/developers/architecture.md). Connected sets of constraints are
    eliminated one after the other.
    """
    n, holds = G.shape[1], _holds(G, blocks, rigid_motions)
    inner = np.diff(known.indptr) > 0
    if inner.any():
        G, B = sp.csr_array(G @ _kept(np.where(inner, 0.0, 1.0))), sp.csr_array(B - G @ known)
        G.eliminate_zeros()
    gram, right = sp.csr_array(G.T @ G), sp.csr_array(G.T @ B)
    parts = [_pivoted(gram, right, unknowns) for unknowns in _connected(gram)]
    fixed = np.concatenate([np.flatnonzero(inner), *(pivots for pivots, *_ in parts)])
    stays = np.ones(n)
    stays[fixed] = 0.0
    depend = _scattered([(pivots, others, D) for pivots, others, D, _ in parts], (n, n))
    every = np.arange(B.shape[1])
    prescription = _scattered([(pivots, every, prescribed) for pivots, _, _, prescribed in parts], (n, every.size))
    return Elimination(_kept(stays) - depend, sp.csr_array(prescription + known), fixed, holds)


def _kept(stays: Array) -> sp.csr_array:
    """Sparse diagonal matrix of `stays`, without stored zeros."""
    kept = np.flatnonzero(stays)
    return sp.csr_array((stays[kept], (kept, kept)), shape=(stays.size, stays.size))


def _scattered(parts: list[tuple[Ints, Ints, Array]], shape: tuple[int, int]) -> sp.csr_array:
    """Sparse matrix from dense blocks (rows, columns, values), without entries below `NO_ENTRY`."""
    if not parts:
        return sp.csr_array(shape)
    where = [np.nonzero(np.abs(values) > NO_ENTRY) for _, _, values in parts]
    row = [rows[at[0]] for (rows, _, _), at in zip(parts, where, strict=True)]
    column = [columns[at[1]] for (_, columns, _), at in zip(parts, where, strict=True)]
    data = [values[at] for (_, _, values), at in zip(parts, where, strict=True)]
    return sp.csr_array((np.concatenate(data), (np.concatenate(row), np.concatenate(column))), shape=shape)


def _connected(gram: sp.csr_array) -> Iterator[Ints]:
    """The unknowns of each connected set of constraints."""
    touched = np.flatnonzero(np.diff(gram.indptr))
    if touched.size == 0:
        return
    sets, label = connected_components(gram[touched][:, touched], directed=False)
    order = np.argsort(label, kind="stable")
    yield from np.split(touched[order], np.searchsorted(label[order], np.arange(1, sets)))


def _pivoted(gram: sp.csr_array, right: sp.csr_array, unknowns: Ints) -> tuple[Ints, Ints, Array, Array]:
    """(pivots, others, D, P): the eliminated unknowns are v[pivots] = P p - D v[others] for prescribed p (k,)."""
    dense = gram[unknowns][:, unknowns].toarray()
    factor, pivot, rank, _ = dpstrf(dense, tol=PIVOT_TOLERANCE * float(dense.diagonal().max()))
    order = unknowns[pivot - 1]
    upper = factor[:rank, :rank]
    prescribed = solve_triangular(upper, right[order[:rank]].toarray(), trans="T")
    dependence = solve_triangular(upper, factor[:rank, rank:])
    return order[:rank], order[rank:], dependence, solve_triangular(upper, prescribed)


def _holds(G: sp.csr_array, blocks: Ints, rigid_motions: Array) -> Bools:
    """Whether the constraints suppress all rigid motions R of each body: smallest eigenvalue of (G R)'(G R)."""
    bodies = blocks.size - 1
    body = np.repeat(np.arange(bodies), np.diff(blocks))
    size = np.stack([np.sqrt(np.bincount(body, m**2, bodies)) for m in rigid_motions.T])
    unit = rigid_motions / np.maximum(size, 1e-300).T[body]
    moved = G @ unit
    owner = body[G.indices[G.indptr[:-1]]]
    products = moved[:, :, None] * moved[:, None, :]
    matrices = np.zeros((bodies, 3, 3))
    np.add.at(matrices, owner, products)
    values = np.linalg.eigvalsh(matrices)
    return np.asarray(values[:, 0] > 1e-10 * np.maximum(values[:, 2], 1e-300))
