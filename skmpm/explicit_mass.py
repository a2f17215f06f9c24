"""Nodal masses of explicit steps, without nodes that are nearly empty."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.grid import BodyGrids

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Smallest mass of a node, over that of the heaviest node of its body. The longest stable step of discs of R/h = 3.2,
# 5 and 10 with Poisson's ratios of 0.3 and 0.45 is 0.09 h/c at the least favourable of 30 positions on the grid
# without a bound; with 0.03, 0.04, 0.05 it is 0.67, 0.69, 0.72 h/c.
MIN_MASS = 0.05
DIRECTIONS = [(dx, dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy]


def explicit_mass(grid: BodyGrids, lumped: Array) -> Array:
    """Nodal masses (nodes,) of at least `MIN_MASS`, from the lumped masses (nodes,) of the points [kg/m].

    A light node i gets what it lacks along the line of nodes i, j, k into the body whose node j is heaviest, diagonal
    lines only where it is twice as heavy: j loses twice as much, k gets the same. That keeps the mass of a body and
    its first moments, and adds two cells squared times the added mass to its moment of inertia, 0.1 to 0.2 % for
    discs of R/h = 5. Where there is no such line, as in parts one cell wide, or j would become light, all nodes of
    the body give, light ones too.
    """
    heaviest = np.zeros(grid.bodies)
    np.maximum.at(heaviest, grid.node_body, lumped)
    least = MIN_MASS * heaviest[grid.node_body]
    light = np.flatnonzero(lumped < least)
    lack, (j, k) = (least - lumped)[light], _inward(grid, lumped, light)
    mass, found = lumped.copy(), j >= 0
    mass[light] = least[light]
    np.subtract.at(mass, j[found], 2.0 * lack[found])
    np.add.at(mass, k[found], lack[found])
    mass = np.maximum(mass, least)
    given, taken = grid.sums(np.stack([lumped, mass]))
    return np.asarray((given / np.maximum(taken, 1e-300))[grid.node_body] * mass)


def _inward(grid: BodyGrids, lumped: Array, light: Ints) -> tuple[Ints, Ints]:
    """The next two nodes (light,) of nodes in the direction with the heaviest next one; -1 where there are none."""
    best, chosen = np.zeros(light.size), np.full((2, light.size), -1)
    lowest = grid.node_index.min(axis=1) - 2
    width, height = grid.node_index.max(axis=1) - lowest + 3

    def key(index: Ints, body: Ints) -> Ints:
        return np.asarray((body * width + index[0] - lowest[0]) * height + index[1] - lowest[1])

    keys = key(grid.node_index, grid.node_body)
    order = np.argsort(keys)
    for direction in np.array(DIRECTIONS):
        pair = []
        for distance in (1, 2):
            wanted = key(grid.node_index[:, light] + distance * direction[:, None], grid.node_body[light])
            at = order[np.minimum(np.searchsorted(keys[order], wanted), order.size - 1)]
            pair.append(np.where(keys[at] == wanted, at, -1))
        near = np.stack(pair)
        weight = np.where((near >= 0).all(axis=0), lumped[near[0]], 0.0) / (direction @ direction)
        chosen = np.where(weight > best, near, chosen)
        best = np.maximum(best, weight)
    return chosen[0], chosen[1]
