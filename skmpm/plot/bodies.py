"""Bodies in pictures: filled curves and fields within them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from skmpm.outline import Polylines
from skmpm.plot.fields import Field, colour_map
from skmpm.plot.snapshot import Snapshot
from skmpm.plot.style import Style
from skmpm.plot.triangles import triangles

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

COLOURS = ("#8ecae6", "#f2b880", "#a3c9a8", "#d8a7b1", "#b8b3d9", "#e6d690", "#9fc5c1", "#c9b8a8")
RIGID, EDGE, EDGE_WIDTH = "0.72", "0.25", 0.5  # greys, and a width [pt]


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
        _shade(axes, seen, x, boundary, soft, field.values, style)
        faces = ["none" if seen.deformable[b] else RIGID for b in bodies.tolist()]
    axes.add_collection(PathCollection(paths, facecolors=faces, edgecolors=EDGE, linewidths=EDGE_WIDTH, zorder=2.0))
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
    values: NDArray[np.float64],
    style: Style,
) -> None:
    """Colour the bodies with these paths by values at the points (n,), which lie at x (2, n)."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path
    from matplotlib.tri import Triangulation

    mesh = triangles(x, seen.owner, seen.boundary_points, boundary, np.flatnonzero(seen.deformable))
    if mesh.corners.size == 0:
        return
    options: dict[str, Any] = {"cmap": colour_map(style.limits), "vmin": style.limits[0], "vmax": style.limits[1]}
    options |= {"shading": "gouraud", "zorder": 1.0, "rasterized": True}
    shading: Any = axes.tripcolor(Triangulation(mesh.x[0], mesh.x[1], mesh.corners), mesh.values(values), **options)
    shading.set_clip_path(PathPatch(Path.make_compound_path(*paths), transform=axes.transData))


def _scatter(axes: Axes, x: NDArray[np.float64], values: NDArray[Any], style: Style | None) -> None:
    from matplotlib.colors import ListedColormap

    options: dict[str, Any] = {"cmap": ListedColormap(COLOURS), "vmin": -0.5, "vmax": len(COLOURS) - 0.5}
    if style is not None:
        options = {"cmap": colour_map(style.limits), "vmin": style.limits[0], "vmax": style.limits[1]}
    axes.scatter(x[0], x[1], 4.0, values, zorder=2.0, **options)
