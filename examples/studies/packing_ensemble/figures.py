"""Figures and tables of the study from what `study.py` ran.

    python -m examples.studies.packing_ensemble figures --study out/study --docs docs/studies

Draws into docs/studies/packing_ensemble/ and writes the parts of docs/studies/packing_ensemble.md that stand between
markers, from whatever members have ended; the page says which are missing. Nothing is run.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .. import pages, provenance
from . import checks, claims, study, summary, targets
from .claims import NOT_RUN, Row
from .curves import EARLY, Member, Study, read
from .members import GROUPS, RADIUS, group_of, members
from .pictures import draw

PAGE, MODULE = "packing_ensemble.md", "examples.studies.packing_ensemble"
CURVES = (*checks.CURVES, "coordination_without_rattlers", "solid_fraction_nominal", "interior_fraction",
          "interior_pressure", "interior_coordination_without_rattlers")  # fmt: skip
Line = tuple[str, ...]


def table(lines: Sequence[Line]) -> str:
    """A table in Markdown, its header first; symbols as mathematics."""
    head, *rest = [tuple(map(greek, line)) for line in lines]
    return pages.table(head, rest)


def greek(text: str) -> str:
    """Names of symbols as mathematics, their indices included."""
    return re.sub(r"\b(alpha|beta|sigma|Phi)(?:_([A-Za-z0-9]+))?\b", mathematics, text)


def mathematics(found: re.Match[str]) -> str:
    """One symbol in TeX."""
    return f"$\\{found[1]}" + (f"_{{{found[2]}}}$" if found[2] else "$")


def runs(found: Study) -> list[Line]:
    """Every member of the study: how far it came and what it cost; the header first."""
    names = [*(wanted := members(study.parser().parse_args([]))), *(n for n in found.members if n not in wanted)]
    times = {m.name: sum(s.get("processor_seconds", 0.0) for s in m.manifest.get("sessions", [])) for m in found.ran}
    head = ("member", "discs", "R/h", "rows", "retries", "solid fraction reached", "worst overlap [%]",
            "processor time [min]", "ended")  # fmt: skip
    return [head, *(ran(name, member, times.get(name, np.nan)) if (member := found.get(name)) else absent(name, found)
                    for name in names)]  # fmt: skip


def absent(name: str, found: Study) -> Line:
    """A member that cannot be used."""
    return (name, *("-",) * 7, "not finished, not used" if name in found.unfinished else "not run")


def ran(name: str, member: Member, seconds: float) -> Line:
    """A member that can."""
    column = member.table
    return (
        name,
        f"{member.options.discs}",
        f"{RADIUS / member.options.cell:.1f}",
        f"{column['t'].size}",
        f"{column['retries'].sum():.0f}",
        f"{column['solid_fraction'].max():.3f}",
        f"{100 * column['overlap'].max():.4f}",
        f"{seconds / 60:.0f}",
        "at its end" if member.status == "finished" else "at a step that failed",
    )


def missing(found: Study) -> str:
    """Which members of the whole study are missing, by group."""
    wanted = members(study.parser().parse_args([]))
    lines = []
    for prefix, title in GROUPS.items():
        names = [name for name in wanted if group_of(name) == prefix]
        left = [name for name in names if found.get(name) is None]
        if left:
            which = "all" if left == names else ", ".join(left)
            lines.append((title, f"{len(names) - len(left)} of {len(names)}", which))
    return table([("group", "ended", "missing"), *lines]) if lines else "No member is missing."


def pictures(captions: dict[str, str]) -> str:
    """The pictures there are, each with its caption."""
    shown = [
        f"![{name.removesuffix('.png')}](packing_ensemble/{name})\n\n*{text}*" for name, text in captions.items()
    ]
    return "\n\n".join(shown) or "Nothing has been run yet."


def curves(found: Study) -> list[Line]:
    """What the pictures show as a table: the curves of every member, 0.0025 of a solid fraction apart."""
    lines: list[Line] = [("member", "solid_fraction", *CURVES)]
    for name, member in found.members.items():
        values = np.stack([member.over(column, EARLY) for column in CURVES], axis=1)
        reached = np.isfinite(values).any(axis=1)
        for phi, line in zip(EARLY[reached], values[reached], strict=True):
            lines.append((name, f"{phi:.4f}", *(f"{value:.5g}" for value in line)))
    return lines


def write(out: Path, docs: Path) -> list[Row]:
    """Draw the pictures and fill the page; returns the judged rows."""
    folder = docs / "packing_ensemble"
    folder.mkdir(parents=True, exist_ok=True)
    with np.errstate(invalid="ignore"):  # nan stands for what was not reached
        found = read(out)
        fast, slow = (claims.rows(found, kind) for kind in ("fast", "quasistatic"))
        first, second = (targets.rows(found, kind) for kind in targets.KINDS)
        grid, checked = claims.jamming(found), checks.rows(found)
        parts = {
            "made": provenance.made(found.ran, MODULE) + "\n\n" + missing(found),
            "targets": table(summary.beside(summary.TARGETS, first, second, ("uniaxial", "isotropic"))),
            "claims": table(summary.beside(summary.CLAIMS, fast, slow, ("2 m/s", "quasi-static"))),
            "grid": table(summary.shared_grid(found)),
            "states": table(summary.states(checked)),
            "curves": table(summary.curves(checked)),
            "pictures": pictures(draw(found, folder)),
        }
        files = {
            "curves": curves(found),
            "targets": summary.judged_twice(first, second, ("uniaxial", "isotropic")),
            "claims": summary.judged_twice(fast, slow, ("2 m/s", "quasi-static")),
            "grid": summary.judged(grid),
            "checks": summary.judged(checked),
            "members": runs(found),
        }
    pages.keep(folder, files)
    pages.put(docs / PAGE, parts)
    return [*first, *second, *fast, *slow, *grid, *checked]


def main(options: argparse.Namespace) -> list[Row]:
    """Write the page and print the rows; returns them."""
    rows = write(options.study, options.docs)
    for row in rows:
        print(f"{row.verdict:>14}: {row.claim}: {row.measured}")
    print(f"{sum(row.verdict == NOT_RUN for row in rows)} of {len(rows)} not run")
    return rows


def parser() -> argparse.ArgumentParser:
    """Where the study is, and where the page."""
    return pages.parser(__doc__, PAGE, Path("out/study"))
