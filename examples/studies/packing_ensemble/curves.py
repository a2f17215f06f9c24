"""Curves of the members of the study from their tables, and means over packings with standard errors."""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import skmpm

from .members import name_of
from .rows import INTERIOR, WALLS
from .scenes import WAVE, YOUNG, options_of

Array = np.ndarray

EARLY = np.linspace(0.55, 1.00, 181)  # solid fractions by outlines, the mode of Nezamabadi et al. (2017)'s included
PHI = EARLY[60:]  # those of the ensemble, from 0.70
NEAR_JAMMING = np.linspace(0.70, 1.00, 601)  # those that jamming is looked for at
AVERAGED = "pressure", "interior_pressure", "interior_fraction"  # means over one transit time where a lid is fast
FILLING = 0.72  # nominal solid fraction at which the box of `compaction.build` would be a square


@dataclass(frozen=True, eq=False)
class Member:
    """One run: its parameters, how it ended and the columns of its table, each (rows,)."""

    folder: Path
    parameters: dict[str, Any]
    status: str
    table: dict[str, Array]

    @cached_property
    def options(self) -> argparse.Namespace:
        """All options: its parameters over the defaults."""
        return options_of(self.parameters)

    @property
    def usable(self) -> bool:
        """Whether it ended, at its end or at a step that failed; what is still to go on is not used."""
        return self.status in ("finished", "failed") and len(self.table) > 0 and self.table["t"].size > 2

    @property
    def slow(self) -> bool:
        """Whether it is quasi-static: its steps are chosen, and longer than waves need to pass the box."""
        return self.options.dt is None

    @property
    def plane(self) -> float:
        """E* = E / (1 - nu^2) [Pa]."""
        return YOUNG / (1.0 - float(self.options.nu) ** 2)

    @property
    def height(self) -> Array:
        """Height of a box of walls (rows,) [m]: 1 / nominal falls with it, at the speed of the lid."""
        t, inverse = self.table["t"], 1.0 / self.table["solid_fraction_nominal"]
        return self.options.speed * inverse * (t[-1] - t[0]) / (inverse[0] - inverse[-1])

    @property
    def box(self) -> Array:
        """Area of a box of walls (rows,) [m2]."""
        return self.height**2 * self.table["solid_fraction_nominal"] / FILLING

    def steady(self, name: str, transits: float = 1.0) -> Array:
        """A column, or a sum of columns, as mean over times that a pressure wave takes from lid to floor.

        The time is centred on each row; nan where it leaves the run. Of quasi-static members it is the column itself.
        """
        if self.slow:
            return self.column(name)
        return steady(self.table["t"], self.column(name), transits * self.height / WAVE)

    def column(self, name: str) -> Array:
        """A column (rows,), or one of those that are made of several; nan where the member has none of the name."""
        if name == "walls":  # mean of the four
            return sum(self.column(f"pressure_{wall}") for wall in WALLS) / len(WALLS)
        if name in ("pressure + motion", "pressure_points + motion"):  # what the walls feel of both
            return self.table[name.split()[0]] + self.table["kinetic"] / self.box
        if name in ("pressure - swing", "pressure_points - swing"):  # the same by the virial theorem of the discs
            return self.table[name.split()[0]] + self._motion
        if name not in self.table and name in INTERIOR:  # a periodic box is interior everywhere
            name = INTERIOR[name]
        return self.table.get(name, np.full(self.table["t"].size, np.nan))

    @property
    def _motion(self) -> Array:
        """What the motion of the discs adds to the pressure on the walls (rows,) [Pa], with a row for every step."""
        rate = np.diff(self.column("swing"), prepend=0.0) / np.diff(self.table["t"], prepend=0.0)
        return (self.column("kinetic_discs") - 0.5 * rate) / self.box

    def over(self, name: str, grid: Array = PHI, *, averaged: bool = False, along: str = "solid_fraction") -> Array:
        """A column where that of `along` first passes each solid fraction of `grid`; nan where it does not.

        Of those in `AVERAGED`, and of all if `averaged`, the mean over one transit time where the lid is fast.
        """
        values = self.steady(name) if averaged or name in AVERAGED else self.column(name)
        return first_passage(self.column(along), values, grid)

    def pressure(self, grid: Array = PHI, *, over: float | None = None) -> Array:
        """P over E*, or over another modulus [Pa]."""
        return self.over("pressure", grid) / (self.plane if over is None else over)


def steady(t: Array, values: Array, window: Array) -> Array:
    """Mean of values over `window` around each t; a value stands for the time since the row before, all (rows,)."""
    edges = np.append(0.0, t)
    sums = np.append(0.0, np.cumsum(values * np.diff(edges)))
    low, high = t - 0.5 * window, t + 0.5 * window
    mean = (np.interp(high, edges, sums) - np.interp(low, edges, sums)) / window
    return np.where((low >= edges[0]) & (high <= edges[-1]), mean, np.nan)


def first_passage(x: Array, values: Array, grid: Array) -> Array:
    """Interpolate values at the points of `grid`, between the rows at which x is larger than ever before."""
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
    ran: tuple[skmpm.sweep.Member, ...] = field(default=())  # all, with their manifests

    def get(self, name: str) -> Member | None:
        """A member, or None if it has not been run."""
        return self.members.get(name)

    def packing(self, kind: str, friction: float, seed: int = 0) -> Member | None:
        """One packing of a kind, or None if it has not been run."""
        return self.get(name_of(kind, friction, seed))

    def seeds(self, kind: str, friction: float) -> list[Member]:
        """The packings of a kind with one friction."""
        return [m for name, m in self.members.items() if name.startswith(name_of(kind, friction, 0)[:-1])]

    def pairs(self, kind: str, other: str, friction: float, than: float | None = None) -> list[tuple[Member, Member]]:
        """The same packing in two kinds of runs, with one friction or with two."""
        second = {m.options.seed: m for m in self.seeds(other, friction if than is None else than)}
        return [(m, second[m.options.seed]) for m in self.seeds(kind, friction) if m.options.seed in second]

    def curve(self, kind: str, friction: float, name: str, grid: Array = PHI) -> tuple[Array, Array]:
        """Mean and standard error over the packings on `grid`; nan where fewer than all reached it."""
        found = self.seeds(kind, friction)
        if not found:
            return np.full(grid.size, np.nan), np.full(grid.size, np.nan)
        samples = np.array([m.over(name, grid) for m in found])
        whole = np.isfinite(samples).all(axis=0)
        return mean(np.where(whole, samples, np.nan))


def read(out: Path) -> Study:
    """Read the members that `study.py` ran, as far as there are any."""
    ran = tuple(skmpm.Sweep.read(out)) if out.is_dir() else ()
    members = [Member(m.folder, m.parameters, m.status, numbers(m.columns)) for m in ran]
    usable = {member.folder.name: member for member in members if member.usable}
    return Study(usable, [member.folder.name for member in members if not member.usable], ran)


def numbers(columns: dict[str, Any]) -> dict[str, Array]:
    """Columns of a table as floating-point numbers."""
    return {name: column.astype(np.float64) for name, column in columns.items()}
