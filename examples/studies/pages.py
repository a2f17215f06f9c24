"""Text between marks of a page of the docs, and where the docs are."""

from __future__ import annotations

import argparse
import csv
import io
import re
from collections.abc import Sequence
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs" / "studies"


def put(page: Path, parts: dict[str, str]) -> None:
    """Write each text between the marks `<!-- name -->` and `<!-- /name -->` of a page; SystemExit without them."""
    page.write_text(filled(page.read_text(), parts, str(page)))


def filled(text: str, parts: dict[str, str], page: str) -> str:
    """The text of a page with its parts written anew."""
    for name, part in parts.items():
        between = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.DOTALL)
        if len(between.findall(text)) != 1:
            raise SystemExit(f"{page}: the marks of '{name}' should be there, once each")
        inner = part.strip("\n")
        text = between.sub(lambda found, inner=inner: f"{found[1]}\n{inner}\n\n{found[2]}", text)
    return text


def table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table of a page."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ("---",) * len(head), *lines))


def as_csv(lines: Sequence[Sequence[str]]) -> str:
    """A table for a file, its header first."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(lines)
    return text.getvalue()


def keep(folder: Path, tables: dict[str, Sequence[Sequence[str]]]) -> None:
    """Write tables as CSV files of a directory, by their names."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, lines in tables.items():
        (folder / f"{name}.csv").write_text(as_csv(lines), encoding="utf-8")


def parser_of_figures(description: str | None, study: Path) -> argparse.ArgumentParser:
    """Options of a command that draws figures and writes a page from the results of a study."""
    options = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--study", type=Path, default=study, help="directory of the study")
    options.add_argument("--docs", type=Path, default=DOCS, help="directory of the page")
    return options
