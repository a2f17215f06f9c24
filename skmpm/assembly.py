"""Fast twins of the weak forms: the same numbers as `forms` on `Body grids.basis`, without a kernel per entry.

Q1 gradients are linear in the local coordinates, so a cell's stiffness is linear in six moments of its points;
one sparse product makes the moments, one GEMM with the reference matrices of `forms` the cell matrices, one
`bincount` the block-sparse matrix whose pattern is known as long as the body grids stay anchored.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.forms import MONOMIALS, PAIRS, reference_ghost, reference_gradient, reference_stiffness
from skmpm.grid import BodyGrids, numbered

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Selection = Ints | slice  # of points or cells
ALL = slice(None)

STENCIL = 25  # nodes at most two cells away from a node: what cells and ghost facets couple
FLOOR = 1e-12  # of the heaviest point of its body: the least mass of a node

# Corners, in the order of `forms.reference_ghost`, of the lower (0) and upper (1) cell beside a facet with
# normal x and with normal y.
GHOST_CORNERS = (
    ((0, 0), (0, 1), (1, 1), (0, 3), (0, 2), (1, 2)),
    ((0, 0), (0, 3), (1, 3), (0, 1), (0, 2), (1, 2)),
)


def _by_blocks(cells: Array) -> Array:
    """Matrices (..., 8, 8) of cells, whose unknowns are node-interleaved, as blocks of pairs of nodes (..., 64)."""
    return cells.reshape(*cells.shape[:-2], 4, 2, 4, 2).swapaxes(-3, -2).reshape(*cells.shape[:-2], 64)


@cache
def _stiffness_table() -> Array:
    """The constant reference matrices of `forms.reference_stiffness`, by blocks, (60, 64)."""
    return _by_blocks(reference_stiffness().reshape(60, 8, 8))


@cache
def _gradient_table() -> Array:
    """From S by 1, xi, eta to S : grad N of the cell's unknowns by `forms.reference_gradient`, (3, 4, 8)."""
    return np.asarray(np.einsum("mIa,ij->miIaj", reference_gradient(), np.eye(2)).reshape(3, 4, 8))


@cache
def _ghost_table() -> Array:
    """The constant 6 x 6 ghost matrix; by symmetry the same for facets with normal x and y."""
    return np.asarray(reference_ghost()[0])


@dataclass(frozen=True)
class Assembly:
    """Everything about an anchored set of body grids that does not change while it stays anchored."""

    grid: BodyGrids
    volume: Array  # (n,) volumes of the points in the anchor configuration [m2]
    lumped: Array  # (2 nodes,) mass of the points at every unknown [kg/m]
    mass: Array  # (2 nodes,) the same, more than zero [kg/m]
    ghost: sp.csr_array  # (nodes, nodes) ghost stiffness, the same for both components [Pa]
    moments: sp.csr_array  # (6 cells, n) monomials of the local coordinates, times volume / cell^2
    indices: Ints  # block columns and row pointers of the pattern of A
    indptr: Ints
    scatter: sp.csr_array  # (blocks, 16 cells) sums the blocks of the cells to those of A
    ghost_data: Array  # (blocks, 2, 2) the ghost stiffness in the pattern of A

    def internal_force(self, P: Array) -> Array:
        """Sum over points of V P : grad N, (2 nodes,) [N/m]; `P` (2, 2, n) [Pa]."""
        Dx, Dy = self.grid.derivatives
        VP = self.volume * P
        return np.asarray(Dx.T @ VP[:, 0].T + Dy.T @ VP[:, 1].T).ravel()

    def ghost_force(self, displacement: Array) -> Array:
        """Force of the ghost penalty on the displacement since anchoring, (2 nodes,) [N/m]."""
        if self.ghost.nnz == 0:
            return np.zeros_like(displacement)
        return np.asarray(self.ghost @ self._within_bodies(displacement)).ravel()

    def ghost_energy(self, displacement: Array) -> float:
        """Energy of the ghost penalty on the displacement since anchoring [J/m]."""
        if self.ghost.nnz == 0:
            return 0.0
        u = self._within_bodies(displacement)
        return 0.5 * float(np.sum(u * (self.ghost @ u)))

    def _within_bodies(self, displacement: Array) -> Array:
        """Displacement less the mean of its body, (nodes, 2): of a long way the penalty would see the rounding."""
        u = displacement.reshape(-1, 2)
        return u - self.grid.means(u.T).T[self.grid.node_body]

    def stiffness(self, C: Array, added: tuple[Selection, Array] | None = None) -> Array:
        """Data of the stiffness in the pattern of A, (blocks, 2, 2).

        From tangents `C` (2, 2, 2, 2, n), and matrices (k, 64), by blocks, to be `added` to those of k cells.
        """
        flat = C.reshape(4, 4, -1)
        entries = np.stack([flat[a, b] for a, b in PAIRS], axis=1)
        moments = (self.moments @ entries).reshape(6, -1, 10).transpose(1, 0, 2).reshape(-1, 60)
        cells = moments @ _stiffness_table()
        if added is not None:
            cells[added[0]] += added[1]
        return np.asarray((self.scatter @ cells.reshape(-1, 4)).reshape(-1, 2, 2) + self.ghost_data)

    def cell_sums(self, values: Array, points: Selection = ALL) -> Array:
        """Sums over points of every cell of V values, (cells,); `values` (points,)."""
        cell = self.grid.cell_of_point[points]
        return np.asarray(np.bincount(cell, self.volume[points] * values, self.grid.cells), dtype=np.float64)

    def mean_dilatation(self, volumes: Array, points: Selection = ALL) -> Array:
        """Volume over undeformed volume of each point's cell, (points,), from both per anchor volume, (2, points).

        `points` are all those of their cells.
        """
        cell = self.grid.cell_of_point[points]
        now, rest = (self.cell_sums(v, points)[cell] for v in volumes)
        return np.asarray(now / rest)

    def mean_dilatation_stiffness(
        self,
        slope: Array,
        mixed: Array,
        bulk: Array,
        rest: Array,
        points: Selection = ALL,
        cells: Selection = ALL,
    ) -> Array:
        """Twin of `forms.mean_dilatation_stiffness`, by cells and blocks, (cells, 64), of rank two each.

        `slope` and `mixed` (4, points), `bulk` and `rest` (points,) are those of all points of these cells.
        """
        grid = self.grid
        of_point = np.concatenate([slope, mixed])
        if not isinstance(points, slice):
            of_point = np.zeros((8, self.volume.size))
            of_point[:, points] = np.concatenate([slope, mixed])
        rows = (np.arange(3)[:, None] * grid.cells + np.arange(grid.cells)[cells]).ravel()
        first = self.moments[slice(rows.size) if isinstance(cells, slice) else rows] @ of_point.T  # of 1, xi, eta
        by_monomial = list(zip(first.reshape(3, -1, 2, 4), grid.cell * _gradient_table(), strict=True))
        growth, push = (sum(values[:, k] @ table for values, table in by_monomial) for k in (0, 1))
        total, curved = (self.cell_sums(values, points)[cells][:, None] for values in (rest, bulk))
        push = (push + 0.5 * curved / total * growth) / total
        return _by_blocks(np.stack([push, growth], axis=2) @ np.stack([growth, push], axis=1))

    def matrix(self, stiffness: Array, factor: float, diagonal: Array | None = None) -> sp.bsr_array:
        """A = M + factor K, block sparse, (2 nodes, 2 nodes), or with a block diagonal (nodes, 2, 2) instead of M."""
        nodes = self.grid.nodes
        data = factor * stiffness
        rows = np.repeat(np.arange(nodes), np.diff(self.indptr))
        own = self.mass.reshape(-1, 2, 1) * np.eye(2) if diagonal is None else diagonal
        data[np.flatnonzero(rows == self.indices)] += own
        return sp.bsr_array((data, self.indices, self.indptr), shape=(2 * nodes, 2 * nodes))


def lumped_mass(grid: BodyGrids, mass: Array) -> Array:
    """Lumped mass of every unknown (2 nodes,) from the points' masses (n,) [kg/m] (Nezamabadi et al. 2017, eq. 6)."""
    return np.repeat(grid.interpolation.T @ mass, 2)


def _heaviest(grid: BodyGrids, mass: Array) -> Array:
    """Mass of the heaviest point of every node's body, (nodes,)."""
    heaviest = np.zeros(grid.bodies)
    np.maximum.at(heaviest, grid.cell_body[grid.cell_of_point], mass)
    return heaviest[grid.node_body]


def ghost_facets(grid: BodyGrids, volume: Array, threshold: float = 0.6) -> tuple[Ints, Ints]:
    """Facets inside a body beside a cell filled less than `threshold`: their six nodes (6, f) and bodies (f,)."""
    fill = np.bincount(grid.cell_of_point, volume, grid.cells) / grid.cell**2
    nodes, owners = [], []
    for normal in (0, 1):
        pair = np.stack(_neighbours(grid, normal))
        pair = pair[:, fill[pair].min(axis=0) < threshold]
        nodes.append(np.stack([grid.nodes_of_cell[corner, pair[k]] for k, corner in GHOST_CORNERS[normal]]))
        owners.append(grid.cell_body[pair[0]])
    return np.concatenate(nodes, axis=1), np.concatenate(owners)


def _neighbours(grid: BodyGrids, normal: int) -> tuple[Ints, Ints]:
    """Pairs of cells of one body that share a facet with this normal: (lower, upper)."""
    corner = 1 if normal == 0 else 3  # of the lower cell, where the upper cell begins
    begins = np.full(grid.nodes, -1)
    begins[grid.nodes_of_cell[0]] = np.arange(grid.cells)
    upper = begins[grid.nodes_of_cell[corner]]
    return np.flatnonzero(upper >= 0), upper[upper >= 0]


def _pairs(nodes: Ints) -> Ints:
    """Rows and columns (2, k, k, m) of the blocks that groups of nodes (k, m) have in A."""
    k, m = nodes.shape
    return np.stack([np.broadcast_to(nodes[:, None], (k, k, m)), np.broadcast_to(nodes[None, :], (k, k, m))])


def _neighbour(grid: BodyGrids, row: Ints, column: Ints) -> Ints:
    """A number for each pair of nodes at most two cells apart, ascending with row and, within it, with column."""
    inner = grid.along[grid.node_body]
    place = np.where(inner == 0, np.array([[1], [5]]), np.array([[5], [1]]))
    place = np.sum(place * grid.node_index, axis=0)
    return np.asarray((STENCIL * np.arange(grid.nodes) + STENCIL // 2 - place)[row] + place[column])


def prepare(grid: BodyGrids, volume: Array, mass: Array, ghost_modulus: Array) -> Assembly:
    """Compute once what stays while the body grids stay anchored.

    `volume`, `mass` (n,) of the points [m2], [kg/m]; `ghost_modulus` (bodies,) gamma E_g of each body [Pa].
    """
    nodes = grid.nodes
    facet_nodes, facet_body = ghost_facets(grid, volume)
    weight = ghost_modulus[facet_body]
    ghost_nodes = facet_nodes[:, weight > 0.0]
    ghost_values = weight[weight > 0.0] * _ghost_table()[:, :, None]

    pairs = [_pairs(grid.nodes_of_cell).transpose(0, 3, 1, 2), _pairs(ghost_nodes)]
    row, column = np.concatenate([pair.reshape(2, -1) for pair in pairs], axis=1)
    where, some = numbered(_neighbour(grid, row, column), STENCIL * nodes)
    row, column = row[some], column[some]
    in_cells, in_ghost = np.split(where, [pairs[0][0].size])
    scatter = sp.csr_array(
        (np.ones(in_cells.size), (in_cells, np.arange(in_cells.size))), shape=(some.size, in_cells.size)
    )
    ghost = np.bincount(in_ghost, ghost_values.ravel(), some.size).astype(np.float64)  # of none: integers
    felt = np.flatnonzero(ghost)

    n = grid.local.shape[1]
    weight = volume / grid.cell**2
    monomials = grid.local[0] ** MONOMIALS[0][:, None] * grid.local[1] ** MONOMIALS[1][:, None] * weight
    rows = np.arange(6)[:, None] * grid.cells + grid.cell_of_point
    moments = sp.csr_array((monomials.ravel(), (rows.ravel(), np.tile(np.arange(n), 6))), shape=(6 * grid.cells, n))
    lumped = lumped_mass(grid, mass)
    return Assembly(
        grid=grid,
        volume=volume,
        lumped=lumped,
        # A point exactly on a grid line leaves a node without mass, where a velocity would be 0/0.
        mass=np.maximum(lumped, FLOOR * np.repeat(_heaviest(grid, mass), 2)),
        ghost=sp.csr_array((ghost[felt], (row[felt], column[felt])), shape=(nodes, nodes)),
        moments=moments,
        indices=column,
        indptr=np.searchsorted(row, np.arange(nodes + 1)),
        scatter=scatter,
        ghost_data=ghost[:, None, None] * np.eye(2),
    )
