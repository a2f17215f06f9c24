"""The smooth curves of outlines as polylines, to be drawn and recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from skmpm.arrays import Array, Ints
from skmpm.outline.curve import curve
from skmpm.outline.topology import Outlines, outlines


@dataclass(frozen=True, eq=False)
class Polylines:
    """Points of the curves through the boundary points, `parts` on each segment, loop after loop.

    Attributes
    ----------
    x : (2, m parts) [m]; the points parts i are the boundary points i
    outlines : closed loops of these points; `point` is the boundary point that begins the segment
    loops : (loops + 1,) first point of each loop
    parts : number of points on each segment
    """

    x: Array
    outlines: Outlines
    loops: Ints
    parts: int

    def values(self, at_boundary_points: Array) -> Array:
        """Values (m parts,) between those at the boundary points (m,), linear in the parameter of each segment."""
        i = np.arange(at_boundary_points.size)
        after = at_boundary_points[self.outlines.next[self.parts * i + self.parts - 1] // self.parts]
        s = np.arange(self.parts) / self.parts
        return np.asarray((1.0 - s) * at_boundary_points[:, None] + s * after[:, None]).ravel()


def polylines(boundary: Outlines, reference: Array, x: Array, parts: int) -> Polylines:
    """Points of the curves through boundary points.

    Parameters
    ----------
    boundary : closed loops of the m boundary points
    reference, x : (2, m) reference positions, which decide where corners are, and current positions [m]
    parts : number of points on each segment

    Returns
    -------
    (2, m parts) points with their loops
    """
    m = boundary.size
    segment, s = np.repeat(np.arange(m), parts), np.tile(np.arange(parts) / parts, m)
    points = curve(boundary, reference, x).through(x).at(segment, s)
    begins = np.append(np.flatnonzero(boundary.previous >= np.arange(m)), m)
    following = np.arange(1, m * parts + 1)
    following[parts * begins[1:] - 1] = parts * begins[:-1]
    previous = np.empty_like(following)
    previous[following] = np.arange(following.size)
    fine = Outlines(segment, boundary.body[segment], following, previous)
    return Polylines(points, fine, parts * begins, parts)


def joined(loops: Sequence[Array], body: Ints, parts: int) -> Polylines:
    """Polylines of loops (2, k parts) [m] of bodies (loops,), which ascend, with `parts` points on each segment."""
    size = np.array([loop.shape[1] for loop in loops], dtype=np.int64)
    start = np.append(0, np.cumsum(size))
    fine = outlines([[np.arange(count)] for count in size.tolist()], start[:-1])
    fine = replace(fine, point=fine.point // parts, body=np.repeat(body, size))
    return Polylines(np.concatenate([np.zeros((2, 0)), *loops], axis=1), fine, start, parts)
