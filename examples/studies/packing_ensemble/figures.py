"""Figures and tables of the study from what `study.py` ran.

    python -m examples.studies.packing_ensemble figures --study out/study --docs docs/studies

Draws into docs/studies/packing_ensemble/ and writes the parts of docs/studies/packing_ensemble.md that stand between
markers: the claims of Nezamabadi et al. (2017) with what was measured, the checks, the members and the pictures there
are. Nothing is run.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

import numpy as np

from .. import pages
from . import checks, claims, study
from .claims import Row
from .curves import EARLY, Member, Study, read
from .pictures import draw

PAGE = "packing_ensemble.md"
CURVES = (*checks.CURVES, "interior_fraction", "interior_pressure")


def table(header: tuple[str, ...], lines: list[tuple[str, ...]]) -> str:
    """A table in Markdown."""
    return "\n".join(f"| {' | '.join(line)} |" for line in [header, ("---",) * len(header), *lines])


def judged(rows: list[Row]) -> str:
    """Claims or checks, those that do not hold in bold."""
    words = {"does not hold": "**does not hold**"}
    lines = [(r.claim, r.rule, r.measured, words.get(r.verdict, r.verdict)) for r in rows]
    return table(("claim", "rule", "measured", "verdict"), [tuple(greek(cell) for cell in line) for line in lines])


def greek(text: str) -> str:
    """Names of symbols as mathematics, their indices included."""
    return re.sub(r"\b(alpha|beta|sigma|Phi)(?:_([A-Za-z0-9]+))?\b", mathematics, text)


def mathematics(found: re.Match[str]) -> str:
    """One symbol in TeX."""
    return f"$\\{found[1]}" + (f"_{{{found[2]}}}$" if found[2] else "$")


def runs(found: Study) -> str:
    """Every member of the study: how far it came and what it cost."""
    wanted = list(study.members(study.parser().parse_args([])))
    names = [*wanted, *(name for name in found.members if name not in wanted)]
    lines = [ran(name, found.get(name)) if found.get(name) else absent(name, found) for name in names]
    return table(
        ("member", "discs", "R/h", "steps", "retries", "$\\Phi$ reached", "worst overlap", "time", "ended"), lines
    )


def absent(name: str, found: Study) -> tuple[str, ...]:
    """A member that cannot be used."""
    return (name, *("-",) * 7, "not finished, not used" if name in found.unfinished else "not run")


def ran(name: str, member: Member) -> tuple[str, ...]:
    """A member that can."""
    column = member.table
    return (
        name,
        f"{member.options.discs}",
        f"{study.RADIUS / member.options.cell:.1f}",
        f"{column['t'].size}",
        f"{column['retries'].sum():.0f}",
        f"{column['solid_fraction'].max():.3f}",
        f"{100 * column['overlap'].max():.4f} %",
        f"{column['seconds'].sum() / 60:.0f} min",
        "at its end" if member.status == "finished" else "at a step that failed",
    )


def pictures(captions: dict[str, str]) -> str:
    """The pictures there are, each with its caption."""
    shown = [
        f"![{name.removesuffix('.png')}](packing_ensemble/{name})\n\n*{text}*" for name, text in captions.items()
    ]
    return "\n\n".join(shown) or "Nothing has been run yet."


def curves(found: Study) -> str:
    """What the pictures show as a table in CSV: the curves of every member, 0.0025 of a solid fraction apart."""
    lines = ["member,solid_fraction," + ",".join(CURVES)]
    for name, member in found.members.items():
        values = np.stack([member.over(column, EARLY) for column in CURVES], axis=1)
        reached = np.isfinite(values).any(axis=1)
        for phi, line in zip(EARLY[reached], values[reached], strict=True):
            lines.append(f"{name},{phi:.4f}," + ",".join(f"{value:.5g}" for value in line))
    return "\n".join(lines) + "\n"


def main(options: argparse.Namespace) -> list[Row]:
    """Draw the pictures and fill the page; returns the judged rows."""
    with np.errstate(invalid="ignore"):  # nan stands for what was not reached
        found = read(options.study)
        claimed, checked = claims.rows(found), checks.rows(found)
        captions = draw(found, options.docs / "packing_ensemble")
        (options.docs / "packing_ensemble" / "curves.csv").write_text(curves(found))
    parts = {
        "claims": judged(claimed),
        "checks": judged(checked),
        "members": runs(found),
        "pictures": pictures(captions),
    }
    pages.put(options.docs / PAGE, parts)
    for row in [*claimed, *checked]:
        print(f"{row.verdict:>14}: {row.claim}: {row.measured}")
    return [*claimed, *checked]


def parser() -> argparse.ArgumentParser:
    """Where the study is, and where the page."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--study", type=Path, default=Path("out/study"), help="directory of study.py's results")
    options.add_argument("--docs", type=Path, default=Path("docs/studies"), help="directory of packing_ensemble.md")
    return options
