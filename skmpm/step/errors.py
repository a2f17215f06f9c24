"""The error of a rejected step, and texts that name bodies."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array, Ints
from skmpm.grid import BodyGrids
from skmpm.linear import NotPositiveDefinite

SMALLER = "use a smaller dt"
NOTHING_DEFORMS = (
    "use a smaller dt, or, where prescribed motions squeeze rigid bodies, a force for one of the motions or a body"
    " that deforms"
)


class StepRejected(RuntimeError):  # noqa: N818
    """The equations of a step were not solved, or its result was rejected: where, why, and the remedy."""

    def __init__(self, where: str, problem: str, remedy: str = SMALLER, *, retryable: bool = True) -> None:
        super().__init__(f"{where}: {problem}; {remedy}")
        self.retryable = retryable  # whether a smaller dt may help


def worst_body(grid: BodyGrids, imbalance: Array) -> tuple[str, float]:
    """The body with the largest share of an out-of-balance impulse (2 nodes,), as text, and that share."""
    square = np.nan_to_num(imbalance, nan=np.inf) ** 2
    each = grid.sums(square.reshape(-1, 2).T).sum(axis=0)
    return f"body {int(np.argmax(each))}", float(np.sqrt(each.max()))


def indefinite(grid: BodyGrids, error: np.linalg.LinAlgError) -> StepRejected:
    """The error of a failed Cholesky factorisation."""
    if not isinstance(error, NotPositiveDefinite):
        return StepRejected("all bodies", str(error))
    b = int(error.bodies[0])
    count = np.bincount(grid.cell_of_point, minlength=grid.cells)[grid.cell_body == b]
    return StepRejected(
        f"body {b}",
        "its matrix is not positive definite, even free of stress;"
        f" {(count == 1).sum()} of its {count.size} cells hold one point, which leaves motions without stiffness",
        "use a smaller spacing of its points, a larger cell or a larger Scheme.ghost, or a smaller dt where it is"
        " deformed much",
    )


def pair(bodies: Ints) -> str:
    """Two bodies (2,), of which walls are -1, -2, ..., as text."""
    a, b = bodies.tolist()
    if a == b:
        return f"body {a} against itself"
    return f"bodies {a} and {b}" if b >= 0 else f"body {a} and wall {-1 - b}"
