"""Body grids: the background grid of every body, as one disconnected scikit-fem mesh.

The grid is unbounded: a cell is a pair of integers, found by floor division. Each body occupies cells of its
own body grid; the occupied (body, cell) and (body, node) pairs are numbered, and one `MeshQuad` holds them all.
Bodies share no vertex, so every matrix assembled on this mesh is block diagonal, one block per body. Material
points are the quadrature of that mesh.
"""

from skmpm.grid.body_grids import CORNERS, BodyGrids
from skmpm.grid.building import build_grids, numbered
from skmpm.grid.mapping import CartesianMapping

__all__ = ["CORNERS", "BodyGrids", "CartesianMapping", "build_grids", "numbered"]
