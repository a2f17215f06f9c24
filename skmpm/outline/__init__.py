"""Outlines, the polygons and curves through the boundary points of bodies: measures, neighbours and overlaps.

In every function `x` (2, m) [m] holds the current positions of the boundary points, in the order of `Outlines`.
"""

from skmpm.outline.cells import cell_moments
from skmpm.outline.crossings import apart, crossings, turns
from skmpm.outline.cubics import Cubics
from skmpm.outline.curve import Curve, curve
from skmpm.outline.measures import area, bend, centroid, chord_sagitta, dimensions, normals, perimeter, second_moments
from skmpm.outline.near import candidates, closest, inside
from skmpm.outline.overlaps import lens_depth, overlap
from skmpm.outline.topology import Outlines, outlines
from skmpm.outline.widths import slit_width, thickness

__all__ = [
    "Cubics",
    "Curve",
    "Outlines",
    "apart",
    "area",
    "bend",
    "candidates",
    "cell_moments",
    "centroid",
    "chord_sagitta",
    "closest",
    "crossings",
    "curve",
    "dimensions",
    "inside",
    "lens_depth",
    "normals",
    "outlines",
    "overlap",
    "perimeter",
    "second_moments",
    "slit_width",
    "thickness",
    "turns",
]
