"""Print the sections of docs/how_to/warnings.md that warnings name: the wheel has a copy, a clone the page itself."""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
from posixpath import join, normpath

PAGE = "docs/how_to/warnings.md"


def explain(section: str | None = None) -> None:
    """Print what a warning of `preflight` means, and what to do about it.

    A warning ends with the name of a section in brackets, as ``[thin-parts]``. The text is that of the page "What the
    warnings mean" of the documentation, which is installed with the library. Links are printed as pages of the
    repository.

    Parameters
    ----------
    section : name in the brackets of a warning; without it, all names are printed with their first sentences

    Raises
    ------
    ValueError
        if there is no such section; the message names the nearest ones

    Examples
    --------
    >>> import skmpm
    >>> skmpm.explain("motion-per-step")
    motion-per-step
    <BLANKLINE>
    **An object moves too far in a step**, or bodies move too far past each other. Beyond a cell a step fails and is
    repeated with a shorter one. Use a smaller `dt`, or none.
    """
    known = sections()
    if section is None:
        width = max(map(len, known))
        # every section begins with what is wrong, in bold
        said = [f"{name:{width}s}  {text.split('**')[1].rstrip('.')}" for name, text in known.items()]
        print("\n".join(said))  # noqa: T201
    elif section in known:
        print(f"{section}\n\n{known[section]}")  # noqa: T201
    else:
        near = get_close_matches(str(section), known) or list(known)
        raise ValueError(f"explain: no section {section!r}; use one of {', '.join(near)}")


def sections() -> dict[str, str]:
    """The sections of the page by name; links are texts with the page that they lead to."""
    installed = Path(__file__).with_name("warnings.md")
    page = installed if installed.exists() else Path(__file__).parents[2] / PAGE
    _, *parts = re.split(r"(?m)^## ", page.read_text(encoding="utf-8"))
    texts = (re.sub(r"\[([^\]]+)\]\(([^)]+)\)", _without_link, part) for part in parts)
    return {name: text.strip() for name, _, text in (part.partition("\n") for part in texts)}


def about(named: Iterable[str]) -> str:
    """What to read about warnings that name these sections."""
    return f'about [...]: skmpm.explain("{next(iter(named))}"), or {PAGE}'


def _without_link(link: re.Match[str]) -> str:
    text, target = link.groups()
    return f"{text}, {normpath(join('docs/how_to', target))}"
