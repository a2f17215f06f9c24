"""The error of a rejected step, and texts that name bodies."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array, Ints
from skmpm.contact import Constraints
from skmpm.grid import BodyGrids
from skmpm.linear import NotPositiveDefinite

NOTHING_DEFORMS = (
    "where prescribed motions squeeze rigid bodies, use a force for one of the motions or a body that deforms"
)


class StepRejected(RuntimeError):  # noqa: N818
    """The equations of a step were not solved, or its result was rejected: where and why."""

    def __init__(self, where: str, problem: str, remedy: str = "", *, retryable: bool = True) -> None:
        super().__init__(f"{where}: {problem}")
        self.remedy = remedy  # beside a smaller dt
        self.retryable = retryable  # whether a smaller dt may help


def place(x: Array, cell: float) -> str:
    """A position (2,), to a thousandth of a cell, as text."""
    x0, x1 = cell * np.round(x / cell, 3) + 0.0  # no -2e-17
    return f"({x0:.6g}, {x1:.6g}) m"


def at_node(grid: BodyGrids, node: int, displacement: Array) -> str:
    """The body of a node, and the position of the node at a displacement (2 nodes,), as text."""
    return f"body {grid.node_body[node]} near {place(grid.at(displacement)[:, node], grid.cell)}"


def at_point(grid: BodyGrids, point: int, displacement: Array) -> str:
    """The body of a point, and the position of a corner of its cell, as text."""
    return at_node(grid, int(grid.nodes_of_cell[0, grid.cell_of_point[point]]), displacement)


def worst_body(grid: BodyGrids, imbalance: Array, displacement: Array) -> tuple[str, float]:
    """The body with the largest share of an out-of-balance impulse (2 nodes,) and its worst node; and that share."""
    square = np.nan_to_num(imbalance, nan=np.inf).reshape(-1, 2).T ** 2
    each = grid.sums(square).sum(axis=0)
    b = int(np.argmax(each))
    node = int(np.argmax(np.where(grid.node_body == b, square.sum(axis=0), -1.0)))
    return at_node(grid, node, displacement), float(np.sqrt(each.max()))


def too_few_points(grid: BodyGrids, error: np.linalg.LinAlgError) -> StepRejected:
    """The error of a matrix that cannot be factorised even free of stress."""
    if not isinstance(error, NotPositiveDefinite):
        return StepRejected("all bodies", str(error))
    b = int(error.bodies[0])
    count = np.bincount(grid.cell_of_point, minlength=grid.cells)[grid.cell_body == b]
    return StepRejected(
        f"body {b}",
        "its matrix is not positive definite, even free of stress;"
        f" {(count == 1).sum()} of its {count.size} cells hold one point, which leaves motions without stiffness",
        "use a smaller spacing of its points, a larger cell or a larger Scheme.ghost",
    )


def of_contact(constraints: Constraints, contact: int, cell: float) -> str:
    """The two bodies at a contact, and its position, as text."""
    return f"{pair(constraints.bodies[:, contact])} near {place(constraints.x[:, contact], cell)}"


def pair(bodies: Ints) -> str:
    """Two bodies (2,), of which walls are -1, -2, ..., as text."""
    a, b = bodies.tolist()
    if a == b:
        return f"body {a} against itself"
    return f"bodies {a} and {b}" if b >= 0 else f"body {a} and wall {-1 - b}"
