"""Text between marks of a page of the docs, and where the docs are."""

from __future__ import annotations

import argparse
import csv
import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

DOCS = Path(__file__).resolve().parents[2] / "docs" / "studies"


def put(page: Path, parts: dict[str, str]) -> None:
    """Write each text between the marks `<!-- name -->` and `<!-- /name -->` of a page; SystemExit without them."""
    text = page.read_text()
    for name, part in parts.items():
        between = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.DOTALL)
        if len(between.findall(text)) != 1:
            raise SystemExit(f"{page}: the marks of '{name}' should be there, once each")
        inner = part.strip("\n")
        text = between.sub(lambda found, inner=inner: f"{found[1]}\n{inner}\n\n{found[2]}", text)
    page.write_text(text)


def table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table of a page."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ("---",) * len(head), *lines))


def as_csv(lines: Sequence[Sequence[object]]) -> str:
    """A table for a file, its header first."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(lines)
    return text.getvalue()


def columns(rows: Sequence[Mapping[str, object]]) -> list[Sequence[object]]:
    """A table of all that rows have by name, its header first."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    return [names, *([row.get(name, "") for name in names] for row in rows)]


def keep(folder: Path, tables: Mapping[str, Sequence[Sequence[object]]]) -> None:
    """Write tables as CSV files of a directory, by their names."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, lines in tables.items():
        (folder / f"{name}.csv").write_text(as_csv(lines), encoding="utf-8")


def picture(figure: Figure, path: Path, dpi: float) -> None:
    """Write a figure and close it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=dpi)
    plt.close(figure)


def parser(description: str | None, page: str, study: Path | None = None) -> argparse.ArgumentParser:
    """Options of a command that writes a page of the docs, from the results of a study if it names a directory."""
    options = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
    )  # a directory that is abbreviated would be none of `provenance.DIRECTORIES`
    options.add_argument("--docs", type=Path, default=DOCS, help=f"directory of {page}")
    if study is not None:
        options.add_argument("--study", type=Path, default=study, help="directory of the results")
    return options
