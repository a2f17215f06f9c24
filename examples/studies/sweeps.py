"""What studies of one sweep share: to run what is missing, to read what has finished, and to write the page."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import skmpm

from . import pages
from .provenance import made


def command(study: ModuleType, **others: ModuleType) -> None:
    """Run a study, or another module that the first argument of the command line names."""
    chosen = others[sys.argv.pop(1)] if sys.argv[1:2] and sys.argv[1] in others else study
    chosen.main(chosen.parser().parse_args())


def run(
    build: Callable[..., skmpm.Run],
    members: Sequence[dict[str, Any]],
    options: argparse.Namespace,
    write: Callable[[Path, Path], None],
) -> None:
    """Run all members that have not finished, with a line of progress; then write the page if one has."""
    found = skmpm.sweep(build, members, out=options.out, processes=options.processes, progress=True)
    print(found)
    for name, error in found.failed.items():
        print(f"{name} stopped: {error}")
    if len(found.finished):
        write(options.out, options.docs)


def add_options(options: argparse.ArgumentParser, out: str, page: str) -> None:
    """Add options for the processes of a study and for its directories, `out` by default and that of `page`."""
    options.add_argument("--processes", type=int, help="members run at a time; None: as many as there are cores")
    options.add_argument("--out", type=Path, default=Path(out), help="directory of the results")
    options.add_argument("--docs", type=Path, default=pages.DOCS, help=f"directory of {page}")


def write(
    out: Path,
    docs: Path,
    study: str,
    draw: Callable[[skmpm.Sweep, Path], None],
    tables: Callable[[skmpm.Sweep], dict[str, str]],
) -> None:
    """Draw the figure of the finished members of a study and fill its page; SystemExit if none has finished."""
    ran = skmpm.Sweep.read(out)
    found = ran.finished
    if not len(found):
        raise SystemExit(f"{out}: no member has finished; run the study first")
    draw(found, docs / study)
    pages.put(docs / f"{study}.md", {"made": made(ran, f"examples.studies.{study}"), **tables(found)})
