"""Material points: quadrature rules with positive weights and points on the boundary."""

from skmpm.points.cloud import Points, check
from skmpm.points.composed import joined, row
from skmpm.points.contour import from_outline
from skmpm.points.convex import capsule, ellipse, polygon
from skmpm.points.mesh import from_mesh
from skmpm.points.rings import disc, ring
from skmpm.points.shapes import box

__all__ = [
    "Points",
    "box",
    "capsule",
    "check",
    "disc",
    "ellipse",
    "from_mesh",
    "from_outline",
    "joined",
    "polygon",
    "ring",
    "row",
]
