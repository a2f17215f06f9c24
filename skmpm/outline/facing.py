"""Parts of one outline that face each other over a gap."""

from __future__ import annotations

import numpy as np

from skmpm.outline.measures import normals
from skmpm.outline.near import candidates
from skmpm.outline.topology import Floats, Integers, Outlines

# Largest cosine between outward normals that face each other, -1 ideally: an angle of 96 degrees, so that the two
# sides of a re-entrant right angle do not.
MAX_FACING_COSINE = -0.1


def facing(outlines: Outlines, x: Floats, bodies: Integers, reach: float, depth: float) -> tuple[Integers, Integers]:
    """Find boundary points in front of segments of their own body that face them.

    Parameters
    ----------
    x : (2, m) [m]
    bodies : indices of the bodies that are searched
    reach : distance [m] below which they are found
    depth : distance [m] by which a point may lie behind a segment, having penetrated it

    Returns
    -------
    c, j : (k,) boundary points and starts of segments (j, next[j]), sorted by c, then j
    """
    c, j = candidates(outlines, x, reach, np.stack([bodies, bodies]))
    along = x[:, outlines.next[j]] - x[:, j]
    outward = np.stack([along[1], -along[0]]) / np.maximum(np.hypot(*along), 1e-300)
    opposite = np.einsum("ik,ik->k", normals(outlines, x)[:, c], outward) < MAX_FACING_COSINE
    in_front = np.einsum("ik,ik->k", x[:, c] - x[:, j], outward) > -depth
    return c[opposite & in_front], j[opposite & in_front]
