"""The forces on bodies as a list of terms: what each stores, its force, its stiffness, its energies in a step.

Residual, matrix, potential of the line search and energy budget of a step are sums over the list. A term that a
scene lacks is not in it. A new one is a class as those of `step.forces`, and a line in `step.scene_forces`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import scipy.sparse as sp

from skmpm.arrays import Array, Ints
from skmpm.material import Response

if TYPE_CHECKING:
    from skmpm.step.bulk import Bulk

ENERGY_TOLERANCE = 5e-7  # over the largest energy: gain by tolerances and round-off (test_gauge)


@dataclass(frozen=True)
class Budget:
    """Energies of one step [J/m], of a term of the balance or of all; pairs are those at its start and its end."""

    kinetic: Array = field(default_factory=lambda: np.zeros(2))  # (2,)
    elastic: Array = field(default_factory=lambda: np.zeros(2))  # (2,)
    springs: Array = field(default_factory=lambda: np.zeros(2))  # (2,) stored in springs
    external: float = 0.0  # work of loads, supports, walls, rigid bodies and moving ends of springs
    push_out: float = 0.0  # penetration correction: work of contact forces on initial overlaps that the step removes
    cohesion: float = 0.0  # work of cohesive contacts on open gaps, positive where these close
    viscous: float = 0.0  # dissipated by the viscosity of materials
    plastic: float = 0.0  # dissipated by changes of the internal variables of materials
    tolerated: float = 0.0  # work of contact forces on open gaps, within `gap_tol`
    rounding: float = 0.0  # round-off of strain energies, kinetic energy of gap velocities that are round-off
    noise: float = 0.0  # round-off of energies
    swing: float = 0.0  # of the energy at the end about the one that is conserved
    overlap: float = 0.0  # largest part of an initial overlap that the step removes [m]
    overlapping: Ints = field(default_factory=lambda: np.zeros(2, dtype=np.int64))  # the two bodies that overlap so

    def __add__(self, other: Budget) -> Budget:
        """The energies of both."""
        deeper = max(self, other, key=lambda each: each.overlap)
        added = [f.name for f in fields(self) if not f.name.startswith("overlap")]
        sums = {name: getattr(self, name) + getattr(other, name) for name in added}
        return Budget(**sums, overlap=deeper.overlap, overlapping=deeper.overlapping)

    @property
    def before(self) -> float:
        """Kinetic and elastic energy at the start."""
        return float(self.kinetic[0] + self.elastic[0])

    @property
    def after(self) -> float:
        """Kinetic and elastic energy at the end."""
        return float(self.kinetic[1] + self.elastic[1])

    @property
    def largest(self) -> float:
        """The largest of the energies."""
        sums = (self.before, self.after, self.external)
        return float(max(*self.springs, *np.abs(sums), self.push_out, self.viscous, self.plastic, self.noise, 1e-300))

    @property
    def exchanged(self) -> float:
        """Sum of the magnitudes of the changes of kinetic and elastic energy, work and dissipation."""
        changes = [each[1] - each[0] for each in (self.springs, self.kinetic, self.elastic)]
        changes[2] += self.plastic  # what flow dissipates has been elastic energy
        return float(np.abs([*changes, self.external]).sum() + self.viscous + self.plastic)

    @property
    def surplus(self) -> float:
        """Energy gained beyond the work and the tolerances."""
        supplied = self.external + self.push_out + self.tolerated + self.rounding + self.cohesion
        spent = self.viscous + self.plastic + self.springs[1] - self.springs[0]
        return float(self.after - self.before + spent - supplied)


@dataclass(frozen=True)
class Configuration:
    """The bodies at some nodal displacement, relative to the reference configuration (the anchor)."""

    displacement: Array  # (2 nodes,) [m]
    bulk: Bulk = field(repr=False, compare=False)
    scalars: Array = field(default_factory=lambda: np.zeros(0))  # (p,) of scalar unknowns in the step [m]

    @cached_property
    def F(self) -> Array:
        """Deformation gradients, (2, 2, n)."""
        F = self.bulk.assembly.grid.strain_at_points(self.displacement)
        F[0, 0] += 1.0
        F[1, 1] += 1.0
        return F

    @cached_property
    def dilatation(self) -> Array | None:
        """Mean dilatation of each cell at its points (n,), nan where it is pointwise; None if everywhere."""
        return self.bulk.mean_dilatations(self.F)

    def translated(self, displacement: Array, scalars: Array) -> Configuration:
        """The configuration after translations of bodies, which lead to a displacement (2 nodes,) [m]."""
        moved = copy(self)  # with what has been evaluated
        object.__setattr__(moved, "displacement", displacement)
        object.__setattr__(moved, "scalars", scalars)
        return moved

    @cached_property
    def responses(self) -> tuple[Response | None, ...]:
        """Energy and its derivatives at the points of each material, None for materials without a compiled pass."""
        return self.bulk.responses(self)

    @cached_property
    def energy(self) -> float:
        """The energy of the bulk [J/m]; inf where a point is inverted."""
        return self.bulk.energy_anew(self)


Mean = TypeVar("Mean", float, Array)


@dataclass(frozen=True)
class Path:
    """The configurations of the bodies in a step, and which forces do its work.

    With inertia those of the balance of momentum do, so that the budget of the time scheme closes. Without, the mean
    of the forces at both ends does (trapezoidal rule, second order).
    """

    start: Configuration
    stressed: Configuration  # in which the forces of the step are taken
    end: Configuration
    theta: float | None  # part of the step after which forces are taken; None without inertia
    internal: Array | None = None  # (k, n) internal variables at the end, None if no material has memory

    @property
    def moved(self) -> Array:
        """Displacements in the step, (2 nodes,) [m]."""
        return np.asarray(self.end.displacement - self.start.displacement)

    def mean(self, force: Callable[[Configuration, float], Mean]) -> Mean:
        """What does work of a force, or of its power, in a configuration and a part of the step after its start."""
        if self.theta is not None:
            return force(self.stressed, self.theta)
        return (force(self.start, 0.0) + force(self.end, 1.0)) * 0.5


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
    def stiff(self) -> bool:
        """Whether it has a stiffness."""
        return type(self).stiffness is not Term.stiffness or type(self).coupling is not Term.coupling

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
