"""Solvers of A v = b, A symmetric positive definite and block diagonal, one block per body.

Each solver is a function (A, blocks, rigid_motions) -> solve; `solve(b)` returns A^-1 b, and
`solve.compliance(H)` returns H A^-1 H', which contact needs. `blocks` (bodies + 1,) are the bodies' first unknowns,
`rigid_motions` (n, 3) the motions that store no energy. `default` picks between `banded` and `amg` by size.
"""

from skmpm.linear.band import Banded, banded
from skmpm.linear.choice import CROSSOVER, default
from skmpm.linear.delassus import Delassus
from skmpm.linear.diagonal import Diagonal, diagonal
from skmpm.linear.lu import Direct, direct
from skmpm.linear.multigrid import Amg, amg
from skmpm.linear.rotation import HeldRotation
from skmpm.linear.solver import Linear, Solver, half_bandwidth
from skmpm.linear.threads import one_thread

__all__ = [
    "CROSSOVER",
    "Amg",
    "Banded",
    "Delassus",
    "Diagonal",
    "Direct",
    "HeldRotation",
    "Linear",
    "Solver",
    "amg",
    "banded",
    "default",
    "diagonal",
    "direct",
    "half_bandwidth",
    "one_thread",
]
