"""Topology of the outlines, constant in time: which boundary point follows which."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from skmpm.arrays import Array, Ints


@dataclass(frozen=True, eq=False)
class Outlines:
    """Closed loops of the boundary points of all bodies, sorted by body.

    Segment c begins at boundary point c and ends at boundary point `next[c]`; the material is on its left.

    Attributes
    ----------
    point : (m,) the material point of each boundary point
    body : (m,) body of each boundary point, ascending
    next : (m,) the boundary point that follows
    previous : (m,) the boundary point that precedes

    Examples
    --------
    >>> import skmpm
    >>> points = skmpm.disc((0, 0), 1.0, spacing=0.05)
    >>> outlines = skmpm.outline.outlines([points.outline], offsets=[0])
    >>> outlines.next[:3].tolist()
    [1, 2, 3]
    """

    point: Ints
    body: Ints
    next: Ints
    previous: Ints

    @property
    def size(self) -> int:
        """Number of boundary points."""
        return int(self.point.size)

    def check(self, x: Array, bodies: int) -> None:
        """Raise ValueError unless x (2, m) are positions of the boundary points, of no more bodies than `bodies`."""
        if x.shape != (2, self.size):
            raise ValueError(
                f"outlines: x has the shape {x.shape}; give positions (2, {self.size}) of boundary points"
            )
        if self.size and not self.body[-1] < bodies:
            raise ValueError(f"outlines: bodies = {bodies}; they are those of {int(self.body[-1]) + 1} bodies")


def outlines(loops: Sequence[Sequence[Ints]], offsets: ArrayLike) -> Outlines:
    """Join the outlines of all bodies.

    Parameters
    ----------
    loops : for each body its closed loops of point indices, numbered within the body; () without outline
    offsets : (bodies,) index of the first point of each body among all points

    Returns
    -------
    the outlines of all bodies

    Examples
    --------
    >>> import skmpm
    >>> points = skmpm.disc((0, 0), 1.0, spacing=0.05)
    >>> outlines = skmpm.outline.outlines([points.outline], offsets=[0])
    >>> bool(len(outlines.point) == len(points.outline[0]))
    True
    """
    first = np.asarray(offsets, dtype=np.int64)
    none = np.zeros(0, dtype=np.int64)
    point = [none, *(first[b] + loop for b, own in enumerate(loops) for loop in own)]
    size = np.array([len(loop) for own in loops for loop in own], dtype=np.int64)
    owner = np.array([b for b, own in enumerate(loops) for _ in own], dtype=np.int64)
    start = np.cumsum(size) - size
    following = np.arange(1, size.sum() + 1)
    following[start + size - 1] = start
    previous = np.empty_like(following)
    previous[following] = np.arange(following.size)
    return Outlines(np.concatenate(point), np.repeat(owner, size), following, previous)


def ranges(start: Ints, count: Ints) -> Ints:
    """Concatenate the ranges start[k], ..., start[k] + count[k] - 1."""
    ends = np.cumsum(count)
    return np.arange(count.sum()) + np.repeat(start - ends + count, count)


def chunks(count: Ints, size: int) -> list[slice]:
    """Divide items with `count` entries each into consecutive slices of about `size` entries."""
    cuts = np.flatnonzero(np.diff(np.cumsum(count) // size)) + 1
    edges = [0, *cuts.tolist(), count.size]
    return [slice(i, j) for i, j in pairwise(edges)]
