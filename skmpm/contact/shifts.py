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
    # (n,) of a segment against the other surface [m]. A contact that comes to another place of the outline may find
    # an overlap there, up to the sagitta, which no contact has prevented: its removal would be work on the bodies.
    sagitta: Array
    travel: Array  # (n,) along the outline per slope of the gap there [m]; 0 where places are fixed in a step
    wide_from: Array  # (n,) [N/m] normal force between the bodies that makes a contact too wide; inf if fixed

    @classmethod
    def none(cls) -> Shifts:
        """No shifts: all contact points are boundary points."""
        return cls(np.zeros(0, dtype=np.int64), *np.zeros((4, 0)))

    def at(self, key: Ints) -> Shifts:
        """Those of the contacts with keys (k,), whether listed or not."""
        known = np.stack([self.shift, self.sagitta, self.travel, self.wide_from])
        fixed = np.array([[0.0], [0.0], [0.0], [np.inf]])
        return Shifts(key, *lookup(self.key, known, key, fixed))


def guarded(shift: Array) -> Bools:
    """Whether contacts at shifts (k,) have a second one at the boundary point, (k,)."""
    return np.asarray(np.abs(shift) >= MIN_SHIFT)
