"""How soft discs fill space with and without friction, as an ensemble of packings.

    python -m examples.studies.packing_ensemble --out out/study

Runs every member of `members.py` by `skmpm.sweep`, each in a directory of its own: `table.csv`, checkpoints at four
stages, `manifest.json` (parameters, versions, command); then draws the figures and writes the page, as the command
`figures` does. Finished members are not run again, interrupted ones go on from their last checkpoint; the page says
which are missing.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

import skmpm
from examples import compaction

from .. import pages, sweeps
from . import scenes
from .members import GROUPS, SLOW, members
from .rows import row

STAGES = (0.75, 0.84, 0.92, 1.00)  # nominal solid fractions at which states are kept
EVERY = 8e-6  # between rows of the runs in steps of 0.5 us [s]


def build(**chosen: Any) -> skmpm.Run:
    """A member from its options, the others being those of `compaction.py`."""
    options = scenes.options_of(chosen)
    scene, until = scenes.build(options)
    keep = {name_of(stage): partial(reached, stage) for stage in STAGES}
    scheme = compaction.SCHEMES[options.scheme]
    every = EVERY if options.scheme == "nezamabadi2017" else 0.0
    return skmpm.Run(scene, until, dt=options.dt, scheme=scheme, observe=row, keep=keep, every=every)


def reached(stage: float, line: dict[str, float]) -> bool:
    """Whether a row is at a stage or beyond."""
    return line["solid_fraction_nominal"] >= stage


def name_of(stage: float) -> str:
    """Under which the state at a nominal solid fraction is kept."""
    return f"stage_{stage:.2f}"


def main(options: argparse.Namespace) -> None:
    """Run all members that have not finished, with a line of progress; then write the page."""
    from . import figures

    wanted = members(options)
    chosen = {n: about for n, about in wanted.items() if not options.only or n.startswith(tuple(options.only))}
    sweeps.run(build, chosen, options)
    figures.write(options.out, options.docs)


def parser() -> argparse.ArgumentParser:
    """Options; the defaults are the study of `docs/studies/packing_ensemble.md`."""
    options = pages.parser(__doc__, "packing_ensemble.md")
    add = options.add_argument
    add("--discs", type=int, default=300, help="a third of them in the mode of Nezamabadi et al. (2017)")
    add("--seeds", type=int, default=4, help="packings for each friction")
    add("--fine-seeds", type=int, default=2, help="the same at R/h = 8, at most as many")
    add("--slow", type=float, default=SLOW, help="speed of the quasi-static lid, and of periodic edges [m/s]")
    add("--start", type=float, default=0.70, help="nominal solid fraction at the start")
    add("--until", type=float, default=1.02, help="nominal solid fraction at the end")
    add("--only", nargs="*", default=[], help=f"members whose names begin so; groups: {', '.join(GROUPS)}")
    add("--out", type=Path, default=Path("out/study"), help="directory of the results")
    sweeps.add_processes(options)
    return options
