"""Material points as a good rule: weights that integrate constants and linear functions over each cell's material."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.grid import BodyGrids

Array = NDArray[np.float64]

MIN_WEIGHT, MOST = 0.02, 5.0  # weights over volumes; more lets points on an edge stand for all of a sliver
RESOLVED_SPREAD = 1e-3  # smallest eigenvalue, over the largest, of moments that the points of a cell can tell apart


def fitted_weights(grid: BodyGrids, volume: Array, moments: Array) -> Array:
    """Weights (n,) of the points, closest to their volumes (n,), with the given moments of 1, xi, eta in each cell.

    `moments` (3, cells) [cell areas]. The weights minimise sum (w - V)^2 / V in each cell; where its points are too
    few for three moments they match those they can, the area first, and no weight falls below `LEAST` of a volume
    (moment fitting: Mueller, Kummer & Oberlack, IJNME 96, 2013). The stress of a uniform field is then balanced on
    any cloud with a few points in every cell, wherever the grid lies.
    """
    of, cells = grid.cell_of_point, grid.cells
    weight = volume / grid.cell**2
    area = np.bincount(of, weight, cells)
    plain = np.clip(moments[0] / area, MIN_WEIGHT, MOST)
    mean = np.stack([np.bincount(of, weight * xi, cells) for xi in grid.local]) / area
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
