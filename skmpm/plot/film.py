"""`animate`: a film of states."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skmpm.plot.fields import Limits, field_of
from skmpm.plot.figure import add_legend, draw, matplotlib_module, new_axes
from skmpm.plot.style import style_of
from skmpm.scene import Scene, State, check_fits
from skmpm.units import prefixed

WRITERS = {".mp4": "ffmpeg", ".gif": "pillow", ".html": "html"}


def animate(
    states: Iterable[State],
    path: str | Path,
    *,
    scene: Scene,
    colour: str | NDArray[np.floating] = "pressure",
    forces: bool = False,
    limits: Limits | None = None,
    label: str = "",
    fps: int = 20,
    dpi: float = 120.0,
) -> Path:
    """Write a film of states as `plot` draws them, with one colour scale, force scale and view for all.

    Parameters
    ----------
    states : in the order of their frames; all are held in memory
    path : the file; its suffix .mp4 (needs ffmpeg), .gif or .html decides the format
    scene, colour, forces, limits, label : as for `plot`
    fps : frames per second
    dpi : pixels per inch, of a figure of 6.4 by 4.8 inches

    Returns
    -------
    path

    Raises
    ------
    ImportError
        if matplotlib is not installed
    ValueError
        if there is no state, the suffix is another, ffmpeg is needed and not found, or as for `plot`
    FileNotFoundError
        if the directory of the file does not exist
    """
    path, frames = Path(path), list(states)
    _check(path, frames)
    for state in frames:
        check_fits(scene, state, "animate")
    writer, axes = _writer(path, fps), new_axes()
    fields = [field_of(scene, state, colour, label) for state in frames]
    style = style_of(scene, frames, fields, forces=forces, limits=limits)
    picture: Any = axes.get_figure()
    add_legend(axes, scene, fields[-1], style)
    with writer.saving(picture, str(path), dpi):
        for state, field in zip(frames, fields, strict=True):
            for artist in [*axes.collections, *axes.lines]:
                artist.remove()
            draw(axes, scene, state, field, style)
            scale, unit = prefixed("s", state.t)
            axes.set_title(f"t = {state.t / scale:.4g} {unit}", loc="right")
            writer.grab_frame()
    matplotlib_module("pyplot").close(picture)
    return path


def _check(path: Path, frames: list[State]) -> None:
    """Raise an error where no film can be written, before anything is drawn."""
    if not frames:
        raise ValueError("animate: there are no states")
    if path.suffix.lower() not in WRITERS:
        raise ValueError(f"animate: {path} has the suffix {path.suffix!r}; use .mp4, .gif or .html")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"animate: the directory {path.parent} does not exist")


def _writer(path: Path, fps: int) -> Any:
    animation, kind = matplotlib_module("animation"), WRITERS[path.suffix.lower()]
    if not animation.writers.is_available(kind):
        raise ValueError(f"animate: {path} needs {kind}, which is not installed; install it, or write a .gif")
    return animation.writers[kind](fps=fps)
