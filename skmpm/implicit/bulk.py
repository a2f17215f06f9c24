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
    dilatation: Array | None = None  # (n,) mean of each point's cell, None where every point keeps its own


@dataclass(frozen=True)
class Bulk:
    """The bodies with unknowns, anchored: their energy and its derivatives at any displacement."""

    assembly: Assembly
    materials: Sequence[tuple[Elastic, NDArray[np.int64] | slice]]  # each with its points
    F_anchor: Array | None  # (2, 2, n), None where undeformed
    stress_anchor: Array | None  # (2, 2, n) [Pa], None where unstressed
    locking: bool = False  # whether the materials are told mean dilatations, against locking

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
        if not self.locking:
            return Configuration(displacement, F)
        return Configuration(displacement, F, self.assembly.mean_dilatation(self._evaluate("volumes", F)))

    def _evaluate(self, method: str, F: Array, dilatation: Array | None = None, **options: bool) -> Array:
        """Energy, stress, tangent, ... of every point by its own material."""
        fields = [F, self.F_anchor, self.stress_anchor] + ([] if dilatation is None else [dilatation])
        if len(self.materials) == 1:
            return np.asarray(getattr(self.materials[0][0], method)(*fields, **options))
        parts = []
        for material, points in self.materials:
            own = [None if a is None else a[..., points] for a in fields]
            parts.append(getattr(material, method)(*own, **options))
        out = np.empty((*parts[0].shape[:-1], F.shape[-1]))
        for part, (_, points) in zip(parts, self.materials, strict=True):
            out[..., points] = part
        return out

    def energy(self, at: Configuration) -> float:
        """Strain energy and ghost penalty [J/m]; inf where a point is turned inside out."""
        density = self._evaluate("energy", at.F, at.dilatation)
        if not np.isfinite(density).all():
            return float("inf")
        return float(self.assembly.volume @ density) + self.assembly.ghost_energy(at.displacement)

    def force(self, at: Configuration) -> Array:
        """Internal and ghost forces, the derivative of `energy`, (2 nodes,) [N/m]."""
        P = self._evaluate("stress", at.F, at.dilatation)
        return self.assembly.internal_force(P) + self.assembly.ghost_force(at.displacement)

    def stiffness(self, at: Configuration, *, projected: bool) -> Array:
        """Stiffness in the pattern of A, positive semi-definite where `projected`, (blocks, 2, 2) [Pa]."""
        C = self._evaluate("tangent", at.F, at.dilatation, projected=projected)
        return self.assembly.stiffness(C, self._bulk_stiffness(at, projected))

    def _bulk_stiffness(self, at: Configuration, projected: bool) -> Array | None:
        """What mean dilatations add to the matrices of the cells, (cells, 64) [Pa]."""
        if at.dilatation is None:
            return None
        modulus = np.empty(self.assembly.sheets.cells)
        modulus[self.assembly.sheets.cell_of_point] = self._evaluate("bulk_tangent", at.F, at.dilatation)
        slope, (_, rest) = self._evaluate("volume_slope", at.F), self._evaluate("volumes", at.F)
        return self.assembly.mean_dilatation_stiffness(
            slope, np.maximum(modulus, 0.0) if projected else modulus, rest
        )

    def cauchy(self, at: Configuration) -> Array:
        """Cauchy stress of the points, (2, 2, n) [Pa]."""
        return self._evaluate("cauchy", at.F, at.dilatation)
