"""How well the points of a body represent it on its grid: the estimated error of a uniform stress."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.grid import BodyGrids, build_grids
from skmpm.grid.forms import reference_gradient
from skmpm.grid.moment_fitting import fitted_places, fitted_weights
from skmpm.outline.cells import cell_moments
from skmpm.scene import Scene

COMPLIANCE = 3.0 / 8.0  # of a node: one over 4 (2/3), the diagonal entry of the Laplacian of Q1 elements


def stress_errors(scene: Scene, *, fitted: bool = True) -> Array:
    """Estimated relative error of the force of a uniform strain on each body, (bodies,); nan without an outline.

    A body is too soft for two reasons. Its parts in cells without points carry no stress: they count by their share
    of the area. And where the weights of the points, `fitted` or their volumes, do not integrate the gradients of the
    shape functions as the exact parts of the cells do, a uniform stress leaves a force g [cells x stress] at a node,
    and the body deforms until these vanish; the first sweep of Jacobi's method lowers the energy by 3/8 sum |g|^2 per
    filled cell. With volumes for weights that is up to three times the measured error.
    `docs/how_to/preflight.md` compares this with measured errors.
    """
    boundary = scene.outlines
    bounded = scene.deformable & scene.outlined
    if not bounded.any():
        return np.full(bounded.size, np.nan)
    grid, volume = _grid(scene, bounded[scene.owner])
    whole, cell = _whole(grid)
    x = scene.initial_positions[:, boundary.point]
    exact = cell_moments(boundary, x, grid.cell, whole.cell_index, whole.cell_body)[:3]
    misfit = exact.copy()
    weights, places = volume, grid.local
    if fitted:
        weights = fitted_weights(grid, volume, exact[:, cell])
        places = fitted_places(grid, weights, exact[:, cell])
    misfit[:, cell] -= _moments(grid, weights, places)
    area, lost = (np.bincount(whole.cell_body, m, grid.bodies) for m in (exact[0], misfit[0]))
    imbalance = np.bincount(whole.node_body, _imbalance(whole, misfit), grid.bodies)
    filled = np.where(bounded, area, np.nan)
    return np.asarray((lost + COMPLIANCE * imbalance) / filled)


def _grid(scene: Scene, chosen: Bools) -> tuple[BodyGrids, Array]:
    """Body grids of the chosen points, and the volumes of these [m2].

    A point inside a body that lies on a grid line to round-off belongs to the upper cell, in any unit of length.
    """
    x = scene.initial_positions
    inward = scene.inward_normals(x)
    inward[:, (inward == 0.0).all(axis=0)] = 1.0
    grid = build_grids(x[:, chosen], scene.owner[chosen], scene.cell, len(scene.bodies), inward[:, chosen])
    return grid, scene.initial_volumes[chosen]


def _whole(grid: BodyGrids) -> tuple[BodyGrids, Ints]:
    """Grids of all cells in the bounding boxes of the bodies, and the number there of each given cell."""
    bodies, first = np.unique(grid.cell_body, return_index=True)  # cells lie body after body
    low, high = (f.reduceat(grid.cell_index, first, axis=1) for f in (np.minimum, np.maximum))
    sizes = (high - low + 1).T.tolist()
    boxes = [start[:, None] + np.indices(size).reshape(2, -1) for start, size in zip(low.T, sizes, strict=True)]
    owner = np.concatenate([grid.cell_body, np.repeat(bodies, [box.shape[1] for box in boxes])])
    centres = grid.cell * (np.concatenate([grid.cell_index, *boxes], axis=1) + 0.5)
    whole = build_grids(centres, owner, grid.cell, grid.bodies)
    return whole, whole.cell_of_point[: grid.cells]


def _moments(grid: BodyGrids, weight: Array, places: Array) -> Array:
    """Moments of 1, xi, eta by weights (n,) [m2] at local coordinates (2, n), (3, cells) [cell areas]."""
    share = weight / grid.cell**2
    return np.stack([np.bincount(grid.cell_of_point, share * f, grid.cells) for f in (1.0, *places)])


def _imbalance(grid: BodyGrids, moments: Array) -> Array:
    """Squared nodal integrals of shape function gradients over regions of such moments, (nodes,) [cells^2]."""
    at_corners = np.einsum("mIa,mc->Iac", reference_gradient(), moments)
    total = [np.bincount(grid.nodes_of_cell.ravel(), g.ravel(), grid.nodes) for g in at_corners]
    return np.asarray(total[0] ** 2 + total[1] ** 2)
