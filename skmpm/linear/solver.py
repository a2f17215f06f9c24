"""The interface of linear solvers, with BLAS restricted to one thread.

For the small matrices of bodies two threads are ten times slower and more.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import cache
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp
from threadpoolctl import ThreadpoolController

from skmpm.arrays import Array, Ints


@cache
def _libraries() -> Any:
    return ThreadpoolController()


def one_thread() -> AbstractContextManager[object]:
    """Context manager within which BLAS uses one thread."""
    limited: AbstractContextManager[object] = _libraries().limit(limits=1, user_api="blas")
    return limited


class Solver(Protocol):
    """A factorised matrix."""

    @property
    def name(self) -> str:
        """Name of the solver."""

    def __call__(self, b: Array, /) -> Array:
        """A^-1 b, for b (n,) or (n, m)."""

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """H A^-1 H^T, (k, k), for rows H (k, n) that touch one body each."""


class NotPositiveDefinite(np.linalg.LinAlgError):
    """Blocks of bodies that are not positive definite; those of the other bodies are factorised.

    Attributes
    ----------
    bodies : (k,) the bodies
    resume : returns the solver for a matrix that differs from the first in these bodies only
    """

    def __init__(self, bodies: Ints, resume: Callable[[sp.bsr_array], Solver]) -> None:
        super().__init__(f"the blocks of bodies {bodies.tolist()} are not positive definite")
        self.bodies = bodies  # (k,)
        self.resume = resume  # the solver for a matrix that differs from the first in these bodies only


Linear = Callable[[sp.bsr_array, Ints, Array], Solver]
