"""Pictures for the examples: outlines filled by a colour, and walls."""

from __future__ import annotations

import io
from pathlib import Path

import matplotlib
import numpy as np

import skmpm

matplotlib.use("Agg")
import matplotlib.path as mpath
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from PIL import Image

COLOURS = plt.get_cmap("tab20").colors
GREY = "0.75"


def pressure(state: skmpm.State) -> np.ndarray:
    """Pressure at the points (n,) [Pa], compression positive."""
    return -0.5 * (state.stress[0, 0] + state.stress[1, 1])


def plot(
    scene: skmpm.Scene,
    state: skmpm.State,
    colour: str | np.ndarray = "body",
    *,
    axes: Axes | None = None,
    limits: tuple[float, float] | None = None,
) -> Axes:
    """Draw a state: outlines filled by "body", "pressure" [Pa] or values (n,) at the points, and walls.

    The colour map spans `limits`, by default the 1st and 99th percentiles; pass an element of `axes.collections` to
    `colorbar`.
    """
    axes = plt.subplots(layout="constrained")[1] if axes is None else axes
    values = pressure(state) if isinstance(colour, str) and colour == "pressure" else colour
    for b, body in enumerate(scene.bodies):
        points = slice(*scene.offsets[b : b + 2])
        x, plain = state.x[:, points], isinstance(values, str) or isinstance(body.material, skmpm.Rigid)
        loops = [np.append(loop, loop[0]) for loop in body.points.outline]
        path = mpath.Path.make_compound_path(*(mpath.Path(x[:, loop].T, closed=True) for loop in loops))
        face = COLOURS[7 * b % 20] if isinstance(values, str) else GREY
        axes.add_patch(PathPatch(path, facecolor=face if plain else "none", edgecolor="black", linewidth=0.5))
        if not plain:
            low, high = np.percentile(values, (1, 99)) if limits is None else limits
            style = {"shading": "gouraud", "cmap": "viridis", "vmin": low, "vmax": high}
            field = axes.tripcolor(*x, values[points], **style, zorder=0.5)
            field.set_clip_path(path, axes.transData)
    axes.set_aspect("equal")
    axes.autoscale_view()
    view = {"xlim": axes.get_xlim(), "ylim": axes.get_ylim()} if scene.walls else {}
    for point, (n_x, n_y) in zip(state.walls, state.wall_normals, strict=True):
        axes.axline(point, (point[0] - n_y, point[1] + n_x), color="black", linewidth=1.5)
    axes.set(**view)  # walls are infinite lines
    return axes


def save(figure: Figure, path: Path) -> None:
    """Write a picture, create its directory if needed, and print the path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=70, bbox_inches="tight", pad_inches=0.05)  # without the margin beside equal axes
    plt.close(figure)
    image = Image.open(drawn).convert("RGB")
    image.quantize(128, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"picture: {path}")
