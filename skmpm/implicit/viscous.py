"""Viscous bodies: the elastic bulk and the viscous potential of a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.assembly import Selection
from skmpm.implicit.bulk import Bulk, Configuration
from skmpm.material import Viscous, is_linear, viscosity_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ViscousBulk:
    """The bulk of a step with viscosity; its potential is the elastic energy plus Psi of `material.viscous`."""

    bulk: Bulk
    parts: tuple[tuple[Viscous, Selection], ...]  # of the materials that are viscous, with their points

    @classmethod
    def of(cls, bulk: Bulk, start: Configuration, theta_dt: float) -> ViscousBulk:
        """The bulk of a step from `start` to the configuration of its stresses, `theta_dt` [s] later."""
        parts = []
        for group in bulk.groups:
            material = group.law.material
            if viscosity_of(material) > 0.0:
                law = Viscous(2.0 * viscosity_of(material) / theta_dt, group.of(start.F), is_linear(material))
                parts.append((law, group.points))
        return cls(bulk, tuple(parts))

    @property
    def linear(self) -> bool:
        """Whether all materials are linear."""
        return self.bulk.linear

    def at(self, displacement: Array) -> Configuration:
        """The configuration at a nodal displacement from the reference configuration (2 nodes,) [m]."""
        return self.bulk.at(displacement)

    def energy(self, configuration: Configuration) -> float:
        """Strain energy, ghost penalty and viscous potential [J/m]; inf where a point is inverted (J <= 0)."""
        elastic = self.bulk.energy(configuration)
        return elastic if np.isinf(elastic) else elastic + self.potential(configuration)

    def potential(self, configuration: Configuration) -> float:
        """The viscous potential [J/m], half of the dissipation from the start at a constant rate."""
        volume = self.bulk.assembly.volume
        return float(sum(volume[points] @ law.energy(configuration.F[..., points]) for law, points in self.parts))

    def force(self, configuration: Configuration) -> Array:
        """Internal, viscous and ghost forces, the derivative of `energy`, (2 nodes,) [N/m]."""
        P = self.bulk.stress(configuration).copy()
        for law, points in self.parts:
            P[..., points] += law.stress(configuration.F[..., points])
        return self.bulk.assembly.internal_force(P) + self.bulk.assembly.ghost_force(configuration.displacement)

    def stiffness(self, configuration: Configuration) -> Array:
        """Stiffness in the pattern of A, (blocks, 2, 2) [Pa]."""
        C, added = self.bulk.tangents(configuration)
        C = C.copy()
        for law, points in self.parts:
            C[..., points] += law.tangent(configuration.F[..., points])
        return self.bulk.assembly.stiffness(C, added)
