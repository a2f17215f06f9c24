"""Ensembles: `sweep` runs every member to its end, `Run` is what a member runs, `Sweep` their tables."""

from skmpm.sweep.directory import SweepError
from skmpm.sweep.results import Member, Sweep
from skmpm.sweep.run import Run
from skmpm.sweep.sweep import sweep

__all__ = ["Member", "Run", "Sweep", "SweepError", "sweep"]
