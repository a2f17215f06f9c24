"""Which solver for which bodies."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.linear.band import banded
from skmpm.linear.multigrid import amg
from skmpm.linear.solver import Solver, half_bandwidth

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

CROSSOVER = 700  # half bandwidth


def default(A: sp.bsr_array, blocks: Ints, rigid_motions: Array) -> Solver:
    """`banded` up to a half bandwidth of 700, a body about 170 cells across, `amg` beyond.

    That is where their times meet for one solve (`examples/crossover.py`); contact, which needs many solves with one
    factor, moves it further up.
    """
    return (banded if half_bandwidth(A) <= CROSSOVER else amg)(A, blocks, rigid_motions)
