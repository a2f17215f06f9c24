"""`animate`: a film of states."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skmpm.io import Frame
from skmpm.plot.fields import Limits, View, field_of, style_of
from skmpm.plot.figure import add_legend, draw, matplotlib_module, new_axes
from skmpm.plot.snapshot import Snapshot, of_frame, of_state
from skmpm.representation import prefixed
from skmpm.scene import Scene, State, check_fits

WRITERS = {".mp4": "ffmpeg", ".gif": "pillow", ".html": "html"}


def animate(
    states: Iterable[State] | Iterable[Frame],
    path: str | Path,
    *,
    scene: Scene | None = None,
    colour: str | NDArray[np.floating] = "pressure",
    forces: bool = False,
    limits: Limits | None = None,
    view: View | None = None,
    units: Sequence[str] = (),
    label: str = "",
    fringe: float | None = None,
    fps: int = 20,
    dpi: float = 120.0,
) -> Path:
    """Write a film of states or of a recording as `plot` draws them, with one colour scale, force scale and view.

    Parameters
    ----------
    states : states, or frames of a recording as of `read("run.vtkhdf")[::10]`; all are held in memory
    path : the file; its suffix .mp4 (needs ffmpeg), .gif or .html decides the format
    scene : the scene of the states; recordings need none
    colour, forces, limits, view, units, label, fringe : as for `plot`
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
        if no states are given, or states without scene, the suffix is another, ffmpeg is needed and not found, or as
        for `plot`
    FileNotFoundError
        if the directory of the file does not exist

    Examples
    --------
    >>> import pathlib
    >>> import tempfile
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> states = list(skmpm.simulate(scene, dt=1e-3, until=2e-3))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = skmpm.animate(states, pathlib.Path(folder, "fall.gif"), scene=scene, colour="speed", dpi=30)
    ...     print(path.name, path.exists())
    fall.gif True
    """
    path = Path(path)
    writer, pictures, axes = _writer(path, fps), _pictures(states, scene), new_axes()
    fields = [field_of(seen, colour, label, fringe) for seen in pictures]
    style = style_of(pictures, fields, forces=forces, limits=limits, view=view, units=units)
    picture: Any = axes.get_figure()
    add_legend(axes, pictures[-1], fields[-1], style)
    with writer.saving(picture, str(path), dpi):
        for seen, field in zip(pictures, fields, strict=True):
            for artist in [*axes.collections, *axes.lines, *axes.patches]:
                artist.remove()
            draw(axes, seen, field, style)
            scale, unit = prefixed("s", seen.t, style.units)
            axes.set_title(f"t = {seen.t / scale:.4g} {unit}", loc="right")
            if seen is pictures[0]:
                picture.draw_without_rendering()
                picture.set_layout_engine("none")  # that of another frame may differ, and axes would jump
            writer.grab_frame()
    matplotlib_module("pyplot").close(picture)
    return path


def _pictures(states: Iterable[State] | Iterable[Frame], scene: Scene | None) -> list[Snapshot]:
    """What is drawn of states or frames; ValueError if there is none, or no scene of a state."""
    pictures = list[Snapshot]()
    for state in states:
        if isinstance(state, Frame):
            pictures.append(of_frame(state))
        elif scene is None:
            raise ValueError("animate: states need their scene; give scene=")
        else:
            check_fits(scene, state, "animate")
            pictures.append(of_state(scene, state))
    if not pictures:
        raise ValueError("animate: there are no states")
    return pictures


def _writer(path: Path, fps: int) -> Any:
    """A writer of films; an error where none can be written, before anything is drawn."""
    if path.suffix.lower() not in WRITERS:
        raise ValueError(f"animate: {path} has the suffix {path.suffix!r}; use .mp4, .gif or .html")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"animate: the directory {path.parent} does not exist")
    animation, kind = matplotlib_module("animation"), WRITERS[path.suffix.lower()]
    if not animation.writers.is_available(kind):
        raise ValueError(f"animate: {path} needs {kind}, which is not installed; install it, or write a .gif")
    return animation.writers[kind](fps=fps)
