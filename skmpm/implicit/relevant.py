"""Which contacts enter the contact problem: those that may close, and can move."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.contact import Rows
from skmpm.elimination import Elimination
from skmpm.grid import Sheets
from skmpm.implicit.failure import NotConverged, pair

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

SOON = 0.08  # contacts with gaps up to this many cells are known to the solver: more than an iteration moves them
PRESSED = 0.01  # [cells] that a supported point lies in what it touches, a fifth of what `simulate.checks` lets pass
ALONG = 1e-9  # component of a normal that counts as none
RIGID = 1e-12  # of the median response: what rounding leaves of a point that does not respond
HELD, FREE = "they press on each other where supports hold both", "give these points no Support"


def relevant(rows: Rows, sheets: Sheets, supports: Elimination | None, held: Bools) -> Rows:
    """The contacts that may close in an iteration and can move.

    Supports decide where points go that they hold: `held` (2, n) are the components of the points' motion that they
    prescribe.

    Raises
    ------
    NotConverged
        where a point that cannot move lies in what it touches
    """
    rows = rows.among(rows.gap < SOON * sheets.cell)
    if supports is None or rows.size == 0:
        return rows
    moves = _moves(rows, sheets, supports, held)
    pressed = np.flatnonzero(~moves & (rows.gap < -PRESSED * sheets.cell))
    if pressed.size:
        raise NotConverged(pair(rows.bodies[:, pressed[0]]), HELD, FREE, curable=False)
    return rows.among(moves)


def _moves(rows: Rows, sheets: Sheets, supports: Elimination, held: Bools) -> Bools:
    """Whether contacts can move along their normals, (k,): both sides may be prescribed, by supports or as rigid."""
    normal = rows.H[:: 2 if rows.tangential else 1]
    free = abs(normal @ supports.T).sum(axis=1) > 1e-12
    rigid = (rows.bodies[1] < 0) | (np.diff(sheets.blocks)[np.maximum(rows.bodies[1], 0)] == 0)
    prescribed = (held[:, rows.point] | (np.abs(rows.normal) < ALONG)).all(axis=0) & (rows.point >= 0)
    return np.asarray(free & ~(rigid & prescribed))


def check_response(rows: Rows, normal: Array, supports: Elimination | None) -> None:
    """Raise NotConverged where a contact does not respond along its normal; `normal` (k,) of diag(W) [1/kg]."""
    if supports is None:
        return
    stiffest = int(np.argmin(normal))
    if not normal[stiffest] > RIGID * float(np.median(normal)):
        raise NotConverged(pair(rows.bodies[:, stiffest]), HELD, FREE, curable=False)
