"""Candidate contacts: those that enter the contact problem, since they may close and their gap can change."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.constraint_elimination import Elimination
from skmpm.contact import Constraints
from skmpm.grid import BodyGrids
from skmpm.implicit.errors import StepRejected, pair
from skmpm.implicit.scalar_unknowns import driven

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

# [cells] Largest gap of a candidate contact. Candidates are selected in every iteration: a contact that an iteration
# closes from a larger gap is one in the next.
MAX_CANDIDATE_GAP = 0.08
# [cells] Largest penetration of a supported point, a fifth of what `simulate.acceptance` accepts at walls.
MAX_SUPPORTED_PENETRATION = 0.01
ZERO_COMPONENT = 1e-9  # component of a unit normal that counts as zero
MIN_RESPONSE = 1e-12  # over the median diagonal entry of W: round-off of a contact that cannot respond
BOTH_SUPPORTED, GIVE_NO_SUPPORT = "they press on each other where supports hold both", "give these points no Support"


def candidates(
    constraints: Constraints,
    grid: BodyGrids,
    supports: Elimination | None,
    supported: Bools,
    rows: Callable[[Constraints], sp.csr_array] | None = None,
) -> Constraints:
    """The contacts, closed or not, whose gap is below `MAX_CANDIDATE_GAP` and can change, and those in tension.

    `supported` (2, n) are the velocity components of the points that supports prescribe; `rows` gives
    the columns of H for unknowns that are not on the grids.

    Raises
    ------
    StepRejected
        if a point that cannot move penetrates what it touches
    """
    if constraints.size == 0:
        return constraints
    near = constraints.gap < MAX_CANDIDATE_GAP * grid.cell
    constraints = constraints.among(near | (constraints.tensile_strength > 0.0))
    if supports is None or constraints.size == 0:
        return constraints
    movable = _movable(constraints, grid, supports, supported)
    if rows is not None:
        movable |= driven(rows(constraints), constraints)
    penetrating = np.flatnonzero(~movable & (constraints.gap < -MAX_SUPPORTED_PENETRATION * grid.cell))
    if penetrating.size:
        bodies = constraints.bodies[:, penetrating[0]]
        raise StepRejected(pair(bodies), BOTH_SUPPORTED, GIVE_NO_SUPPORT, retryable=False)
    return constraints.among(movable)


def _movable(constraints: Constraints, grid: BodyGrids, supports: Elimination, supported: Bools) -> Bools:
    """Whether nodes move contacts along their normals, (k,): supports or rigid bodies may prescribe both sides."""
    normal = constraints.H[:: 2 if constraints.tangential else 1]
    free = abs(normal @ supports.T).sum(axis=1) > 1e-12
    rigid = (constraints.bodies[1] < 0) | (np.diff(grid.blocks)[np.maximum(constraints.bodies[1], 0)] == 0)
    prescribed = (supported[:, constraints.point] | (np.abs(constraints.normal) < ZERO_COMPONENT)).all(axis=0)
    return np.asarray(free & ~(rigid & prescribed & (constraints.point >= 0)))


def check_response(constraints: Constraints, normal: Array, supports: Elimination | None) -> None:
    """Raise StepRejected if a contact cannot respond along its normal; `normal` (k,) are entries of diag W [1/kg]."""
    if supports is None:
        return
    stiffest = int(np.argmin(normal))
    if not normal[stiffest] > MIN_RESPONSE * float(np.median(normal)):
        raise StepRejected(pair(constraints.bodies[:, stiffest]), BOTH_SUPPORTED, GIVE_NO_SUPPORT, retryable=False)
