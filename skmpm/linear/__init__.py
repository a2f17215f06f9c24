"""Linear solvers for A v = b, where A is symmetric positive definite with one diagonal block per body.

A solver is a function (A, blocks, rigid_motions) -> solve. `solve(b)` returns A^-1 b, and `solve.delassus(H)` returns
H A^-1 H^T, the Delassus operator of constraints H. `blocks` (bodies + 1,) are the first unknowns of the bodies and
`rigid_motions` (n, 3) the rigid-body motions of all bodies. `default` selects `banded` or `amg` by cost.
"""

from skmpm.linear.band import Banded, banded
from skmpm.linear.choice import Direct, default, direct
from skmpm.linear.delassus import Delassus
from skmpm.linear.multigrid import Amg, amg
from skmpm.linear.solver import Linear, NotPositiveDefinite, Solver

__all__ = [
    "Amg",
    "Banded",
    "Delassus",
    "Direct",
    "Linear",
    "NotPositiveDefinite",
    "Solver",
    "amg",
    "banded",
    "default",
    "direct",
]
