"""docs/studies/work_precision.md, its figures and its csv, from the results of `study.py`.

    python -m examples.studies.work_precision page --study out/work_precision --docs docs

Everything between the marks `<!-- study -->` and `<!-- /study -->` is written anew; the rules above and the section
of `feature_cost` below are left alone.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from typing import Any

import skmpm

from .. import pages, provenance
from . import figures, tables
from .results import Found, beating, load

MODULE = "examples.studies.work_precision"


def keep(found: Found, path: Path) -> None:
    """All runs, a line each."""
    rows: list[dict[str, Any]] = []
    for scene, each in found.runs.items():
        for run in each.values():
            errors = {f"error {name}": f"{e:.4g}" for name, e in run.errors.items()}
            counts = {f"count {name}": f"{run.cost[name]:.6g}" for name in tables.COUNTS}
            whys = " ".join(sorted(run.whys))
            rows.append(
                {
                    "scene": scene,
                    "why": whys,
                    **run.setting,
                    "status": run.status[:80],
                    "library": run.source,
                    "seconds": f"{run.seconds:.6g}",
                    **counts,
                    **errors,
                }
            )
    names = list(dict.fromkeys(name for row in rows for name in row))
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, names or ["scene"], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def write(study: Path, docs: Path) -> None:
    """Write the page, its figures and its csv."""
    found, folder, page = load(study), docs / "work_precision", docs / "work_precision.md"
    folder.mkdir(parents=True, exist_ok=True)
    keep(found, folder / "results.csv")
    for name in ("fronts", "parameters", "codes"):
        getattr(figures, name)(found, folder / f"{name}.png")
    parts = [
        ("", provenance.made(skmpm.Sweep.read(study), MODULE), TEXT["ran"], tables.ran(found)),
        (
            "## Presets",
            tables.presets(found),
            TEXT["counts"],
            tables.counts(found),
            "![Error against cost](work_precision/fronts.png)\n",
        ),
        ("## What an error costs", TEXT["prices"], tables.prices(found)),
        ("## Who beats `balanced`", tables.beaters(found, beating(found))),
        (
            "## One parameter at a time",
            TEXT["parameters"],
            tables.parameters(found),
            "![Resolution](work_precision/parameters.png)\n",
        ),
        ("## What limits accuracy", TEXT["limits"], tables.limits(found)),
        ("## Laws of the error", TEXT["laws"], tables.laws(found)),
        (
            "## Beside explicit finite elements",
            TEXT["codes"],
            tables.codes(found),
            "![Both codes](work_precision/codes.png)\n",
        ),
    ]
    text = "\n".join("\n\n".join(p.strip("\n") for p in part if p) + "\n" for part in parts)
    pages.put(page, {"study": text})


TEXT = {
    "codes": "The cheapest run of each code within an error, - where none of the runs reaches it.",
    "ran": "What has been run:",
    "counts": "Counts are means over the positions on the grid. `work` is unknowns times half bandwidth squared,"
    " of all factorisations.",
    "prices": "The cheapest of all runs within an error, lucky ones among them. Errors that no run reaches are"
    " left out.",
    "parameters": "Error, and cost over that of the default. Cells are empty where a parameter has no effect or was"
    " not run.",
    "limits": r"The slopes $d \ln(\text{error}) / d \ln(\text{parameter})$ at the presets, for h, dt, spacing and"
    " `contact_tol`.",
    "laws": r"The law is $\text{error} = c\, n^{-p} + d\, s$ with n = R/h and R the radius of the smallest body."
    " The step s is dt c / R or, where a lid drives, its displacement over R. The law is fitted to all"
    " runs that differ from `balanced` in R/h, spacing and dt only; tighter tolerances make no"
    " difference. The second d is fitted to the lids. Constants of `skmpm.suggest` are in brackets. Its"
    " c of packings is that of a square array of equal discs, whose errors do not cancel"
    " (`test_promises`).",
}


def parser() -> argparse.ArgumentParser:
    """The options."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--study", type=Path, default=Path("out/work_precision"), help="directory of the results")
    options.add_argument("--docs", type=Path, default=pages.DOCS, help="directory of work_precision.md")
    return options


def main(options: argparse.Namespace) -> None:
    """Write the page."""
    write(options.study, options.docs)
