"""Time stepping: `initial` makes the first state, `step` advances it, `simulate` is the generator around `step`."""

from skmpm.simulate.algorithm import step
from skmpm.simulate.initial_state import initial
from skmpm.simulate.run import exit_at_sigterm, simulate

__all__ = ["exit_at_sigterm", "initial", "simulate", "step"]
