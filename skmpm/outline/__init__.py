"""Outlines, the polygons and curves through the boundary points of bodies: measures, neighbours and overlaps.

In every function `x` (2, m) [m] holds the current positions of the boundary points, in the order of `Outlines`.
"""

from skmpm.outline.crossings import crossings, depth
from skmpm.outline.curve import Cubics, Curve, curve
from skmpm.outline.measures import area, centroid, dimensions, normals, perimeter, second_moments
from skmpm.outline.near import closest, inside
from skmpm.outline.overlaps import overlap
from skmpm.outline.polylines import Polylines, polylines
from skmpm.outline.topology import Outlines, outlines

__all__ = [
    "Cubics",
    "Curve",
    "Outlines",
    "Polylines",
    "area",
    "centroid",
    "closest",
    "crossings",
    "curve",
    "depth",
    "dimensions",
    "inside",
    "normals",
    "outlines",
    "overlap",
    "perimeter",
    "polylines",
    "second_moments",
]
