"""Time stepping: `initial` makes the first state, `step` advances it; `skmpm.run` has the loop around `step`."""

from skmpm.simulate.algorithm import step
from skmpm.simulate.initial_state import initial

__all__ = ["initial", "step"]
