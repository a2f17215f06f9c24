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

    One solve alone is faster by amg from 400 on, 95 cells across, and 2.5 times as fast at 700
    (`examples/studies/benchmark/crossover.py`). But contact needs as many solves as a body has contact rows, with one
    factor: a body 120 cells across with 20 rows takes four times as long by amg, one with 100 rows twelve times.
    """
    return (banded if half_bandwidth(A) <= CROSSOVER else amg)(A, blocks, rigid_motions)
