"""How sharp outlines are: the angles in which bodies end, seen over a given length."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array, Ints
from skmpm.compiled import compiled_in_order
from skmpm.outline.topology import Outlines


def tip_angles(outlines: Outlines, x: Array, reach: float) -> Array:
    """Angles inside the body between the points that lie `reach` [m] along its outline to either side, (m,) [rad].

    That of a sharp corner is found there, more where it is rounded, pi on a straight side, up to 2 pi in a notch.
    """
    ahead, behind = np.empty((2, 2, outlines.size))
    _walk(x, outlines.next, reach, ahead)
    _walk(x, outlines.previous, reach, behind)
    cross, along = ahead[0] * behind[1] - ahead[1] * behind[0], (ahead * behind).sum(axis=0)
    return np.asarray(np.arctan2(cross, along) % (2.0 * np.pi))


@compiled_in_order
def _walk(x: Array, following: Ints, reach: float, to: Array) -> None:
    """Write the vectors (2, m) from boundary points to those that lie `reach` further along the polygon."""
    for start in range(following.size):
        i, left = start, reach
        for _ in range(following.size):
            j = following[i]
            length = np.hypot(x[0, j] - x[0, i], x[1, j] - x[1, i])
            if length >= left:
                break
            i, left = j, left - length
        share = min(left / length, 1.0)
        for k in range(2):
            to[k, start] = x[k, i] + share * (x[k, j] - x[k, i]) - x[k, start]
