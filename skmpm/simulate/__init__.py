"""Running a scene: `initial` makes its first state, `step` advances it, `simulate` is the generator around `step`.

`report` says beforehand what a run asks for, `suggest` what resolution an error asks for.
"""

from skmpm.simulate.algorithm import step
from skmpm.simulate.health import report
from skmpm.simulate.run import simulate
from skmpm.simulate.start import initial
from skmpm.simulate.suggest import Suggestion, suggest

__all__ = ["Suggestion", "initial", "report", "simulate", "step", "suggest"]
