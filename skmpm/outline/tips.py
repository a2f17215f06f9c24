"""How sharp outlines are: the angles in which bodies end, seen over a given length."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array, Ints
from skmpm.compiled import compiled_in_order
from skmpm.outline.topology import Outlines


def tip_angles(outlines: Outlines, x: Array, reach: float) -> Array:
    """Angles inside the body between the points of its outline that lie `reach` along it to either side.

    Parameters
    ----------
    outlines, x : outlines, and positions (2, m) [m] of their boundary points
    reach : length along the outline [m]

    Returns
    -------
    (m,) between 0 and 2 pi [rad]: that of a sharp corner, more where it is rounded, pi on a straight side

    Examples
    --------
    >>> import numpy as np
    >>> import skmpm
    >>> points = skmpm.box((0, 0), (1, 1), spacing=0.1)
    >>> outlines = skmpm.outline.outlines([points.outline], offsets=[0])
    >>> angles = skmpm.outline.tip_angles(outlines, points.x[:, outlines.point], reach=0.3)
    >>> np.rad2deg([angles.min(), angles.max()]).round(6).tolist()
    [90.0, 180.0]
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
