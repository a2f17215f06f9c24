"""Outlines, the polygons and curves through the boundary points of bodies: measures, neighbours and overlaps.

In every function `x` (2, m) [m] holds the current positions of the boundary points, in the order of `Outlines`.
"""

from skmpm.outline.cells import cell_moments
from skmpm.outline.crossings import apart, crossings, depth, folded, turns
from skmpm.outline.cubics import Loops, foot, place, seen, tangent
from skmpm.outline.curve import Cubics, Curve, curve
from skmpm.outline.images import Images, first_half, heights, images, lattice_vectors, reduced, without_images
from skmpm.outline.measures import (
    TURNED_AWAY,
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
from skmpm.outline.near import both_ways, candidates, closest, distance_to_segment, facing, inside
from skmpm.outline.overlaps import box_pairs, boxes, overlap
from skmpm.outline.polylines import Polylines, joined, polylines
from skmpm.outline.tips import tip_angles
from skmpm.outline.topology import Outlines, outlines
from skmpm.outline.widths import inclined_thickness, slit_width, thickness

__all__ = [
    "TURNED_AWAY",
    "Cubics",
    "Curve",
    "Images",
    "Loops",
    "Outlines",
    "Polylines",
    "apart",
    "area",
    "bend",
    "both_ways",
    "box_pairs",
    "boxes",
    "candidates",
    "cell_moments",
    "centroid",
    "chord_sagitta",
    "closest",
    "crossings",
    "curve",
    "depth",
    "dimensions",
    "distance_to_segment",
    "facing",
    "first_half",
    "folded",
    "foot",
    "half_segments",
    "heights",
    "images",
    "inclined_thickness",
    "inside",
    "joined",
    "lattice_vectors",
    "normals",
    "outlines",
    "overlap",
    "perimeter",
    "place",
    "polylines",
    "reduced",
    "second_moments",
    "seen",
    "slit_width",
    "tangent",
    "thickness",
    "tip_angles",
    "turning_angles",
    "turns",
    "without_images",
]
