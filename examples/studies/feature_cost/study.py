"""What each feature costs when it is on, and what is not done when it is off: a table of the page work_precision.

    OPENBLAS_NUM_THREADS=1 python -m examples.studies.feature_cost --docs docs/studies

Each line compares two ways to run a scene from the same state. Calls of the library's functions, unknowns, matrix
entries and solves of a few steps are counted; then both make steps in turn and their processor times are compared.
The table goes between the marks `<!-- features -->` and `<!-- /features -->`. Takes two minutes.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from time import process_time
from types import FrameType
from typing import Any

import numpy as np

import skmpm
from skmpm.linear.band import column_lengths, half_bandwidth

from .. import pages
from . import scenes
from .scenes import DT, Variant

WARM = 2  # steps before those that are counted and timed
HEAD = """`python -m examples.studies.feature_cost` measures this (here in {seconds:.0f} s of one core).
{repeats} steps are counted and, in another run, timed, on and off in turn. The packing is {discs} NeoHookean discs of
R/h = {cells:g} at a nominal solid fraction of 0.85, friction 0.5. The disc of R/h = {large:g} swings by 1 %, or is
squeezed between two smooth planes.

The table has median ratios of processor times with and without a feature, if they differ by a factor of
{large_change:g} or more. The disc against itself gives {still}.
{{download}}`features.csv <work_precision/features.csv>` has all features with quartiles, counts and tests.
"""
LARGE = 1.2  # ratio of times from which on a feature is on the page
FILE = ("feature", "scene", "not done when off", "in a step, on / off", "time on / off", "lower quartile",
        "upper quartile", "tests")  # fmt: skip
Line = tuple[str, ...]


@dataclass
class Counts:
    """What some steps did: calls by module and qualified name, and the states they made."""

    calls: Counter[str] = field(default_factory=Counter)
    states: list[skmpm.State] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)  # of contact problems
    geometric: list[int] = field(default_factory=list)  # of them, those of the geometric stiffness of contacts
    bands: list[int] = field(default_factory=list)  # of matrices: half bandwidths

    def note(self, frame: FrameType, event: str, argument: Any) -> None:
        """The profiler: counts calls of Python functions of the library, wherever they are looked up."""
        module = frame.f_globals.get("__name__", "")
        if event != "call" or not module.startswith("skmpm."):
            return
        name = f"{module}.{frame.f_code.co_qualname}"
        self.calls[name] += 1
        if name == "skmpm.coulomb.search.solve":
            bilateral = frame.f_locals["bilateral"]
            self.rows.append(int(np.size(frame.f_locals["q"])))
            self.geometric.append(0 if bilateral is None else bilateral.q.size)
        if name == "skmpm.linear.choice.default":
            self.bands.append(half_bandwidth(column_lengths(frame.f_locals["A"], frame.f_locals["blocks"])))

    def named(self, *ends: str) -> float:
        """Calls in a step of functions whose names end so."""
        ended = tuple(f".{end}" for end in ends)
        return sum(n for name, n in self.calls.items() if name.endswith(ended)) / len(self.states)

    def below(self, *packages: str) -> float:
        """Calls in a step of functions in these packages."""
        started = tuple(f"skmpm.{package}." for package in packages)
        return sum(n for name, n in self.calls.items() if name.startswith(started)) / len(self.states)

    def reported(self, name: str) -> float:
        """Mean of a number of the steps' reports."""
        return float(np.mean([getattr(state.report, name) for state in self.states]))

    @property
    def blocks(self) -> int:
        """2 x 2 blocks of A in the last step."""
        return int(self.states[-1].derived.assembly.indices.size)


def mean(numbers: list[int]) -> float:
    """Of none 0."""
    return float(np.mean(numbers)) if numbers else 0.0


COUNTS: dict[str, Callable[[Counts], float]] = {
    "calls in `contact` and `coulomb`": lambda c: c.below("contact", "coulomb"),
    "unknowns": lambda c: c.states[-1].displacement.size,
    "blocks of A": lambda c: c.blocks,
    "contacts": lambda c: mean([state.contacts.gap.size for state in c.states]),
    "rows of W": lambda c: mean(c.rows),
    "rows of geometric stiffness": lambda c: mean(c.geometric),
    "half bandwidth": lambda c: mean(c.bands),
    "Newton": lambda c: c.reported("newton"),
    "contact iterations": lambda c: c.reported("contact"),
    "factorisations": lambda c: c.reported("factorisations"),
    "solves": lambda c: c.named("Banded.__call__", "Amg.__call__"),
    "line searches": lambda c: c.named("line_search.search"),
    "gravity evaluated": lambda c: c.named("prescribed.gravity_at"),
    "loads evaluated": lambda c: c.named("Model.forces"),
    "body grids built": lambda c: c.named("building.build_grids"),
    "weights fitted": lambda c: c.named("moment_fitting.fitted_weights"),
    "outlines cut by cells": lambda c: c.named("measures.cell_moments"),
    "patterns made": lambda c: c.named("assembly.prepare"),
    "means of dilatation": lambda c: c.named("Assembly.mean_dilatation"),
    "eliminations": lambda c: c.named("Elimination.factorised"),
    "kinetic energies": lambda c: c.named("budget.kinetic_energy"),
}


# What a count that is larger by half on one side tells, by feature.
NOTES = {
    "friction 0.5 / 0": ("rows of geometric stiffness", "without friction contacts slide, and their forces"
                         " rotate with the surface: two rows more for each."),
    "ghost 0.005 / 0": ("half bandwidth", "the penalty couples nodes two cells apart. At the boundary only, but"
                        " a band is as wide as its widest row."),
    "fitted": ("blocks of A", "with volumes for weights cells inside bodies look poorly filled, too, and the ghost"
               " penalty acts there."),
}  # fmt: skip


def steps(variant: Variant, state: skmpm.State) -> Iterator[tuple[skmpm.State, float]]:
    """The states after each of its steps, for ever, and the processor time of each [s]."""
    while True:
        began = process_time()
        state = skmpm.step(variant.scene, state, DT, scheme=variant.scheme)
        yield state, process_time() - began


def counted(variant: Variant, number: int) -> Counts:
    """What so many steps do, after those that count nothing."""
    found = Counts()
    run = steps(variant, variant.start())
    for _ in range(WARM):
        next(run)
    sys.setprofile(found.note)
    try:
        found.states.extend(next(run)[0] for _ in range(number))
    finally:
        sys.setprofile(None)
    return found


def ratios(on: Variant, off: Variant, repeats: int) -> np.ndarray:
    """Time of a step on over that of one off, (repeats,), each pair made one after the other."""
    runs = [steps(variant, variant.start()) for variant in (on, off)]
    for _ in range(WARM):
        for run in runs:
            next(run)
    taken = np.empty((repeats, 2))
    for i in range(repeats):
        for k in (0, 1) if i % 2 else (1, 0):
            taken[i, k] = next(runs[k])[1]
    return np.asarray(taken[:, 0] / taken[:, 1])


def spread(ratio: np.ndarray) -> Line:
    """Median and quartiles."""
    low, middle, high = np.quantile(ratio, (0.25, 0.5, 0.75))
    return f"{middle:.2f}", f"{low:.2f}", f"{high:.2f}"


def digits(count: float) -> str:
    """A count in as few digits as tell it."""
    return f"{count:.0f}" if count >= 10.0 or count == round(count) else f"{count:.1f}"


def line(feature: scenes.Feature, repeats: int) -> tuple[Line, str]:
    """A feature's line of the file, and what should be said of it."""
    on, off = counted(feature.on, repeats), counted(feature.off, repeats)
    each = (f"{name} {digits(COUNTS[name](on))} / {digits(COUNTS[name](off))}" for name in feature.counts)
    time = spread(ratios(feature.on, feature.off, repeats))
    name, note = NOTES.get(feature.name, (feature.counts[0], ""))
    few, many = sorted((COUNTS[name](on), COUNTS[name](off)))
    cells = (feature.name, feature.scene, feature.spared, "; ".join(each), *time, " ".join(feature.tests))
    return cells, note if many > 1.5 * few else ""


def short(lines: list[Line]) -> str:
    """The features that change the time most."""
    shown = [(name, scene, time) for name, scene, _, _, time, *_ in lines
             if not 1.0 / LARGE < float(time) < LARGE]  # fmt: skip
    return pages.table(("feature", "scene", "time on / off"), shown)


def measured(options: argparse.Namespace) -> tuple[list[Line], str]:
    """The lines of the file, its header first, and all that goes between the marks."""
    began = process_time()
    features = scenes.features(options.discs, options.cells, options.large)
    lines, notes = [], []
    for feature in [each for each in features if not options.only or each.name in options.only]:
        cells, note = line(feature, options.repeats)
        print(*cells, flush=True)
        lines.append(cells)
        notes.append(f"- {feature.name}: {note}" if note else "")
    still = scenes.alone(options.large)
    about = {
        **vars(options),
        "large_change": LARGE,
        "still": spread(ratios(still, still, options.repeats))[0],
        "seconds": process_time() - began,
    }
    below = "\n".join(filter(None, dict.fromkeys(notes)))
    return [FILE, *lines], f"{HEAD.format(**about)}\n{short(lines)}\n\n{below}\n"


def parser() -> argparse.ArgumentParser:
    """Options; the defaults are those of the page."""
    options = pages.parser(__doc__, "work_precision.md")
    options.add_argument("--discs", type=int, default=30, help="of the packing")
    options.add_argument("--cells", type=float, default=5.0, help="per radius of these")
    options.add_argument("--large", type=float, default=20.0, help="cells per radius of the single disc")
    options.add_argument("--repeats", type=int, default=15, help="steps that are timed")
    options.add_argument("--only", nargs="*", default=[], help="features by name; nothing is written then")
    return options


def main(options: argparse.Namespace) -> list[Line]:
    """Measure, write unless only some features are measured, and return the lines."""
    if os.environ.get("OPENBLAS_NUM_THREADS") != "1":
        print("times are comparable with OPENBLAS_NUM_THREADS=1 only", file=sys.stderr)
    lines, text = measured(options)
    if not options.only:
        pages.keep(options.docs / "work_precision", {"features": lines})
        pages.put(options.docs / "work_precision.md", {"features": text})
    return lines
