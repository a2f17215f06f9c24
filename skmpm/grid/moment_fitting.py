"""Moment fitting: weights and places of evaluation that integrate linear functions exactly over parts of cells."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array
from skmpm.grid import BodyGrids

# Bounds of the ratio of weight to volume; the upper one is that of the mean of a cell. Larger weights would let
# points on an edge represent all of a sliver; tighter bounds lose area in slivers with boundary points only and
# first moments elsewhere (docs/developers/architecture.md).
MIN_WEIGHT, MAX_WEIGHT = 0.02, 5.0
RESOLVED_SPREAD = 1e-3  # variance [cells^2] above which the points of a cell resolve the moment along a direction


def fitted_weights(grid: BodyGrids, volume: Array, moments: Array) -> Array:
    """Weights (n,) of the points that are closest to their volumes (n,) and have the given moments in each cell.

    `moments` (3, cells) [cell areas] are those of 1, xi, eta. The weights minimise sum (w - V)^2 / V in each cell
    (moment fitting: Mueller, Kummer & Oberlack, IJNME 96, 2013). If the points of a cell are too few for three
    moments, the weights match the area first and then the moments that the points resolve; no weight is below
    `MIN_WEIGHT` volumes. `fitted_places` match the moments that remain.
    """
    of, cells = grid.cell_of_point, grid.cells
    weight = volume / grid.cell**2
    area, mean = _sums(grid, weight)
    plain = np.clip(moments[0] / area, MIN_WEIGHT, MAX_WEIGHT)
    arm = grid.local - mean[:, of]
    spread = np.stack([[np.bincount(of, weight * a * b, cells) for b in arm] for a in arm])
    values, vectors = np.linalg.eigh(np.moveaxis(spread, 2, 0))
    known = values > RESOLVED_SPREAD * area[:, None]
    inverse = np.where(known, 1.0 / np.where(known, values, 1.0), 0.0)
    lever = moments[1:] - mean * moments[0]
    slope = np.einsum("cik,ck,cjk,jc->ic", vectors, inverse, vectors, lever)
    tilt = np.einsum("ip,ip->p", slope[:, of], arm)
    lowest = np.zeros(cells)
    np.minimum.at(lowest, of, tilt)
    room = plain - MIN_WEIGHT
    share = np.where(lowest < -room, room / np.maximum(-lowest, 1e-300), 1.0)
    return np.asarray(volume * (plain[of] + share[of] * tilt))


def fitted_places(grid: BodyGrids, weight: Array, moments: Array) -> Array:
    """Local coordinates (2, n) of the points, moved alike in each cell so that their mean is the material's centroid.

    `weight` (n,) are those of the points [m2], `moments` (3, cells) [cell areas] as in `fitted_weights`. Gradients of
    bilinear shape functions and det F are linear in a cell, so that a uniform stress is in equilibrium and volumes of
    cells are exact on any cloud, but for the bounds of weights, and for any position of the grid: a single row of
    points stands for the middle of its cell, not for where it happens to lie. Points stay where the lower bound of
    weights has doubled the area.
    """
    total, mean = _sums(grid, weight)
    filled = grid.cell**2 * moments[0] > 0.5 * total
    centroid = np.where(filled, moments[1:] / np.where(filled, moments[0], 1.0), mean)
    return np.asarray(grid.local + (centroid - mean)[:, grid.cell_of_point])


def _sums(grid: BodyGrids, weight: Array) -> tuple[Array, Array]:
    """Sums of the weights (n,) of the points in each cell, (cells,), and their mean local coordinates (2, cells)."""
    of, cells = grid.cell_of_point, grid.cells
    total = np.bincount(of, weight, cells)
    mean = np.stack([np.bincount(of, weight * xi, cells) for xi in grid.local]) / total
    return np.asarray(total, dtype=np.float64), mean
