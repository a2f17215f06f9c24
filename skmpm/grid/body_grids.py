"""The occupied cells and nodes of all bodies, a disconnected mesh with the material points as quadrature."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from skfem import CellBasis, ElementQuad1, ElementVector, MeshQuad

from skmpm.arrays import Array, Ints
from skmpm.grid import loops as point_loops


@dataclass(frozen=True)
class BodyGrids:
    """The occupied cells and nodes of all bodies, and the positions of the material points in the cells.

    Nodes are sorted by body, and within a body in rows along its shorter side, which minimises the bandwidth.
    """

    cell: float  # h [m]
    cell_of_point: Ints  # (n,)
    local: Array  # (2, n) coordinates of the points in their cells, in [0, 1]
    nodes_of_cell: Ints  # (4, cells), corners as in ElementQuad1
    cell_index: Ints  # (2, cells) integer coordinates of the cells
    cell_body: Ints  # (cells,)
    node_index: Ints  # (2, nodes) integer coordinates of the nodes
    node_body: Ints  # (nodes,)
    along: Ints  # (bodies,) axis of the rows of nodes, 0 for x or 1 for y
    bodies: int  # number of bodies
    quadrature: Array | None = None  # (2, n) local coordinates where strains are taken; None: those of the points

    @property
    def nodes(self) -> int:
        """Number of occupied (body, node) pairs."""
        return int(self.node_index.shape[1])

    @cached_property
    def pieces(self) -> Ints:
        """Number of connected components, which share no node, of the cells of each body, (bodies,)."""
        cell, corner = np.tile(np.arange(self.cells), 4), self.nodes_of_cell.ravel()
        size = self.cells + self.nodes
        shares = sp.coo_array((np.ones(cell.size), (cell, self.cells + corner)), shape=(size, size))
        count, piece = connected_components(shares, directed=False)
        owner = np.zeros(count, dtype=np.int64)
        owner[piece[: self.cells]] = self.cell_body
        return np.bincount(owner, minlength=self.bodies)

    @property
    def cells(self) -> int:
        """Number of occupied (body, cell) pairs."""
        return int(self.cell_index.shape[1])

    @property
    def position(self) -> Array:
        """Positions of the nodes, (2, nodes) [m]."""
        return self.cell * self.node_index.astype(np.float64)

    @cached_property
    def blocks(self) -> Ints:
        """Offsets (bodies + 1,) of the unknowns of bodies: those of body b are blocks[b]:blocks[b + 1]."""
        return 2 * np.searchsorted(self.node_body, np.arange(self.bodies + 1))

    @cached_property
    def point_offsets(self) -> Ints:
        """Offsets (bodies + 1,) of the points, which are sorted by body."""
        return np.searchsorted(self.cell_body[self.cell_of_point], np.arange(self.bodies + 1))

    @property
    def shape(self) -> Array:
        """Q1 shape functions of the four nodes of each point's cell, (4, n), evaluated by scikit-fem."""
        return np.stack([ElementQuad1().lbasis(self.local, i)[0] for i in range(4)])

    @property
    def gradient(self) -> Array:
        """Gradients of the shape functions at the points, (2, 4, n) [1/m]."""
        return self._gradient(self.local)

    def _gradient(self, local: Array) -> Array:
        return np.stack([ElementQuad1().lbasis(local, i)[1] for i in range(4)], axis=1) / self.cell

    @cached_property
    def _pattern(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Columns (4 n,) and row offsets (n + 1,) of every `_point_matrix`; shared, therefore read-only."""
        columns = self.nodes_of_cell.T.astype(np.int32)[self.cell_of_point].ravel()
        offsets = np.arange(0, columns.size + 1, 4, dtype=np.int32)
        for shared in (columns, offsets):
            shared.setflags(write=False)
        return columns, offsets

    def _point_matrix(self, values: Array) -> sp.csr_array:
        """Sparse matrix (n, nodes) from four values per point, (4, n)."""
        return sp.csr_array((values.T.ravel(), *self._pattern), shape=(values.shape[1], self.nodes))

    @cached_property
    def interpolation(self) -> sp.csr_array:
        """Interpolation matrix N (n, nodes) from nodes to points."""
        return self._point_matrix(self.shape)

    @cached_property
    def derivatives(self) -> tuple[sp.csr_array, sp.csr_array]:
        """Matrices (n, nodes) of d/dx and d/dy at the points [1/m]."""
        along_x, along_y = self.gradient
        return self._point_matrix(along_x), self._point_matrix(along_y)

    @cached_property
    def strain_gradients(self) -> tuple[Array, Array]:
        """Derivatives of the four shape functions by x and by y where strains are evaluated, both (n, 4) [1/m]."""
        if self.quadrature is None:
            by_x, by_y = map(_by_point, self.derivatives)
            return by_x, by_y
        along_x, along_y = self._gradient(self.quadrature)
        return np.ascontiguousarray(along_x.T), np.ascontiguousarray(along_y.T)

    @property
    def _nodes_of_points(self) -> NDArray[np.int32]:
        """The nodes of the cell of each point, (n, 4)."""
        return self._pattern[0].reshape(-1, 4)

    def at_points(self, field: Array) -> Array:
        """Values (2, n) of a nodal field (2 nodes,) at the points."""
        values = np.empty((2, self.cell_of_point.size))
        point_loops.interpolate(self._nodes_of_points, _by_point(self.interpolation), field.reshape(-1, 2), values)
        return values

    def gradient_at_points(self, field: Array) -> Array:
        """Gradients H[i, j] = d field_i / d x_j (2, 2, n) of a nodal field (2 nodes,) at the points."""
        by_x, by_y = map(_by_point, self.derivatives)
        return self._differentiated(field, by_x, by_y)

    def strain_at_points(self, field: Array) -> Array:
        """Gradients (2, 2, n) of a nodal field (2 nodes,) where the strains of the points are evaluated."""
        return self._differentiated(field, *self.strain_gradients)

    def _differentiated(self, field: Array, by_x: Array, by_y: Array) -> Array:
        """Gradients of a nodal field from derivatives of the shape functions (n, 4) [1/m]."""
        gradients = np.empty((2, 2, self.cell_of_point.size))
        point_loops.differentiate(self._nodes_of_points, by_x, by_y, field.reshape(-1, 2), gradients)
        return gradients

    def divergence(self, volume: Array, P: Array) -> Array:
        """Sum over points of V P : grad N, (2 nodes,), the transpose of `strain_at_points`; (n,) and (2, 2, n)."""
        sums, (by_x, by_y) = np.zeros((self.nodes, 2)), self.strain_gradients
        point_loops.add_divergence(self._nodes_of_points, by_x, by_y, volume, P, sums)
        return sums.ravel()

    def affine_momentum(self, mass: Array, v: Array, C: Array) -> Array:
        """Sum over points of m N (v + C (X - x)), (2 nodes,); masses (n,), velocities (2, n), gradients (2, 2, n)."""
        sums, N = np.zeros((self.nodes, 2)), _by_point(self.interpolation)
        point_loops.add_affine_momentum(self._nodes_of_points, N, self.local, self.cell, mass, v, C, sums)
        return sums.ravel()

    @cached_property
    def mesh(self) -> MeshQuad:
        """The disconnected mesh, whose vertices are the nodes."""
        return MeshQuad(self.position, self.nodes_of_cell)

    def basis(self, volume: Array) -> CellBasis:
        """Scikit-fem basis whose quadrature points are those of strains, weighted by `volume` (n,) [m2]."""
        local = self.local if self.quadrature is None else self.quadrature
        X, weights = local[:, :, None], (volume / self.cell**2)[:, None]
        return CellBasis(
            self.mesh, ElementVector(ElementQuad1()), elements=self.cell_of_point, quadrature=(X, weights)
        )

    def sums(self, values: Array) -> Array:
        """Sums (k, bodies) of nodal values (k, nodes) over the nodes of each body."""
        sums = np.zeros((values.shape[0], self.bodies))
        point_loops.sum_by_body(self.node_body, np.asarray(values, dtype=np.float64), sums)
        return sums

    def means(self, values: Array, weight: Array | None = None) -> Array:
        """Means (k, bodies) of nodal values (k, nodes) over the nodes of each body, weighted by (nodes,)."""
        weight = np.ones(self.nodes) if weight is None else weight
        (total,) = self.sums(weight[None])
        return np.asarray(self.sums(weight * values) / np.maximum(total, 1e-300))

    def at(self, displacement: Array) -> Array:
        """Positions (2, nodes) [m] of the nodes at a displacement (2 nodes,) [m]."""
        return np.asarray(self.position + displacement.reshape(-1, 2).T)

    def arms(self, x: Array, weight: Array | None = None) -> Array:
        """Nodal positions x (2, nodes) [m] relative to the means of their bodies, weighted by (nodes,)."""
        return np.asarray(x - self.means(x, weight)[:, self.node_body])

    def moments(self, x: Array, mass: Array, impulse: Array) -> tuple[Array, Array]:
        """Arms (nodes, 2) [m] of nodes at x (nodes, 2) about their bodies' centres of mass, and sums (3, bodies).

        The sums are moments of an impulse (nodes, 2), moments of inertia and masses; `mass` (nodes,).
        """
        arms, sums = np.empty((self.nodes, 2)), np.zeros((3, self.bodies))
        point_loops.moments_by_body(self.node_body, x, mass, impulse, arms, sums)
        return arms, sums

    def radii_of_gyration(self, arms: Array, weight: Array) -> Array:
        """Root mean square (bodies,) [m] of arms (2, nodes) [m], weighted by (nodes,)."""
        return np.asarray(np.sqrt(self.means((arms**2).sum(axis=0)[None], weight)[0]))

    @cached_property
    def rigid_motions(self) -> Array:
        """Two translations and the rotation of each body about the mean position of its nodes, (2 nodes, 3)."""
        arm = self.arms(self.position) / self.cell
        motions = np.zeros((2 * self.nodes, 3))
        motions[0::2, 0] = motions[1::2, 1] = 1.0
        motions[0::2, 2], motions[1::2, 2] = -arm[1], arm[0]
        motions.setflags(write=False)  # shared
        return motions


def _by_point(matrix: sp.csr_array) -> Array:
    """The four entries of each row, (n, 4)."""
    return np.asarray(matrix.data.reshape(-1, 4))
