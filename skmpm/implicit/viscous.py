"""The viscous potential of a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.assembly import Assembly, Selection
from skmpm.implicit.budget import Budget
from skmpm.implicit.bulk import Bulk
from skmpm.implicit.configuration import Configuration
from skmpm.implicit.terms import Path, Term
from skmpm.material import Viscous, is_linear, viscosity_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ViscousBulk(Term):
    """The viscosity of bodies in a step: Psi of `material.viscous`."""

    assembly: Assembly
    parts: tuple[tuple[Viscous, Selection], ...]  # of the materials that are viscous, with their points
    theta: float

    @classmethod
    def of(cls, start: Configuration, dt: float, theta: float) -> ViscousBulk:
        """That of a step of dt [s] from `start`, with forces a part theta after it."""
        parts, bulk = [], start.bulk
        assert isinstance(bulk, Bulk)
        for group in bulk.groups:
            material = group.law.material
            if viscosity_of(material) > 0.0:
                resistance = 2.0 * viscosity_of(material) / (theta * dt)
                parts.append((Viscous(resistance, group.of(start.F), is_linear(material)), group.points))
        return cls(bulk.assembly, tuple(parts), theta)

    @property
    def linear(self) -> bool:
        """Whether the viscous materials are linear."""
        return all(law.linear for law, _ in self.parts)

    @property
    def balanced(self) -> bool:
        """Its forces are internal."""
        return True

    @property
    def modulus(self) -> float:
        """Largest 2 eta / dt [Pa]."""
        return max(law.resistance for law, _ in self.parts)

    def energy(self, at: Configuration) -> float:
        """The viscous potential [J/m], half of the dissipation from the start at a constant rate."""
        volume = self.assembly.volume
        return float(sum(volume[points] @ law.energy(at.F[..., points]) for law, points in self.parts))

    def force(self, at: Configuration) -> Array:
        """The derivative of the potential, (2 nodes,) [N/m]."""
        P = np.zeros_like(at.F)
        for law, points in self.parts:
            P[..., points] = law.stress(at.F[..., points])
        return self.assembly.internal_force(P)

    def stiffness(self, at: Configuration) -> Array:
        """The derivative of the force, in the pattern of A, (blocks, 2, 2) [Pa]."""
        C = np.zeros((2, 2, *at.F.shape))
        for law, points in self.parts:
            C[..., points] = law.tangent(at.F[..., points])
        return self.assembly.stiffness(C, ghost=False)

    def budget(self, path: Path) -> Budget:
        """What viscosity dissipates; never negative."""
        return Budget(viscous=2.0 * self.energy(path.stressed) / self.theta)
