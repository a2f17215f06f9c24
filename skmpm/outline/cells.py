"""Moments of the parts of grid cells that lie within outlines, exact for polygons with holes."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array, Ints
from skmpm.outline.topology import Outlines, ranges

GAUSS_POINTS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)  # two, on [0, 1]: exact for polynomials of degree 3


def cell_moments(outlines: Outlines, x: Array, cell: float, index: Ints, owner: Ints) -> Array:
    """Moments of the parts of cells that lie inside their bodies, (6, cells) [cell areas].

    These are the integrals of 1, xi, eta, xi eta, xi^2 and eta^2 over the cells with coordinates `index` (2, cells),
    of the bodies `owner` (cells,). By Green's theorem a moment is the integral over dy, along the outline, of the
    primitive in x of its integrand. The primitive vanishes to the left of the cell and is constant to its right, so
    each piece of the boundary contributes to its own cell and to all cells to its left.
    """
    start, end, piece_cell, body = _pieces(outlines, x / cell)
    local = start - piece_cell + GAUSS_POINTS[:, None, None] * (end - start)
    weight = 0.5 * (end[1] - start[1])
    inside = np.einsum("p,gkp->kp", weight, _primitives(local[:, 0], local[:, 1]))
    beyond = np.einsum("p,gkp->kp", weight, _primitives(np.ones_like(local[:, 0]), local[:, 1]))

    low = np.minimum(piece_cell.min(axis=1), index.min(axis=1))
    columns, rows = np.maximum(piece_cell.max(axis=1), index.max(axis=1)) - low + 2
    of_piece, of_cell = (
        (b * rows + ij[1] - low[1]) * columns + ij[0] - low[0] for b, ij in ((body, piece_cell), (owner, index))
    )
    order, sorted_cells = np.argsort(of_piece, kind="stable"), np.argsort(of_cell)
    # In each row of each body the contributions of all pieces to the cells to their left add up to zero, because
    # outlines are closed; so one cumulative sum serves all rows.
    passed = np.concatenate([np.zeros((6, 1)), np.cumsum(beyond[:, order], axis=1)], axis=1)
    moments = -passed[:, np.searchsorted(of_piece[order], of_cell, side="right")]
    known = of_cell[sorted_cells]
    at = np.minimum(np.searchsorted(known, of_piece), known.size - 1)
    own = known[at] == of_piece
    for k in range(6):
        moments[k] += np.bincount(sorted_cells[at[own]], inside[k, own], known.size)
    return moments


def _primitives(xi: Array, eta: Array) -> Array:
    """Primitives in xi of the six monomials, (Gauss points, 6, pieces)."""
    return np.stack([xi, xi**2 / 2, eta * xi, eta * xi**2 / 2, xi**3 / 3, eta**2 * xi], axis=1)


def _pieces(outlines: Outlines, X: Array) -> tuple[Array, Array, Ints, Ints]:
    """The boundary cut at all grid lines: starts, ends and cells (2, p) of the pieces, and their bodies (p,)."""
    a, b = X, X[:, outlines.next]
    segments = np.arange(outlines.size)
    parts = [(segments, np.zeros(outlines.size)), (segments, np.ones(outlines.size))]
    for axis in (0, 1):
        low, high = np.minimum(a[axis], b[axis]), np.maximum(a[axis], b[axis])
        first = np.floor(low).astype(np.int64) + 1
        count = np.maximum(np.ceil(high).astype(np.int64) - first, 0)
        segment = np.repeat(segments, count)
        line = ranges(first, count)
        parts.append((segment, (line - a[axis, segment]) / (b[axis, segment] - a[axis, segment])))
    segment, t = (np.concatenate(part) for part in zip(*parts, strict=True))
    order = np.lexsort((t, segment))
    segment, t = segment[order], t[order]
    here = np.flatnonzero((segment[1:] == segment[:-1]) & (t[1:] > t[:-1]))
    of, span = segment[here], b[:, segment[here]] - a[:, segment[here]]
    start, end = a[:, of] + t[here] * span, a[:, of] + t[here + 1] * span
    return start, end, np.floor(0.5 * (start + end)).astype(np.int64), outlines.body[of]
