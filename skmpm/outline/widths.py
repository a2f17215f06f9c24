"""The thinnest part and the narrowest slit of bodies: the smallest width between opposite parts of the boundary.

A double normal is a line between two points of the boundary that is perpendicular to the boundary at both, as across
walls, strips and necks, and along diameters. The double normals that begin at boundary points p are found: the other
end is the foot of the perpendicular on an edge, or a vertex whose normal cone contains the direction to p. At p the
line may deviate from the normals by 15 degrees, because strips may taper. The two sides of a sharp convex corner
(tip) face each other as well; such a pair is excluded while the wedge between them widens. The thickness of a body
without double normals, for example a triangle, is the diameter of its largest inscribed circle. Slits are the thin
parts of the complement, found on the reversed loops; a crack, whose sides meet at a tip under up to 15 degrees, has
the width of its mouth.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.outline.crossings import turns
from skmpm.outline.curve import CORNER_COSINE
from skmpm.outline.measures import turning_angles
from skmpm.outline.topology import Outlines, chunks, ranges

# Sides at a larger angle form a wedge and no wall; the thickness of an ellipse of 4:1 is 0.89 of its short axis.
FACING_COSINE = np.cos(np.deg2rad(15.0))
INCLINED = np.sin(np.deg2rad(15.0))  # least component of a normal that is inclined to the axes
TIP_COSINE = np.cos(np.deg2rad(150.0))  # of the turn of the boundary at a tip, a wedge of 30 degrees or less
# Pairs wider than this fraction of the wedge at a tip belong to the tip; a lens has half that width in its middle.
MIN_WEDGE_FRACTION = 0.5
# Boundary points of a body that double normals begin at, evenly spaced, and the turn of the boundary to another one,
# so that none is missed at a corner or a short arc; all edges are used.
MAX_POINTS, MAX_TURN = 500, np.deg2rad(10.0)
CHUNK = 500_000  # pairs processed at a time, which take about 100 MB
LENGTH_TOLERANCE = 1e-9  # relative to the length of an edge
MAX_SMOOTH_TURN = np.deg2rad(30.0)  # turns beyond it are corners, which take part in all pairs of their body


def thickness(outlines: Outlines, x: Array, bodies: int) -> Array:
    """Width of the thinnest part of each body, (bodies,) [m]; nan for a body without outline.

    It is the side of a square, the diameter of a disc, the wall of an annulus and the neck of a dumbbell; convex
    corners do not count.
    """
    count = np.bincount(outlines.body, minlength=bodies)
    edges = _edges(outlines, x)
    found, _ = _narrowest(outlines, x, edges, count)
    compact = np.isinf(found) & (count > 0)
    if compact.any():
        found[compact] = _inscribed(outlines, x, edges, np.where(compact, count, 0))[compact]
    return np.where(count == 0, np.nan, found)


def inclined_thickness(outlines: Outlines, x: Array, chosen: Bools) -> Array:
    """Width of the thinnest part whose sides are inclined to the axes by more than 15 degrees, (bodies,) [m].

    It is inf without such a part, and for bodies that are not `chosen` (bodies,).
    """
    if not chosen.any():
        return np.full(chosen.size, np.inf)
    count = np.where(chosen, np.bincount(outlines.body, minlength=chosen.size), 0)
    return _narrowest(outlines, x, _edges(outlines, x), count, inclination=INCLINED)[0]


def slit_width(outlines: Outlines, x: Array, bodies: int) -> Array:
    """Width of the narrowest slit, mouth or hole of each body, (bodies,) [m]; inf without a slit or an outline.

    Parts of the boundary that face each other over what is not material turn back by pi in between: bodies that turn
    back by less than pi less 15 degrees, as convex ones, are not searched.
    """
    _, backward = turns(outlines, x)
    folded = np.zeros(bodies, dtype=bool)
    folded[: backward.size] = backward > np.pi - np.arccos(FACING_COSINE)
    if not folded.any():
        return np.full(bodies, np.inf)
    last = outlines.size - 1
    back = Outlines(
        outlines.point[::-1],
        bodies - 1 - outlines.body[::-1],
        last - outlines.previous[::-1],
        last - outlines.next[::-1],
    )
    x = x[:, ::-1]
    count = np.where(folded[::-1], np.bincount(back.body, minlength=bodies), 0)
    return np.minimum(*_narrowest(back, x, _edges(back, x), count))[::-1]


def _narrowest(
    outlines: Outlines, x: Array, edges: _Edges, count: Ints, inclination: float = 0.0
) -> tuple[Array, Array]:
    """Least double normals of bodies with `count` boundary points or none, and least mouths of wedges, (bodies,).

    Of double normals those count whose components are at least `inclination`.
    """
    found, mouth = np.full((2, count.size), np.inf)
    tips = np.flatnonzero(_turned(outlines, edges))
    widest = np.zeros(tips.size)
    for p, e in _steep_pairs(outlines, edges, count):
        p, e, s, width = _facing(outlines, x, edges, p, e)
        pair, tip = _at_tip(outlines, edges, tips, p, e, s, width)
        np.maximum.at(widest, tip, width[pair])
        wide = np.abs(edges.across[:, e]).min(axis=0) >= inclination
        wide[pair] = False
        np.minimum.at(found, outlines.body[p[wide]], width[wide])
    np.minimum.at(mouth, outlines.body[tips[widest > 0.0]], widest[widest > 0.0])
    return found, mouth


@dataclass(frozen=True)
class _Edges:
    """The edges: unit vectors along and inward across them (2, m), lengths, and where on which loop they start."""

    along: Array
    across: Array
    length: Array  # (m,) [m]
    start: Array  # (m,) along its loop [m]
    loop: Ints  # (m,)
    around: Array  # (m,) length of its loop [m]
    turn: Array  # (m,) to the left at their starts [rad]


def _edges(outlines: Outlines, x: Array) -> _Edges:
    t = x[:, outlines.next] - x
    length = np.maximum(np.hypot(*t), np.finfo(np.float64).tiny)
    along = t / length
    begins = outlines.previous >= np.arange(outlines.size)
    loop = np.cumsum(begins) - 1
    before = np.cumsum(length) - length
    around = np.bincount(loop, length)[loop] if loop.size else length
    across, turn = np.stack([-along[1], along[0]]), turning_angles(outlines, x)
    return _Edges(along, across, length, before - before[begins][loop], loop, around, turn)


def _turned(outlines: Outlines, edges: _Edges) -> Bools:
    """Whether boundary points are tips, (m,): corners that stick out, of 30 degrees and less."""
    back = edges.along[:, outlines.previous]
    return np.asarray((_dot(back, edges.along) < TIP_COSINE) & (edges.turn > 0.0))


def _starts(outlines: Outlines, edges: _Edges, count: Ints) -> Ints:
    """The boundary points that pairs begin at, of bodies with `count` boundary points or none."""
    first = np.searchsorted(outlines.body, np.arange(count.size))
    stride = np.maximum(1, -(-count // MAX_POINTS))[outlines.body]
    chosen = (np.arange(outlines.size) - first[outlines.body]) % stride == 0
    turned = np.floor(np.cumsum(np.abs(edges.turn)) / MAX_TURN)
    return np.flatnonzero((count[outlines.body] > 0) & (chosen | (np.diff(turned, prepend=0.0) > 0.0)))


def _pairs(outlines: Outlines, edges: _Edges, count: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Boundary points with every edge of their body, of bodies with `count` boundary points or none, in chunks."""
    points, first = _starts(outlines, edges, count), np.searchsorted(outlines.body, np.arange(count.size))
    body = outlines.body[points]
    yield from _in_chunks(points, first[body], count[body])


def _in_chunks(points: Ints, first: Ints, count: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Points, each with the numbers `first`, ..., `first + count - 1`, in chunks."""
    for part in chunks(count, CHUNK) if points.size else ():
        yield np.repeat(points[part], count[part]), ranges(first[part], count[part])


def _steep_pairs(outlines: Outlines, edges: _Edges, count: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Of the `_pairs` those in which the edge runs against those of the point as far as facing ones do.

    Edges that end in a corner may face any point. The others of a body are sorted by their direction, two turns of
    them, so that those that face a point are consecutive.
    """
    angle = np.arctan2(edges.along[1], edges.along[0]) % (2.0 * np.pi)
    turn, points = edges.turn, _starts(outlines, edges, count)
    body, margin = outlines.body[points], np.arccos(FACING_COSINE) + MAX_SMOOTH_TURN
    corner = np.abs(turn[outlines.next]) > MAX_SMOOTH_TURN
    smooth, corners = np.flatnonzero(~corner), np.flatnonzero(corner)
    key = np.concatenate([angle[smooth], angle[smooth] + 2.0 * np.pi]) + 8.0 * np.pi * np.tile(
        outlines.body[smooth], 2
    )
    order = np.argsort(key)
    least = (angle[points] - np.maximum(turn[points], 0.0) + np.pi - margin) % (2.0 * np.pi) + 8.0 * np.pi * body
    first = np.searchsorted(key[order], least)
    each = np.searchsorted(key[order], least + np.abs(turn[points]) + 2.0 * margin, side="right") - first
    for p, k in _in_chunks(points, first, each):
        yield p, smooth[order[k] % smooth.size]
    first = np.searchsorted(outlines.body[corners], body)
    each = np.searchsorted(outlines.body[corners], body, side="right") - first
    for p, k in _in_chunks(points, first, each):
        yield p, corners[k]


def _facing(outlines: Outlines, x: Array, edges: _Edges, p: Ints, e: Ints) -> tuple[Ints, Ints, Array, Array]:
    """Of these pairs the double normals: boundary point, edge, place on the edge and width [m]."""
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


def _leaves(outlines: Outlines, edges: _Edges, p: Ints, direction: Array) -> Bools:
    """Whether unit vectors (2, k) point inward within 15 degrees of normals of boundary points p or of their edges.

    Between its edges' normals lie those of a notch and of a smooth boundary; a corner that sticks out has none.
    """
    back = outlines.previous[p]
    along, before = _dot(direction, edges.along[:, p]), _dot(direction, edges.along[:, back])
    across = np.stack([_dot(direction, edges.across[:, p]), _dot(direction, edges.across[:, back])])
    smooth = _dot(edges.along[:, p], edges.along[:, back]) > CORNER_COSINE
    between = ((before >= 0.0) & (along <= 0.0)) | (smooth & (before <= 0.0) & (along >= 0.0))
    return np.asarray((across.max(axis=0) > FACING_COSINE) | (between & (across.sum(axis=0) > 0.0)))


def _at_tip(
    outlines: Outlines, edges: _Edges, tips: Ints, p: Ints, e: Ints, s: Array, width: Array
) -> tuple[Ints, Ints]:
    """The pairs that are the two sides of a tip, as far apart as its wedge is there, and which of the tips."""
    first = np.searchsorted(edges.loop[tips], edges.loop[p])
    count = np.searchsorted(edges.loop[tips], edges.loop[p], side="right") - first
    count[edges.loop[p] != edges.loop[e]] = 0
    pair, number = np.repeat(np.arange(p.size), count), ranges(first, count)
    tip = tips[number]
    ends = np.stack([edges.start[p], edges.start[e] + s])[:, pair]
    direction = _around(edges, ends - edges.start[tip], tip).sum(axis=0)
    turn = np.arccos(np.clip(_dot(edges.along[:, outlines.previous[tip]], edges.along[:, tip]), -1.0, 1.0))
    wedge = direction / np.tan(0.5 * turn)  # the tip's angle is pi less its turn
    close = width[pair] >= MIN_WEDGE_FRACTION * wedge
    return pair[close], number[close]


def _around(edges: _Edges, direction: Array, at: Ints) -> Array:
    """The shorter way along a loop [m]."""
    return np.asarray(np.minimum(np.abs(direction), edges.around[at] - np.abs(direction)))


def _inscribed(outlines: Outlines, x: Array, edges: _Edges, count: Ints) -> Array:
    """Diameter (bodies,) [m] of the largest circle that touches the middle of an edge and holds no boundary point."""
    middle, radius = x + 0.5 * edges.length * edges.along, np.full(outlines.size, np.inf)
    for p, e in _pairs(outlines, edges, count):
        for place in (x, middle):
            direction = place[:, e] - middle[:, p]
            depth = _dot(direction, edges.across[:, p])
            k = np.flatnonzero(depth > LENGTH_TOLERANCE * edges.length[p])
            np.minimum.at(radius, p[k], 0.5 * _dot(direction, direction)[k] / depth[k])
    out = np.zeros(count.size)
    np.maximum.at(out, outlines.body, np.where(np.isinf(radius), 0.0, 2.0 * radius))
    return out


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(a[0] * b[0] + a[1] * b[1])
