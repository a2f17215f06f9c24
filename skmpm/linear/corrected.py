"""Solvers for matrices that differ from a factorised one: by a low rank, by springs between bodies, by rotations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import count

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from skmpm.arrays import Array, Ints
from skmpm.compiled import compiled
from skmpm.linear.solver import Solver

SOFT = 1e-12  # of the stiffness of a spring: what is less, in a direction, is round-off


@dataclass(frozen=True)
class LowRank:
    """The inverse A^-1 + Z G_b Z^T, with the rows of Z of one body b and a small matrix G_b for that body.

    `without_added_mass` makes it from a solver for a matrix that is positive definite.

    Attributes
    ----------
    solver : for A
    blocks : (bodies + 1,) first unknown of each body
    Z : (2 nodes, k)
    G : (bodies, k, k); zero for bodies without correction
    """

    solver: Solver
    blocks: Ints
    Z: Array
    G: Array

    @property
    def name(self) -> str:
        """Name of the solver for A."""
        return self.solver.name

    def __call__(self, b: Array, /) -> Array:
        """The solution for b (n,) or (n, m)."""
        x = np.ascontiguousarray(self.solver(b))
        _add_correction(self.blocks, self.Z, self.G, b.reshape(b.shape[0], -1), x.reshape(b.shape[0], -1))
        return x

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """The Delassus operator of rows H that touch one body each; dense within a body."""
        W = sp.csr_array(self.solver.delassus(H), copy=True)
        body_of_row = np.zeros(H.shape[0], dtype=np.int64)
        filled = np.flatnonzero(np.diff(H.indptr))
        body_of_row[filled] = np.searchsorted(self.blocks, H.indices[H.indptr[filled]], side="right") - 1
        response = np.asarray(H @ self.Z)
        _add_products(W.indptr, W.indices, np.einsum("rk,rkl->rl", response, self.G[body_of_row]), response, W.data)
        return W


def without_added_mass(solver: Solver, blocks: Ints, added: Array, mass: Array, m: Array | None = None) -> LowRank:
    """Solver for A + c (M - M T (T^T M T)^-1 T^T M), T the translations of a body, from a solver for A + c M.

    `added` (bodies,) is c times the mass of a body, `mass` (bodies,) that in M [kg/m]; where it is zero,
    translations keep c M. Translations store no energy, A T = M T. Hence (A + c M) T = (1 + c) M T, and by
    Woodbury's formula the inverse is (A + c M)^-1 + c / (1 + c) T (T^T M T)^-1 T^T. With `m` (2 nodes,), on the
    velocities w with m^T w = 0 in every body in which m, orthogonal to translations, does not vanish: less z z^T /
    m^T z with z = (A + c M)^-1 m.
    """
    Z, inertia = np.tile(np.eye(2), (int(blocks[-1]) // 2, 1)), np.maximum(mass, 1e-300)
    G = np.zeros((mass.size, 3, 3))
    G[:, 0, 0] = G[:, 1, 1] = np.where(mass > 0.0, added / (inertia + added) / inertia, 0.0)
    if m is None:
        return LowRank(solver, blocks, Z, G[:, :2, :2])
    z = solver(m)
    product = np.bincount(np.repeat(np.arange(mass.size), np.diff(blocks)), m * z, mass.size)
    G[product > 0.0, 2, 2] = -1.0 / product[product > 0.0]
    return LowRank(solver, blocks, np.column_stack([Z, z]), G)


@compiled
def _add_correction(blocks: Ints, Z: Array, G: Array, b: Array, x: Array) -> None:
    """Add Z G Z^T b of every body to x, both (n, m)."""
    k = Z.shape[1]
    products, weights = np.zeros(k), np.zeros(k)
    for body in range(blocks.size - 1):
        for column in range(b.shape[1]):
            products[:] = 0.0
            for i in range(blocks[body], blocks[body + 1]):
                for j in range(k):
                    products[j] += Z[i, j] * b[i, column]
            for j in range(k):
                weights[j] = 0.0
                for l in range(k):  # noqa: E741
                    weights[j] += G[body, j, l] * products[l]
            for i in range(blocks[body], blocks[body + 1]):
                for j in range(k):
                    x[i, column] += Z[i, j] * weights[j]


@compiled
def _add_products(
    indptr: NDArray[np.integer], indices: NDArray[np.integer], left: Array, right: Array, data: Array
) -> None:
    """Add the product of row i of `left` and row j of `right` to every entry (i, j) of a CSR matrix."""
    for i in range(indptr.size - 1):
        for e in range(indptr[i], indptr[i + 1]):
            for k in range(left.shape[1]):
                data[e] += left[i, k] * right[indices[e], k]


@dataclass(frozen=True)
class Joined:
    """The inverse A^-1 - Z D^-1 Z^T, Z = A^-1 E^T and D = I + E Z, which couples the bodies that rows of E touch.

    Attributes
    ----------
    solver : for A
    Z : (n, k)
    D : (k, k) positive definite, with entries where springs are on the same body
    divided : D^-1 b, for b (k,) or (k, m)
    """

    solver: Solver
    Z: sp.csr_array
    D: sp.csc_array
    divided: Callable[[Array], Array]

    @property
    def name(self) -> str:
        """Name of the solver for A."""
        return self.solver.name

    def __call__(self, b: Array, /) -> Array:
        """The solution for b (n,) or (n, m)."""
        return np.asarray(self.solver(b) - self.Z @ self.divided(self.Z.T @ b))

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """The Delassus operator of rows H, with entries between the bodies that are joined."""
        moved = sp.csr_array(H @ self.Z)
        return sp.csr_array(self.solver.delassus(H) - sp.csr_array(self.correction(moved, moved)))

    def correction(self, left: sp.csr_array, right: sp.csr_array) -> Array:
        """What the springs take off products L A^-1 R^T, from left = L Z (k, m) and right = R Z, dense."""
        return np.asarray(left @ self.divided(right.T.toarray()))


def joined(solver: Solver, B: sp.csr_array, K: Array, blocks: Ints) -> Joined:
    """Solver for A + B^T K B from a solver for A, with blocks K >= 0 (springs, 2, 2) and B (2 springs, n).

    The rows E of `Joined` are s^(1/2) v^T B, of the eigenvalues s of the blocks above round-off.
    """
    values, vectors = np.linalg.eigh(K)
    kept = (values > SOFT * values[:, -1:]).ravel()
    roots = np.sqrt(np.maximum(values, 0.0))[:, :, None] * vectors.swapaxes(1, 2)
    springs = np.arange(K.shape[0] + 1)
    E = sp.csr_array((sp.bsr_array((roots, springs[:-1], springs)).tocsr() @ B)[kept])
    Z = _responses(solver, E, blocks)
    D = sp.csc_array(sp.eye_array(E.shape[0]) + E @ Z)
    return Joined(solver, Z, D, splu(D).solve if E.shape[0] else lambda b: b)


def _responses(solver: Solver, E: sp.csr_array, blocks: Ints) -> sp.csr_array:
    """A^-1 E^T, sparse: rows of E that touch different bodies share a right-hand side."""
    body = np.searchsorted(blocks, E.indices, side="right") - 1
    row = np.repeat(np.arange(E.shape[0]), np.diff(E.indptr))
    pairs = np.unique(np.stack([row, body]), axis=1)
    side = _sides(pairs, E.shape[0], blocks.size - 1)
    b = np.zeros((E.shape[1], int(side.max(initial=-1)) + 1))
    b[E.indices, side[row]] = E.data
    found = solver(b) if b.size else b
    size = np.diff(blocks)[pairs[1]]
    column = np.repeat(pairs[0], size)
    unknown = np.arange(column.size) - np.repeat(np.cumsum(size) - size - blocks[pairs[1]], size)
    return sp.csr_array((found[unknown, side[column]], (unknown, column)), shape=E.shape[::-1])


def _sides(pairs: Ints, rows: int, bodies: int) -> Ints:
    """Right-hand sides (rows,), from pairs (2, m) of rows and bodies that they touch, rows ascending.

    Each row takes the first that no row on its bodies has.
    """
    begins = np.searchsorted(pairs[0], np.arange(rows + 1))
    taken, side = [set[int]() for _ in range(bodies)], np.zeros(rows, dtype=np.int64)
    for k in range(rows):
        own = pairs[1, begins[k] : begins[k + 1]].tolist()
        side[k] = next(j for j in count() if all(j not in taken[b] for b in own))
        for b in own:
            taken[b].add(int(side[k]))
    return side


@dataclass(frozen=True)
class Rotated:
    """The inverse of R A R^T, with a rotation in R for every body: R A^-1 R^T.

    Attributes
    ----------
    solver : for A
    body : (nodes,) body of each node
    angle : (bodies,) [rad]
    """

    solver: Solver
    body: Ints
    angle: Array

    @property
    def name(self) -> str:
        """Name of the solver for A."""
        return self.solver.name

    @cached_property
    def _turn(self) -> NDArray[np.complex128]:
        return np.asarray(np.exp(1j * self.angle))

    def __call__(self, b: Array, /) -> Array:
        """The solution for b (n,) or (n, m)."""
        turn = self._turn[self.body]
        back = _turned(b.reshape(b.shape[0], -1).T, turn.conj())
        x = self.solver(np.ascontiguousarray(back.T).reshape(b.shape))
        return np.ascontiguousarray(_turned(x.reshape(b.shape[0], -1).T, turn).T).reshape(b.shape)

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """The Delassus operator of rows H that touch one body each."""
        return self.solver.delassus(self.turned_back(H, self.body))

    def turned_back(self, rows: sp.csr_array, body: Ints) -> sp.csr_array:
        """Rows (k, 2 m) of pairs of components, of points of these bodies (m,), in the directions of A: H R."""
        turn = self._turn[body]
        blocks = np.stack([turn.real, -turn.imag, turn.imag, turn.real], axis=1).reshape(-1, 2, 2)
        R = sp.bsr_array((blocks, np.arange(body.size), np.arange(body.size + 1)))
        return sp.csr_array(rows @ R.tocsr())


def _turned(rows: Array, turn: NDArray[np.complex128]) -> Array:
    """Vectors (m, 2 nodes) turned by exp(i angle) at every node."""
    z = np.ascontiguousarray(rows).view(np.complex128) * turn
    return np.asarray(z.view(np.float64))
