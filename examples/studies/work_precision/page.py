"""The tables of docs/studies/work_precision.md, its figures and its csv, from the results of `study.py`.

python -m examples.studies.work_precision page --study out/work_precision --docs docs
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import skmpm

from .. import pages, provenance
from . import figures, tables
from .results import Run, beating, load

MODULE = "examples.studies.work_precision"


def line(run: Run) -> dict[str, Any]:
    """What a run was, how it ended, what it cost and its errors."""
    counts = {f"count {name}": f"{run.cost[name]:.6g}" for name in tables.COUNTS}
    ended = {"status": run.status[:80], "library": run.source, "seconds": f"{run.seconds:.6g}"}
    errors = {f"error {name}": f"{e:.4g}" for name, e in run.errors.items()}
    return {"scene": run.scene, "why": " ".join(sorted(run.whys)), **run.setting, **ended, **counts, **errors}


def write(study: Path, docs: Path) -> None:
    """Write the page, its figures and its csv."""
    found, folder, page = load(study), docs / "work_precision", docs / "work_precision.md"
    for name in ("fronts", "parameters", "codes"):
        getattr(figures, name)(found, folder / f"{name}.png")
    settings, slopes = beating(found), tables.slopes(found)
    files = {
        "results": pages.columns([line(run) for each in found.runs.values() for run in each.values()]),
        "scenes": tables.ran(found),
        "counts": tables.counts(found),
        "prices": tables.prices(found),
        "beating": tables.beating(settings),
        "parameters": tables.parameters(found),
        "codes": tables.codes(found),
        "slopes": slopes,
    }
    pages.keep(folder, files)
    parts = {
        "made": provenance.made(skmpm.Sweep.read(study), MODULE),
        "presets": tables.presets(found),
        "prices": tables.priced(found),
        "beating": tables.beaters(found, settings),
        "limits": tables.limits(slopes),
        "laws": tables.laws(found),
        "codes": tables.code_ratios(found),
    }
    pages.put(page, parts)


def parser() -> argparse.ArgumentParser:
    """The options."""
    return pages.parser(__doc__, "work_precision.md", Path("out/work_precision"))


def main(options: argparse.Namespace) -> None:
    """Write the page."""
    write(options.study, options.docs)
