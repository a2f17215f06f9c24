"""Bodies in pictures: filled curves, and fields within them, linear in triangles between points and boundaries."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError

from skmpm import outline
from skmpm.arrays import Array, Ints
from skmpm.outline import Polylines
from skmpm.plot import fringes
from skmpm.plot.fields import Field, Style
from skmpm.plot.snapshot import Snapshot

if TYPE_CHECKING:
    from matplotlib.axes import Axes


COLOURS = ("#8ecae6", "#f2b880", "#a3c9a8", "#d8a7b1", "#b8b3d9", "#e6d690", "#9fc5c1", "#c9b8a8")
RIGID, EDGE, EDGE_WIDTH = "0.72", "0.25", 0.5  # greys, and a width [pt]


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


def draw_bodies(axes: Axes, seen: Snapshot, field: Field, style: Style, offset: Array) -> None:
    """Fill the bodies by a field or by their colours, rigid ones grey, and draw their boundaries.

    All displaced by an offset (2,) [m]. Bodies without outline are drawn as their points.
    """
    from matplotlib.collections import PathCollection

    boundary = seen.boundary()
    boundary, x = replace(boundary, x=boundary.x + offset[:, None]), seen.x + offset[:, None]
    paths, bodies = body_paths(boundary)
    faces = [COLOURS[b % len(COLOURS)] if seen.deformable[b] else RIGID for b in bodies.tolist()]
    if field.values is not None:
        soft = [path for path, b in zip(paths, bodies.tolist(), strict=True) if seen.deformable[b]]
        _shade(axes, seen, x, boundary, soft, field, style)
        faces = ["none" if seen.deformable[b] else RIGID for b in bodies.tolist()]
    # Axes clip bodies. To ask how much room they take is to turn each triangle into a path.
    outlined = PathCollection(paths, facecolors=faces, edgecolors=EDGE, linewidths=EDGE_WIDTH, zorder=2.0)
    outlined.set_in_layout(False)
    axes.add_collection(outlined)
    bare = np.flatnonzero(~seen.outlined[seen.owner])
    if bare.size:
        values = seen.owner[bare] % len(COLOURS) if field.values is None else field.values[bare]
        _scatter(axes, x[:, bare], values, None if field.values is None else style)


def body_paths(boundary: Polylines) -> tuple[list[Any], Ints]:
    """A path for each body with an outline, holes as loops of the opposite sense, and these bodies (k,)."""
    from matplotlib.path import Path

    owner, paths = boundary.outlines.body[boundary.loops[:-1]], []
    for b in np.unique(owner).tolist():
        loops = [boundary.x[:, slice(*boundary.loops[i : i + 2])].T for i in np.flatnonzero(owner == b)]
        closed = [Path(np.concatenate([loop, loop[:1]]), closed=True) for loop in loops]
        paths.append(Path.make_compound_path(*closed))
    return paths, np.unique(owner)


def _shade(
    axes: Axes,
    seen: Snapshot,
    x: Array,
    boundary: Polylines,
    paths: list[Any],
    field: Field,
    style: Style,
) -> None:
    """Colour the bodies with these paths by a field of the points, which lie at x (2, n)."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path
    from matplotlib.tri import Triangulation

    mesh = triangles(x, seen.owner, seen.boundary_points, boundary, np.flatnonzero(seen.deformable))
    if mesh.corners.size == 0:
        return
    corners, place = mesh.corners, mesh.x
    if field.order is not None:
        place, corners, order = fringes.divided(place, corners, np.stack([mesh.values(each) for each in field.order]))
        values = fringes.light(order)
    else:
        assert field.values is not None
        values = mesh.values(field.values)
    options: dict[str, Any] = {"cmap": style.colours, "vmin": style.limits[0], "vmax": style.limits[1]}
    options |= {"shading": "gouraud", "zorder": 1.0, "rasterized": True}
    shading: Any = axes.tripcolor(Triangulation(place[0], place[1], corners), values, **options)
    shading.set_in_layout(False)
    shading.set_clip_path(PathPatch(Path.make_compound_path(*paths), transform=axes.transData))


def _scatter(axes: Axes, x: Array, values: NDArray[Any], style: Style | None) -> None:
    from matplotlib.colors import ListedColormap

    options: dict[str, Any] = {"cmap": ListedColormap(COLOURS), "vmin": -0.5, "vmax": len(COLOURS) - 0.5}
    if style is not None:
        options = {"cmap": style.colours, "vmin": style.limits[0], "vmax": style.limits[1]}
    axes.scatter(x[0], x[1], 4.0, values, zorder=2.0, **options)
