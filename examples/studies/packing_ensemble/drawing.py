"""What the figures have in common: colours, bands, and small files."""

from __future__ import annotations

import io
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from .curves import PHI, Array, Study

COLOURS = {0.0: "C0", 0.1: "C2", 0.5: "C3"}
FRACTION = r"solid fraction $\Phi$ by outlines"
DPI = 120, 110, 100, 90, 80, 70, 60  # the first at which a picture is small enough
LARGEST = 120_000  # bytes
TONES = 128  # colours of a picture


def save(figure: Figure | None, path: Path) -> bool:
    """Write a small PNG; without a figure delete one of an earlier study, which would be mistaken for this one's."""
    if figure is None:
        path.unlink(missing_ok=True)
        return False
    for dpi in DPI:
        memory = io.BytesIO()
        figure.savefig(memory, dpi=dpi)
        image = Image.open(memory).convert("RGB")
        image.quantize(TONES, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(path, optimize=True)
        if path.stat().st_size < LARGEST:
            break
    plt.close(figure)
    return True


def panels(
    rows: int, columns: int, width: float, height: float, **options: object
) -> tuple[Figure, list[list[Axes]]]:
    """A figure of panels of one size [inch]."""
    size = (width * columns, height * rows)
    return plt.subplots(rows, columns, figsize=size, layout="constrained", squeeze=False, **options)


def label_of(found: Study, kind: str, friction: float) -> str:
    """Friction, and how many packings there are."""
    return rf"$\mu$ = {friction:g} ({len(found.seeds(kind, friction))})"


def band(axis: Axes, found: Study, kind: str, friction: float, name: str, unit: float = 1.0, label: str = "") -> None:
    """Mean over the packings of a kind and its standard error."""
    line(axis, found, kind, friction, name, "-", unit, linewidth=1.5, label=label or None)
    if found.seeds(kind, friction):
        value, error = (unit * v for v in found.curve(kind, friction, name))
        axis.fill_between(PHI, value - error, value + error, color=COLOURS[friction], alpha=0.25, linewidth=0.0)


def line(
    axis: Axes, found: Study, kind: str, friction: float, name: str, style: str, unit: float = 1.0, **options: object
) -> None:
    """The mean alone."""
    if found.seeds(kind, friction):
        value = unit * found.curve(kind, friction, name)[0]
        axis.plot(PHI, value, COLOURS[friction], linestyle=style, **{"linewidth": 0.9} | options)


def legend(axis: Axes) -> None:
    """Say what was drawn, if anything was."""
    if axis.get_legend_handles_labels()[0]:
        axis.legend(fontsize=8)


def fitted(axis: Axes, found: Study, kind: str, friction: float, curves: list[Array], width: float = 0.6) -> None:
    """Mean of curves that were fitted to packings, as far as the measured one goes, in black."""
    there = np.isfinite(found.curve(kind, friction, "solid_fraction")[0])
    axis.plot(PHI, np.where(there, np.mean(curves, axis=0), np.nan), "k", linewidth=width)


def any_of(found: Study, *kinds: str) -> bool:
    """Whether there is a packing of one of the kinds."""
    return any(found.seeds(kind, friction) for kind in kinds for friction in COLOURS)
