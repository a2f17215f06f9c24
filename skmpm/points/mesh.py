"""Points of a finite element mesh: scikit-fem's rule in inner cells, in outer cells one with boundary points."""

from __future__ import annotations

import logging
from copy import copy
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from skmpm.arrays import Array, Bools, Ints
from skmpm.outline.cubics import backward_shares
from skmpm.points.cloud import Points, signed_area
from skmpm.points.mesh_groups import cell_groups

if TYPE_CHECKING:
    import meshio
    import skfem

_log = logging.getLogger("skmpm")

# Weights at the corners, edge midpoints and centre of a reference cell by its number of corners: the degree 3
# rule of the triangle (Zienkiewicz & Taylor, The Finite Element Method, vol. 1; its area is 1/2), Simpson's.
BOUNDARY_RULES = {3: (1 / 40, 1 / 15, 9 / 40), 4: (1 / 36, 4 / 36, 16 / 36)}
CORNERS = {"triangle": 3, "quad": 4}
SECOND_ORDER = {"triangle6": "triangle", "triangle7": "triangle", "quad8": "quad", "quad9": "quad"}
NOT_AREAS = ("vertex", "line", "line3")
HIGHEST = 19  # degree of the last rule that scikit-fem has for triangles; its weights are positive
# Boundaries that turn by less from edge to edge are smooth: circles of twelve edges and more.
SMOOTH_COSINE = np.cos(np.deg2rad(30.5))
LARGEST_BULGE = 0.75  # of a midpoint's area that a concave boundary takes from it; in flat cells it has little

Rule = tuple[Ints, Ints, Array]  # sites (m, cells) of cells, the centre last, their groups, weights


def from_mesh(mesh: meshio.Mesh | skfem.Mesh, *, order: int = 2) -> Points:
    """Points of a mesh of triangles and quadrilaterals.

    Physical groups of cells, as gmsh writes them, sets of cells (`meshio.Mesh.cell_sets`) and subdomains of
    scikit-fem become the groups of the points (`Points.group`), for a body of several materials: see `Body`. An
    unnamed group has its number as a name; of several sets the smallest that a cell belongs to counts, cells in none
    are "other". The sets that gmsh makes of all curves and surfaces of an Abaqus file, "Surface1" and so on, count
    where no other does. The volumes of a group add up to the area of its cells.

    With `order` 2 edges of the mesh should be about 1.2 cells of the scene long, in both directions: a uniform stress
    is then right to 2 %. With edges of 2 cells some cells have no points, the body may be 10 to 50 % too soft, and
    with longer ones it may fall apart; a higher order adds points to inner cells of the mesh, but none to those on
    the boundary. `preflight` warns of it.

    Parameters
    ----------
    mesh : a meshio.Mesh or a mesh of scikit-fem, in the plane; blocks of lines and vertices and unused nodes are
        ignored. Of cells with six to nine nodes the corners are taken, and the log says so
    order : polynomial degree of the rule of the inner cells

    Returns
    -------
    points and loops of the outline, the largest first; groups as in the mesh

    Raises
    ------
    ValueError
        if the order is out of range; if the mesh has no or other cells, sets of cells that it does not have, nodes
        out of the plane or at the same position, degenerate or overlapping cells, or parts joined by one node only

    Notes
    -----
    Inner cells carry the rule of scikit-fem that is exact to `order`; cells with an edge on the boundary a
    rule with points at corners, edge midpoints and centre, merged where such cells meet. The loops of boundary
    corners and midpoints are the outline. Midpoints lie on the chord where the boundary turns by
    more than 30.5 degrees at an end of the edge, else on a smooth curve through the corners: with midpoints on chords
    a round body would roll as a polygon. At holes with flat cells they lie between the two. The volumes add up to the
    area of the outlines. A mesh of several parts is not split: call this once per part. Polygons of eight and more
    sides have a smooth outline: see `Points`.

    Examples
    --------
    >>> import skfem
    >>> import skmpm
    >>> points = skmpm.from_mesh(skfem.MeshQuad().refined(2))
    >>> len(points.outline[0])
    32
    >>> round(float(points.volume.sum()), 3)
    1.0
    """
    if order not in range(HIGHEST + 1):
        raise ValueError(f"order is {order}; give a whole degree from 0 to {HIGHEST}")
    mesh = _first_order(mesh)
    nodes, blocks = _read(mesh)
    names, groups = cell_groups(mesh, tuple(CORNERS))
    count = max(len(names), 1)
    ends, edges, edge, outer = _edges(blocks)
    centres = [nodes[:, b].mean(axis=1) for b in blocks]
    sites = np.concatenate((nodes, nodes[:, edges].mean(axis=1), *centres), axis=1)
    midpoint = nodes.shape[1] + edge

    cell = nodes.shape[1] + edges.shape[1]
    inner, outermost = [], []
    for b, group, its_middle, its_outer in zip(
        blocks, groups, _split(midpoint, blocks), _split(outer, blocks), strict=True
    ):
        boundary = its_outer.any(axis=0)
        site = np.concatenate((b, its_middle, [np.arange(cell, cell + boundary.size)]))[:, boundary]
        outermost.append((site, group[boundary], _boundary_weights(nodes[:, b[:, boundary]])))
        x, volume = _inner_rule(nodes[:, b[:, ~boundary]], order)
        inner.append((x, volume, np.repeat(group[~boundary], x.shape[1] // max((~boundary).sum(), 1))))
        cell += boundary.size

    loops = _loops(ends[:, outer], midpoint[outer], nodes)
    weight, own = _weights(outermost, (sites.shape[1], count), np.concatenate(loops))
    used = weight.ravel() > 0
    number = (np.cumsum(used) - 1).reshape(weight.shape)[np.arange(own.size), own]
    for loop in loops:
        bulge, area = _bulges(nodes[:, loop[::2]])
        middle = loop[1::2], own[loop[1::2]]
        share = np.minimum(1.0, LARGEST_BULGE * weight[middle] / np.maximum(-area, 1e-300))
        sites[:, middle[0]] += share * bulge
        weight[middle] += share * area
    loops.sort(key=lambda loop: -abs(signed_area(sites[:, loop])))
    at, of = np.divmod(np.flatnonzero(used), count)
    x = np.concatenate((sites[:, at], *(x for x, _, _ in inner)), axis=1)
    volume = np.concatenate((weight.ravel()[used], *(v for _, v, _ in inner)))
    own_group = np.array(names)[np.concatenate((of, *(g for _, _, g in inner)))] if names else None
    return Points(x, volume, tuple(number[loop] for loop in loops), own_group)


def _first_order(mesh: meshio.Mesh | skfem.Mesh) -> meshio.Mesh:
    """The mesh as one of meshio, whose cells have only their corners."""
    from meshio import CellBlock
    from skfem import Mesh
    from skfem.io.meshio import to_meshio

    if isinstance(mesh, Mesh):
        mesh = to_meshio(mesh)
    if not (hasattr(mesh, "cells") and hasattr(mesh, "points")):
        raise ValueError(
            f"the mesh is a {type(mesh).__name__}; give a meshio.Mesh, as meshio.read(path), or one of scikit-fem"
        )
    if kinds := sorted({block.type for block in mesh.cells} & SECOND_ORDER.keys()):
        _log.warning("from_mesh takes the corners of cells of type %s", ", ".join(kinds))
    first = copy(mesh)
    first.cells = []
    for block in mesh.cells:
        kind = SECOND_ORDER.get(block.type, block.type)
        first.cells.append(CellBlock(kind, block.data[:, : CORNERS.get(kind)]))
    return first


def _read(mesh: meshio.Mesh) -> tuple[Array, list[Ints]]:
    """Nodes in use (2, n) and, per type, the nodes of each cell (corners, cells), counter-clockwise."""
    if others := sorted({block.type for block in mesh.cells} - {*CORNERS, *NOT_AREAS}):
        raise ValueError(f"the mesh has cells of type {others}; give cells of type 'triangle' and 'quad'")
    data = [[block.data for block in mesh.cells if block.type == kind and len(block.data)] for kind in CORNERS]
    cells = [np.concatenate(blocks).astype(np.int64).T for blocks in data if blocks]
    if not cells:
        raise ValueError("the mesh has no cells of type 'triangle' or 'quad'")
    used, number = np.unique(np.concatenate([c.ravel() for c in cells]), return_inverse=True)
    nodes = _planar(np.asarray(mesh.points, dtype=np.float64)[used].T)
    cells = _split(number, cells)
    for c in cells:
        clockwise = _corner_jacobians(nodes[:, c]).sum(axis=0) < 0
        c[:, clockwise] = c[::-1, clockwise]
        jacobian = _corner_jacobians(nodes[:, c]).min(axis=0)
        if (flat := jacobian <= 1e-12 * np.abs(jacobian).max()).any():
            where = nodes[:, c[:, flat.argmax()]].mean(axis=1)
            raise ValueError(f"the cell at {where} has no area, is folded or is not convex; repair the mesh there")
    return nodes, cells


def _split(flat: NDArray[Any], blocks: list[Ints]) -> list[NDArray[Any]]:
    """Split values in the order of the blocks into arrays of the blocks' shapes."""
    parts = np.split(flat, np.cumsum([b.size for b in blocks])[:-1])
    return [part.reshape(b.shape) for part, b in zip(parts, blocks, strict=True)]


def _planar(nodes: Array) -> Array:
    """Coordinates (2, n) of nodes that lie in a plane of constant z, each at its own position."""
    tiny = 1e-9 * np.ptp(nodes[:2], axis=1).max()
    if not np.isfinite(nodes).all() or np.abs(nodes[2:] - nodes[2:, :1]).max(initial=0.0) > tiny:
        raise ValueError("the nodes of the mesh are not in a plane z = constant; give a finite, plane mesh")
    if pairs := cKDTree(nodes[:2].T).query_pairs(tiny):
        where = nodes[:2, min(pairs)[0]]
        raise ValueError(f"the mesh has {len(pairs)} pairs of nodes at the same position, one at {where}; merge them")
    return nodes[:2]


def _corner_jacobians(corners: Array) -> Array:
    """Jacobian of the (bi)linear map of a cell at its corners, from their positions (2, corners, cells)."""
    a, b = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    jacobian: Array = a[0] * b[1] - a[1] * b[0]
    return jacobian


def _edges(blocks: list[Ints]) -> tuple[Ints, Ints, Ints, Bools]:
    """Ends of all sides (2, s), edges (2, e), the edge of each side, and whether that is on the boundary."""
    ends = np.concatenate([[b.ravel(), np.roll(b, -1, axis=0).ravel()] for b in blocks], axis=1)
    edges, edge, count = np.unique(np.sort(ends, axis=0), axis=1, return_inverse=True, return_counts=True)
    if np.unique(ends, axis=1).shape[1] < ends.shape[1]:
        raise ValueError("cells of the mesh overlap: an edge has two cells on the same side; remove one of them")
    edge = edge.ravel()  # of shape (1, s) in NumPy 2.0.0
    return ends, edges, edge, count[edge] == 1


def _boundary_weights(corners: Array) -> Array:
    """Weights (2 corners + 1, cells) of the rule at corners, edge midpoints and centre."""
    at_corner, at_edge, at_centre = BOUNDARY_RULES[corners.shape[1]]
    J = _corner_jacobians(corners)
    rows = (
        at_corner * J,
        at_edge * (J + np.roll(J, -1, axis=0)) / 2,
        at_centre * J.mean(axis=0, keepdims=True),
    )
    return np.concatenate(rows)


def _weights(rules: list[Rule], shape: tuple[int, int], boundary: Ints) -> tuple[Array, Ints]:
    """Weights (sites, groups) of rules at sites, and the group of each boundary site, (sites,).

    That is the group with the largest weight there; the others' weights go to the centres of their cells, for no
    point but one of the outline lies on the boundary.
    """
    weight, own = np.zeros(shape), np.zeros(shape[0], dtype=np.int64)
    for site, group, values in rules:
        key = shape[1] * site + group
        weight += np.bincount(key.ravel(), values.ravel(), weight.size).reshape(shape)
    own[boundary] = weight[boundary].argmax(axis=1)
    on_boundary = np.bincount(boundary, minlength=shape[0]) > 0
    for site, group, values in rules if shape[1] > 1 else ():
        other = on_boundary[site] & (own[site] != group)
        np.add.at(weight, (site[-1], group), np.where(other, values, 0.0).sum(axis=0))
        weight[site[other], np.broadcast_to(group, site.shape)[other]] = 0.0
    return weight, own


def _inner_rule(corners: Array, order: int) -> tuple[Array, Array]:
    """Positions (2, m) and volumes (m,) of scikit-fem's rule in cells with corners (2, corners, cells)."""
    from skfem.quadrature import get_quadrature
    from skfem.refdom import RefQuad, RefTri

    triangles = corners.shape[1] == 3
    (xi, eta), W = get_quadrature(RefTri if triangles else RefQuad, order)
    if W.min() <= 0:  # as in some rules of the triangle; masses of material points must be positive
        return _inner_rule(corners, order + 1)
    one = 1 - xi
    N = np.array((one - eta, xi, eta) if triangles else (one * (1 - eta), xi * (1 - eta), xi * eta, one * eta))
    x: Array = np.einsum("ikc,kq->icq", corners, N).reshape(2, -1)
    return x, (np.einsum("kc,kq->cq", _corner_jacobians(corners), N) * W).ravel()


def _bulges(x: Array) -> tuple[Array, Array]:
    """From midpoints of edges to a smooth curve through the corners x (2, m) of a loop, (2, m); areas added, (m,).

    Tangents are those of the outline's curve; Hermite's cubic is off the chord by (T_1 - T_2) l / 8 in the middle.
    Areas are those of the triangles between edge and midpoint.
    """
    edge = np.roll(x, -1, axis=1) - x
    length = np.hypot(*edge)
    along, before = edge / length, np.roll(edge / length, 1, axis=1)
    smooth = (along * before).sum(axis=0) > SMOOTH_COSINE
    number = np.arange(length.size)
    share = backward_shares(x, np.roll(number, 1), np.roll(number, -1), ~smooth)
    tangent = (1.0 - share) * along + share * before
    turn = np.where(smooth & np.roll(smooth, -1), tangent - np.roll(tangent, -1, axis=1), 0.0)
    bulge = length / 8.0 * turn
    return bulge, 0.5 * (bulge[0] * edge[1] - bulge[1] * edge[0])


def _loops(ends: Ints, middle: Ints, nodes: Array) -> list[Ints]:
    """Join boundary sides (2, m) to loops of corners and edge midpoints in order, the material on the left."""
    starts, count = np.unique(ends[0], return_counts=True)
    if count.max() > 1:
        where = nodes[:, starts[count.argmax()]]
        raise ValueError(f"parts of the mesh are joined by the one node at {where}; separate them or add cells")
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
