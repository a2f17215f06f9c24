"""The bodies at some nodal displacement, evaluated when it is asked."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from skmpm.assembly import Assembly
from skmpm.material import Response

Array = NDArray[np.float64]


class Bodies(Protocol):
    """What a configuration asks of the bulk."""

    @property
    def assembly(self) -> Assembly:
        """The points and their grids."""
        ...

    def mean_dilatations(self, F: Array) -> Array | None:
        """Means of the cells at deformation gradients (2, 2, n), (n,); None if all are pointwise."""
        ...

    def responses(self, configuration: Configuration) -> tuple[Response | None, ...]:
        """Energy and its derivatives at the points of each material."""
        ...

    def energy_anew(self, configuration: Configuration) -> float:
        """The energy [J/m]."""
        ...


@dataclass(frozen=True)
class Configuration:
    """The bodies at some nodal displacement, relative to the reference configuration (the anchor)."""

    displacement: Array  # (2 nodes,) [m]
    bulk: Bodies | None = field(default=None, repr=False, compare=False)
    scalars: Array = field(default_factory=lambda: np.zeros(0))  # (p,) of scalar unknowns in the step [m]
    given: tuple[Array, Array | None] | None = None  # F and dilatation that do not follow from the displacement

    @cached_property
    def F(self) -> Array:
        """Deformation gradients, (2, 2, n)."""
        if self.given is not None:
            return self.given[0]
        assert self.bulk is not None
        F = self.bulk.assembly.grid.strain_at_points(self.displacement)
        F[0, 0] += 1.0
        F[1, 1] += 1.0
        return F

    @cached_property
    def dilatation(self) -> Array | None:
        """Mean dilatation of each cell at its points (n,), nan where it is pointwise; None if everywhere."""
        if self.given is not None:
            return self.given[1]
        return None if self.bulk is None else self.bulk.mean_dilatations(self.F)

    def translated(self, displacement: Array, scalars: Array | None = None) -> Configuration:
        """The same with a displacement (2 nodes,) [m] that differs from its own by translations of bodies."""
        moved = copy(self)  # with what has been evaluated
        object.__setattr__(moved, "displacement", displacement)
        object.__setattr__(moved, "scalars", np.zeros(0) if scalars is None else scalars)
        return moved

    @cached_property
    def responses(self) -> tuple[Response | None, ...] | None:
        """Energy and its derivatives at the points of each material, None for materials without a compiled pass."""
        return None if self.bulk is None else self.bulk.responses(self)

    @cached_property
    def energy(self) -> float | None:
        """The energy of the bulk [J/m], None without one."""
        return None if self.bulk is None else self.bulk.energy_anew(self)
