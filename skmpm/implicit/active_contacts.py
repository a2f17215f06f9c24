"""Which contacts enter the contact problem: those that may close, and can move."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.constraint_elimination import Elimination
from skmpm.contact import Constraints
from skmpm.grid import BodyGrids
from skmpm.implicit.errors import NotConverged, pair

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

DETECTION_GAP = (
    0.08  # contacts with gaps up to this many cells are known to the solver: more than an iteration moves them
)
PRESSED_DEPTH = (
    0.01  # [cells] that a supported point lies in what it touches, a fifth of what `simulate.acceptance` lets pass
)
ZERO_COMPONENT = 1e-9  # component of a normal that counts as none
LEAST_RESPONSE = 1e-12  # of the median response: what rounding leaves of a point that does not respond
BOTH_SUPPORTED, GIVE_NO_SUPPORT = "they press on each other where supports hold both", "give these points no Support"


def relevant(constraints: Constraints, grid: BodyGrids, supports: Elimination | None, held: Bools) -> Constraints:
    """The contacts that may close in an iteration and can move.

    Supports decide where points go that they hold: `held` (2, n) are the components of the points' motion that they
    prescribe.

    Raises
    ------
    NotConverged
        where a point that cannot move lies in what it touches
    """
    constraints = constraints.among(constraints.gap < DETECTION_GAP * grid.cell)
    if supports is None or constraints.size == 0:
        return constraints
    moves = _moves(constraints, grid, supports, held)
    pressed = np.flatnonzero(~moves & (constraints.gap < -PRESSED_DEPTH * grid.cell))
    if pressed.size:
        raise NotConverged(pair(constraints.bodies[:, pressed[0]]), BOTH_SUPPORTED, GIVE_NO_SUPPORT, retryable=False)
    return constraints.among(moves)


def _moves(constraints: Constraints, grid: BodyGrids, supports: Elimination, held: Bools) -> Bools:
    """Whether contacts can move along their normals, (k,): both sides may be prescribed, by supports or as rigid."""
    normal = constraints.H[:: 2 if constraints.tangential else 1]
    free = abs(normal @ supports.T).sum(axis=1) > 1e-12
    rigid = (constraints.bodies[1] < 0) | (np.diff(grid.blocks)[np.maximum(constraints.bodies[1], 0)] == 0)
    prescribed = (held[:, constraints.point] | (np.abs(constraints.normal) < ZERO_COMPONENT)).all(axis=0) & (
        constraints.point >= 0
    )
    return np.asarray(free & ~(rigid & prescribed))


def check_response(constraints: Constraints, normal: Array, supports: Elimination | None) -> None:
    """Raise NotConverged where a contact does not respond along its normal; `normal` (k,) of diag(W) [1/kg]."""
    if supports is None:
        return
    stiffest = int(np.argmin(normal))
    if not normal[stiffest] > LEAST_RESPONSE * float(np.median(normal)):
        raise NotConverged(pair(constraints.bodies[:, stiffest]), BOTH_SUPPORTED, GIVE_NO_SUPPORT, retryable=False)
