"""Unknowns of a step that are not on a grid: velocities of driven walls, of free rigid bodies, of a periodic box.

Each has a mass m, a velocity z = theta v1 + (1 - theta) v0 and a force F that drives it, and moves contacts: their
relative velocity changes by J z. With the contact impulses r,

    m (z - v0) = theta (dt F + J^T r).

The unknowns are eliminated from the contact problem: impulses determine z, and add theta J m^-1 J^T to W. So F is
exact at the end of the step, whatever the stiffness of what it acts on. Without inertia m = 0 in this balance, and
`response` takes its place in W.

A periodic box carries the bodies in it: inertia resists velocities relative to that of the box at their centres. What
it adds to them when its rates change in the step (`translation`) changes no stress and no imbalance, only contacts.
Nodal velocities of the iteration, and unknowns of bodies, are therefore without it until the step is solved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.contact import Constraints
from skmpm.scene import PrescribedVelocities

Array = NDArray[np.float64]

# Without inertia, mass of an unknown in W over dt^2 times the largest shear modulus of the bodies.
RESPONSE = 1e-3
SMALL = 1e-12  # motion along the normal of a contact per motion of what moves it, by round-off


@dataclass(frozen=True)
class Inertia:
    """What resists changes of p unknowns, and where they begin."""

    mass: Array  # in the balance, zero without inertia (p,) [kg/m]
    response: Array  # in W (p,) [kg/m]
    v0: Array  # at the start of the step (p,) [m/s]
    theta: Array  # Moreau-Jean parameters (p,)
    farthest: Array  # largest change in an iteration (p,) [m/s]

    @staticmethod
    def joined(parts: Sequence[Inertia]) -> Inertia:
        """That of several kinds, one after the other."""
        return Inertia(*(np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(Inertia)))


class Unknowns(Protocol):
    """Unknowns of one kind, p velocities [m/s]: spins are times radii of gyration, strain rates times lengths."""

    @property
    def inertia(self) -> Inertia:
        """Masses, and velocities at the start of the step."""

    @property
    def names(self) -> Sequence[str]:
        """What each of them moves, for messages (p,)."""

    def load(self, z: Array) -> Array:
        """The forces that drive the unknowns (p,) [N/m], which move as z."""

    def motions(self, z: Array, end: Array, prescribed: PrescribedVelocities) -> PrescribedVelocities:
        """All prescribed velocities with these: means z in the step, and those at its end (p,)."""

    def rows(self, z: Array, constraints: Constraints) -> sp.csr_array:
        """J from z to the relative velocities of contacts, (k, p) or (2 k, p)."""

    def carried(self, translation: Array) -> Array:
        """What velocities (2, bodies) of all bodies add to the unknowns, (p,)."""


class Carrier(Unknowns, Protocol):
    """Unknowns that carry bodies."""

    def translation(self, z: Array) -> Array:
        """Velocities of bodies, over those at the start of the step, (2, bodies)."""


@dataclass(frozen=True)
class ScalarUnknowns:
    """All such unknowns of a step."""

    kinds: Sequence[Unknowns]
    prescribed: PrescribedVelocities
    dt: float
    carrier: Carrier | None = None  # one of them, the first

    @cached_property
    def inertia(self) -> Inertia:
        """Masses, and velocities at the start of the step, of all."""
        return Inertia.joined([kind.inertia for kind in self.kinds])

    @property
    def v0(self) -> Array:
        """Velocities at the start of the step, (p,)."""
        return self.inertia.v0

    def _each(self, z: Array) -> list[tuple[Unknowns, Array]]:
        ends = np.cumsum([kind.inertia.v0.size for kind in self.kinds])
        return list(zip(self.kinds, np.split(z, ends[:-1]), strict=True))

    def translation(self, z: Array) -> Array | None:
        """Velocities (2, bodies) that the changes of the carrier's unknowns add to those of bodies."""
        return None if self.carrier is None else self.carrier.translation(z[: self.carrying])

    def _carried(self, z: Array) -> Array:
        """What the carrier adds to the unknowns, (p,)."""
        translation = self.translation(z)
        if translation is None:
            return np.zeros_like(z)
        return np.concatenate([kind.carried(translation) for kind in self.kinds])

    def at_end(self, z: Array) -> Array:
        """Velocities at the end of the step without impulses there, (p,)."""
        return np.asarray(self.v0 + (z - self.v0) / self.inertia.theta)

    def motions(self, z: Array, at_end: Array | None = None) -> PrescribedVelocities:
        """All prescribed velocities, with those of the unknowns, and with those at the end of the step (p,)."""
        motions, carried = self.prescribed, self._carried(z)
        after = self.at_end(z) if at_end is None else at_end
        for (kind, own), (_, end) in zip(self._each(z + carried), self._each(after + carried), strict=True):
            motions = kind.motions(own, end, motions)
        return motions

    def load(self, z: Array) -> Array:
        """The driving forces, (p,)."""
        return np.concatenate([kind.load(own) for kind, own in self._each(z)])

    def rows(self, z: Array, constraints: Constraints) -> sp.csr_array:
        """J from z to the relative velocities of contacts, (k, p) or (2 k, p)."""
        blocks = [kind.rows(own, constraints) for kind, own in self._each(z + self._carried(z))]
        return sp.csr_array(sp.hstack(blocks, format="csr"))

    def drives(self, z: Array, constraints: Constraints) -> NDArray[np.bool_]:
        """Whether they move contacts along their normals, (k,)."""
        normal = self.rows(z, constraints)[:: 2 if constraints.tangential else 1]
        return np.asarray(abs(normal).sum(axis=1) > SMALL)

    def elastic_shares(self, z: Array, constraints: Constraints) -> Array | float:
        """Of the response of each contact the share that is not that of unknowns without mass, (k,).

        Between walls of prescribed motion gaps are a millionth of it anyway.
        """
        return 1.0 if self.inertia.mass.any() else np.where(self.drives(z, constraints), RESPONSE, 1.0)

    def imbalance(self, z: Array, constraints: Constraints, r: Array) -> Array:
        """Out-of-balance impulse under contact impulses r, (p,)."""
        pushed = self.rows(z, constraints).T @ r
        return np.asarray(self.inertia.theta * (self.dt * self.load(z) + pushed) - self.inertia.mass * (z - self.v0))

    def worst(self, z: Array, constraints: Constraints, r: Array) -> tuple[float, str]:
        """The largest out-of-balance impulse, what it moves, and whether contacts press on that."""
        each = np.abs(self.imbalance(z, constraints, r))
        k = int(np.argmax(np.nan_to_num(each, nan=np.inf)))
        name = [name for kind in self.kinds for name in kind.names][k]
        pressed = (self.rows(z, constraints).T @ r)[k] != 0.0
        return float(each[k]), name if pressed else f"{name}, on which no contact presses"

    def change(self, z: Array, constraints: Constraints, r: Array) -> Array:
        """The change of z that balances contact impulses r, (p,)."""
        return np.asarray(self.imbalance(z, constraints, r) / self.inertia.response)

    def moved(self, z: Array, constraints: Constraints, r: Array) -> Array:
        """The velocities that balance contact impulses r, at most `farthest` from z, (p,)."""
        farthest = self.inertia.farthest
        return np.asarray(z + np.clip(self.change(z, constraints, r), -farthest, farthest))

    @property
    def carrying(self) -> int:
        """Number of the carrier's unknowns, the first."""
        return 0 if self.carrier is None else self.carrier.inertia.v0.size

    @property
    def stiffness(self) -> Array:
        """Impulses of contacts over the changes of the unknowns that balance them, (p,) [kg/m]."""
        return np.asarray(self.inertia.response / self.inertia.theta)

    def size(self, z: Array) -> float:
        """The norm of the impulses of the driving forces [kg m/s per m]."""
        return self.dt * float(np.linalg.norm(self.inertia.theta * self.load(z)))
