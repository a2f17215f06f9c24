"""Energy of the deformable bodies and its derivatives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skmpm.arrays import EXACT, Array, Ints
from skmpm.grid.assembly import Assembly, Selection
from skmpm.material import (
    Anchored,
    InStep,
    Material,
    Response,
    dilatation,
    in_step,
    is_linear,
    response,
)
from skmpm.step.terms import Budget, Configuration, Path, Term

Matrices = tuple[Selection, Array]  # k cells, and matrices (k, 64) by blocks [Pa]


class Group(NamedTuple):
    """The points of one material."""

    law: Anchored
    points: Selection
    mean_dilatation: bool  # whether their dilatation is the mean over the cell

    def part(self, values: NDArray[Any]) -> NDArray[Any]:
        """The values (..., n) of these points."""
        return values[..., self.points]


@dataclass(frozen=True)
class Bulk(Term):
    """The deformable bodies: their energy and its derivatives at any displacement from the reference configuration.

    `F_anchor` and `stress_anchor` are the deformation gradients and stresses that the points had in it. Materials
    with memory have the potential of a step that begins with their `internal` variables.
    """

    assembly: Assembly
    materials: Sequence[tuple[Material, Ints | slice]]  # each with its points
    F_anchor: Array | None  # (2, 2, n), None where undeformed
    stress_anchor: Array | None  # (2, 2, n) [Pa], None where unstressed
    mean_dilatation: tuple[bool, ...] = ()  # for which materials dilatation is the mean over a cell; () for none
    mixed_cells: bool = False  # whether cells may hold points of several materials
    internal: Array | None = None  # (k, n) internal variables of the points, None if no material has memory

    @cached_property
    def linear(self) -> bool:
        """Whether all materials are linear."""
        return all(is_linear(material) for material, _ in self.materials)

    @property
    def balanced(self) -> bool:
        """Whether forces are internal."""
        return True

    @property
    def turns(self) -> bool:
        """Whether its stiffness turns with bodies: linear materials resist rotations."""
        return not self.linear

    @property
    def modulus(self) -> float:
        """Largest lambda + 2 mu of the materials [Pa]."""
        return max((sum(material.lame) + material.lame[1] for material, _ in self.materials), default=0.0)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """The points by material."""
        mean_dilatation = self.mean_dilatation or (False,) * len(self.materials)
        if len(self.materials) == 1:
            law = Anchored(in_step(self.materials[0][0], self.internal), self.F_anchor, self.stress_anchor)
            return (Group(law, slice(None), mean_dilatation[0]),)
        out = []
        for (material, points), one in zip(self.materials, mean_dilatation, strict=True):
            fields = (self.F_anchor, self.stress_anchor, self.internal)
            F, stress, internal = (None if a is None else a[..., points] for a in fields)
            out.append(Group(Anchored(in_step(material, internal), F, stress), points, one))
        return tuple(out)

    def at(self, displacement: Array, scalars: Array | None = None) -> Configuration:
        """The configuration at a nodal displacement from the reference configuration (2 nodes,) [m].

        Scalar unknowns have moved by `scalars` (p,) [m] since the start of the step.
        """
        return Configuration(displacement, self, np.zeros(0) if scalars is None else scalars)

    def mean_dilatations(self, F: Array) -> Array | None:
        """Means of the cells at deformation gradients (2, 2, n), (n,), nan where pointwise; None if everywhere."""
        if not any(self.mean_dilatation):
            return None
        volumes = [dilatation.volumes(g.law, g.part(F)) for g in self._mean_dilatation_groups]
        return self._cell_means(np.concatenate(volumes, axis=-1))

    def responses(self, configuration: Configuration) -> tuple[Response | None, ...]:
        """Energy and its derivatives at the points of each material, None for materials without a compiled pass."""
        means = self.dilatations_by_group(configuration)
        return tuple(response(g.law, g.part(configuration.F), m) for g, m in zip(self.groups, means, strict=True))

    def energy(self, configuration: Configuration) -> float:
        """Strain energy and ghost penalty [J/m]; inf where a point is inverted (J <= 0)."""
        return configuration.energy

    def energy_anew(self, configuration: Configuration) -> float:
        """`energy`, evaluated: the configuration keeps it."""
        F, parts = configuration.F, []
        for g, mean, found in self._by_group(configuration):
            if found is not None:
                parts.append(found.energy)
            else:
                parts.append(g.law.energy(g.part(F)) if mean is None else dilatation.energy(g.law, g.part(F), mean))
        density = self._of_all_points(parts)
        if not np.isfinite(density).all():
            return float("inf")
        return float(self.assembly.volume @ density) + self.assembly.ghost_energy(configuration.displacement)

    @cached_property
    def reference_energy(self) -> float:
        """Elastic energy of linear materials in the reference configuration, 1/2 stress : C^-1 : stress [J/m]."""
        total = 0.0
        for law, points, _ in self.groups:
            if law.linear and law.stress_anchor is not None:
                stress = law.stress_anchor.reshape(4, -1)
                C = law.tangent(np.eye(2)[:, :, None]).reshape(4, 4)
                square = np.einsum("ap,ab,bp->p", stress, np.linalg.pinv(C), stress)
                total += 0.5 * float(self.assembly.volume[points] @ square)
        return total

    def budget(self, path: Path) -> Budget:
        """Elastic energies, and what changes of internal variables dissipate.

        The midpoint rule balances forces in the middle of the step, where bodies that rotate have not the strain of
        the ends of chords. The elastic energy there is never above that of a vibration.
        """
        modulus, swing = self.modulus * float(self.assembly.volume.sum()), 0.0
        start, end = (self.energy(at) + self.reference_energy for at in (path.start, path.end))
        if path.stressed.displacement is not path.end.displacement:
            swing = end - self.energy(path.stressed) - self.reference_energy
        plastic = self.dissipated(path.end, path.internal)
        return Budget(
            elastic=np.array([start, end - plastic]),
            plastic=plastic,
            rounding=float(np.finfo(float).eps) * modulus,  # a strain energy is a small difference of terms as large
            noise=EXACT**2 * modulus,  # energy of strains that are round-off
            swing=swing,
        )

    def updated(self, end: Configuration) -> Array | None:
        """Internal variables (k, n) after a step that ends so; None if no material has memory."""
        if self.internal is None:
            return None
        internal = self.internal.copy()
        for law, points, F, _ in self._with_memory(end):
            internal[: law.state.shape[0], points] = law.update(F)
        return internal

    def dissipated(self, end: Configuration, after: Array | None) -> float:
        """Energy that changes of the internal variables to `after` (k, n) dissipate in a step that ends so [J/m]."""
        if after is None:
            return 0.0
        total = 0.0
        for law, points, F, rest in self._with_memory(end):
            density = law.dissipated(F, after[: law.state.shape[0], points])
            total += float(self.assembly.volume[points] @ (rest * density))
        return total

    def _with_memory(self, at: Configuration) -> Iterator[tuple[InStep, Selection, Array, Array]]:
        """Materials with memory, their points, the total F they are evaluated in, undeformed over anchor volume."""
        for g, mean in zip(self.groups, self.dilatations_by_group(at), strict=True):
            if isinstance(g.law.material, InStep):
                F = g.part(at.F)
                total = g.law.total(F) if mean is None else dilatation.seen(g.law, F, mean)
                yield g.law.material, g.points, total, g.law.rest(F.shape[-1])

    def force(self, configuration: Configuration) -> Array:
        """Internal and ghost forces, the derivative of `energy`, (2 nodes,) [N/m]."""
        internal = self.assembly.internal_force(self.stress(configuration))
        return internal + self.assembly.ghost_force(configuration.displacement)

    def stress(self, configuration: Configuration) -> Array:
        """First Piola-Kirchhoff stress, the derivative of the cells' energies by F at the points, (2, 2, n) [Pa]."""
        P, mean_stress = self._derivatives(configuration)
        if mean_stress is None:
            return P
        if len(self.groups) == 1:
            return dilatation.with_tension(self.groups[0].law, configuration.F, P, mean_stress)
        for g in self._mean_dilatation_groups:
            own = dilatation.with_tension(g.law, g.part(configuration.F), g.part(P), g.part(mean_stress))
            P[..., g.points] = own
        return P

    def stiffness(self, configuration: Configuration) -> Array:
        """Stiffness in the pattern of A, (blocks, 2, 2) [Pa]."""
        return self.assembly.stiffness(*self.tangents(configuration))

    @cached_property
    def gradient_stiffness(self) -> Array:
        """Stiffness of mu |grad u|^2 / 2 and the ghost penalty, zero for translations, (blocks, 2, 2) [Pa]."""
        one, n = np.eye(2), self.assembly.volume.size
        mu = self._of_all_points([np.full(n, material.lame[1])[points] for material, points in self.materials])
        return self.assembly.stiffness(np.einsum("ik,jl,p->ijklp", one, one, mu))

    def tangents(self, configuration: Configuration) -> tuple[Array, Matrices | None]:
        """Tangents of the points (2, 2, 2, 2, n) [Pa], and the cell matrices that mean dilatation adds."""
        F = configuration.F
        if configuration.dilatation is None:
            return self._of_all_points([g.law.tangent(g.part(F)) for g in self.groups]), None
        _, mean_stress = self._derivatives(configuration)
        parts, added = [], []
        for g, mean in zip(self.groups, self.dilatations_by_group(configuration), strict=True):
            if mean is None or mean_stress is None:
                parts.append(g.law.tangent(g.part(F)))
                continue
            C, *others = dilatation.tangents(g.law, g.part(F), mean, g.part(mean_stress))
            parts.append(C.reshape(2, 2, 2, 2, -1))
            added.append((dilatation.volume_slope(g.law, g.part(F)).reshape(4, -1), *others, g.law.rest(mean.size)))
        volume_gradient, mixed, bulk, rest = (np.concatenate(a, axis=-1) for a in zip(*added, strict=True))
        points, cells, part = self._mean_dilatation_points
        matrices = self.assembly.mean_dilatation_stiffness(volume_gradient, mixed, bulk, rest, points, cells, part)
        return self._of_all_points(parts), (cells, matrices)

    def cauchy(self, configuration: Configuration) -> Array:
        """Cauchy stress of the points, (2, 2, n) [Pa]."""
        P = self.stress(configuration)
        return self._of_all_points([g.law.cauchy(g.part(configuration.F), g.part(P)) for g in self.groups])

    def _derivatives(self, configuration: Configuration) -> tuple[Array, Array | None]:
        """Derivatives of the energy by F at fixed mean dilatation (2, 2, n), and by the volumes of cells (n,) [Pa].

        The latter is a mean stress of the cell of each point, positive in tension; None without mean dilatation.
        """
        F, parts, stresses = configuration.F, [], []
        for g, mean, found in self._by_group(configuration):
            if found is not None:
                P, by_dilatation = found.by_F, found.by_theta
            elif mean is not None:
                P, by_dilatation = dilatation.slopes(g.law, g.part(F), mean)
            else:
                P = g.law.stress(g.part(F))
            parts.append(P)
            if mean is None:
                continue
            stresses.append(np.stack([by_dilatation, g.law.rest(mean.size)]))
        mean_stress = self._cell_means(np.concatenate(stresses, axis=-1)) if stresses else None
        return self._of_all_points(parts), mean_stress

    @cached_property
    def _mean_dilatation_groups(self) -> tuple[Group, ...]:
        return tuple(g for g in self.groups if g.mean_dilatation)

    @cached_property
    def _mean_dilatation_points(self) -> tuple[Selection, Selection, Ints | None]:
        """The points, by material, and the cells with mean dilatation.

        In a cell of several materials each has a mean of its own, over its part of the cell. With such cells the part
        of each point is the third value, and the cells are those of the parts.
        """
        if len(self.groups) == 1:
            return slice(None), slice(None), None
        every = np.arange(self.assembly.volume.size)
        points = np.concatenate([every[g.points] for g in self._mean_dilatation_groups])
        if self.mixed_cells:
            count = len(self._mean_dilatation_groups)
            group = np.repeat(np.arange(count), [every[g.points].size for g in self._mean_dilatation_groups])
            parts, part = np.unique(count * self.assembly.grid.cell_of_point[points] + group, return_inverse=True)
            return points, parts // count, part
        if all(self.mean_dilatation):
            return points, slice(None), None
        within = np.zeros(self.assembly.grid.cells, dtype=bool)
        within[self.assembly.grid.cell_of_point[points]] = True
        return points, np.flatnonzero(within), None

    def dilatations_by_group(self, configuration: Configuration) -> list[Array | None]:
        """Mean dilatations at the points of each group; None for groups with pointwise dilatation."""
        return [
            g.part(configuration.dilatation) if g.mean_dilatation and configuration.dilatation is not None else None
            for g in self.groups
        ]

    def _by_group(self, configuration: Configuration) -> list[tuple[Group, Array | None, Response | None]]:
        """The points by material with their mean dilatations, None where pointwise, and compiled responses."""
        means = self.dilatations_by_group(configuration)
        return list(zip(self.groups, means, configuration.responses, strict=True))

    def _cell_means(self, values: Array) -> Array:
        """Ratio of the cell sums of both rows of `values` (2, points with mean dilatation), (n,); nan elsewhere."""
        points, _, part = self._mean_dilatation_points
        mean = np.full(self.assembly.volume.size, np.nan)
        mean[points] = self.assembly.mean_dilatation(values, points, part)
        return mean

    def _of_all_points(self, parts: Sequence[Array]) -> Array:
        """Values at all points (..., n) from those of each group."""
        if len(parts) == 1:
            return parts[0]
        out = np.empty((*parts[0].shape[:-1], self.assembly.volume.size))
        for part, group in zip(parts, self.groups, strict=True):
            out[..., group.points] = part
        return out
