"""Print the pages of docs/how_to that warnings and errors name: a wheel has copies of them, a clone the pages."""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
from posixpath import join, normpath

FOLDER = "docs/how_to"
WARNINGS = f"{FOLDER}/warnings.md"


def explain(section: str | None = None) -> None:
    """Print what a warning of `preflight` means, or a step that failed, and what to do about it.

    A warning ends with the name of a section in brackets, as ``[thin-parts]``. The texts are those of the pages "What
    the warnings mean" and, by the name "failures", "When a step fails" of the documentation, which are installed with
    the library. Links are printed as pages of the repository.

    Parameters
    ----------
    section : name in the brackets of a warning, or "failures"; without it, all names are printed, each with its first
        sentence

    Raises
    ------
    ValueError
        if there is no such section; the message names the nearest ones

    Examples
    --------
    >>> import skmpm
    >>> skmpm.explain("friction")
    friction
    <BLANKLINE>
    **The coefficient of friction is above 2**, up to which the contact solver was verified. Beyond it hardly anything
    slides; use 2.
    """
    known = sections()
    if section is None:
        width = max(map(len, known))
        # a section begins with what is wrong, in bold
        begin = {name: re.split(r"\.|\*\*", text.removeprefix("**"))[0] for name, text in known.items()}
        said = [f"{name:{width}s}  {text}" for name, text in begin.items()]
        print("\n".join(said))  # noqa: T201
    elif section in known:
        print(f"{section}\n\n{known[section]}")  # noqa: T201
    else:
        near = get_close_matches(str(section), known) or list(known)
        raise ValueError(f"explain: no section {section!r}; use one of {', '.join(near)}")


def sections() -> dict[str, str]:
    """The sections of the page on warnings by name, and the page on failures; links as texts with their pages."""
    _, *parts = re.split(r"(?m)^## ", _page("warnings"))
    named = [*(part.partition("\n") for part in parts), ("failures", "", _page("failures").partition("\n")[2])]
    return {name: text.strip() for name, _, text in named}


def _page(name: str) -> str:
    installed = Path(__file__).with_name(f"{name}.md")
    page = installed if installed.exists() else Path(__file__).parents[2] / FOLDER / f"{name}.md"
    return re.sub(r"\[([^\]]+)\]\(([^)]+)\)", _without_link, page.read_text(encoding="utf-8"))


def about(named: Iterable[str]) -> str:
    """What to read about warnings that name these sections."""
    return f'about [...]: skmpm.explain("{next(iter(named))}"), or {WARNINGS}'


def _without_link(link: re.Match[str]) -> str:
    text, target = link.groups()
    return f"{text}, {normpath(join(FOLDER, target))}"
