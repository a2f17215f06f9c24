"""Places of contact points between boundary points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.contact.constraints import match

# [segments] Smaller shifts are zero. A shifted contact keeps a second one at the boundary point, because a force at
# the contact point dents the outline there, and the boundary point would pass a wall by up to 0.02 cells in impacts
# (test_closest_points).
MIN_SHIFT = 0.02


@dataclass(frozen=True)
class Shifts:
    """Shifts of contact points from boundary points along the outline; those of contacts not listed are zero."""

    key: Ints  # (n,) identities of contacts
    shift: Array  # (n,) between -1/2 and 1/2, not zero [segments]
    # (n,) of a segment against the other surface [m]. A contact that comes to another place of the outline may find
    # an overlap there, up to the sagitta, which no contact has prevented: its removal would be work on the bodies.
    sagitta: Array
    travel: Array  # (n,) along the outline per slope of the gap there [m]; 0 where places are fixed in a step
    wide_from: Array  # (n,) [N/m] normal force between the bodies that makes a contact too wide to slide

    @classmethod
    def none(cls) -> Shifts:
        """No shifts: all contact points are boundary points."""
        return cls(np.zeros(0, dtype=np.int64), *np.zeros((4, 0)))

    def at(self, key: Ints) -> Shifts:
        """Those of the contacts with keys (k,), whether listed or not; no force makes one too wide that is fixed."""
        if self.key.size == 0:
            none = np.zeros(key.size)
            return Shifts(key, none, none, none, np.full(key.size, np.inf))
        found, where = match(self.key, key)
        shift, sagitta, travel = (
            np.where(found, values[where], 0.0) for values in (self.shift, self.sagitta, self.travel)
        )
        return Shifts(key, shift, sagitta, travel, np.where(travel > 0.0, self.wide_from[where], np.inf))


def guarded(shift: Array) -> Bools:
    """Whether contacts at shifts (k,) have a second one at the boundary point, (k,)."""
    return np.asarray(np.abs(shift) >= MIN_SHIFT)
