"""Places of contact points between boundary points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.contact.constraints import lookup

# [segments] Smaller shifts are zero. A shifted contact keeps a second one at the boundary point, because a force at
# the contact point dents the outline there, and the boundary point would pass a wall by up to 0.02 cells in impacts
# (test_closest_points).
MIN_SHIFT = 0.02


@dataclass(frozen=True)
class Shifts:
    """Shifts of contact points from boundary points along the outline; those of contacts not listed are zero."""

    key: Ints  # (n,) identities of contacts
    shift: Array  # (n,) between -1/2 and 1/2, not zero [segments]
    sagitta: Array  # (n,) of a segment against the other surface [m]
    travel: Array  # (n,) along the outline per slope of the gap there [m]; 0 where places are fixed in a step
    wide_from: Array  # (n,) [N/m] normal force between the bodies that makes a contact too wide to slide

    @classmethod
    def none(cls) -> Shifts:
        """No shifts: all contact points are boundary points."""
        return cls(np.zeros(0, dtype=np.int64), *np.zeros((4, 0)))

    def at_keys(self, key: Ints) -> Array:
        """Shifts (k,) of the contacts with keys (k,)."""
        return lookup(self.key, self.shift, key, 0.0)

    def travel_of(self, key: Ints) -> Array:
        """How far contacts travel along their outlines per slope of the gap, (k,) [m]."""
        return lookup(self.key, self.travel, key, 0.0)

    def wide_from_of(self, key: Ints) -> Array:
        """Normal forces between bodies that make contacts too wide to slide, (k,) [N/m]; infinite if none does."""
        return lookup(self.key, np.where(self.travel > 0.0, self.wide_from, np.inf), key, np.inf)

    def kept_overlap(self, key: Ints) -> Array:
        """Overlap at the start of the step that remains, (k,) [m].

        A contact that comes to another place of the outline may find an overlap there, up to the sagitta, which no
        contact has prevented: its removal would be work on the bodies.
        """
        return lookup(self.key, self.sagitta, key, 0.0)


def guarded(shift: Array) -> Bools:
    """Whether contacts at shifts (k,) have a second one at the boundary point, (k,)."""
    return np.asarray(np.abs(shift) >= MIN_SHIFT)
