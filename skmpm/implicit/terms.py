"""The forces on bodies, as a list of terms: what each stores, its force and its stiffness.

Residual, matrix, potential of the line search and energy budget of a step are sums over the list, and a term that a
scene lacks is not in it. A new one is a class as those of `loads` or `springs`, and a line in `simulate.forces`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.implicit.budget import Budget
from skmpm.implicit.configuration import Configuration

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Path:
    """The configurations of the bodies in a step, and how its work is taken."""

    start: Configuration
    stressed: Configuration  # in which the forces of the step are taken
    end: Configuration
    inertia: bool  # with the forces of the balance of momentum; without the mean of those at both ends
    internal: Array | None = None  # (k, n) internal variables at the end, None if no material has memory

    @property
    def moved(self) -> Array:
        """Displacements in the step, (2 nodes,) [m]."""
        return np.asarray(self.end.displacement - self.start.displacement)


class Term(ABC):
    """Forces on unknowns that belong to a configuration: on the nodes, or on scalar unknowns."""

    @property
    def own(self) -> slice | None:
        """The scalar unknowns on which it acts; None if it acts on the nodes."""
        return None

    @property
    def linear(self) -> bool:
        """Whether its stiffness is the same in all configurations."""
        return True

    @property
    def balanced(self) -> bool:
        """Whether its forces on every body have neither a resultant nor a moment, as internal ones."""
        return False

    @property
    def turns(self) -> bool:
        """Whether its stiffness turns with bodies that rotate."""
        return True

    @property
    def modulus(self) -> float:
        """Largest of its moduli [Pa], for the round-off of its forces."""
        return 0.0

    @abstractmethod
    def energy(self, at: Configuration) -> float:
        """The energy [J/m]; inf where a point is inverted."""

    @abstractmethod
    def force(self, at: Configuration) -> Array:
        """The derivative of the energy by the displacement of what it acts on, (2 nodes,) or (p,) [N/m]."""

    @abstractmethod
    def budget(self, path: Path) -> Budget:
        """The energies of a step."""

    def stiffness(self, at: Configuration) -> Array | None:
        """The derivative of the force in the pattern of A, (blocks, 2, 2) [N/m2]; None if it is not in A."""
        return None

    def frozen(self, at: Configuration) -> Term:
        """The term along a search that begins at a configuration: forces without an energy stay as they are there."""
        return self

    def coupling(self, at: Configuration) -> tuple[sp.csr_array, Array] | None:
        """B and K of a stiffness B^T K B that couples bodies, with blocks (k, 2, 2) of K; None if there is none."""
        return None
