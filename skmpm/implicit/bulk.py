"""The deformable bodies' energy and its derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skmpm.assembly import Assembly, Selection
from skmpm.material import Anchored, Material, dilatation, is_linear, viscosity_of
from skmpm.material import projected as without_negative

Array = NDArray[np.float64]
Matrices = tuple[Selection, Array]  # (k, 64) by blocks [Pa], and which k cells


@dataclass(frozen=True)
class Configuration:
    """The bodies at some nodal displacement."""

    displacement: Array  # (2 nodes,) since anchoring [m]
    F: Array  # (2, 2, n) since anchoring
    dilatation: Array | None = None  # (n,) mean of each point's cell, nan where a point keeps its own; None if all do


class Group(NamedTuple):
    """The points of one material."""

    law: Anchored
    points: Selection
    averaged: bool  # whether they take the mean dilatation of their cell

    def of(self, values: Array) -> Array:
        """The values (..., n) of these points."""
        return values[..., self.points]


@dataclass(frozen=True)
class Bulk:
    """The bodies with unknowns, anchored: their energy and its derivatives at any displacement."""

    assembly: Assembly
    materials: Sequence[tuple[Material, NDArray[np.int64] | slice]]  # each with its points
    F_anchor: Array | None  # (2, 2, n), None where undeformed
    stress_anchor: Array | None  # (2, 2, n) [Pa], None where unstressed
    averaged: tuple[bool, ...] = ()  # which materials take the mean dilatation of a cell; () for none

    @property
    def linear(self) -> bool:
        """Whether all materials are linear."""
        return all(is_linear(material) for material, _ in self.materials)

    @property
    def modulus(self) -> float:
        """Largest lambda + 2 mu of the materials [Pa]."""
        return max((sum(material.lame) + material.lame[1] for material, _ in self.materials), default=0.0)

    @property
    def viscosity(self) -> float:
        """Largest viscosity of the materials [Pa s]."""
        return max((viscosity_of(material) for material, _ in self.materials), default=0.0)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """The points by material."""
        averaged = self.averaged or (False,) * len(self.materials)
        if len(self.materials) == 1:
            law = Anchored(self.materials[0][0], self.F_anchor, self.stress_anchor)
            return (Group(law, slice(None), averaged[0]),)
        out = []
        for (material, points), one in zip(self.materials, averaged, strict=True):
            own = [None if a is None else a[..., points] for a in (self.F_anchor, self.stress_anchor)]
            out.append(Group(Anchored(material, *own), points, one))
        return tuple(out)

    def at(self, displacement: Array) -> Configuration:
        """The configuration at a nodal displacement since anchoring (2 nodes,) [m]."""
        F = self.assembly.grid.gradient_at_points(displacement)
        F[0, 0] += 1.0
        F[1, 1] += 1.0
        if not any(self.averaged):
            return Configuration(displacement, F)
        volumes = [dilatation.volumes(g.law, g.of(F)) for g in self._averaged]
        return Configuration(displacement, F, self._mean(np.concatenate(volumes, axis=-1)))

    def energy(self, at: Configuration) -> float:
        """Strain energy and ghost penalty [J/m]; inf where a point is turned inside out."""
        density = self._gathered(
            [
                g.law.energy(g.of(at.F)) if mean is None else dilatation.energy(g.law, g.of(at.F), mean)
                for g, mean in zip(self.groups, self._dilatations(at), strict=True)
            ]
        )
        if not np.isfinite(density).all():
            return float("inf")
        return float(self.assembly.volume @ density) + self.assembly.ghost_energy(at.displacement)

    def force(self, at: Configuration) -> Array:
        """Internal and ghost forces, the derivative of `energy`, (2 nodes,) [N/m]."""
        return self.assembly.internal_force(self.stress(at)) + self.assembly.ghost_force(at.displacement)

    def stress(self, at: Configuration) -> Array:
        """First Piola-Kirchhoff stress, the derivative of the cells' energies by F at the points, (2, 2, n) [Pa]."""
        P, tension = self._slopes(at)
        if tension is not None:
            for g in self._averaged:
                P[..., g.points] += g.of(tension) * dilatation.volume_slope(g.law, g.of(at.F))
        return P

    def stiffness(self, at: Configuration, *, projected: bool) -> Array:
        """Stiffness in the pattern of A, positive semi-definite where `projected`, (blocks, 2, 2) [Pa]."""
        return self.assembly.stiffness(*self.tangents(at, projected=projected))

    def tangents(self, at: Configuration, *, projected: bool) -> tuple[Array, Matrices | None]:
        """Tangents of the points (2, 2, 2, 2, n) [Pa], and what mean dilatations add to the matrices of cells."""
        if at.dilatation is None:
            return self._gathered([_tangent(g.law, g.of(at.F), projected) for g in self.groups]), None
        _, tension = self._slopes(at)
        parts, added = [], []
        for g, mean in zip(self.groups, self._dilatations(at), strict=True):
            if mean is None or tension is None:
                parts.append(_tangent(g.law, g.of(at.F), projected))
                continue
            C, *others = dilatation.tangents(g.law, g.of(at.F), mean, g.of(tension), projected=projected)
            parts.append(C.reshape(2, 2, 2, 2, -1))
            added.append((dilatation.volume_slope(g.law, g.of(at.F)).reshape(4, -1), *others, g.law.rest(mean.size)))
        slope, mixed, bulk, rest = (np.concatenate(a, axis=-1) for a in zip(*added, strict=True))
        points, cells = self._averaged_points
        matrices = self.assembly.mean_dilatation_stiffness(slope, mixed, bulk, rest, points, cells)
        return self._gathered(parts), (cells, matrices)

    def cauchy(self, at: Configuration) -> Array:
        """Cauchy stress of the points, (2, 2, n) [Pa]."""
        P = self.stress(at)
        return self._gathered([g.law.cauchy(g.of(at.F), g.of(P)) for g in self.groups])

    def _slopes(self, at: Configuration) -> tuple[Array, Array | None]:
        """Derivatives of the points' energies by F (2, 2, n), those of the cells' by their volumes (n,) [Pa]."""
        parts, tensions = [], []
        for g, mean in zip(self.groups, self._dilatations(at), strict=True):
            if mean is None:
                parts.append(g.law.stress(g.of(at.F)))
                continue
            P, tension = dilatation.slopes(g.law, g.of(at.F), mean)
            parts.append(P)
            tensions.append(np.stack([tension, g.law.rest(mean.size)]))
        mean_tension = self._mean(np.concatenate(tensions, axis=-1)) if tensions else None
        return self._gathered(parts), mean_tension

    @cached_property
    def _averaged(self) -> tuple[Group, ...]:
        return tuple(g for g in self.groups if g.averaged)

    @cached_property
    def _averaged_points(self) -> tuple[Selection, Selection]:
        """The points, by material, and the cells whose dilatation is averaged."""
        if len(self.groups) == 1:
            return slice(None), slice(None)
        every = np.arange(self.assembly.volume.size)
        points = np.concatenate([every[g.points] for g in self._averaged])
        if all(self.averaged):
            return points, slice(None)
        within = np.zeros(self.assembly.grid.cells, dtype=bool)
        within[self.assembly.grid.cell_of_point[points]] = True
        return points, np.flatnonzero(within)

    def _dilatations(self, at: Configuration) -> list[Array | None]:
        """Mean dilatations of the points of each group that takes them."""
        return [g.of(at.dilatation) if g.averaged and at.dilatation is not None else None for g in self.groups]

    def _mean(self, values: Array) -> Array:
        """Sums over cells of the first over those of the second of (2, averaged points), nan elsewhere, (n,)."""
        points, _ = self._averaged_points
        mean = np.full(self.assembly.volume.size, np.nan)
        mean[points] = self.assembly.mean_dilatation(values, points)
        return mean

    def _gathered(self, parts: Sequence[Array]) -> Array:
        """Values of all points (..., n) from those of each group."""
        if len(parts) == 1:
            return parts[0]
        out = np.empty((*parts[0].shape[:-1], self.assembly.volume.size))
        for part, group in zip(parts, self.groups, strict=True):
            out[..., group.points] = part
        return out


def _tangent(law: Anchored, F: Array, projected: bool) -> Array:
    C = law.tangent(F)
    if not projected or law.linear:  # the energy of a linear material is convex
        return C
    return without_negative(C.reshape(4, 4, -1)).reshape(C.shape)
