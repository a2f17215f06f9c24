"""A progress line on a terminal or in a notebook; no output elsewhere."""

from __future__ import annotations

import sys
from time import perf_counter
from types import TracebackType

import numpy as np

from skmpm.observe import box_area
from skmpm.representation import quantity
from skmpm.scene import Scene, State

WIDTH = 110  # characters; the line before is overwritten
SLOW = 0.01  # kinetic over elastic energy below which the motion counts as quasi-static


class Progress:
    """Shows how far a running simulation is, if `shown` and where a line can be overwritten.

    Step, time, ETA, whether the motion is quasi-static, the nominal solid fraction or else the stroke of the walls,
    and retries.
    """

    def __init__(self, scene: Scene, start: State, until: float, *, shown: bool) -> None:
        self._scene, self._start, self._until = scene, start, until
        self._shown = shown and (sys.stderr.isatty() or "ipykernel" in sys.modules)
        self._steps, self._retries, self._began, self._drawn = 0, 0, perf_counter(), 0.0

    def __enter__(self) -> Progress:
        return self

    def show(self, state: State) -> None:
        """Redraw the line, at most five times a second."""
        self._steps, self._retries = self._steps + 1, self._retries + state.report.retries
        now = perf_counter()
        if not self._shown or now - self._drawn < 0.2:
            return
        self._drawn = now
        done = (state.t - self._start.t) / (self._until - self._start.t)
        left = (now - self._began) * (1.0 - done) / max(done, 1e-9)
        parts = [
            f"step {self._steps}",
            f"t = {quantity(state.t, 's')}",
            f"{100.0 * done:5.1f} %",
            f"ETA {int(left // 60)}:{int(left % 60):02d}",
            *_motion(self._scene, self._start, state),
        ]
        if self._retries:
            parts.append(f"retries {self._retries}")
        sys.stderr.write("\r" + "  ".join(parts).ljust(WIDTH)[:WIDTH])
        sys.stderr.flush()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._shown and self._steps:
            sys.stderr.write("\n")


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
