"""Selection of the linear solver."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.linear.band import banded
from skmpm.linear.multigrid import amg
from skmpm.linear.solver import Solver, half_bandwidth

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

CROSSOVER = 700  # half bandwidth up to which `default` takes `banded`; measurements in its docstring


def default(A: sp.bsr_array, blocks: Ints, rigid_motions: Array) -> Solver:
    """`banded` up to a half bandwidth of 700, a body of about 170 cells across, and `amg` beyond.

    For a single solve amg is faster from a half bandwidth of 400, 95 cells across, and 2.5 times as fast at 700
    (`examples/studies/benchmark/crossover.py`). Contact, however, needs as many solves with one matrix as a body has
    contact rows: a body of 120 cells across takes four times as long with amg for 20 rows, and twelve times as long
    for 100 rows.
    """
    return (banded if half_bandwidth(A) <= CROSSOVER else amg)(A, blocks, rigid_motions)
