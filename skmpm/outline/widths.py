"""The thinnest part of bodies: the least width of material between parts of the boundary that face each other.

A double normal is a line between two places of the boundary that leaves both at right angles: across walls, strips
and necks, and along diameters. Those are found that begin at a boundary point p: the other end is the foot of the
perpendicular on an edge, or a vertex whose normals, from those of one edge to the other's, contain the direction to
p. At p the line may be 15 degrees off the normals, for strips taper. The sides of a sharp corner that sticks out face
each other, too: such a pair is left out as long as the wedge goes on opening. A body without pairs, as a triangle,
has the diameter of its largest inscribed circle.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.outline.curve import CORNER
from skmpm.outline.topology import Floats, Integers, Outlines, chunks, ranges

FACING = np.cos(np.deg2rad(15.0))  # less parallel sides are a wedge's; an ellipse of 4:1 has 0.89 of its short axis
CORNER_RADIUS = np.cos(np.deg2rad(150.0))  # of the boundary's turn at a tip: wedges of 30 degrees and less
OPENING = 0.5  # of the width of the wedge at a tip: what is wider is the tip's; in the middle a lens is half as wide
MOST = 500  # boundary points of a body that pairs begin at, evenly; all edges take part
CHUNK = 500_000  # pairs held at a time: about 100 MB
ANGLE_TOLERANCE = 1e-9  # of the length of an edge


def thickness(outlines: Outlines, x: Floats, bodies: int) -> Floats:
    """Return the width of the thinnest part of each body (bodies,) [m]; nan for a body without outline.

    Of a square its side, of a disc its diameter, of an annulus its wall, of a dumbbell its neck; corners do not.
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
    """The edges: unit vectors along and inward across them (2, m), lengths, and where on which loop they start."""

    along: Floats
    across: Floats
    length: Floats  # (m,) [m]
    start: Floats  # (m,) along its loop [m]
    loop: Integers  # (m,)
    around: Floats  # (m,) length of its loop [m]


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
    """Whether boundary points are tips, (m,): corners that stick out, of 30 degrees and less."""
    back = edges.along[:, outlines.previous]
    return np.asarray(
        (_dot(back, edges.along) < CORNER_RADIUS) & (_dot(edges.across[:, outlines.previous], edges.along) > 0.0)
    )


def _pairs(outlines: Outlines, count: Integers) -> Iterator[tuple[Integers, Integers]]:
    """Boundary points with every edge of their body, of bodies with `count` boundary points or none, in chunks."""
    first = np.searchsorted(outlines.body, np.arange(count.size))
    stride = np.maximum(1, -(-count // MOST))[outlines.body]
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
    """Of these pairs the double normals: boundary point, edge, place on the edge and width [m]."""
    arm, after = x[:, p] - x[:, e], outlines.next[e]
    s, height, length = _dot(arm, edges.along[:, e]), _dot(arm, edges.across[:, e]), edges.length[e]
    inner, on_edge = (
        height > ANGLE_TOLERANCE * length,
        (s > -ANGLE_TOLERANCE * length) & (s < (1.0 + ANGLE_TOLERANCE) * length),
    )
    at_vertex = ~on_edge & (s > length) & (_dot(x[:, p] - x[:, after], edges.along[:, after]) < 0.0)
    k = np.flatnonzero(inner & (on_edge | at_vertex))
    p, e, s, on_edge = p[k], e[k], s[k], on_edge[k]
    direction = np.where(on_edge, -height[k] * edges.across[:, e], x[:, after[k]] - x[:, p])
    width = np.hypot(*direction)
    k = np.flatnonzero(_leaves(outlines, edges, p, direction / width))
    return p[k], e[k], np.clip(s[k], 0.0, edges.length[e[k]]), width[k]


def _leaves(outlines: Outlines, edges: _Edges, p: Integers, direction: Floats) -> NDArray[np.bool_]:
    """Whether unit vectors (2, k) point inward within 15 degrees of normals of boundary points p or of their edges.

    Between its edges' normals lie those of a notch and of a smooth boundary; a corner that sticks out has none.
    """
    back = outlines.previous[p]
    along, before = _dot(direction, edges.along[:, p]), _dot(direction, edges.along[:, back])
    across = np.stack([_dot(direction, edges.across[:, p]), _dot(direction, edges.across[:, back])])
    smooth = _dot(edges.along[:, p], edges.along[:, back]) > CORNER
    between = ((before >= 0.0) & (along <= 0.0)) | (smooth & (before <= 0.0) & (along >= 0.0))
    return np.asarray((across.max(axis=0) > FACING) | (between & (across.sum(axis=0) > 0.0)))


def _at_tip(
    outlines: Outlines, edges: _Edges, tips: Integers, p: Integers, e: Integers, s: Floats, width: Floats
) -> NDArray[np.bool_]:
    """Whether pairs are the two sides of a tip, as far apart as its wedge is where they are, (k,)."""
    out = np.zeros(p.size, dtype=bool)
    first = np.searchsorted(edges.loop[tips], edges.loop[p])
    count = np.searchsorted(edges.loop[tips], edges.loop[p], side="right") - first
    count[edges.loop[p] != edges.loop[e]] = 0
    pair, tip = np.repeat(np.arange(p.size), count), tips[ranges(first, count)]
    ends = np.stack([edges.start[p], edges.start[e] + s])[:, pair]
    direction = _around(edges, ends - edges.start[tip], tip).sum(axis=0)
    turn = np.arccos(np.clip(_dot(edges.along[:, outlines.previous[tip]], edges.along[:, tip]), -1.0, 1.0))
    wedge = direction / np.tan(0.5 * turn)  # the tip's angle is pi less its turn
    out[pair[width[pair] >= OPENING * wedge]] = True
    return out


def _around(edges: _Edges, direction: Floats, at: Integers) -> Floats:
    """The shorter way along a loop [m]."""
    return np.asarray(np.minimum(np.abs(direction), edges.around[at] - np.abs(direction)))


def _inscribed(outlines: Outlines, x: Floats, edges: _Edges, count: Integers) -> Floats:
    """Diameter (bodies,) [m] of the largest circle that touches the middle of an edge and holds no boundary point."""
    middle, radius = x + 0.5 * edges.length * edges.along, np.full(outlines.size, np.inf)
    for p, e in _pairs(outlines, count):
        for place in (x, middle):
            direction = place[:, e] - middle[:, p]
            depth = _dot(direction, edges.across[:, p])
            k = np.flatnonzero(depth > ANGLE_TOLERANCE * edges.length[p])
            np.minimum.at(radius, p[k], 0.5 * _dot(direction, direction)[k] / depth[k])
    out = np.zeros(count.size)
    np.maximum.at(out, outlines.body, np.where(np.isinf(radius), 0.0, 2.0 * radius))
    return out


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[0] * b[0] + a[1] * b[1])
