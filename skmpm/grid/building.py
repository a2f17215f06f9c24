"""Construction of the body grids from the positions of material points."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array, Ints
from skmpm.grid.body_grids import BodyGrids
from skmpm.grid.loops import CORNERS

TABLE_RATIO = 30  # possible keys per given key above which sorting is faster than a table of all possible keys


def numbered(key: Ints, size: int) -> tuple[Ints, Ints]:
    """Rank (k,) of each key (k,) among the distinct keys, and an index of each distinct key; 0 <= key < size.

    A table of all possible keys is used, several times faster than sorting unless only few of them occur.
    """
    if size > TABLE_RATIO * key.size:
        _, where, number = np.unique(key, return_index=True, return_inverse=True)
        return number, where
    table = np.full(size, -1)
    table[key] = np.arange(key.size)
    present = np.flatnonzero(table >= 0)
    where = table[present]
    table[present] = np.arange(present.size)
    return table[key], where


def build_grids(x: Array, body: Ints, cell: float, bodies: int, inward: Array | None = None) -> BodyGrids:
    """Build the body grids of points `x` (2, n) [m] of bodies `body` (n,).

    A point exactly on a grid line belongs to the cell on the side that `inward` (2, n) points to, if given, so that a
    boundary on a grid line does not occupy cells outside its body.
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
    along = np.where(extent[0] <= extent[1], 0, 1)  # rows are parallel to the shorter side
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
    return BodyGrids(
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
