"""Points within closed curves: equidistant boundary points, a triangular lattice inside, areas of its triangles."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from skmpm.arrays import Array, Bools, Ints
from skmpm.points.cloud import Points, signed_area
from skmpm.points.shapes import check_number

Curve = Callable[[Array], Array]  # points (2, n) at parameters (n,), of period 1; the body lies on its left

# Least distance of a lattice point from the boundary, over the spacing. With 0.2, 0.3, 0.4, 0.6 and 0.8 a uniform
# stress is too small by 2.6, 2.7, 5.4, 12.6 and 13 % in the worst of 150 bodies whose points are 0.74 cells apart
# (`preflight.sampling`, ellipses, capsules and polygons as in tests/unit/test_shapes.py).
CLEARANCE = 0.3
# Points of a boundary, at least, and in every spacing, by which its length and distances from it are measured: those
# are too large by up to 0.03 spacings.
FINE, FINE_IN_SPACING = 2000, 4
LEAST_IN_LOOP = 8  # boundary points, as of a `disc`
HALVINGS = 6  # of intervals of the boundary beside slits and notches; slits of 0.005 to 0.1 spacings took up to four


def rounded(vertices: Array, radius: float, origin: Array) -> tuple[Curve, Array, float]:
    """The boundary, seen from the origin (2, 1), of a polygon (2, k) of which arcs replace the corners.

    Returns
    -------
    curve by its length, parameters of ends and middles of its arcs (vertices without a radius), area on its left
    """
    k, side = vertices.shape[1], np.roll(vertices, -1, axis=1) - vertices
    length, heading = np.hypot(*side), np.arctan2(side[1], side[0])
    turn = np.mod(np.roll(heading, -1) - heading + np.pi, 2.0 * np.pi) - np.pi  # at the end of each side
    cut = np.tan(0.5 * np.abs(turn))
    both = cut + np.roll(cut, 1)
    if (over := radius * both - length).max() > 1e-9 * length.max():
        i, most = over.argmax(), float((length / np.maximum(both, 1e-300)).min())
        raise ValueError(
            f"rounding is {radius:g}, its arcs need {radius * both[i]:.4g} m of the side of {length[i]:.4g} m"
            f" that begins at {vertices[:, i]} m; give {0.99 * most:.3g} or less"
        )
    straight = np.maximum(-over, 0.0)
    start = vertices - origin + radius * np.roll(cut, 1) * side / length
    ends = np.append(0.0, np.cumsum(np.stack([straight, radius * np.abs(turn)], axis=1)))

    def curve(s: Array) -> Array:
        along = np.mod(s, 1.0) * ends[-1]
        piece = np.clip(np.searchsorted(ends, along, side="right") - 1, 0, 2 * k - 1)
        i, rest, on_arc = piece // 2, along - ends[piece], piece % 2 == 1
        phi, bend = heading[i], radius * np.sign(turn[i])
        forward = np.where(on_arc, straight[i], rest) * np.stack([np.cos(phi), np.sin(phi)])
        psi = phi + np.where(on_arc, np.sign(turn[i]) * rest / max(radius, 1e-300), 0.0)
        x: Array = start[:, i] + forward + bend * np.stack([np.sin(psi) - np.sin(phi), np.cos(phi) - np.cos(psi)])
        return x

    breaks = np.unique(np.concatenate([ends[1:], 0.5 * (ends[1::2] + ends[2::2])])) % ends[-1]
    area = signed_area(vertices) - radius**2 * float(np.sum(np.tan(0.5 * turn) - 0.5 * turn))
    return curve, np.sort(breaks) / ends[-1], area


def filled(loops: Sequence[tuple[Curve, Array]], area: float, h: float, origin: Array) -> Points:
    """Points within curves that are seen from the origin (2, 1), a spacing h apart; volumes add up to the area.

    Each curve has boundary points at its knots, ascending parameters, and at equal intervals between them.
    """
    check_number(area, h)
    fine, places = [], []
    for curve, knots in loops:
        x, s = _boundary(curve, knots, h)
        fine.append(x)
        places.append(s)
    for _ in range(HALVINGS + 1):
        boundary = [curve(s) for (curve, _), s in zip(loops, places, strict=True)]
        x = np.concatenate([*boundary, _lattice(boundary, np.concatenate(fine, axis=1), h)], axis=1)
        own = consecutive([s.size for s in places])
        volume, lacks = _shares(x, own)
        if not lacks.any() and volume.min() > 0.0:
            return Points(origin + x, volume * (area / volume.sum()), tuple(own))
        places = [_halved(s, lacks[loop]) for s, loop in zip(places, own, strict=True)]
    where = origin[:, 0] + x[:, lacks.argmax() if lacks.any() else volume.argmin()]
    raise ValueError(f"spacing is {h:g}; a slit, notch or part at {where} m needs a smaller one, or a wider gap")


def consecutive(sizes: Sequence[int]) -> list[Ints]:
    """The numbers of points that are in loops of so many, one after the other."""
    return np.split(np.arange(sum(sizes)), np.cumsum(sizes)[:-1])


def _boundary(curve: Curve, knots: Array, h: float) -> tuple[Array, Array]:
    """Closely spaced points (2, n) of a curve, and the parameters (m,) of its boundary points."""
    cuts, pieces = np.append(knots, knots[0] + 1.0), FINE
    for _ in range(2):
        s, at = _divided(cuts, np.ceil(pieces * np.diff(cuts) - 1e-9))
        fine = curve(s)
        along = np.append(0.0, np.cumsum(np.hypot(*np.diff(fine, axis=1))))
        pieces = max(FINE, int(np.ceil(FINE_IN_SPACING * along[-1] / h)))
    parts = along[at]
    counts = np.maximum(np.rint(np.diff(parts) / h - 1e-9), -(-LEAST_IN_LOOP // knots.size))
    return fine[:, :-1], np.interp(_divided(parts, counts)[0][:-1], along, s)


def _divided(cuts: Array, counts: Array) -> tuple[Array, Ints]:
    """Values from cut to cut in as many equal parts, and where the cuts are among them."""
    at = np.append(0, np.cumsum(counts)).astype(np.int64)
    return np.interp(np.arange(at[-1] + 1), at, cuts), at


def _halved(s: Array, chosen: Bools) -> Array:
    """Ascending parameters of period 1, with the middles of the chosen intervals."""
    middles = 0.5 * (s + np.append(s[1:], s[0] + 1.0))
    return np.sort(np.append(s, middles[chosen]))


def _lattice(loops: Sequence[Array], fine: Array, h: float) -> Array:
    """The points (2, k) of a triangular lattice within polygons (2, m), and not close to the fine boundary (2, n)."""
    start, end = np.concatenate(loops, axis=1), np.concatenate([np.roll(x, -1, axis=1) for x in loops], axis=1)
    rows, columns = (int(most) + 1 for most in np.abs(start).max(axis=1)[::-1] / (h * np.array([np.sqrt(0.75), 1.0])))
    inside = list[Array]()
    for j in range(-rows, rows + 1):
        y = h * np.sqrt(0.75) * j
        (a, b), (c, d) = (ends[:, (start[1] > y) != (end[1] > y)] for ends in (start, end))
        x = h * (np.arange(-columns, columns + 1) + 0.5 * (j % 2))
        x = x[np.searchsorted(np.sort(a + (y - b) / (d - b) * (c - a)), x) % 2 == 1]
        inside.append(np.stack([x, np.full(x.size, y)]))
    lattice: Array = np.concatenate(inside, axis=1)
    return lattice[:, cKDTree(fine.T).query(lattice.T)[0] > CLEARANCE * h]


def _shares(x: Array, loops: Sequence[Ints]) -> tuple[Array, Bools]:
    """Areas of the triangles around points (2, n), a third of each, and of which edges of the loops these cross.

    The points of the loops come first. A triangle that crosses no loop lies on the left of one if it has its corners
    there in their order, and between loops if it has corners of several.
    """
    following = np.concatenate([np.roll(loop, -1) for loop in loops])
    a, b, c = np.sort(Delaunay(x.T).simplices, axis=1).T.astype(np.int64)
    n, m = x.shape[1], following.size
    start, end = np.sort([np.arange(m), following], axis=0)
    crossed = ~np.isin(n * start + end, np.concatenate([n * a + b, n * b + c, n * a + c]))
    p, q = x[:, b] - x[:, a], x[:, c] - x[:, a]
    size = 0.5 * (p[0] * q[1] - p[1] * q[0])
    loop = np.repeat(np.arange(len(loops)), [own.size for own in loops])
    of_loops = np.flatnonzero(c < m)
    outside = of_loops[(loop[a[of_loops]] == loop[c[of_loops]]) & (size[of_loops] < 0.0)]
    size = np.abs(size)
    size[outside] = 0.0
    return np.asarray(np.bincount(np.concatenate([a, b, c]), np.tile(size / 3.0, 3), n), dtype=np.float64), crossed
