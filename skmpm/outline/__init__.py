"""Outlines, the polygons and curves through the boundary points of bodies: measures, neighbours and overlaps.

In every function `x` (2, m) [m] holds the current positions of the boundary points, in the order of `Outlines`.
"""

from skmpm.outline.cells import cell_moments
from skmpm.outline.crossings import crossings, depth
from skmpm.outline.curve import Cubics, Curve, curve
from skmpm.outline.measures import (
    area,
    bend,
    centroid,
    chord_sagitta,
    dimensions,
    half_segments,
    normals,
    perimeter,
    second_moments,
    turning_angles,
)
from skmpm.outline.near import closest, inside
from skmpm.outline.overlaps import overlap
from skmpm.outline.polylines import Polylines, polylines
from skmpm.outline.tips import tip_angles
from skmpm.outline.topology import Outlines, outlines
from skmpm.outline.widths import inclined_thickness, slit_width, thickness

__all__ = [
    "Cubics",
    "Curve",
    "Outlines",
    "Polylines",
    "area",
    "bend",
    "cell_moments",
    "centroid",
    "chord_sagitta",
    "closest",
    "crossings",
    "curve",
    "depth",
    "dimensions",
    "half_segments",
    "inclined_thickness",
    "inside",
    "normals",
    "outlines",
    "overlap",
    "perimeter",
    "polylines",
    "second_moments",
    "slit_width",
    "thickness",
    "tip_angles",
    "turning_angles",
]
