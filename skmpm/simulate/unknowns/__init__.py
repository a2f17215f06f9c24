"""What forces move and has no grid: driven walls, free rigid bodies, a periodic box under stress."""

from skmpm.simulate.unknowns.of_step import scalar_unknowns

__all__ = ["scalar_unknowns"]
