"""Unknowns of a step that are not on a grid: velocities of driven walls, of free rigid bodies, of a periodic box.

They follow the nodes in the vector w of all unknowns. Each has a mass m, a velocity z = theta v1 + (1 - theta) v0 and
a force F that drives it, and moves contacts: their relative velocity changes by J z. With the contact impulses r,

    m (z - v0) = theta (dt F + J^T r),

as at the nodes: J are further columns of H, and m further entries of the diagonals of M and A. So F is exact at the
end of the step, whatever the stiffness of what it acts on. Without inertia m = 0 in this balance, and `response`
takes its place in A.

A periodic box carries the bodies in it: inertia resists velocities relative to that of the box at their centres. What
it adds to them when its rates change in the step (`translation`) changes no stress and no imbalance, only contacts.
Nodal velocities of the iteration, and unknowns of bodies, are therefore without it until the step is solved.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from skmpm.arrays import EXACT, Array, Bools, Ints
from skmpm.contact import Constraints
from skmpm.scene import PrescribedVelocities
from skmpm.step.forces import DeadLoad
from skmpm.step.terms import Budget, Configuration, Path, Term

# Without inertia, mass of an unknown in A over dt^2 times the largest shear modulus of the bodies. Solves of packings
# with rigid discs take 16 iterations with 1e-3, three from 1e-5 to 1e-7 (test_contact_stiffness).
RESPONSE = 1e-5


@dataclass(frozen=True)
class Interval:
    """A step, as the unknowns that are not on a grid see it."""

    t: float  # at which forces are taken [s]
    dt: float  # [s]
    theta: float  # Moreau-Jean parameter
    inertial: bool  # whether bodies have inertia
    soft: float  # mass of an unknown in W without it, zero with it [kg/m]
    farthest: float  # largest change of an unknown in an iteration [m/s]

    def inertia(self, mass: Array, v0: Array) -> Inertia:
        """Inertia of unknowns with these masses (p,) [kg/m] and velocities (p,) [m/s]."""
        farthest, theta = (np.full_like(mass, value) for value in (self.farthest, self.theta))
        resisting = self.inertial * mass
        return Inertia(resisting, resisting + self.soft, v0, theta, farthest)


@dataclass(frozen=True)
class Inertia:
    """What resists changes of p unknowns, and where they begin."""

    mass: Array  # in the balance, zero without inertia (p,) [kg/m]
    response: Array  # in A (p,) [kg/m]
    v0: Array  # at the start of the step (p,) [m/s]
    theta: Array  # Moreau-Jean parameters (p,)
    farthest: Array  # largest change in an iteration (p,) [m/s]

    @staticmethod
    def joined(parts: Sequence[Inertia]) -> Inertia:
        """The inertia of several kinds, one after the other."""
        none = np.zeros(0)
        return Inertia(*(np.concatenate([none, *(getattr(part, f.name) for part in parts)]) for f in fields(Inertia)))


class Entries(NamedTuple):
    """What is not zero in a matrix with a column for each scalar unknown of a step, each (n,); nothing by default."""

    data: Array = np.zeros(0)
    row: Ints = np.zeros(0, dtype=np.int64)
    column: Ints = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True)
class Unknowns(Term):
    """Unknowns of one kind, p velocities [m/s]: spins are times radii of gyration, strain rates times lengths."""

    inertia: Inertia
    dt: float
    first: int  # number of scalar unknowns of other kinds before these

    @property
    def own(self) -> slice:
        """These among the scalar unknowns."""
        return slice(self.first, self.first + self.inertia.v0.size)

    @property
    def counted(self) -> Bools:
        """Whether its kinetic energy and the work of its load are in the budget, of each (p,); here those of all."""
        return np.ones(self.inertia.v0.size, dtype=bool)

    @property
    @abstractmethod
    def names(self) -> Sequence[str]:
        """What each of them moves, for messages (p,)."""

    @abstractmethod
    def load(self, z: Array) -> Array:
        """The forces that drive the unknowns (p,) [N/m], which move as z."""

    @abstractmethod
    def motions(self, z: Array, end: Array, prescribed: PrescribedVelocities) -> PrescribedVelocities:
        """All prescribed velocities with these: means z in the step, and those at its end (p,)."""

    @abstractmethod
    def rows(self, z: Array, constraints: Constraints, directions: Sequence[Array]) -> Entries:
        """From z to components of the relative velocities of k contacts, d k rows.

        They are those along d directions (2, k), one contact after the other.
        """

    def spins(self, constraints: Constraints, side: int) -> Entries:
        """From z to the angular velocities of the bodies on one side of k contacts [rad/s], k rows; here none."""
        return Entries()

    def turning(self, z: Array, constraints: Constraints, impulses: Array) -> tuple[Array, Entries]:
        """Virials (q,) of q bodies that turn, and from z to their angular velocities [rad/s], q rows; here none.

        Virials [kg m2/s per m] are sums of arms times impulses (2, k), those on the first bodies of k contacts.
        """
        return np.zeros(0), Entries()

    def translation(self, z: Array) -> Array | None:
        """Velocities of bodies, over those at the start of the step, (2, bodies); None where these carry none."""
        return None

    def carried(self, translation: Array) -> Array:
        """What velocities (2, bodies) of all bodies add to the unknowns, (p,)."""
        return np.zeros_like(self.inertia.v0)

    def energy(self, at: Configuration) -> float:
        """Zero: forces that follow what they move have none."""
        return 0.0

    def force(self, at: Configuration) -> Array:
        """Minus the load, (p,) [N/m]."""
        return -self.load(at.scalars[self.own] / (self.inertia.theta * self.dt))

    def frozen(self, at: Configuration) -> Term:
        """The load at a configuration, as a dead one."""
        return DeadLoad(-self.force(at), None, at.scalars[self.own], self.own)

    @abstractmethod
    def load_at_start(self) -> Array:
        """The forces when the step begins, (p,) [N/m]."""

    def budget(self, path: Path) -> Budget:
        """The work of the load, where it is counted."""
        load = path.mean(lambda at, part: -self.force(at) if part else self.load_at_start())
        return Budget(external=float((self.counted * load) @ path.end.scalars[self.own]))


@dataclass(frozen=True)
class ScalarUnknowns:
    """The scalar unknowns of a step, p in number; there may be none."""

    kinds: Sequence[Unknowns] = ()
    carrier: Unknowns | None = None  # the first of them, if it carries bodies

    @cached_property
    def inertia(self) -> Inertia:
        """Masses, and velocities at the start of the step, of all."""
        return Inertia.joined([kind.inertia for kind in self.kinds])

    @property
    def names(self) -> list[str]:
        """What each unknown moves, for messages (p,)."""
        return [name for kind in self.kinds for name in kind.names]

    def translation(self, z: Array) -> Array | None:
        """Velocities (2, bodies) that the changes of the carrier's unknowns add to those of bodies."""
        return None if self.carrier is None else self.carrier.translation(z[self.carrier.own])

    def carried(self, translation: Array) -> Array:
        """What velocities (2, bodies) of all bodies add to the unknowns, (p,)."""
        return np.concatenate([np.zeros(0), *(kind.carried(translation) for kind in self.kinds)])

    def motions(self, prescribed: PrescribedVelocities, z: Array, end: Array | None = None) -> PrescribedVelocities:
        """All prescribed velocities, with those of the unknowns, and with those at the end of the step (p,)."""
        for kind in self.kinds:
            prescribed = kind.motions(z[kind.own], (z if end is None else end)[kind.own], prescribed)
        return prescribed

    def rows(self, z: Array, constraints: Constraints, directions: Sequence[Array]) -> sp.csr_array:
        """From z to components of the relative velocities of k contacts along d directions (2, k), (d k, p)."""
        found = [kind.rows(z[kind.own], constraints, directions) for kind in self.kinds]
        return self._matrix(len(directions) * constraints.size, found)

    def spins(self, constraints: Constraints, side: int) -> sp.csr_array:
        """From z to the angular velocities of the bodies on one side of k contacts [rad/s], (k, p)."""
        return self._matrix(constraints.size, [kind.spins(constraints, side) for kind in self.kinds])

    def turning(self, z: Array, constraints: Constraints, impulses: Array) -> tuple[Array, sp.csr_array]:
        """Virials (q,) [kg m2/s per m] of bodies that turn, and from z to their angular velocities (q, p) [rad/s]."""
        found = [kind.turning(z[kind.own], constraints, impulses) for kind in self.kinds]
        virial = np.concatenate([np.zeros(0), *(each for each, _ in found)])
        return virial, self._matrix(virial.size, [rates for _, rates in found])

    def _matrix(self, rows: int, parts: Sequence[Entries]) -> sp.csr_array:
        """The entries of all kinds."""
        if not parts:
            return sp.csr_array((rows, 0))
        data, row, column = (np.concatenate(each) for each in zip(*parts, strict=True))
        return sp.csr_array((data, (row, column)), shape=(rows, self.inertia.v0.size))


def moved_by_scalars(rows: sp.csr_array) -> Bools:
    """Whether scalar unknowns move contacts, (k,), from what they add to the velocities along normals (k, p)."""
    return np.asarray(abs(rows).sum(axis=1) > EXACT)
