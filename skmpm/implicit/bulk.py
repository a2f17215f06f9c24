"""The deformable bodies' energy and its derivatives, and the equations of one time step without contact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.assembly import Assembly
from skmpm.linear import Solver
from skmpm.material import Elastic
from skmpm.scheme import Scheme

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


@dataclass(frozen=True)
class Increment:
    """The equations of one time step."""

    bulk: Bulk
    start: Array  # U (2 nodes,) [m]
    v0: Array  # (2 nodes,) [m/s]
    free: Array  # w*, (2 nodes,) [m/s]
    dt: float
    scheme: Scheme

    @property
    def _reach(self) -> float:
        return self.scheme.theta * self.dt

    def at(self, w: Array) -> Configuration:
        """The configuration whose stress drives the step."""
        return self.bulk.at(self.start + self._reach * w)

    def after(self, w: Array) -> Array:
        """The velocity v1 at the end of the step, (2 nodes,) [m/s]."""
        return self.v0 + (w - self.v0) / self.scheme.theta

    def energy(self, w: Array, at: Configuration) -> float:
        """The incremental potential E(w) [J/m]."""
        slip = w - self.free
        return self.bulk.energy(at) + 0.5 * float(slip @ (self.bulk.assembly.mass * slip))

    def gradient(self, w: Array, at: Configuration) -> tuple[Array, float]:
        """The imbalance of momentum without contact (2 nodes,) [kg/s], and the size of its terms."""
        inertia = self.bulk.assembly.mass * (w - self.free)
        elastic = self._reach * self.bulk.force(at)
        noise = self.round_off(w, at) / self.scheme.newton_tol
        return inertia + elastic, max(float(np.linalg.norm(inertia)), float(np.linalg.norm(elastic)), noise)

    def round_off(self, w: Array, at: Configuration) -> float:
        """The imbalance that round-off of displacements and velocities leaves, whatever w [kg/s]."""
        modulus = self.bulk.modulus
        reach = self.bulk.assembly.sheets.cell + float(np.abs(at.displacement).max(initial=0.0))
        inertia = float(np.linalg.norm(self.bulk.assembly.mass * w))
        return float(20.0 * np.finfo(float).eps * (self._reach * modulus * reach * np.sqrt(w.size) + inertia))

    def matrix(self, at: Configuration, *, projected: bool = False) -> sp.bsr_array:
        """A = M + theta^2 dt^2 K."""
        return self.bulk.assembly.matrix(self.bulk.stiffness(at, projected=projected), self._reach**2)

    def factorised(self, at: Configuration, *, projected: bool) -> Solver:
        """The scheme's solver for A; LinAlgError where it sees that A is not positive definite."""
        sheets = self.bulk.assembly.sheets
        return self.scheme.linear(self.matrix(at, projected=projected), sheets.blocks, sheets.rigid_motions())
