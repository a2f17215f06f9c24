"""The deformable bodies' energy and its derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.assembly import Assembly
from skmpm.material import Elastic

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Configuration:
    """The bodies at some nodal displacement."""

    displacement: Array  # (2 nodes,) since anchoring [m]
    F: Array  # (2, 2, n) since anchoring


@dataclass(frozen=True)
class Bulk:
    """The bodies with unknowns, anchored: their energy and its derivatives at any displacement."""

    assembly: Assembly
    materials: Sequence[tuple[Elastic, NDArray[np.int64] | slice]]  # each with its points
    F_anchor: Array | None  # (2, 2, n), None where undeformed
    stress_anchor: Array | None  # (2, 2, n) [Pa], None where unstressed

    @property
    def linear(self) -> bool:
        """Whether all materials are linear."""
        return all(material.linear for material, _ in self.materials)

    @property
    def modulus(self) -> float:
        """Largest lambda + 2 mu of the materials [Pa]."""
        return max((sum(material.lame) + material.lame[1] for material, _ in self.materials), default=0.0)

    def at(self, displacement: Array) -> Configuration:
        """The configuration at a nodal displacement since anchoring (2 nodes,) [m]."""
        F = self.assembly.sheets.gradient_at_points(displacement)
        F[0, 0] += 1.0
        F[1, 1] += 1.0
        return Configuration(displacement, F)

    def _evaluate(self, method: str, F: Array, **options: bool) -> Array:
        """Energy, stress, tangent or Cauchy stress of every point by its own material."""
        if len(self.materials) == 1:
            return np.asarray(getattr(self.materials[0][0], method)(F, self.F_anchor, self.stress_anchor, **options))
        parts = []
        for material, points in self.materials:
            anchor = [None if a is None else a[..., points] for a in (self.F_anchor, self.stress_anchor)]
            parts.append(getattr(material, method)(F[..., points], *anchor, **options))
        out = np.empty((*parts[0].shape[:-1], F.shape[-1]))
        for part, (_, points) in zip(parts, self.materials, strict=True):
            out[..., points] = part
        return out

    def energy(self, at: Configuration) -> float:
        """Strain energy and ghost penalty [J/m]; inf where a point is turned inside out."""
        density = self._evaluate("energy", at.F)
        if not np.isfinite(density).all():
            return float("inf")
        ghost = 0.5 * at.displacement @ self.assembly.ghost_force(at.displacement)
        return float(self.assembly.volume @ density + ghost)

    def force(self, at: Configuration) -> Array:
        """Internal and ghost forces, the derivative of `energy`, (2 nodes,) [N/m]."""
        P = self._evaluate("stress", at.F)
        return self.assembly.internal_force(P) + self.assembly.ghost_force(at.displacement)

    def stiffness(self, at: Configuration, *, projected: bool) -> Array:
        """Stiffness in the pattern of A, positive semi-definite where `projected`, (blocks, 2, 2) [Pa]."""
        return self.assembly.stiffness(self._evaluate("tangent", at.F, projected=projected))

    def cauchy(self, at: Configuration) -> Array:
        """Cauchy stress of the points, (2, 2, n) [Pa]."""
        return self._evaluate("cauchy", at.F)
