"""Triangles between material points and boundaries, in which fields are interpolated linearly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError

from skmpm import outline
from skmpm.outline import Polylines

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles that fill the bodies with outlines, up to their curves.

    Corners are the n material points, of which some lie on the boundary, and the points of the curves between these.
    """

    x: Array  # (2, corners) [m]
    corners: Ints  # (triangles, 3)
    boundary: Polylines
    point: Ints  # (m,) material point of each boundary point

    def values(self, by_point: Array) -> Array:
        """Values at the corners (corners,) from those at the material points (n,)."""
        between = self.boundary.values(by_point[self.point]).reshape(-1, self.boundary.parts)[:, 1:]
        return np.append(by_point, between)


def triangles(points: Array, owner: Ints, boundary_points: Ints, boundary: Polylines, bodies: Ints) -> Triangles:
    """Triangulate some bodies (Delaunay), and leave out what lies outside their curves, as in notches and holes.

    Parameters
    ----------
    points, owner : (2, n) [m] material points, and (n,) their bodies
    boundary_points : (m,) those of them that are on the boundary
    boundary : the curves through these
    bodies : to be filled; those without outline are left out
    """
    n, between = owner.size, np.arange(boundary.outlines.size) % boundary.parts > 0
    x = np.concatenate([points, boundary.x[:, between]], axis=1)
    owner = np.append(owner, boundary.outlines.body[between])
    on_boundary = np.ones(owner.size, dtype=bool)
    on_boundary[:n] = False
    on_boundary[boundary_points] = True
    order = np.argsort(owner, kind="stable")
    ordered = owner[order]
    found = [np.zeros((0, 3), dtype=np.int64)]
    for b in np.intersect1d(bodies, boundary.outlines.body).tolist():
        own = order[slice(*np.searchsorted(ordered, (b, b + 1)))]
        found.append(own[_delaunay(x[:, own])])
    corners = np.concatenate(found)
    doubtful = np.flatnonzero(on_boundary[corners].all(axis=1))  # the others have a corner inside
    centre = x[:, corners[doubtful]].mean(axis=2)
    outside = ~outline.inside(boundary.outlines, boundary.x, owner[corners[doubtful, 0]], centre)
    return Triangles(x, np.delete(corners, doubtful[outside], axis=0), boundary, boundary_points)


def _delaunay(x: Array) -> Ints:
    """Triangles (t, 3) of points (2, k); none where all lie on a line."""
    try:
        return np.asarray(Delaunay((x - x.mean(axis=1, keepdims=True)).T).simplices, dtype=np.int64)
    except (QhullError, ValueError):
        return np.zeros((0, 3), dtype=np.int64)
