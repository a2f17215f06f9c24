"""Sheets: the background grid of every body, as one disconnected scikit-fem mesh.

The grid is unbounded: a cell is a pair of integers, found by floor division. Each body occupies cells of its
own sheet; the occupied (body, cell) and (body, node) pairs are numbered, and one `MeshQuad` holds them all.
Bodies share no vertex, so every matrix assembled on this mesh is block diagonal, one block per body. Material
points are the quadrature of that mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from skfem import CellBasis, ElementQuad1, ElementVector, MeshQuad
from skfem.mapping import Mapping

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

CORNERS = np.array([[0, 1, 1, 0], [0, 0, 1, 1]])
"""Corners of the reference square in the order of `ElementQuad1`, (2, 4)."""
SPARSE = 30  # possible keys for each one given, beyond which sorting beats a table of all possible


class CartesianMapping(Mapping):
    """Affine map of the reference square onto equal square cells: constant, and nothing is cached."""

    def __init__(self, origin: Array, cell: float) -> None:
        self.origin, self.cell = origin, cell

    def _select(self, tind: Ints | None) -> Array:
        return self.origin if tind is None else self.origin[:, tind]

    def _diagonal(self, X: Array, tind: Ints | None, value: float) -> Array:
        points = X.shape[-1]
        return np.broadcast_to(value * np.eye(2)[:, :, None, None], (2, 2, self._select(tind).shape[1], points))

    def F(self, X: Array, tind: Ints | None = None) -> Array:
        """Global positions (2, cells, points) [m] of local ones."""
        local = X if X.ndim == 3 else X[:, None, :]
        return self._select(tind)[:, :, None] + self.cell * local

    def invF(self, x: Array, tind: Ints | None = None) -> Array:
        """Local coordinates of global positions (2, cells, points) [m]; not clipped."""
        return (x - self._select(tind)[:, :, None]) / self.cell

    def DF(self, X: Array, tind: Ints | None = None) -> Array:
        """Jacobian, (2, 2, cells, points) [m]."""
        return self._diagonal(X, tind, self.cell)

    def invDF(self, X: Array, tind: Ints | None = None) -> Array:
        """Inverse Jacobian, (2, 2, cells, points) [1/m]."""
        return self._diagonal(X, tind, 1.0 / self.cell)

    def detDF(self, X: Array, tind: Ints | None = None) -> Array:
        """Jacobian determinant, (cells, points) [m2]."""
        return np.broadcast_to(self.cell**2, (self._select(tind).shape[1], X.shape[-1]))


@dataclass(frozen=True)
class Sheets:
    """The occupied cells and nodes of all bodies, and the points' place in them.

    Nodes are sorted by body, and within a body row by row along its shorter side: the smallest band.
    """

    cell: float  # h [m]
    cell_of_point: Ints  # (n,)
    local: Array  # (2, n) coordinates of the points in their cells, in [0, 1]
    nodes_of_cell: Ints  # (4, cells), corners as in ElementQuad1
    cell_index: Ints  # (2, cells) integer coordinates of the cells
    cell_body: Ints  # (cells,)
    node_index: Ints  # (2, nodes) integer coordinates of the nodes
    node_body: Ints  # (nodes,)
    along: Ints  # (bodies,) the component that runs along the rows of nodes
    bodies: int

    @property
    def nodes(self) -> int:
        """How many (body, node) pairs are occupied."""
        return int(self.node_index.shape[1])

    @cached_property
    def pieces(self) -> Ints:
        """Into how many pieces, that share no node, the cells of every body fall, (bodies,)."""
        cell, corner = np.tile(np.arange(self.cells), 4), self.nodes_of_cell.ravel()
        size = self.cells + self.nodes
        shares = sp.coo_array((np.ones(cell.size), (cell, self.cells + corner)), shape=(size, size))
        count, piece = connected_components(shares, directed=False)
        owner = np.zeros(count, dtype=np.int64)
        owner[piece[: self.cells]] = self.cell_body
        return np.bincount(owner, minlength=self.bodies)

    @property
    def cells(self) -> int:
        """How many (body, cell) pairs are occupied."""
        return int(self.cell_index.shape[1])

    @property
    def position(self) -> Array:
        """Positions of the nodes, (2, nodes) [m]."""
        return self.cell * self.node_index.astype(np.float64)

    @cached_property
    def blocks(self) -> Ints:
        """Offsets of the bodies' unknowns, (bodies + 1,): body b owns dofs blocks[b]:blocks[b + 1]."""
        return 2 * np.searchsorted(self.node_body, np.arange(self.bodies + 1))

    @property
    def shape(self) -> Array:
        """Q1 shape functions of each point's four nodes, (4, n): scikit-fem's, at the local coordinates."""
        return np.stack([ElementQuad1().lbasis(self.local, i)[0] for i in range(4)])

    @property
    def gradient(self) -> Array:
        """Gradients of the shape functions, (2, 4, n) [1/m]."""
        return np.stack([ElementQuad1().lbasis(self.local, i)[1] for i in range(4)], axis=1) / self.cell

    @cached_property
    def _pattern(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Columns (4 n,) and row offsets (n + 1,) of every `_point_matrix`: shared, so nobody may sort them."""
        columns = self.nodes_of_cell.T.astype(np.int32)[self.cell_of_point].ravel()
        offsets = np.arange(0, columns.size + 1, 4, dtype=np.int32)
        for shared in (columns, offsets):
            shared.setflags(write=False)
        return columns, offsets

    def _point_matrix(self, values: Array) -> sp.csr_array:
        """A sparse matrix (n, nodes) from four values per point, (4, n)."""
        return sp.csr_array((values.T.ravel(), *self._pattern), shape=(values.shape[1], self.nodes))

    @cached_property
    def interpolation(self) -> sp.csr_array:
        """N (n, nodes): nodal values to point values."""
        return self._point_matrix(self.shape)

    @cached_property
    def derivatives(self) -> tuple[sp.csr_array, sp.csr_array]:
        """(n, nodes) matrices of d/dx and d/dy at the points [1/m]."""
        along_x, along_y = self.gradient
        return self._point_matrix(along_x), self._point_matrix(along_y)

    @cached_property
    def levers(self) -> tuple[sp.csr_array, sp.csr_array]:
        """N_ip (X_i - X_p), one matrix (n, nodes) [m] per component: the arms of the affine momentum."""
        arms = self.cell * (CORNERS[:, :, None] - self.local[:, None, :])
        N = self.shape
        return self._point_matrix(N * arms[0]), self._point_matrix(N * arms[1])

    def at_points(self, field: Array) -> Array:
        """Values at the points (2, n) of a nodal field (2 nodes,)."""
        return np.ascontiguousarray((self.interpolation @ field.reshape(-1, 2)).T)

    def gradient_at_points(self, field: Array) -> Array:
        """Gradients H[i, j] = d field_i / d x_j at the points, (2, 2, n), of a nodal field (2 nodes,)."""
        columns = [D @ field.reshape(-1, 2) for D in self.derivatives]
        return np.ascontiguousarray(np.stack(columns, axis=-1).transpose(1, 2, 0))

    @cached_property
    def mesh(self) -> MeshQuad:
        """The disconnected mesh; its vertices are the nodes."""
        return MeshQuad(self.position, self.nodes_of_cell)

    def basis(self, volume: Array, intorder: int | None = None) -> CellBasis:
        """Scikit-fem basis whose quadrature points are the material points, weighted by `volume` (n,) [m2].

        With `intorder` it is the ordinary basis on the full cells instead (for comparison with plain FEM).
        """
        mapping = CartesianMapping(self.cell * self.cell_index.astype(np.float64), self.cell)
        options: dict[str, Any] = {"mapping": mapping, "disable_doflocs": True}
        if intorder is not None:
            return CellBasis(self.mesh, ElementVector(ElementQuad1()), intorder=intorder, **options)
        X, weights = self.local[:, :, None], (volume / self.cell**2)[:, None]
        return CellBasis(
            self.mesh,
            ElementVector(ElementQuad1()),
            elements=self.cell_of_point,
            quadrature=(X, weights),
            **options,
        )

    def sums(self, values: Array) -> Array:
        """Sums over the nodes of every body, (k, bodies), of nodal values (k, nodes)."""
        return np.stack([np.bincount(self.node_body, row, self.bodies) for row in values])

    def means(self, values: Array, weight: Array | None = None) -> Array:
        """Means over the nodes of every body, (k, bodies), of nodal values (k, nodes) weighed (nodes,)."""
        weight = np.ones(self.nodes) if weight is None else weight
        (total,) = self.sums(weight[None])
        return np.asarray(self.sums(weight * values) / np.maximum(total, 1e-300))

    def rigid_motions(self) -> Array:
        """Two translations and the rotation about each body's own centre, (2 nodes, 3)."""
        position = self.position
        arm = (position - self.means(position)[:, self.node_body]) / self.cell
        motions = np.zeros((2 * self.nodes, 3))
        motions[0::2, 0] = motions[1::2, 1] = 1.0
        motions[0::2, 2], motions[1::2, 2] = -arm[1], arm[0]
        return motions

    def pins(self, stiffness: Array) -> Array:
        """Springs that stop the rigid motions of each body and no other, on the diagonal, (nodes, 2, 2).

        Two hold the node in the middle of a body, one the node farthest from it, across the line to it: under
        forces that balance each other they carry nothing. `stiffness` (bodies,).
        """
        x, body = self.position, self.node_body
        centre = self.means(x)
        first = self.blocks[:-1] // 2
        held = np.flatnonzero(stiffness > 0.0)

        def nearest(distance: Array) -> Ints:
            return np.asarray(np.lexsort((distance, body))[first[held]])

        middle = nearest(np.hypot(*(x - centre[:, body])))
        place = np.zeros((2, self.bodies))
        place[:, held] = x[:, middle]
        outer = nearest(-np.hypot(*(x - place[:, body])))
        arm = x[:, outer] - x[:, middle]
        across = np.stack([-arm[1], arm[0]]) / np.hypot(*arm)
        springs = np.zeros((self.nodes, 2, 2))
        springs[middle] = stiffness[held, None, None] * np.eye(2)
        springs[outer] = stiffness[held, None, None] * np.einsum("ib,jb->bij", across, across)
        return springs


def numbered(key: Ints, size: int) -> tuple[Ints, Ints]:
    """The number (k,) of each key (k,) among the distinct ones, ascending, and where one of each is; 0 <= key < size.

    By a table of all possible keys, which is several times faster than sorting unless they are few among many.
    """
    if size > SPARSE * key.size:
        _, where, number = np.unique(key, return_index=True, return_inverse=True)
        return number, where
    place = np.full(size, -1)
    place[key] = np.arange(key.size)
    there = np.flatnonzero(place >= 0)
    where = place[there]
    place[there] = np.arange(there.size)
    return place[key], where


def lay(x: Array, body: Ints, cell: float, bodies: int, inward: Array | None = None) -> Sheets:
    """Lay the sheets through points `x` (2, n) [m] of bodies `body` (n,).

    `inward` (2, n), where given, decides for a point exactly on a grid line: it belongs to the cell on the
    side `inward` points to, so that a rim that lies on a line does not open cells outside its body.
    """
    probe = x / cell if inward is None else x / cell + 1e-9 * inward
    index = np.floor(probe).astype(np.int64)
    low = np.full((2, bodies), np.iinfo(np.int64).max)
    high = np.full((2, bodies), np.iinfo(np.int64).min)
    for axis in (0, 1):
        np.minimum.at(low[axis], body, index[axis])
        np.maximum.at(high[axis], body, index[axis])
    present = high[0] >= low[0]
    extent = np.where(present, high - low + 2, 0)
    along = np.where(extent[0] <= extent[1], 0, 1)  # rows run along the shorter side
    start = np.concatenate([[0], np.cumsum(extent[0] * extent[1])])

    def number(ij: Ints, b: Ints) -> Ints:
        rel = ij - low[:, b]
        inner = np.where(along[b] == 0, rel[0], rel[1])
        outer = np.where(along[b] == 0, rel[1], rel[0])
        return np.asarray(start[b] + outer * np.minimum(extent[0], extent[1])[b] + inner)

    cell_of_point, some = numbered(number(index, body), int(start[-1]))
    cell_index, cell_body = index[:, some], body[some]
    corner = cell_index[:, None, :] + CORNERS[:, :, None]
    owner = np.broadcast_to(cell_body, corner.shape[1:])
    node, some = numbered(number(corner.reshape(2, -1), owner.ravel()), int(start[-1]))
    return Sheets(
        cell=cell,
        cell_of_point=cell_of_point,
        local=np.clip(x / cell - cell_index[:, cell_of_point], 0.0, 1.0),
        nodes_of_cell=np.ascontiguousarray(node.reshape(4, -1)),
        cell_index=cell_index,
        cell_body=cell_body,
        node_index=corner.reshape(2, -1)[:, some],
        node_body=owner.ravel()[some],
        along=along,
        bodies=bodies,
    )
