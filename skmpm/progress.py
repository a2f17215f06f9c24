"""A progress line on a terminal or in a notebook; no output elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from time import perf_counter
from types import TracebackType

import numpy as np

from skmpm.observe import box_area
from skmpm.representation import quantity
from skmpm.scene import Scene, State

WIDTH = 110  # characters; the line before is overwritten
SLOW = 0.01  # kinetic over elastic energy below which the motion counts as quasi-static


class Line:
    """A line that is written over the one before, on a terminal or in a notebook; no output elsewhere."""

    def __init__(self, *, shown: bool) -> None:
        self._shown = shown and (sys.stderr.isatty() or "ipykernel" in sys.modules)
        self._begun, self._drawn = False, 0.0

    @property
    def due(self) -> bool:
        """Whether it is shown, and was not drawn in the last fifth of a second."""
        return self._shown and perf_counter() - self._drawn >= 0.2

    def draw(self, parts: Iterable[str]) -> None:
        """Write the line."""
        if self._shown:
            self._begun, self._drawn = True, perf_counter()
            sys.stderr.write("\r" + "  ".join(parts).ljust(WIDTH)[:WIDTH])
            sys.stderr.flush()

    def end(self) -> None:
        """Leave it; what is written next stands below."""
        if self._begun:
            self._begun = False
            sys.stderr.write("\n")


def eta(seconds: float, share: float) -> str:
    """The time that is left in minutes and seconds, where a share of the work has taken so many."""
    left = seconds * (1.0 - share) / max(share, 1e-9)
    return f"ETA {int(left // 60)}:{int(left % 60):02d}"


class Progress:
    """Shows how far a running simulation is, if `shown` and where a line can be overwritten.

    Step, time, ETA, whether the motion is quasi-static, the nominal solid fraction or else the stroke of the walls,
    and retries.
    """

    def __init__(self, scene: Scene, start: State, until: float, *, shown: bool) -> None:
        self._scene, self._start, self._until = scene, start, until
        self._line = Line(shown=shown)
        self._steps, self._retries, self._began = 0, 0, perf_counter()

    def __enter__(self) -> Progress:
        return self

    def show(self, state: State) -> None:
        """Redraw the line, at most five times a second."""
        self._steps, self._retries = self._steps + 1, self._retries + state.report.retries
        if not self._line.due:
            return
        done = (state.t - self._start.t) / (self._until - self._start.t)
        parts = [
            f"step {self._steps}",
            f"t = {quantity(state.t, 's')}",
            f"{100.0 * done:5.1f} %",
            eta(perf_counter() - self._began, done),
            *_motion(self._scene, self._start, state),
        ]
        if self._retries:
            parts.append(f"retries {self._retries}")
        self._line.draw(parts)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._line.end()


def _motion(scene: Scene, start: State, state: State) -> list[str]:
    """How a scene moves, and how far it has come."""
    energy = state.report.energy
    parts = ["quasi-static" if energy.kinetic <= SLOW * energy.elastic else "dynamic"]
    area, stroke = box_area(state), float(np.hypot(*(state.walls - start.walls).T).max(initial=0.0))
    if np.isfinite(area):
        parts.append(f"solid fraction {scene.initial_volumes.sum() / area:.3f}")
    elif stroke > 0.0:
        parts.append(f"stroke {quantity(stroke, 'm')}")
    return parts
