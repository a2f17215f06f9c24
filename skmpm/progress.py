"""A progress line on a terminal; no output elsewhere."""

from __future__ import annotations

import sys
from time import perf_counter
from types import TracebackType

from skmpm.scene import State


class Progress:
    """Shows step, time, ETA, residual and retries of a running simulation, if `shown` and on a terminal."""

    def __init__(self, begin: float, until: float, *, shown: bool) -> None:
        self._begin, self._until = begin, until
        self._shown = shown and sys.stderr.isatty()
        self._steps, self._retries, self._started, self._drawn = 0, 0, perf_counter(), 0.0

    def __enter__(self) -> Progress:
        return self

    def show(self, state: State) -> None:
        """Redraw the line, at most five times a second."""
        self._steps, self._retries = self._steps + 1, self._retries + state.report.retries
        now = perf_counter()
        if not self._shown or now - self._drawn < 0.2:
            return
        self._drawn = now
        done = (state.t - self._begin) / (self._until - self._begin)
        left = (now - self._started) * (1.0 - done) / max(done, 1e-9)
        line = (
            f"step {self._steps}  t = {state.t:.4g} s  {100.0 * done:5.1f} %  "
            f"ETA {int(left // 60)}:{int(left % 60):02d}  residual {state.report.residual:.1e}"
        )
        if self._retries:
            line += f"  retries {self._retries}"
        sys.stderr.write("\r" + line.ljust(78))
        sys.stderr.flush()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._shown and self._steps:
            sys.stderr.write("\n")
