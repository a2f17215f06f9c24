"""The contacts of a state."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from skmpm.representation import with_shapes

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_BODIES = 2**32  # of a scene, so that pairs of them have numbers


@dataclass(frozen=True, repr=False)
class Contacts:
    """The contacts at the end of a step; walls are bodies -1, -2, ...

    Attributes
    ----------
    bodies : (2, k) the two bodies, walls -1, -2, ...; the same twice where parts of one body touch
    x : (2, k) contact points [m]
    normal : (2, k) unit, from the second to the first body
    force : (2, k) [N/m] on the first body, in (n, t), t = (-n_y, n_x)
    gap : (k,) distance, negative where boundaries overlap [m]
    key : (k,) identity of a contact from step to step, for the warm start
    point : (k,) boundary point of the first body in contact; -1 at a grid node
    image : (2, k) displacement of the second body to its image that the first one touches [m]; zero but in a
        periodic box. `x` is where the first body is
    lasting_force : (k,) [N/m] the normal force between the two bodies, or its mean over the steps in which waves
        cross the contact, where these are short; it tells light contacts from wide ones (`contact.closest_points`).
        By default the former
    """

    __repr__ = with_shapes

    bodies: Ints
    x: Array
    normal: Array
    force: Array
    gap: Array
    key: Ints
    point: Ints
    image: Array
    lasting_force: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if self.lasting_force.shape != self.gap.shape:
            object.__setattr__(self, "lasting_force", between_bodies(self.bodies, self.force[0]))

    def at(self, side: int) -> Array:
        """The contact points where the first (0) or the second bodies (1) are, (2, k) [m]."""
        return self.x - self.image if side else self.x

    @property
    def vectors(self) -> Array:
        """Forces on the first bodies in x and y, (2, k) [N/m]."""
        n = self.normal
        return np.asarray(self.force[0] * n + self.force[1] * np.stack([-n[1], n[0]]))

    @staticmethod
    def none() -> Contacts:
        """No contacts."""
        ints, floats = np.zeros((2, 0), dtype=np.int64), np.zeros((2, 0))
        return Contacts(ints, floats, floats, floats, floats[0], ints[0], ints[0], floats)


def pair_numbers(bodies: Ints) -> Ints:
    """Numbers (k,) by which pairs of bodies (2, k) differ, whichever comes first; walls are -1, -2, ..."""
    return np.asarray(np.minimum(*bodies) * MOST_BODIES + np.maximum(*bodies))


def between_bodies(bodies: Ints, force: Array) -> Array:
    """Sums (k,) of the forces (k,) of all contacts between the same two bodies (2, k)."""
    pair = np.unique(pair_numbers(bodies), return_inverse=True)[1]
    return np.asarray(np.bincount(pair, force)[pair])
