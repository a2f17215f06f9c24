"""Studies of one sweep: to run what is missing, to read what has finished, and to write the page.

Such a study is a module with `build` and `members` of the sweep and `add_options` of its command line. It, or another
module of the study, has `draw`, which writes the figure of the finished members into a directory, and `tables`, the
parts of the page that are made of them.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import skmpm
from skmpm.sweep import Member

from . import pages
from .provenance import made

FIGURES = "Draw the figures of a study and write its page from the members that have finished; nothing is run."


def command(study: ModuleType, page: ModuleType | None = None, words: Sequence[str] | None = None) -> None:
    """Run all members that have not finished and write the page; after the word `figures`, only write it.

    SystemExit if members have failed, after the page of the others.
    """
    words = sys.argv[1:] if words is None else words
    only = words[:1] == ["figures"]
    options = parser(study, only=only).parse_args(words[only:])
    found = None if only else run(study.build, study.members(options), options)
    if found is None or len(found.finished):
        write(options.out, options.docs, page or study)
    if found is not None and found.failed:
        raise SystemExit(f"{len(found.failed)} of {len(found)} members stopped; a page is of the others")


def parser(study: ModuleType, *, only: bool = False) -> argparse.ArgumentParser:
    """Options of a study, or only those of its page."""
    name = name_of(study)
    options = pages.parser(FIGURES if only else study.__doc__, f"{name}.md")
    words = "--study" if only else "--out"
    options.add_argument(words, dest="out", type=Path, default=Path("out") / name, help="directory of the results")
    if not only:
        add_processes(options)
        study.add_options(options)
    return options


def name_of(module: ModuleType) -> str:
    """The name of the study that a module belongs to."""
    return module.__name__.split(".")[-2]


def add_processes(options: argparse.ArgumentParser) -> None:
    """Add the option of how many processes there are."""
    options.add_argument("--processes", type=int, help="members run at a time; None: as many as there are cores")


def run(
    build: Callable[..., skmpm.Run],
    members: Sequence[dict[str, Any]] | Mapping[str, dict[str, Any]],
    options: argparse.Namespace,
) -> skmpm.Sweep:
    """Run all members that have not finished, with a line of progress."""
    found = skmpm.sweep(build, members, out=options.out, processes=options.processes, progress=True)
    print(found)
    for name, error in found.failed.items():
        print(f"{name} stopped: {error}")
    return found


def write(out: Path, docs: Path, page: ModuleType) -> None:
    """Draw the figure of the finished members of a study and fill its page; SystemExit if none has finished."""
    ran, name = skmpm.Sweep.read(out), name_of(page)
    found = ran.finished
    if not len(found):
        raise SystemExit(f"{out}: no member has finished; run the study first")
    page.draw(found, docs / name)
    pages.put(docs / f"{name}.md", {"made": made(ran, f"examples.studies.{name}"), **page.tables(found)})


def groups(found: skmpm.Sweep, *names: str) -> dict[tuple[float, ...], list[Member]]:
    """Members by the values of these parameters."""
    out: dict[tuple[float, ...], list[Member]] = {}
    for member in found:
        out.setdefault(tuple(member.parameters[name] for name in names), []).append(member)
    return dict(sorted(out.items()))


def named(study: ModuleType, **others: ModuleType) -> None:
    """Run a study, or another of its modules that the first argument of the command line names."""
    chosen = others[sys.argv.pop(1)] if sys.argv[1:2] and sys.argv[1] in others else study
    chosen.main(chosen.parser().parse_args())
