"""Material points: a quadrature rule with positive weights whose outermost points lie on the rim."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

if TYPE_CHECKING:
    import meshio

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Weights at the corners, edge midpoints and centre of a reference cell, by its number of corners: the degree 3
# rule of the triangle (Zienkiewicz & Taylor, The Finite Element Method, vol. 1; the area is 1/2), Simpson squared.
RIM_RULES = {3: (1 / 40, 1 / 15, 9 / 40), 4: (1 / 36, 4 / 36, 16 / 36)}
CORNERS = {"triangle": 3, "quad": 4}
NOT_AREAS = ("vertex", "line", "line3")


@dataclass(frozen=True, eq=False)
class Points:
    """Material points of one body and, if it has one, its outline.

    `outline` holds closed loops of indices of the points on the rim, in order: outer loops counter-clockwise,
    holes clockwise; the last point of a loop is joined to its first. Only types are converted here: see `check`.
    """

    x: Floats  # (2, n) [m]
    volume: Floats  # (n,) [m2 per metre of thickness]
    outline: tuple[Integers, ...] = ()  # one (m,) per loop

    def __post_init__(self) -> None:
        object.__setattr__(self, "x", np.asarray(self.x, dtype=np.float64))
        object.__setattr__(self, "volume", np.asarray(self.volume, dtype=np.float64))
        object.__setattr__(self, "outline", tuple(np.asarray(loop, dtype=np.int64) for loop in self.outline))

    @property
    def n(self) -> int:
        """Number of material points."""
        return int(self.volume.size)


def check(points: Points) -> str | None:
    """Say what is wrong with `points`, with the value and the remedy; None if nothing is."""
    x, volume = points.x, points.volume
    if x.ndim != 2 or x.shape[0] != 2 or x.shape[1] == 0:
        return f"x has the shape {x.shape}; give (2, n) with n > 0, components first"
    if volume.shape != x.shape[1:]:
        return f"volume has the shape {volume.shape}, x {x.shape}; give one volume per point"
    if not np.isfinite(x).all():
        return f"the position of point {np.argmin(np.isfinite(x).all(axis=0))} is not finite"
    if not (np.isfinite(volume) & (volume > 0)).all():
        worst = np.argmin(np.where(np.isfinite(volume), volume, -np.inf))
        return f"the volume of point {worst} is {volume[worst]:g}; volumes must be finite and > 0"
    for k, loop in enumerate(points.outline):
        if message := _check_loop(x, loop):
            return f"outline loop {k} {message}"
    return _check_orientation(x, points.outline)


def _check_loop(x: Floats, loop: Integers) -> str | None:
    if loop.ndim != 1 or loop.size < 3:
        return f"has the shape {loop.shape}; a loop is a list of at least 3 indices of points"
    if loop.min() < 0 or loop.max() >= x.shape[1]:
        return (
            f"has indices from {loop.min()} to {loop.max()}; there are {x.shape[1]} points, numbered from 0"
        )
    if np.unique(loop).size < loop.size:
        return "visits a point twice; it is closed implicitly, do not repeat its first point"
    length = np.linalg.norm(x[:, np.roll(loop, -1)] - x[:, loop], axis=0)
    if length.min() == 0:
        return f"has two consecutive points at the same place (point {loop[length.argmin()]}); merge them"
    return None


def _check_orientation(x: Floats, outline: Sequence[Integers]) -> str | None:
    """Loops inside an even number of others bound material from outside and must turn counter-clockwise."""
    for k, loop in enumerate(outline):
        depth = sum(_encloses(x[:, other], x[:, loop[0]]) for other in (*outline[:k], *outline[k + 1 :]))
        area, kind = _signed_area(x[:, loop]), ("an outer loop", "a hole")[depth % 2]
        if area * (-1) ** depth <= 0:
            way = ("counter-clockwise", "clockwise")[depth % 2]
            return f"outline loop {k} is {kind} with signed area {area:g}; list its points {way}"
    return None


def _signed_area(x: Floats) -> float:
    y = x - x[:, :1]
    z = np.roll(y, -1, axis=1)
    return float(np.sum(y[0] * z[1] - y[1] * z[0]) / 2)


def _encloses(x: Floats, p: Floats) -> bool:
    """Whether the loop x (2, m) goes around p (2,): parity of the edges crossed by the ray to the right."""
    (a, b), (c, d) = x - p[:, None], np.roll(x, -1, axis=1) - p[:, None]
    crosses = (b > 0) != (d > 0)
    side = (a * d - b * c) * np.sign(d - b)
    return bool(np.count_nonzero(crosses & (side > 0)) % 2)


def disc(centre: ArrayLike, radius: float, *, spacing: float) -> Points:
    """Return the points of a disc: rings of equal thickness, the outermost points on the rim.

    Each ring has its exact area, shared equally, at its root mean square radius; the outermost one carries a
    two-point Radau rule in the radial direction (weight r dr, exact for 1, r, r2) that includes the rim. Area,
    centroid and second moments are exact. The rim points are equally spaced, at least 8, and are the outline.

    Parameters
    ----------
    centre : (2,) [m]
    radius : [m]
    spacing : distance between neighbouring points, roughly [m]

    Raises
    ------
    ValueError
        If radius or spacing is not positive, or the centre is not a finite point.
    """
    c, R = _point("centre", centre), _positive("radius", radius)
    h = _positive("spacing", spacing)
    edges = R * np.linspace(0.0, 1.0, max(1, round(R / h)) + 1)
    area = np.pi * np.diff(edges**2)
    radii = np.sqrt((edges[1:] ** 2 + edges[:-1] ** 2) / 2)
    inner, rim, share = _radau_ring(edges[-2], R)
    radii = np.append(radii[:-1], (inner, rim))
    area = np.append(area[:-1], area[-1] * np.array((1 - share, share)))
    counts = np.maximum(np.rint(2 * np.pi * radii / h).astype(np.int64), 4)
    counts[-1] = max(8, counts[-1])

    place = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    shift = np.arange(counts.size)[::-1] % 2 / 2  # neighbouring rings staggered, a rim point at angle 0
    angle = 2 * np.pi * (place + np.repeat(shift, counts)) / np.repeat(counts, counts)
    x = c[:, None] + np.repeat(radii, counts) * np.array((np.cos(angle), np.sin(angle)))
    return Points(x, np.repeat(area / counts, counts), (np.arange(place.size - counts[-1], place.size),))


def _radau_ring(r0: float, R: float) -> tuple[float, float, float]:
    """Inner and outer radius of the Radau rule of the ring [r0, R], and the share of the area at R."""
    m1 = 2 / 3 * (R**2 + R * r0 + r0**2) / (R + r0)
    m2 = (R**2 + r0**2) / 2
    r2 = (m2 - m1 * R) / (m1 - R)
    return r2, R, (m1 - r2) / (R - r2)


def box(corner: ArrayLike, size: ArrayLike, *, spacing: float) -> Points:
    """Return the points of a rectangle: a tensor rule that includes edges and corners.

    In each direction the first and the last interval carry a two-point Radau rule that includes the end, the
    others a midpoint: area and first moments are exact. The rim points are the outline.

    Parameters
    ----------
    corner : (2,) lower left corner [m]
    size : (2,) width and height [m]
    spacing : length of the intervals, roughly [m]

    Raises
    ------
    ValueError
        If a size or the spacing is not positive, or the corner is not a finite point.
    """
    c, L, h = _point("corner", corner), _point("size", size), _positive("spacing", spacing)
    (x, u), (y, v) = (_radau_interval(_positive("size", length), h) for length in L.tolist())
    index = np.arange(x.size * y.size).reshape(x.size, y.size)
    rim = np.concatenate((index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]))
    position = c[:, None] + np.array((np.repeat(x, y.size), np.tile(y, x.size)))
    return Points(position, np.outer(u, v).ravel(), (rim,))


def _radau_interval(L: float, h: float) -> tuple[Floats, Floats]:
    """Points and weights on [0, L]: Radau at both ends (1/4 at the end, 3/4 at two thirds), else midpoints."""
    n = max(2, round(L / h))
    middle = np.arange(1, n - 1) + 0.5
    x = np.concatenate(((0, 2 / 3), middle, (n - 2 / 3, n))) / n
    w = np.concatenate(((1 / 4, 3 / 4), np.ones(n - 2), (3 / 4, 1 / 4))) / n
    return L * x, L * w


def _positive(name: str, value: float) -> float:
    if np.ndim(value) or not 0 < float(value) < np.inf:
        raise ValueError(f"{name} is {value!r}; give a finite number > 0")
    return float(value)


def _point(name: str, value: ArrayLike) -> Floats:
    point = np.asarray(value, dtype=np.float64)
    if point.shape != (2,) or not np.isfinite(point).all():
        raise ValueError(f"{name} is {value!r}; give two finite numbers")
    return point


def from_mesh(mesh: meshio.Mesh, *, order: int = 2) -> Points:
    """Return the points of a mesh of triangles and quadrilaterals.

    Inner cells carry the rule of scikit-fem that is exact to `order`; cells with an edge on the boundary a rule
    with points at corners, edge midpoints and centre, merged where such cells meet. The loops of boundary corners
    and midpoints are the outline, the largest first. The volumes add up to the area of the mesh.

    Parameters
    ----------
    mesh : a meshio.Mesh in the plane; blocks of lines and vertices and unused nodes are ignored
    order : polynomial degree of the rule of the inner cells

    Raises
    ------
    ValueError
        If there are no or other cells, nodes out of the plane or at the same place, degenerate or overlapping
        cells, or parts joined by one node only.
    """
    nodes, blocks = _read(mesh)
    ends, edges, edge, on_rim = _edges(blocks)
    centres = [nodes[:, b].mean(axis=1) for b in blocks]
    sites = np.concatenate((nodes, nodes[:, edges].mean(axis=1), *centres), axis=1)
    middle = nodes.shape[1] + edge

    weight = np.zeros(sites.shape[1])
    inner = []
    side, cell = 0, nodes.shape[1] + edges.shape[1]
    for b in blocks:
        sides, cells = slice(side, side + b.size), np.arange(cell, cell + b.shape[1])
        rim = on_rim[sides].reshape(b.shape).any(axis=0)
        site = np.concatenate((b, middle[sides].reshape(b.shape), cells[None]))[:, rim]
        weight += np.bincount(site.ravel(), _rim_weights(nodes[:, b[:, rim]]).ravel(), weight.size)
        inner.append(_inner_rule(nodes[:, b[:, ~rim]], order))
        side, cell = side + b.size, cell + b.shape[1]

    used = weight > 0
    number = np.cumsum(used) - 1
    loops = _loops(ends[:, on_rim], middle[on_rim], nodes)
    loops.sort(key=lambda loop: -abs(_signed_area(sites[:, loop])))
    x = np.concatenate((sites[:, used], *(x for x, _ in inner)), axis=1)
    volume = np.concatenate((weight[used], *(v for _, v in inner)))
    return Points(x, volume, tuple(number[loop] for loop in loops))


def _read(mesh: meshio.Mesh) -> tuple[Floats, list[Integers]]:
    """Nodes in use (2, n) and, per type, the nodes of each cell (corners, cells), counter-clockwise."""
    if others := sorted({block.type for block in mesh.cells} - {*CORNERS, *NOT_AREAS}):
        raise ValueError(f"the mesh has cells of type {others}; give cells of type 'triangle' and 'quad'")
    data = [
        [block.data for block in mesh.cells if block.type == kind and len(block.data)] for kind in CORNERS
    ]
    cells = [np.concatenate(blocks).astype(np.int64).T for blocks in data if blocks]
    if not cells:
        raise ValueError("the mesh has no cells of type 'triangle' or 'quad'")
    used, number = np.unique(np.concatenate([c.ravel() for c in cells]), return_inverse=True)
    nodes = _planar(np.asarray(mesh.points, dtype=np.float64)[used].T)
    counts = np.cumsum([0, *(c.size for c in cells)])
    cells = [number[i:j].reshape(c.shape) for i, j, c in zip(counts[:-1], counts[1:], cells, strict=True)]
    for c in cells:
        clockwise = _corner_jacobians(nodes[:, c]).sum(axis=0) < 0
        c[:, clockwise] = c[::-1, clockwise]
        jacobian = _corner_jacobians(nodes[:, c]).min(axis=0)
        if (flat := jacobian <= 1e-12 * np.abs(jacobian).max()).any():
            where = nodes[:, c[:, flat.argmax()]].mean(axis=1)
            raise ValueError(
                f"the cell at {where} has no area, is folded or is not convex; repair the mesh there"
            )
    return nodes, cells


def _planar(nodes: Floats) -> Floats:
    """Coordinates (2, n) of nodes that lie in a plane of constant z, each at a place of its own."""
    tiny = 1e-9 * np.ptp(nodes[:2], axis=1).max()
    if not np.isfinite(nodes).all() or np.abs(nodes[2:] - nodes[2:, :1]).max(initial=0.0) > tiny:
        raise ValueError("the nodes of the mesh are not in a plane z = constant; give a finite, plane mesh")
    if pairs := cKDTree(nodes[:2].T).query_pairs(tiny):
        where = nodes[:2, min(pairs)[0]]
        raise ValueError(
            f"the mesh has {len(pairs)} pairs of nodes at the same place, one at {where}; merge them"
        )
    return nodes[:2]


def _corner_jacobians(corners: Floats) -> Floats:
    """Jacobian of the (bi)linear map of a cell at its corners, from their positions (2, corners, cells)."""
    a, b = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    jacobian: Floats = a[0] * b[1] - a[1] * b[0]
    return jacobian


def _edges(blocks: list[Integers]) -> tuple[Integers, Integers, Integers, NDArray[np.bool_]]:
    """Return the ends of all sides (2, s), the edges (2, e), the edge of each side, and if it is on the boundary."""
    ends = np.concatenate([[b.ravel(), np.roll(b, -1, axis=0).ravel()] for b in blocks], axis=1)
    edges, edge, count = np.unique(np.sort(ends, axis=0), axis=1, return_inverse=True, return_counts=True)
    if np.unique(ends, axis=1).shape[1] < ends.shape[1]:
        raise ValueError(
            "cells of the mesh overlap: an edge has two cells on the same side; remove one of them"
        )
    return ends, edges, edge, count[edge] == 1


def _rim_weights(corners: Floats) -> Floats:
    """Weights (2 corners + 1, cells) of the rule at corners, edge midpoints and centre."""
    at_corner, at_edge, at_centre = RIM_RULES[corners.shape[1]]
    J = _corner_jacobians(corners)
    rows = (
        at_corner * J,
        at_edge * (J + np.roll(J, -1, axis=0)) / 2,
        at_centre * J.mean(axis=0, keepdims=True),
    )
    return np.concatenate(rows)


def _inner_rule(corners: Floats, order: int) -> tuple[Floats, Floats]:
    """Positions (2, m) and volumes (m,) of scikit-fem's rule in cells with corners (2, corners, cells)."""
    from skfem.quadrature import get_quadrature
    from skfem.refdom import RefQuad, RefTri

    triangles = corners.shape[1] == 3
    (xi, eta), W = get_quadrature(RefTri if triangles else RefQuad, order)
    if (
        W.min() <= 0
    ):  # some rules of the triangle have negative weights; material points have no negative mass
        return _inner_rule(corners, order + 1)
    one = 1 - xi
    N = np.array(
        (one - eta, xi, eta) if triangles else (one * (1 - eta), xi * (1 - eta), xi * eta, one * eta)
    )
    x: Floats = np.einsum("ikc,kq->icq", corners, N).reshape(2, -1)
    return x, (np.einsum("kc,kq->cq", _corner_jacobians(corners), N) * W).ravel()


def _loops(ends: Integers, middle: Integers, nodes: Floats) -> list[Integers]:
    """Join boundary sides (2, m) to loops of corners and edge midpoints in order, the material on the left."""
    starts, count = np.unique(ends[0], return_counts=True)
    if count.max() > 1:
        where = nodes[:, starts[count.argmax()]]
        raise ValueError(
            f"parts of the mesh are joined by the one node at {where}; separate them or add cells"
        )
    following = dict(zip(ends[0].tolist(), zip(ends[1].tolist(), middle.tolist(), strict=True), strict=True))
    loops = []
    while following:
        corner, loop = next(iter(following)), list[int]()
        while corner in following:
            loop.append(corner)
            corner, midpoint = following.pop(corner)
            loop.append(midpoint)
        loops.append(np.array(loop))
    return loops
