"""The smooth curves of outlines as polylines, to be drawn and recorded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skmpm.outline.curve import curve
from skmpm.outline.topology import Floats, Integers, Outlines


@dataclass(frozen=True, eq=False)
class Polylines:
    """Points of the curves through the boundary points, `parts` on each segment, loop after loop."""

    x: Floats  # (2, m parts) [m]; the points parts i are the boundary points i
    outlines: Outlines  # closed loops of these points; `point` is the boundary point that begins the segment
    loops: Integers  # (loops + 1,) first point of each loop
    parts: int

    def values(self, at_boundary_points: Floats) -> Floats:
        """Values (m parts,) between those at the boundary points (m,), linear in the parameter of each segment."""
        i = np.arange(at_boundary_points.size)
        after = at_boundary_points[self.outlines.next[self.parts * i + self.parts - 1] // self.parts]
        s = np.arange(self.parts) / self.parts
        return np.asarray((1.0 - s) * at_boundary_points[:, None] + s * after[:, None]).ravel()


def polylines(boundary: Outlines, reference: Floats, x: Floats, parts: int) -> Polylines:
    """The curves through boundary points at x (2, m) [m], with the corners of their `reference` positions (2, m)."""
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
