"""The energies of a step: those of what moves and works, each by itself, and their sum."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def _none() -> Array:
    return np.zeros(2)


@dataclass(frozen=True)
class Budget:
    """Energies of one step [J/m], of a term of the balance or of all; pairs are those at its start and its end."""

    kinetic: Array = field(default_factory=_none)  # (2,)
    elastic: Array = field(default_factory=_none)  # (2,)
    springs: Array = field(default_factory=_none)  # (2,) stored in springs
    external: float = 0.0  # work of loads, supports, walls, rigid bodies and moving ends of springs
    push_out: float = 0.0  # penetration correction: work of contact forces on initial overlaps that the step removes
    cohesion: float = 0.0  # work of cohesive contacts on open gaps, positive where these close
    viscous: float = 0.0  # dissipated by the viscosity of materials
    plastic: float = 0.0  # dissipated by changes of the internal variables of materials
    tolerated: float = 0.0  # work of contact forces on open gaps, within `gap_tol`
    rounding: float = 0.0  # round-off of strain energies, kinetic energy of gap velocities that are round-off
    noise: float = 0.0  # round-off of energies
    swing: float = 0.0  # of the energy at the end about the one that is conserved
    overlap: float = 0.0  # largest part of an initial overlap that the step removes [m]
    overlapping: Ints = field(default_factory=lambda: np.zeros(2, dtype=np.int64))  # the two bodies that overlap so

    def __add__(self, other: Budget) -> Budget:
        """The energies of both."""
        deeper = max(self, other, key=lambda each: each.overlap)
        added = [f.name for f in fields(self) if not f.name.startswith("overlap")]
        sums = {name: getattr(self, name) + getattr(other, name) for name in added}
        return Budget(**sums, overlap=deeper.overlap, overlapping=deeper.overlapping)

    @property
    def before(self) -> float:
        """Kinetic and elastic energy at the start."""
        return float(self.kinetic[0] + self.elastic[0])

    @property
    def after(self) -> float:
        """Kinetic and elastic energy at the end."""
        return float(self.kinetic[1] + self.elastic[1])

    @property
    def largest(self) -> float:
        """The largest of the energies."""
        sums = (self.before, self.after, self.external)
        return float(max(*self.springs, *np.abs(sums), self.push_out, self.viscous, self.plastic, self.noise, 1e-300))

    @property
    def exchanged(self) -> float:
        """Sum of the magnitudes of the changes of kinetic and elastic energy, work and dissipation."""
        changes = [each[1] - each[0] for each in (self.springs, self.kinetic, self.elastic)]
        changes[2] += self.plastic  # what flow dissipates has been elastic energy
        return float(np.abs([*changes, self.external]).sum() + self.viscous + self.plastic)

    @property
    def surplus(self) -> float:
        """Energy gained beyond the work and the tolerances."""
        supplied = self.external + self.push_out + self.tolerated + self.rounding + self.cohesion
        spent = self.viscous + self.plastic + self.springs[1] - self.springs[0]
        return float(self.after - self.before + spent - supplied)
