"""Curves of the members of the study from their tables, and means over packings with standard errors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import skmpm
from examples import compaction

from .main_job import WAVE

Array = np.ndarray

EARLY = np.linspace(0.55, 1.00, 181)  # solid fractions by outlines, the mode of Nezamabadi et al. (2017)'s included
PHI = EARLY[60:]  # those of the ensemble, from 0.70
YOUNG = 10e6  # [Pa]
PLANE = YOUNG / (1.0 - 0.45**2)  # E* [Pa]
AVERAGED = "pressure", "interior_pressure", "interior_fraction"  # always shown as means over one transit time
FILLING = 0.72  # nominal solid fraction at which the box of `compaction.build` would be a square


@dataclass(frozen=True, eq=False)
class Member:
    """One run: its parameters, how it ended and the columns of its table, each (steps,)."""

    folder: Path
    parameters: dict[str, Any]
    status: str
    table: dict[str, Array]

    @cached_property
    def options(self) -> Any:
        """All options of `compaction.py`, its parameters over the defaults."""
        options = compaction.parser().parse_args([])
        vars(options).update(self.parameters)
        return options

    @property
    def usable(self) -> bool:
        """Whether it ended, at its end or at a step that failed; what is still to go on is not used."""
        return self.status in ("finished", "failed") and len(self.table) > 0 and self.table["t"].size > 2

    @property
    def height(self) -> Array:
        """Height of the box (steps,) [m]: 1 / nominal falls with it, at the speed of the lid."""
        t, inverse = self.table["t"], 1.0 / self.table["solid_fraction_nominal"]
        return self.options.speed * inverse * (t[-1] - t[0]) / (inverse[0] - inverse[-1])

    @property
    def box(self) -> Array:
        """Area of the box (steps,) [m2]."""
        return self.height**2 * self.table["solid_fraction_nominal"] / FILLING

    def steady(self, name: str, transits: float = 1.0) -> Array:
        """A column, or a sum of columns, as mean over times that a pressure wave takes from lid to floor.

        The time is centred on each step; nan where it leaves the run.
        """
        t, length = self.table["t"], self.table["dt"]
        return steady(t, length, self.column(name), transits * self.height / np.sqrt(WAVE))

    def column(self, name: str) -> Array:
        """A column (steps,), or one of those that are made of several."""
        if name == "walls":  # mean of the four
            return sum(self.table[f"pressure_{wall}"] for wall in ("floor", "roof", "left", "right")) / 4.0
        if name in ("pressure + motion", "pressure_points + motion"):  # what the walls feel of both
            return self.table[name.split()[0]] + self.table["kinetic"] / self.box
        if name in ("pressure - swing", "pressure_points - swing"):  # the same by the virial theorem of the discs
            return self.table[name.split()[0]] + self._motion
        return self.table[name]

    @property
    def _motion(self) -> Array:
        """What the motion of the discs adds to the pressure on the walls (steps,) [Pa]; nan in old tables."""
        if "swing" not in self.table:
            return np.full(self.table["t"].size, np.nan)
        rate = np.diff(self.table["swing"], prepend=0.0) / self.table["dt"]
        return (self.table["kinetic_discs"] - 0.5 * rate) / self.box

    def over(self, name: str, grid: Array = PHI, *, averaged: bool = False) -> Array:
        """A column at the first passage of each solid fraction of `grid`; nan where it was not.

        Of those in `AVERAGED`, and of all if `averaged`, the mean over one transit time.
        """
        values = self.steady(name) if averaged or name in AVERAGED else self.column(name)
        return first_passage(self.table["solid_fraction"], values, grid)


def steady(t: Array, length: Array, values: Array, window: Array) -> Array:
    """Mean of values over `window` around each t; steps end at t and last `length`, all (steps,)."""
    edges = np.append(t[0] - length[0], t)
    sums = np.append(0.0, np.cumsum(values * np.diff(edges)))
    low, high = t - 0.5 * window, t + 0.5 * window
    mean = (np.interp(high, edges, sums) - np.interp(low, edges, sums)) / window
    return np.where((low >= edges[0]) & (high <= edges[-1]), mean, np.nan)


def first_passage(x: Array, values: Array, grid: Array) -> Array:
    """Interpolate values at the points of `grid`, between the steps at which x is larger than ever before."""
    finite = np.isfinite(x) & np.isfinite(values)
    x, values = x[finite], values[finite]
    if x.size == 0:
        return np.full(grid.size, np.nan)
    ahead = np.append(True, x[1:] > np.maximum.accumulate(x)[:-1])
    return np.interp(grid, x[ahead], values[ahead], left=np.nan, right=np.nan)


def mean(samples: Array) -> tuple[Array, Array]:
    """Mean and standard error over the first axis of samples (k, ...), of those that are not nan.

    The mean is nan where there is none, the error (deviation with k - 1 over sqrt k) where there are fewer than two.
    """
    samples = np.asarray(samples, dtype=float)
    count = np.isfinite(samples).sum(axis=0)
    average = np.nansum(samples, axis=0) / np.maximum(count, 1)
    scatter = np.nansum((samples - average) ** 2, axis=0) / np.maximum(count - 1, 1)
    return np.where(count > 0, average, np.nan), np.where(count > 1, np.sqrt(scatter / np.maximum(count, 1)), np.nan)


@dataclass(frozen=True, eq=False)
class Study:
    """The members that can be used, and the names of the others, by name."""

    members: dict[str, Member]
    unfinished: list[str]

    def get(self, name: str) -> Member | None:
        """A member, or None if it has not been run."""
        return self.members.get(name)

    def seeds(self, friction: float) -> list[Member]:
        """The packings of the ensemble with one friction."""
        return [m for name, m in self.members.items() if name.startswith(f"mu{friction:g}_seed")]

    def pairs(self) -> list[tuple[Member, Member]]:
        """The same packing without and with friction."""
        with_friction = {m.options.seed: m for m in self.seeds(0.5)}
        return [(m, with_friction[m.options.seed]) for m in self.seeds(0.0) if m.options.seed in with_friction]

    def curve(self, friction: float, name: str) -> tuple[Array, Array]:
        """Mean and standard error over the packings on PHI; nan where fewer than all reached it."""
        found = self.seeds(friction)
        if not found:
            return np.full(PHI.size, np.nan), np.full(PHI.size, np.nan)
        samples = np.array([m.over(name) for m in found])
        whole = np.isfinite(samples).all(axis=0)
        return mean(np.where(whole, samples, np.nan))


def read(out: Path) -> Study:
    """Read the members that `study.py` ran."""
    members = [Member(m.folder, m.parameters, m.status, numbers(m.columns)) for m in skmpm.Sweep.read(out)]
    usable = {member.folder.name: member for member in members if member.usable}
    return Study(usable, [member.folder.name for member in members if not member.usable])


def numbers(columns: dict[str, Any]) -> dict[str, Array]:
    """Columns of a table as floating-point numbers."""
    return {name: column.astype(np.float64) for name, column in columns.items()}
