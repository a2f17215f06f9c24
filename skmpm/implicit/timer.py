"""Wall time by phase of a step."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import perf_counter


@dataclass
class Timer:
    """Seconds by phase, for the report."""

    seconds: dict[str, float] = field(default_factory=dict)
    _since: float = field(default_factory=perf_counter)

    def lap(self, phase: str) -> None:
        """Add the time since the last lap to `phase`."""
        now = perf_counter()
        self.seconds[phase] = self.seconds.get(phase, 0.0) + now - self._since
        self._since = now
