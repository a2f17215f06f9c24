"""Self-contact: parts of the outline of one body that face each other over a gap.

The contact law is that between two bodies. What differs is the search. Parts of one outline face each other where
their outward normals are opposite and each lies in front of the other: over a gap, and not through the material of a
thin part, where each lies behind the other. Of two such parts that which comes first along the outline contributes
the points, the other the curve; corners of both are projected.

Only bodies whose outlines turn back far enough to meet themselves are searched (`outline.crossings.folded`), which
convex ones never do. Parts that lie close together in the reference configuration move as one, since they share nodes
of the body grid, and are no pairs (`MIN_SEPARATION`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skmpm import outline
from skmpm.arrays import Array, Bools, Ints
from skmpm.contact.motion import contact_reach
from skmpm.outline import Outlines
from skmpm.outline.near import facing
from skmpm.scene import MAX_OVERLAP, Scene, State

# [cells] Least distance in the reference configuration of parts that may touch. Slits of 1 and 1.5 cells with sides
# on grid lines close with the forces of two bodies to 0.5 % (`test_self_contact`). At other positions, and where they
# are narrower, their sides move as one: 80 and 56 times (0.5 cells) the force of two bodies in throw-away runs.
MIN_SEPARATION = 0.75
# [cells] Parts closer than the first share nodes wherever they lie on the grid, parts farther apart than the second
# do not: the support of a shape function is two cells wide.
ALWAYS_JOINED, NEVER_JOINED = 1.0, 2.0


@dataclass(frozen=True)
class SelfContact:
    """The bodies that may touch themselves, and which of their parts."""

    bodies: Ints  # deformable bodies whose outlines turn back
    outlines: Outlines
    reference: Array  # (2, m) boundary points in the configuration in which body grids were built [m]
    cell: float  # [m]

    @staticmethod
    def of_scene(scene: Scene, state: State, outlines: Outlines | None = None) -> SelfContact:
        """The bodies of a scene that may touch themselves in a step from this state.

        `outlines` are those of the scene, or of its bodies with images of these.
        """
        boundary = scene.outlines if outlines is None else outlines
        return SelfContact(scene.folded(state.x), boundary, state.x_anchor[:, boundary.point], scene.cell)

    def facing(self, x: Array, reach: float) -> tuple[Ints, Ints]:
        """Boundary points (k,) and segments (k,) of parts that face each other within `reach` [m] at positions x.

        Only those far enough apart in the reference configuration.
        """
        c, j = self.all_facing(x, reach)
        apart = self.separation(c, j) > MIN_SEPARATION * self.cell
        return c[apart], j[apart]

    def all_facing(self, x: Array, reach: float) -> tuple[Ints, Ints]:
        """Pairs of parts that face each other, however close in the reference configuration."""
        if self.bodies.size == 0:
            return self.bodies, self.bodies
        return facing(self.outlines, x, self.bodies, reach, MAX_OVERLAP * self.cell)

    def across_gap(self, point: Ints, segment: Ints, gap: Array) -> Bools:
        """Whether feet on segments (k,) of points (k,) with gaps (k,) at the start of a step are contacts.

        Those on other bodies are. On the same body a foot may lie across a thin part, or have moved along the curve
        to the point itself. A point behind a surface has penetrated it by at most what `step.acceptance` accepts
        between bodies, `MAX_OVERLAP` cells or distances in the reference configuration.
        """
        other = self.outlines.body[point] != self.outlines.body[segment]
        separation = self.separation(point, segment)
        distinct = separation > 0.5 * MIN_SEPARATION * self.cell
        return np.asarray(other | (distinct & (gap > -MAX_OVERLAP * np.minimum(separation, self.cell))))

    def separation(self, c: Ints, j: Ints) -> Array:
        """Distances (k,) of points from segments in the reference configuration [m]."""
        X, after = self.reference, self.outlines.next[j]
        return outline.closest(X[:, c], X[:, j], X[:, after])[1]


def may_touch_itself(scene: Scene, state: State) -> bool:
    """Whether any body has parts that may meet in a step from this state."""
    x = state.x[:, scene.outlines.point]
    return bool(SelfContact.of_scene(scene, state).facing(x, 2.0 * scene.cell + contact_reach(scene))[0].size)


def joined_parts(scene: Scene, state: State) -> Ints:
    """Bodies with parts that approach each other, and were apart at t = 0, but share nodes of rebuilt body grids."""
    now, x = SelfContact.of_scene(scene, state), state.x[:, scene.outlines.point]
    start = replace(now, reference=scene.initial_positions[:, scene.outlines.point])
    c, j = now.all_facing(x, ALWAYS_JOINED * scene.cell)
    joined = start.separation(c, j) > NEVER_JOINED * scene.cell
    joined &= now.separation(c, j) < ALWAYS_JOINED * scene.cell
    return np.unique(scene.outlines.body[c[joined]])
