"""Selection of the linear solver."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.linear.band import banded, column_lengths
from skmpm.linear.cholesky import WIDEST
from skmpm.linear.multigrid import amg
from skmpm.linear.solver import Linear, Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

CROSSOVER = 700  # mean length of columns up to which `default` takes `banded`; measurements at `chosen`


def default(A: sp.bsr_array, blocks: Ints, rigid_motions: Array) -> Solver:
    """`banded` or `amg`, as `chosen`."""
    return chosen(column_lengths(A, blocks))(A, blocks, rigid_motions)


def chosen(columns: Ints) -> Linear:
    """`banded` or `amg`, by the lengths of the columns of the Cholesky factor, `column_lengths` (nodes,).

    Their mean square is the work of the factorisation per unknown. `banded` is taken up to a root mean square of 700,
    a disc of about 270 cells across. For a single solve amg is faster from 200 on, 75 cells across, and eight times
    as fast at 830 (`examples/studies/benchmark/crossover.py`). Contact, however, needs as many solves with one matrix
    as a body has contact rows: at 830 amg takes twice as long as `banded` for 20 rows, eight times as long for 100.
    """
    mean = np.sqrt(np.mean(np.square(columns))) if columns.size else 0.0
    return banded if mean <= CROSSOVER and columns.max(initial=0) <= WIDEST else amg
