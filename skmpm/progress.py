"""How far a run is, on a terminal or in a notebook; no output elsewhere."""

from __future__ import annotations

import sys
from typing import Any, Self

import numpy as np

from skmpm.observe import between_walls
from skmpm.representation import quantity
from skmpm.scene import Scene, State

EVERY = 0.2  # [s] between two drawings
SLOW = 1e-3  # kinetic over elastic energy below which the motion counts as quasi-static


class Bar:
    """A bar of tqdm, if `shown` and where it can be drawn over the one before; else nothing.

    `total` is the amount of work.
    """

    def __init__(self, total: float, *, shown: bool) -> None:
        self._bar: Any = None
        if shown and total > 0.0 and (sys.stderr.isatty() or "ipykernel" in sys.modules):
            from tqdm.auto import tqdm  # imported only where it is used, since it takes a tenth of a second

            shape = "{desc}{percentage:5.1f} % |{bar}| {elapsed}, {remaining} left{postfix}"
            self._bar = tqdm(total=total, bar_format=shape, miniters=0, mininterval=EVERY, delay=1e-9)

    @property
    def shown(self) -> bool:
        """Whether there is one."""
        return self._bar is not None

    def show(self, done: float, *facts: str) -> None:
        """Draw what is done of the work, and facts beside it."""
        if self.shown:
            self._bar.set_postfix_str("  ".join(facts), refresh=False)
            self._bar.update(done - self._bar.n)

    def make_room(self) -> None:
        """Clear the line for what is printed next."""
        if self.shown:
            self._bar.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if self.shown:
            self._bar.close()


class Progress(Bar):
    """How far a simulation is.

    Step, time, ETA, whether the motion is quasi-static, the nominal solid fraction or else the stroke of the walls,
    and retries.
    """

    def __init__(self, scene: Scene, start: State, until: float, *, shown: bool) -> None:
        super().__init__(until - start.t, shown=shown)
        self._scene, self._start = scene, start
        self._steps, self._retries = 0, 0

    def show_state(self, state: State) -> None:
        """Draw how far a state is."""
        self._steps, self._retries = self._steps + 1, self._retries + state.report.retries
        if self.shown:
            facts = [
                f"step {self._steps}",
                f"t = {quantity(state.t, 's')}",
                *_motion(self._scene, self._start, state),
            ]
            retries = [f"retries {self._retries}"] if self._retries else []
            self.show(state.t - self._start.t, *facts, *retries)


def _motion(scene: Scene, start: State, state: State) -> list[str]:
    """How a scene moves, and how far it has come."""
    energy = state.report.energy
    parts = ["quasi-static" if energy.kinetic <= SLOW * energy.elastic else "dynamic"]
    area, stroke = between_walls(state).area, float(np.hypot(*(state.walls - start.walls).T).max(initial=0.0))
    if np.isfinite(area):
        solid = scene.initial_volumes[scene.inside[scene.owner]].sum()
        parts.append(f"solid fraction {solid / area:.3f}")
    elif stroke > 0.0:
        parts.append(f"stroke {quantity(stroke, 'm')}")
    return parts
