"""The deformable bodies' energy and its derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.assembly import Assembly, Selection
from skmpm.material import Elastic

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Configuration:
    """The bodies at some nodal displacement."""

    displacement: Array  # (2 nodes,) since anchoring [m]
    F: Array  # (2, 2, n) since anchoring
    dilatation: Array | None = None  # (n,) mean of each point's cell, nan where a point keeps its own; None if all do


@dataclass(frozen=True)
class Bulk:
    """The bodies with unknowns, anchored: their energy and its derivatives at any displacement."""

    assembly: Assembly
    materials: Sequence[tuple[Elastic, NDArray[np.int64] | slice]]  # each with its points
    F_anchor: Array | None  # (2, 2, n), None where undeformed
    stress_anchor: Array | None  # (2, 2, n) [Pa], None where unstressed
    averaged: tuple[bool, ...] = ()  # which materials take the mean dilatation of a cell; () for none

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
        F = self.assembly.grid.gradient_at_points(displacement)
        F[0, 0] += 1.0
        F[1, 1] += 1.0
        return Configuration(displacement, F, self._mean_dilatation(F) if any(self.averaged) else None)

    def _mean_dilatation(self, F: Array) -> Array:
        points, _ = self._averaged
        dilatation = np.full(F.shape[-1], np.nan)
        dilatation[points] = self.assembly.mean_dilatation(self._evaluate_averaged("volumes", F), points)
        return dilatation

    @property
    def _averaged(self) -> tuple[Selection, Selection]:
        """The points, by material, and the cells whose dilatation is averaged."""
        if len(self.materials) == 1:
            return slice(None), slice(None)
        chosen = [points for (_, points), one in zip(self.materials, self.averaged, strict=True) if one]
        points = np.concatenate([np.arange(self.assembly.volume.size)[own] for own in chosen])
        if all(self.averaged):
            return points, slice(None)
        within = np.zeros(self.assembly.grid.cells, dtype=bool)
        within[self.assembly.grid.cell_of_point[points]] = True
        return points, np.flatnonzero(within)

    def _of_material(self, k: int, method: str, F: Array, dilatation: Array | None, **options: bool) -> Array:
        """Energy, stress, tangent, ... of the points of one material."""
        material, points = self.materials[k]
        fields = [F, self.F_anchor, self.stress_anchor]
        if dilatation is not None and self.averaged[k]:
            fields.append(dilatation)
        if len(self.materials) > 1:
            fields = [None if a is None else a[..., points] for a in fields]
        return np.asarray(getattr(material, method)(*fields, **options))

    def _evaluate_averaged(self, method: str, F: Array, dilatation: Array | None = None) -> Array:
        """Volumes, slopes or moduli of the points whose dilatation is averaged, (..., points)."""
        parts = [self._of_material(k, method, F, dilatation) for k, one in enumerate(self.averaged) if one]
        return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=-1)

    def _evaluate(self, method: str, F: Array, dilatation: Array | None = None, **options: bool) -> Array:
        """Energy, stress, tangent, ... of every point by its own material."""
        parts = [self._of_material(k, method, F, dilatation, **options) for k in range(len(self.materials))]
        if len(parts) == 1:
            return parts[0]
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
        return self.assembly.stiffness(C, None if at.dilatation is None else self._bulk_stiffness(at, projected))

    def _bulk_stiffness(self, at: Configuration, projected: bool) -> tuple[Selection, Array]:
        """What mean dilatations add to the matrices of cells: which cells, and (their number, 64) [Pa]."""
        points, cells = self._averaged
        modulus = np.zeros(self.assembly.grid.cells)
        tangent = self._evaluate_averaged("bulk_tangent", at.F, at.dilatation)
        modulus[self.assembly.grid.cell_of_point[points]] = np.maximum(tangent, 0.0) if projected else tangent
        slope, (_, rest) = (self._evaluate_averaged(name, at.F) for name in ("volume_slope", "volumes"))
        return cells, self.assembly.mean_dilatation_stiffness(slope, modulus, rest, points, cells)

    def cauchy(self, at: Configuration) -> Array:
        """Cauchy stress of the points, (2, 2, n) [Pa]."""
        return self._evaluate("cauchy", at.F, at.dilatation)
