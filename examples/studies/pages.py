"""Text between marks of a page of the docs, and where the docs are."""

from __future__ import annotations

import re
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
