"""Linear solvers for A v = b, where A is symmetric positive definite with one diagonal block per body.

A solver is a function (A, blocks, rigid_motions) -> solve. `solve(b)` returns A^-1 b, and `solve.delassus(H)` returns
H A^-1 H^T, the Delassus operator of constraints H. `blocks` (bodies + 1,) are the first unknowns of the bodies and
`rigid_motions` (n, 3) the rigid-body motions of all bodies. `default` selects `banded` or `amg` by cost.
"""

from skmpm.linear.band import Banded, banded, column_lengths
from skmpm.linear.choice import chosen, default
from skmpm.linear.delassus import Delassus
from skmpm.linear.joined import Joined, joined
from skmpm.linear.low_rank import LowRank, without_added_mass
from skmpm.linear.lu import Direct, direct
from skmpm.linear.multigrid import Amg, amg
from skmpm.linear.rotated import Rotated
from skmpm.linear.solver import Linear, NotPositiveDefinite, Solver, half_bandwidth
from skmpm.linear.threads import one_thread

__all__ = [
    "Amg",
    "Banded",
    "Delassus",
    "Direct",
    "Joined",
    "Linear",
    "LowRank",
    "NotPositiveDefinite",
    "Rotated",
    "Solver",
    "amg",
    "banded",
    "chosen",
    "column_lengths",
    "default",
    "direct",
    "half_bandwidth",
    "joined",
    "one_thread",
    "without_added_mass",
]
