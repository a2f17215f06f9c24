"""The thinnest part of bodies: the smallest width of material between opposite parts of the boundary.

A double normal is a line between two points of the boundary that is perpendicular to the boundary at both, as across
walls, strips and necks, and along diameters. The double normals that begin at boundary points p are found: the other
end is the foot of the perpendicular on an edge, or a vertex whose normal cone contains the direction to p. At p the
line may deviate from the normals by 15 degrees, because strips may taper. The two sides of a sharp convex corner
(tip) face each other as well; such a pair is excluded while the wedge between them widens. The thickness of a body
without double normals, for example a triangle, is the diameter of its largest inscribed circle.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.outline.curve import CORNER_COSINE
from skmpm.outline.topology import Floats, Integers, Outlines, chunks, ranges

# Sides at a larger angle form a wedge and no wall; the thickness of an ellipse of 4:1 is 0.89 of its short axis.
FACING_COSINE = np.cos(np.deg2rad(15.0))
TIP_COSINE = np.cos(np.deg2rad(150.0))  # of the turn of the boundary at a tip, a wedge of 30 degrees or less
# Pairs wider than this fraction of the wedge at a tip belong to the tip; a lens has half that width in its middle.
MIN_WEDGE_FRACTION = 0.5
MAX_POINTS = 500  # boundary points of a body that double normals begin at, evenly spaced; all edges are used
CHUNK = 500_000  # pairs processed at a time, which take about 100 MB
LENGTH_TOLERANCE = 1e-9  # relative to the length of an edge


def thickness(outlines: Outlines, x: Floats, bodies: int) -> Floats:
    """Return the width of the thinnest part of each body (bodies,) [m]; nan for a body without outline.

    It is the side of a square, the diameter of a disc, the wall of an annulus and the neck of a dumbbell; convex
    corners do not count.
    """
    count = np.bincount(outlines.body, minlength=bodies)
    found = np.where(count == 0, np.nan, np.inf)
    edges = _edges(outlines, x)
    tips = np.flatnonzero(_turned(outlines, edges))
    for p, e in _pairs(outlines, count):
        p, e, s, width = _facing(outlines, x, edges, p, e)
        wide = ~_at_tip(outlines, edges, tips, p, e, s, width)
        np.minimum.at(found, outlines.body[p[wide]], width[wide])
    compact = np.isinf(found)
    if compact.any():
        found[compact] = _inscribed(outlines, x, edges, np.where(compact, count, 0))[compact]
    return found


@dataclass(frozen=True)
class _Edges:
    """Geometry of the edges: tangents, inward normals, lengths, and positions on their loops."""

    along: Floats  # (2, m) unit tangent
    across: Floats  # (2, m) unit inward normal
    length: Floats  # (m,) [m]
    start: Floats  # (m,) arc length along the loop [m]
    loop: Integers  # (m,) number of the loop
    around: Floats  # (m,) length of the loop [m]


def _edges(outlines: Outlines, x: Floats) -> _Edges:
    t = x[:, outlines.next] - x
    length = np.maximum(np.hypot(*t), np.finfo(np.float64).tiny)
    along = t / length
    begins = outlines.previous >= np.arange(outlines.size)
    loop = np.cumsum(begins) - 1
    before = np.cumsum(length) - length
    around = np.bincount(loop, length)[loop] if loop.size else length
    return _Edges(along, np.stack([-along[1], along[0]]), length, before - before[begins][loop], loop, around)


def _turned(outlines: Outlines, edges: _Edges) -> NDArray[np.bool_]:
    """Whether boundary points are tips, (m,): convex corners of 30 degrees or less."""
    back = edges.along[:, outlines.previous]
    return np.asarray(
        (_dot(back, edges.along) < TIP_COSINE) & (_dot(edges.across[:, outlines.previous], edges.along) > 0.0)
    )


def _pairs(outlines: Outlines, count: Integers) -> Iterator[tuple[Integers, Integers]]:
    """Pairs of boundary points and all edges of their body, in chunks; bodies with zero `count` are left out."""
    first = np.searchsorted(outlines.body, np.arange(count.size))
    stride = np.maximum(1, -(-count // MAX_POINTS))[outlines.body]
    points = np.flatnonzero(
        (count[outlines.body] > 0) & ((np.arange(outlines.size) - first[outlines.body]) % stride == 0)
    )
    each = count[outlines.body[points]]
    for part in chunks(each, CHUNK) if points.size else ():
        p = points[part]
        yield np.repeat(p, each[part]), ranges(first[outlines.body[p]], each[part])


def _facing(
    outlines: Outlines, x: Floats, edges: _Edges, p: Integers, e: Integers
) -> tuple[Integers, Integers, Floats, Floats]:
    """The double normals among these pairs: boundary point, edge, arc length on the edge [m] and width [m]."""
    arm, after = x[:, p] - x[:, e], outlines.next[e]
    s, height, length = _dot(arm, edges.along[:, e]), _dot(arm, edges.across[:, e]), edges.length[e]
    inner, on_edge = (
        height > LENGTH_TOLERANCE * length,
        (s > -LENGTH_TOLERANCE * length) & (s < (1.0 + LENGTH_TOLERANCE) * length),
    )
    at_vertex = ~on_edge & (s > length) & (_dot(x[:, p] - x[:, after], edges.along[:, after]) < 0.0)
    k = np.flatnonzero(inner & (on_edge | at_vertex))
    p, e, s, on_edge = p[k], e[k], s[k], on_edge[k]
    direction = np.where(on_edge, -height[k] * edges.across[:, e], x[:, after[k]] - x[:, p])
    width = np.hypot(*direction)
    k = np.flatnonzero(_leaves(outlines, edges, p, direction / width))
    return p[k], e[k], np.clip(s[k], 0.0, edges.length[e[k]]), width[k]


def _leaves(outlines: Outlines, edges: _Edges, p: Integers, direction: Floats) -> NDArray[np.bool_]:
    """Whether unit vectors (2, k) point inward within 15 degrees of a normal at boundary points p, (k,).

    Normals are those of the two edges and, at a notch or a smooth boundary point, all directions between them.
    """
    back = outlines.previous[p]
    along, before = _dot(direction, edges.along[:, p]), _dot(direction, edges.along[:, back])
    across = np.stack([_dot(direction, edges.across[:, p]), _dot(direction, edges.across[:, back])])
    smooth = _dot(edges.along[:, p], edges.along[:, back]) > CORNER_COSINE
    between = ((before >= 0.0) & (along <= 0.0)) | (smooth & (before <= 0.0) & (along >= 0.0))
    return np.asarray((across.max(axis=0) > FACING_COSINE) | (between & (across.sum(axis=0) > 0.0)))


def _at_tip(
    outlines: Outlines, edges: _Edges, tips: Integers, p: Integers, e: Integers, s: Floats, width: Floats
) -> NDArray[np.bool_]:
    """Whether pairs connect the two sides of a tip and are about as wide as its wedge there, (k,)."""
    out = np.zeros(p.size, dtype=bool)
    first = np.searchsorted(edges.loop[tips], edges.loop[p])
    count = np.searchsorted(edges.loop[tips], edges.loop[p], side="right") - first
    count[edges.loop[p] != edges.loop[e]] = 0
    pair, tip = np.repeat(np.arange(p.size), count), tips[ranges(first, count)]
    ends = np.stack([edges.start[p], edges.start[e] + s])[:, pair]
    direction = _around(edges, ends - edges.start[tip], tip).sum(axis=0)
    turn = np.arccos(np.clip(_dot(edges.along[:, outlines.previous[tip]], edges.along[:, tip]), -1.0, 1.0))
    wedge = direction / np.tan(0.5 * turn)  # the tip's angle is pi less its turn
    out[pair[width[pair] >= MIN_WEDGE_FRACTION * wedge]] = True
    return out


def _around(edges: _Edges, direction: Floats, at: Integers) -> Floats:
    """Arc length along a loop in the shorter direction [m]."""
    return np.asarray(np.minimum(np.abs(direction), edges.around[at] - np.abs(direction)))


def _inscribed(outlines: Outlines, x: Floats, edges: _Edges, count: Integers) -> Floats:
    """Diameter (bodies,) [m] of the largest circle that touches the middle of an edge and contains no point."""
    middle, radius = x + 0.5 * edges.length * edges.along, np.full(outlines.size, np.inf)
    for p, e in _pairs(outlines, count):
        for other in (x, middle):
            direction = other[:, e] - middle[:, p]
            depth = _dot(direction, edges.across[:, p])
            k = np.flatnonzero(depth > LENGTH_TOLERANCE * edges.length[p])
            np.minimum.at(radius, p[k], 0.5 * _dot(direction, direction)[k] / depth[k])
    out = np.zeros(count.size)
    np.maximum.at(out, outlines.body, np.where(np.isinf(radius), 0.0, 2.0 * radius))
    return out


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[0] * b[0] + a[1] * b[1])
