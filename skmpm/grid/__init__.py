"""Body grids: the background grids of all bodies as one disconnected scikit-fem mesh.

The grid is unbounded: a cell is a pair of integers, found by floor division. Each body occupies cells of its own body
grid; the occupied (body, cell) and (body, node) pairs are numbered and form one `MeshQuad`. Bodies share no vertices,
so every matrix assembled on this mesh is block diagonal with one block per body. The material points, or the
places to which moment fitting moves their strains, are quadrature points of this mesh.
"""

from skmpm.grid.body_grids import BodyGrids
from skmpm.grid.building import build_grids, numbered
from skmpm.grid.loops import CORNERS

__all__ = ["CORNERS", "BodyGrids", "build_grids", "numbered"]
