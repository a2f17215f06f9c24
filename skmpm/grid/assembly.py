"""Compiled assembly of the weak forms: equal to `forms` on `BodyGrids.basis`, in one loop over the points.

The stiffness is summed in a block-sparse matrix, whose pattern is fixed while the body grids stay anchored. Shape
functions at the points, and their gradients where strains are taken, are scikit-fem's.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.arrays import Array, Ints
from skmpm.grid import BodyGrids, loops, numbered
from skmpm.grid.forms import reference_ghost
from skmpm.parallel import over_bodies

Selection = Ints | slice  # of points or cells
ALL = slice(None)

STENCIL_NODES = 25  # nodes at most two cells away from a node, coupled with it by cells and ghost facets
POOR_FILLING = 0.6  # of a cell, below which it gets the ghost penalty
MIN_MASS_RATIO = 1e-12  # smallest mass of a node, relative to the heaviest point of its body

# Corners, in the order of `forms.reference_ghost`, of the lower (0) and upper (1) cell beside a facet with
# normal x and with normal y.
GHOST_CORNERS = (
    ((0, 0), (0, 1), (1, 1), (0, 3), (0, 2), (1, 2)),
    ((0, 0), (0, 3), (1, 3), (0, 1), (0, 2), (1, 2)),
)


@dataclass(frozen=True)
class Assembly:
    """Data of a set of body grids that do not change while these stay anchored."""

    grid: BodyGrids
    volume: Array  # (n,) volumes of the points in the anchor configuration [m2]
    lumped: Array  # (2 nodes,) mass of the points at every unknown [kg/m]
    mass: Array  # (2 nodes,) the same, bounded from below by a positive value [kg/m]
    ghost: sp.csr_array  # (nodes, nodes) ghost stiffness, the same for both components [Pa]
    indices: NDArray[np.int32]  # (blocks,) columns of the blocks of A
    indptr: NDArray[np.int32]  # (nodes + 1,) row offsets of the blocks of A
    block_of_cell: Ints  # (cells, 4, 4) the block of A for each pair of nodes of a cell
    ghost_data: Array  # (blocks, 2, 2) the ghost stiffness in the pattern of A

    def internal_force(self, P: Array) -> Array:
        """Internal force, the sum over points of V P : grad N, (2 nodes,) [N/m]; `P` (2, 2, n) [Pa]."""
        return self.grid.divergence(self.volume, P)

    def ghost_force(self, displacement: Array) -> Array:
        """Force of the ghost penalty for the displacement since anchoring, (2 nodes,) [N/m]."""
        force = np.zeros_like(displacement)
        if self.ghost.nnz:
            u = displacement.reshape(-1, 2)
            loops.ghost_force(self.ghost.indptr, self.ghost.indices, self.ghost.data, u, force.reshape(-1, 2))
        return force

    def ghost_energy(self, displacement: Array) -> float:
        """Energy of the ghost penalty for the displacement since anchoring [J/m]."""
        if self.ghost.nnz == 0:
            return 0.0
        u = displacement.reshape(-1, 2)
        return float(loops.ghost_energy(self.ghost.indptr, self.ghost.indices, self.ghost.data, u))

    def stiffness(self, C: Array, added: tuple[Selection, Array] | None = None, *, ghost: bool = True) -> Array:
        """Blocks of the stiffness in the pattern of A, (blocks, 2, 2), from tangents `C` (2, 2, 2, 2, n) [Pa].

        With `ghost` the ghost penalty is in it. `added` are k cells and the vectors of `mean_dilatation_stiffness`
        (k, 2, 4, 2), whose matrices are added.
        """
        K, grid = self.ghost_data.copy() if ghost else np.zeros_like(self.ghost_data), self.grid
        points, cells = grid.point_offsets, np.searchsorted(grid.cell_body, np.arange(grid.bodies + 1))
        of_cells = (cells, grid.cell_body, self.block_of_cell, grid.cell_of_point)
        arguments = (*of_cells, *grid.strain_gradients, self.volume, C.reshape(4, 4, -1), K)
        over_bodies(lambda first, last: loops.add_stiffness(points[first], points[last], *arguments), points)
        if added is not None:
            block, body = self.block_of_cell[added[0]], grid.cell_body[added[0]]
            own = np.searchsorted(body, np.arange(grid.bodies + 1))
            over_bodies(lambda first, last: loops.add_rank_two(own[first], own[last], block, added[1], K), own)
        return K

    @cached_property
    def diagonal_blocks(self) -> Ints:
        """The block of A on the diagonal for each node, (nodes,)."""
        rows = np.repeat(np.arange(self.grid.nodes), np.diff(self.indptr))
        return np.flatnonzero(rows == self.indices)

    def mean_dilatation(self, volumes: Array, points: Selection = ALL, part: Ints | None = None) -> Array:
        """Ratio of current to undeformed volume of the cell of each point, or of its part of it, (points,).

        `volumes` (2, points) are the current and undeformed volumes of points per anchor volume; `points` include all
        points of their cells, or of the parts `part` (points,).
        """
        cell, count = (
            (self.grid.cell_of_point[points], self.grid.cells) if part is None else (part, int(part.max()) + 1)
        )
        ratios = np.empty(volumes.shape[1])
        loops.cell_ratios(cell, self.volume[points], volumes, np.zeros((count, 2)), ratios)
        return ratios

    def mean_dilatation_stiffness(
        self,
        slope: Array,
        mixed: Array,
        bulk: Array,
        rest: Array,
        points: Selection = ALL,
        cells: Selection = ALL,
        part: Ints | None = None,
    ) -> Array:
        """Vectors B and D of the cell matrices B D' + D B' of `forms.mean_dilatation_stiffness`, (cells, 2, 4, 2).

        `slope` and `mixed` (4, points), `bulk` and `rest` (points,) belong to all points of these cells. With `part`
        (points,) `cells` are the cells of the parts, and each part has its vectors.
        """
        grid, own = self.grid, np.arange(self.grid.cells)[cells]
        cell, (gx, gy), volume = part, grid.strain_gradients, self.volume[points]
        if cell is None:
            number = np.zeros(grid.cells, dtype=np.int64)
            number[own] = np.arange(own.size)
            cell = number[grid.cell_of_point[points]]
        vectors = np.zeros((own.size, 2, 4, 2))
        loops.mean_dilatation_vectors(cell, gx[points], gy[points], volume, slope, mixed, bulk, rest, vectors)
        return vectors

    def matrix(self, stiffness: Array, factor: float, diagonal: Array | None = None) -> sp.bsr_array:
        """Block-sparse A = M + factor K, (2 nodes, 2 nodes), or with diagonal blocks (nodes, 2, 2) in place of M.

        A takes the array of the stiffness.
        """
        nodes = self.grid.nodes
        added = self.mass.reshape(-1, 2, 1) * np.eye(2) if diagonal is None else diagonal
        loops.scale_and_add(factor, stiffness, self.diagonal_blocks, added)
        return sp.bsr_array((stiffness, self.indices, self.indptr), shape=(2 * nodes, 2 * nodes))


def _heaviest(grid: BodyGrids, mass: Array) -> Array:
    """Mass of the heaviest point of the body of each node, (nodes,) [kg/m]."""
    heaviest = np.zeros(grid.bodies)
    np.maximum.at(heaviest, grid.cell_body[grid.cell_of_point], mass)
    return heaviest[grid.node_body]


def ghost_facets(grid: BodyGrids, volume: Array) -> tuple[Ints, Ints]:
    """Interior facets beside cells with a filling below `POOR_FILLING`: their six nodes (6, f) and cells (2, f)."""
    fill = np.bincount(grid.cell_of_point, volume, grid.cells) / grid.cell**2
    nodes, cells = [], []
    for normal in (0, 1):
        pair = np.stack(_neighbours(grid, normal))
        pair = pair[:, fill[pair].min(axis=0) < POOR_FILLING]
        nodes.append(np.stack([grid.nodes_of_cell[corner, pair[k]] for k, corner in GHOST_CORNERS[normal]]))
        cells.append(pair)
    return np.concatenate(nodes, axis=1), np.concatenate(cells, axis=1)


def _neighbours(grid: BodyGrids, normal: int) -> tuple[Ints, Ints]:
    """Pairs of adjacent cells of one body whose common facet has this normal: (lower, upper)."""
    corner = 1 if normal == 0 else 3  # of the lower cell, corner 0 of the upper cell
    begins = np.full(grid.nodes, -1)
    begins[grid.nodes_of_cell[0]] = np.arange(grid.cells)
    upper = begins[grid.nodes_of_cell[corner]]
    return np.flatnonzero(upper >= 0), upper[upper >= 0]


def _pairs(nodes: Ints) -> Ints:
    """Rows and columns (2, k, k, m) in A of all blocks of m groups of k nodes each (k, m)."""
    k, m = nodes.shape
    return np.stack([np.broadcast_to(nodes[:, None], (k, k, m)), np.broadcast_to(nodes[None, :], (k, k, m))])


def _neighbour(grid: BodyGrids, row: Ints, column: Ints) -> Ints:
    """Key of each pair of nodes at most two cells apart, ascending with row and, within a row, with column."""
    inner = grid.along[grid.node_body]
    strides = np.where(inner == 0, np.array([[1], [5]]), np.array([[5], [1]]))
    offset = np.sum(strides * grid.node_index, axis=0)
    return np.asarray((STENCIL_NODES * np.arange(grid.nodes) + STENCIL_NODES // 2 - offset)[row] + offset[column])


def prepare(grid: BodyGrids, volume: Array, mass: Array, ghost_modulus: Array) -> Assembly:
    """Compute the data that do not change while the body grids stay anchored.

    `volume` [m2] and `mass` [kg/m] (n,) are those of the points, `ghost_modulus` (cells,) [Pa] is gamma E_g; of a
    facet the smaller of its cells', so that a stiff core does not stiffen the soft skin.
    """
    nodes = grid.nodes
    facet_nodes, facet_cells = ghost_facets(grid, volume)
    weight = ghost_modulus[facet_cells].min(axis=0)
    ghost_nodes = facet_nodes[:, weight > 0.0]
    ghost_values = weight[weight > 0.0] * reference_ghost()[:, :, None]

    pairs = [_pairs(grid.nodes_of_cell).transpose(0, 3, 1, 2), _pairs(ghost_nodes)]
    row, column = np.concatenate([pair.reshape(2, -1) for pair in pairs], axis=1)
    where, some = numbered(_neighbour(grid, row, column), STENCIL_NODES * nodes)
    row, column = row[some], column[some]
    in_cells, in_ghost = np.split(where, [pairs[0][0].size])
    ghost = np.bincount(in_ghost, ghost_values.ravel(), some.size).astype(np.float64)  # integers if there are none
    nonzero = np.flatnonzero(ghost)

    lumped = np.repeat(grid.interpolation.T @ mass, 2)  # Nezamabadi et al. 2017, eq. 6
    return Assembly(
        grid=grid,
        volume=volume,
        lumped=lumped,
        # A point exactly on a grid line may leave a node of its cell without mass, whose velocity would be 0/0.
        mass=np.maximum(lumped, MIN_MASS_RATIO * np.repeat(_heaviest(grid, mass), 2)),
        ghost=sp.csr_array((ghost[nonzero], (row[nonzero], column[nonzero])), shape=(nodes, nodes)),
        indices=column.astype(np.int32),  # as SciPy stores them: copied into no matrix
        indptr=np.searchsorted(row, np.arange(nodes + 1)).astype(np.int32),
        block_of_cell=in_cells.reshape(-1, 4, 4),
        ghost_data=ghost[:, None, None] * np.eye(2),
    )
