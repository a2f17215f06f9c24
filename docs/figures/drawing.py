"""Figures of the docs in two modes: NAME.svg for white paper, and NAME_dark.svg for the site's dark background.

`python docs/figures/X.py` writes those of a script into docs/static. Pages name the former, docs/pictures.py adds the
latter.
"""

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patheffects import withStroke

from skmpm import outline

DOCS = Path(__file__).parents[1]
STATIC = DOCS / "static"
OPTIONS = {
    "svg": {"metadata": {"Date": None, "Creator": None}},
    "webp": {"dpi": 220, "bbox_inches": "tight", "pad_inches": 0.02, "pil_kwargs": {"quality": 85}},
}


@dataclass(frozen=True)
class Ink:
    """Colours of a mode."""

    text: str
    muted: str  # lines of grids and leaders
    faint: str  # background grid, walls
    paper: str
    body: str  # filled cells
    other: str  # those of a second body
    points: str
    edge: str  # outlines
    boundary: str  # boundary points
    force: str


LIGHT = Ink(
    "#222832", "#6b7280", "#c9cdd3", "#ffffff", "#cfe3f2", "#f7dfc2", "#2f78b0", "#222832", "#c2540a", "#b2182b"
)
DARK = Ink(
    "#e6e9ed", "#9aa3ad", "#4a525c", "#14181e", "#234156", "#55401f", "#79b8e4", "#e6e9ed", "#f2954a", "#f4717f"
)
MODES = {"": LIGHT, "_dark": DARK}
RC = {
    "font.size": 8.0,
    "svg.hashsalt": "skmpm",
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
}


def save(name, draw, kind="svg"):
    """Write the figures that `draw(ink)` returns, of both modes."""
    for mode, ink in MODES.items():
        colours = dict.fromkeys(
            ("text.color", "axes.labelcolor", "xtick.color", "ytick.color", "axes.edgecolor"), ink.text
        )
        with plt.rc_context(RC | colours):
            figure = draw(ink)
            figure.savefig(STATIC / f"{name}{mode}.{kind}", **OPTIONS[kind])
            plt.close(figure)


def label(axes, ink, text, at, place, around=None):
    """Write a text at a place, in a colour around it, with a leader line that ends at a point."""
    arrow = {"arrowstyle": "-", "color": ink.muted, "linewidth": 0.8, "shrinkA": 2.0, "shrinkB": 0.0}
    halo = [withStroke(linewidth=3.0, foreground=around)] if around else []
    axes.annotate(text, at, place, arrowprops=arrow, color=ink.text, va="center", zorder=9.0, path_effects=halo)


def arrow(axes, start, end, colour, width=1.6, **options):
    """Draw an arrow from one point to another."""
    style = {"arrowstyle": "-|>,head_length=0.45,head_width=0.2", "color": colour, "linewidth": width}
    style |= {"shrinkA": 0.0, "shrinkB": 0.0}
    axes.annotate("", tuple(end), tuple(start), arrowprops=style | options, zorder=8.0)


def canvas(width, view):
    """Axes without frame and ticks in a figure of a width [inches], that show ((left, right), (lower, upper))."""
    (left, right), (low, high) = view
    axes = plt.figure(figsize=(width, width * (high - low) / (right - left))).add_axes((0.0, 0.0, 1.0, 1.0))
    bare(axes, view)
    return axes


def bare(axes, view):
    """Show ((left, right), (lower, upper)), without frame and ticks."""
    axes.set(xlim=view[0], ylim=view[1], aspect="equal", xticks=[], yticks=[])
    axes.set_axis_off()


def curves(scene, x, unit=1.0):
    """The smooth outlines, a closed loop (2, k) for each, and the boundary points (2, m) on them, in a unit [m]."""
    place = scene.outlines.point
    line = outline.polylines(scene.outlines, scene.initial_positions[:, place], x[:, place], 12)
    ends = zip(line.loops[:-1], line.loops[1:], strict=True)
    loops = [line.x[:, slice(*each)] / unit for each in ends]
    return [np.concatenate([loop, loop[:, :1]], axis=1) for loop in loops], x[:, place] / unit
