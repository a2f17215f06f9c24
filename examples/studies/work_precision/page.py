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
    settings, slopes = beating(found), tables.slopes(found)
    files = {
        "scenes": tables.ran(found),
        "counts": tables.counts(found),
        "prices": tables.prices(found),
        "beating": tables.beating(settings),
        "parameters": tables.parameters(found),
        "codes": tables.codes(found),
        "slopes": slopes,
    }
    pages.keep(folder, files)
    parts = [
        ("", provenance.made(skmpm.Sweep.read(study), MODULE), TEXT["files"]),
        ("## Presets", TEXT["presets"], tables.presets(found), "![Error against cost](work_precision/fronts.png)"),
        ("## What an error costs", TEXT["prices"], tables.priced(found)),
        ("## Who beats `balanced`", tables.beaters(found, settings)),
        ("## One parameter at a time", TEXT["parameters"], "![Resolution](work_precision/parameters.png)"),
        ("## What limits accuracy", TEXT["limits"], tables.limits(slopes)),
        ("## Laws of the error", TEXT["laws"], tables.laws(found)),
        (
            "## Beside explicit finite elements",
            TEXT["codes"],
            tables.code_ratios(found),
            "![Both codes](work_precision/codes.png)",
        ),
    ]
    text = "\n".join("\n\n".join(p.strip("\n") for p in part if p) + "\n" for part in parts)
    pages.put(page, {"study": text})


def download(name: str) -> str:
    """A link to a table."""
    return f"{{download}}`{name}.csv <work_precision/{name}.csv>`"


TEXT = {
    "files": f"All runs are in {download('results')}, their numbers and the floors in {download('scenes')}.",
    "presets": "Errors and costs, mean over the positions on the grid. Counts of steps, iterations and unknowns are"
    f" in {download('counts')}.",
    "prices": "The cost of the cheapest run within an error, lucky ones included"
    f" ({download('prices')} has settings).",
    "parameters": f"Errors and costs are in {download('parameters')}, settings that beat `balanced` in"
    f" {download('beating')}.",
    "limits": r"The parameter with the largest slope $d \ln(\text{error}) / d \ln(\text{parameter})$ at each preset;"
    f" {download('slopes')} has the slopes of h, dt, spacing and `contact_tol`.",
    "laws": r"The law is $\text{error} = c\, n^{-p} + d\, s$ with n = R/h and R the radius of the smallest body."
    " The step s is dt c / R or, where a lid drives, its displacement over R. The law is fitted to all runs that"
    " differ from `balanced` in R/h, spacing and dt only, the d of packings to the lids. `skmpm.suggest` uses the"
    " constants on the right. Its c of packings is that of a square array of equal discs, whose errors do not cancel"
    " (`test_promises`). The last columns are the factors between errors of runs and the law.",
    "codes": "Cost of finite elements over that of this library, by the cheapest run of each within an error, if both"
    f" reach it ({download('codes')}).",
}


def parser() -> argparse.ArgumentParser:
    """The options."""
    return pages.parser(__doc__, "work_precision.md", Path("out/work_precision"))


def main(options: argparse.Namespace) -> None:
    """Write the page."""
    write(options.study, options.docs)
