"""The forces on bodies but those of the bulk, as terms: loads, pressures, springs, viscosity.

The pressure p on a segment from boundary point a to b exerts the force p (x_b - x_a) rotated inwards, half of it on
either point: the derivative of -p A by the boundary points, with A the area that a closed outline encloses. So a
pressure all around has neither a resultant nor a moment, whatever the shape. The force belongs to the configuration
of the stresses. Its derivative is left out of the Newton matrix, which would lose its pattern: iterations converge at
the rate of the pressure over that which makes the body buckle.

Beds act on single points: their stiffness has the pattern of A. Bars couple the means of two sets of points, of one
body or two: they enter the matrix by Woodbury's formula (`linear.corrected`), with the energy 1/2 k (|d| - l)^2 of
their span d = B u + d_0.

The ends of springs move uniformly in a step, so that their work is what the springs store, exactly, whatever their
motion in time.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from skmpm.arrays import Array, Ints
from skmpm.grid.assembly import Assembly, Selection
from skmpm.material import Viscous, is_linear, viscosity_of
from skmpm.step.terms import Budget, Configuration, Path, Term


@dataclass(frozen=True)
class DeadLoad(Term):
    """Forces that do not depend on the configuration: gravity and dead loads."""

    load: Array  # (2 nodes,) or (p,) of the step [N/m]
    at_start: Array | None  # the same when a step without inertia begins [N/m]
    origin: Array  # displacement with no energy [m]
    own: slice | None = None

    def energy(self, at: Configuration) -> float:
        """Minus the work of the load from the origin [J/m]."""
        moved = at.displacement if self.own is None else at.scalars[self.own]
        return -float(self.load @ (moved - self.origin))

    def force(self, at: Configuration) -> Array:
        """Minus the load, (2 nodes,) or (p,) [N/m]."""
        return -self.load

    def budget(self, path: Path) -> Budget:
        """The work of the load."""
        load = path.mean(lambda at, part: self.load if part or self.at_start is None else self.at_start)
        return Budget(external=float(load @ path.moved))


@dataclass(frozen=True)
class FollowerPressure(Term):
    """The pressures on s segments between k boundary points."""

    interpolation: sp.csr_array  # (k, nodes) from nodes to the boundary points
    reference: Array  # (2, k) positions without nodal displacement [m]
    ends: Ints  # (2, s) points at which segments start and end, the material on their left
    value: Array  # (s,) of the step [Pa]
    at_start: Array  # (s,) when it begins [Pa]
    assembly: Assembly
    inside: Array  # (n,) at the points of deformable bodies, that of the nearest segment [Pa]; (0,) for no stiffness

    @property
    def stiff(self) -> bool:
        """Whether it has a stiffness: not among linear materials, beside whose moduli pressures are small."""
        return bool(self.inside.size)

    def energy(self, at: Configuration) -> float:
        """Zero: pressures on a part of an outline have no energy."""
        return 0.0

    def force(self, at: Configuration) -> Array:
        """Minus the forces on the nodes, (2 nodes,) [N/m]."""
        return -self._exerted(at.displacement, self.value)

    def stiffness(self, at: Configuration) -> Array | None:
        """The second derivative of p times the area, in the pattern of A, (blocks, 2, 2) [N/m2].

        It is that of the force round a whole outline. Where pressures differ along it, or end, that of each acts in
        the points next to it: then it is near the derivative, and as smooth as the stiffness of the body.
        """
        if not self.stiff:
            return None
        C = np.zeros((2, 2, 2, 2, self.inside.size))
        C[0, 0, 1, 1] = C[1, 1, 0, 0] = self.inside
        C[0, 1, 1, 0] = C[1, 0, 0, 1] = -self.inside
        return self.assembly.stiffness(C, ghost=False)

    def frozen(self, at: Configuration) -> Term:
        """The forces at a configuration, as a dead load."""
        return DeadLoad(-self.force(at), None, at.displacement)

    def budget(self, path: Path) -> Budget:
        """The work: p times the change of an area, quadratic in displacements: the force halfway gives it exactly."""
        halfway = 0.5 * (path.start.displacement + path.end.displacement)
        value = path.mean(lambda at, part: self.value if part else self.at_start)
        return Budget(external=float(self._exerted(halfway, value) @ path.moved))

    def _exerted(self, displacement: Array, value: Array) -> Array:
        """Nodal forces of pressures (s,) at a nodal displacement (2 nodes,), (2 nodes,) [N/m]."""
        x = self.reference + (self.interpolation @ displacement.reshape(-1, 2)).T
        along = x[:, self.ends[1]] - x[:, self.ends[0]]
        half = 0.5 * value * np.stack([-along[1], along[0]])
        count = self.reference.shape[1]
        each = [np.bincount(self.ends.ravel(), np.tile(component, 2), count) for component in half]
        return np.asarray(self.interpolation.T @ np.stack(each, axis=1)).ravel()


@dataclass(frozen=True)
class Springs(Term):
    """Springs of one kind, with the energy 1/2 k (length - rest)^2."""

    constant: Array  # stiffness of each, (...,) [N/m2]
    rest: Array  # (2, ...) lengths without a force, when the step begins and when it ends [m]
    theta: float  # part of the step after which its forces are taken

    @property
    def turns(self) -> bool:
        """Whether stiffness turns with bodies: directions of springs stay."""
        return False

    @abstractmethod
    def length(self, displacement: Array) -> Array:
        """Lengths of the springs at a nodal displacement (2 nodes,), (...,) [m]."""

    def energy(self, at: Configuration) -> float:
        """The energy of the springs with the ends of the step [J/m]."""
        return self.stored(at.displacement, self.theta)

    def stored(self, displacement: Array, part: float) -> float:
        """The energy at a displacement (2 nodes,), a part of the step after its start [J/m]."""
        return 0.5 * float(np.sum(self.constant * self._stretch(displacement, part) ** 2))

    def budget(self, path: Path) -> Budget:
        """What they store, and the work of their ends."""
        stored = np.array([self.stored(path.start.displacement, 0.0), self.stored(path.end.displacement, 1.0)])
        work = path.mean(lambda at, part: self._work_of_ends(at.displacement, part))
        return Budget(springs=stored, external=work)

    def _stretch(self, displacement: Array, part: float) -> Array:
        before, after = self.rest
        return np.asarray(self.length(displacement) - before - part * (after - before))

    def _pull(self, at: Configuration) -> Array:
        """Forces along the springs, (...,) [N/m]."""
        return np.asarray(self.constant * self._stretch(at.displacement, self.theta))

    def _work_of_ends(self, displacement: Array, part: float) -> float:
        moved = self.rest[1] - self.rest[0]
        return -float(np.sum(self.constant * moved * self._stretch(displacement, part)))


@dataclass(frozen=True)
class Beds(Springs):
    """Beds on m points; lengths are displacements, two of each point (2, m)."""

    assembly: Assembly
    points: Ints  # (m,) among those of deformable bodies
    start: Array  # (2, m) displacements where the nodal one is zero [m]

    def length(self, displacement: Array) -> Array:
        """Displacements of the points, (2, m) [m]."""
        moved = self.assembly.grid.interpolation[self.points] @ displacement.reshape(-1, 2)
        return np.asarray(self.start + moved.T)

    def force(self, at: Configuration) -> Array:
        """The derivative of the energy, (2 nodes,) [N/m]."""
        return np.asarray(self.assembly.grid.interpolation[self.points].T @ self._pull(at).T).ravel()

    def stiffness(self, at: Configuration) -> Array:
        """The stiffness in the pattern of A, (blocks, 2, 2) [N/m2]."""
        assembly, grid = self.assembly, self.assembly.grid
        cell = grid.cell_of_point[self.points]
        N = grid.interpolation.data.reshape(-1, 4)[self.points]
        each = np.einsum("pI,pJ,ip,ij->pIJij", N, N, self.constant, np.eye(2))
        blocks = np.zeros_like(assembly.ghost_data)
        np.add.at(blocks, assembly.block_of_cell[cell], each)
        return blocks


@dataclass(frozen=True)
class Bars(Springs):
    """Bars between the means of points of bodies, or from one to a fixed point; lengths (b,)."""

    ends: sp.csr_array  # (2 b, 2 nodes) B
    span: Array  # (b, 2) where the nodal displacement is zero [m]

    @property
    def linear(self) -> bool:
        """Whether stiffness stays: bars turn, and resist turning by their stress."""
        return False

    def length(self, displacement: Array) -> Array:
        """Distances of their ends, (b,) [m]."""
        return np.asarray(np.hypot(*self._spans(displacement).T))

    def force(self, at: Configuration) -> Array:
        """The derivative of the energy, (2 nodes,) [N/m]."""
        return np.asarray(self.ends.T @ (self._pull(at)[:, None] * self._along(at.displacement)).ravel())

    def coupling(self, at: Configuration) -> tuple[sp.csr_array, Array]:
        """B, and second derivatives of the energies by the spans, (b, 2, 2) [N/m2], none negative."""
        length, along = self.length(at.displacement), self._along(at.displacement)
        axial = np.einsum("bi,bj->bij", along, along)
        stress = self._stretch(at.displacement, self.theta) / np.maximum(length, 1e-300)
        K = axial + np.maximum(stress, 0.0)[:, None, None] * (np.eye(2) - axial)
        return self.ends, np.asarray(self.constant[:, None, None] * K)

    def _spans(self, displacement: Array) -> Array:
        return np.asarray(self.span + (self.ends @ displacement).reshape(-1, 2))

    def _along(self, displacement: Array) -> Array:
        """Unit vectors of the bars, (b, 2); of a bar without length any."""
        span = self._spans(displacement)
        length = np.hypot(*span.T)[:, None]
        return np.asarray(np.where(length > 0.0, span, [1.0, 0.0]) / np.where(length > 0.0, length, 1.0))


@dataclass(frozen=True)
class ViscousBulk(Term):
    """The viscosity of bodies in a step: Psi of `material.viscous`."""

    assembly: Assembly
    parts: tuple[tuple[Viscous, Selection], ...]  # of the materials that are viscous, with their points
    theta: float

    @classmethod
    def in_step(cls, start: Configuration, dt: float, theta: float) -> ViscousBulk:
        """The viscosity in a step of dt [s] from `start`, with forces a part theta after it."""
        parts = []
        for group in start.bulk.groups:
            material = group.law.material
            if viscosity_of(material) > 0.0:
                resistance = 2.0 * viscosity_of(material) / (theta * dt)
                parts.append((Viscous(resistance, group.part(start.F), is_linear(material)), group.points))
        return cls(start.bulk.assembly, tuple(parts), theta)

    @property
    def linear(self) -> bool:
        """Whether the viscous materials are linear."""
        return all(law.linear for law, _ in self.parts)

    @property
    def balanced(self) -> bool:
        """Whether forces are internal."""
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
