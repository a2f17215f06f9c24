"""Selection of the linear solver by size, and sparse LU, the reference solver of the tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from skmpm.arrays import Array, Ints
from skmpm.linear.band import banded, column_lengths
from skmpm.linear.blockwise import by_columns
from skmpm.linear.cholesky import WIDEST
from skmpm.linear.multigrid import amg
from skmpm.linear.solver import Linear, Solver

CROSSOVER = 700  # mean length of columns up to which `default` takes `banded`; measurements at `chosen`


@dataclass(frozen=True)
class Direct:
    """Sparse LU of the whole matrix: slow and simple, the reference solver of the tests.

    Attributes
    ----------
    factor : SuperLU's factors
    blocks : (bodies + 1,) first unknown of each body
    name : of the solver
    """

    factor: spla.SuperLU
    blocks: Ints
    name: str = "direct"

    def __call__(self, b: Array, /) -> Array:
        """A^-1 b."""
        return np.asarray(self.factor.solve(b))

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """H A^-1 H^T."""
        return by_columns(self, self.blocks, H)


def direct(A: sp.bsr_array, blocks: Ints, rigid_motions: Array) -> Solver:
    """Factorise the whole matrix with SuperLU.

    Parameters
    ----------
    A, blocks, rigid_motions : matrix (n, n), first unknowns of the bodies (bodies + 1,), rigid motions of all (n, 3)

    Returns
    -------
    the factorised matrix

    Raises
    ------
    LinAlgError
        if it is singular

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> scheme = skmpm.Scheme(linear=skmpm.linear.direct)
    >>> state = skmpm.step(scene, skmpm.initial(scene), 1e-3, scheme=scheme)
    >>> round(float(state.v[1].mean()), 5)
    -0.00981
    """
    try:
        lu = spla.splu(A.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    except RuntimeError as error:
        raise np.linalg.LinAlgError(f"linear.direct: {error}") from error
    return Direct(lu, blocks)


def default(A: sp.bsr_array, blocks: Ints, rigid_motions: Array) -> Solver:
    """Solve with `banded` or `amg`, as `chosen`.

    Parameters
    ----------
    A, blocks, rigid_motions : matrix (n, n), first unknowns of the bodies (bodies + 1,), rigid motions of all (n, 3)

    Returns
    -------
    the factorised matrix of the solver that is chosen

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> scheme = skmpm.Scheme(linear=skmpm.linear.default)
    >>> state = skmpm.step(scene, skmpm.initial(scene), 1e-3, scheme=scheme)
    >>> round(float(state.v[1].mean()), 5)
    -0.00981
    """
    return chosen(column_lengths(A, blocks))(A, blocks, rigid_motions)


def chosen(columns: Ints) -> Linear:
    """Select `banded` or `amg` by the lengths (nodes,) of the columns of the Cholesky factor (`column_lengths`).

    Their mean square is the work of the factorisation per unknown. `banded` is taken up to a root mean square of 700,
    a disc of about 270 cells across. For a single solve amg is faster from 200 on, 75 cells across, and eight times
    as fast at 830 (`examples/studies/benchmark/crossover.py`). Contact, however, needs as many solves with one matrix
    as a body has contact rows: at 830 amg takes twice as long as `banded` for 20 rows, eight times as long for 100.
    """
    mean = np.sqrt(np.mean(np.square(columns))) if columns.size else 0.0
    return banded if mean <= CROSSOVER and columns.max(initial=0) <= WIDEST else amg
