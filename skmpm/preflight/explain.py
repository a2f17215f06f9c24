"""Print the pages of docs/how_to that warnings and errors name: a wheel has copies of them, a clone the pages."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from posixpath import join, normpath

from skmpm.preflight.limits import TABLE, PreflightWarning

FOLDER = "docs/how_to"
WARNINGS = f"{FOLDER}/warnings.md"
NEAR = 0.75  # least likeness of words for difflib: "millimeter" is near "millimetres", "memory" is not near "energy"


def explain(section: str | PreflightWarning | None = None) -> None:
    """Print what a warning of `preflight` means, or a step that failed, and what to do about it.

    A warning ends with the name of a section in brackets, as ``[thin-parts]``. The texts are those of the pages "What
    the warnings mean" and, by the name "failures", "When a step fails" of the documentation, which are installed with
    the library. Links are printed as pages of the repository.

    Parameters
    ----------
    section : a warning of `preflight`, its text, its kind or the name in its brackets, or "failures"; without it, all
        names are printed, each with its first sentence

    Raises
    ------
    ValueError
        if there is no such section; the message names those that speak of it, or of the nearest words, and all others

    Examples
    --------
    >>> import skmpm
    >>> skmpm.explain("friction")
    friction
    <BLANKLINE>
    **The coefficient of friction is above 2**, up to which the contact solver was verified. Beyond it hardly anything
    slides; use 2.
    """
    text = str(section)
    text = {limit.kind: limit.section for limit in TABLE}.get(text, (re.findall(r"\[([\w-]+)\]", text) or [text])[-1])
    known, name = sections(), re.sub(r"[\s_]+", "-", text.strip().lower())
    if section is None:
        width = max(map(len, known))
        # a section begins with what is wrong, in bold
        begin = {name: re.split(r"\.|\*\*", text.removeprefix("**"))[0] for name, text in known.items()}
        said = [f"{name:{width}s}  {text}" for name, text in begin.items()]
        print("\n".join(said))  # noqa: T201
    elif name in known:
        print(f"{name}\n\n{known[name]}")  # noqa: T201
    else:
        perhaps = " or ".join(_speaking_of(name.split("-"), known))
        meant = f", perhaps {perhaps}" if perhaps else ""
        raise ValueError(f"explain: no section {section!r}{meant}; use one of {', '.join(known)}")


def _speaking_of(words: list[str], known: dict[str, str]) -> list[str]:
    """Up to three sections that have all words or, where none has, the nearest ones; the densest in them first.

    Kinds and texts of warnings belong to their sections. An s at the end of a word does not matter.
    """
    said = {name: f"{name} {text}".lower() for name, text in known.items()}
    for limit in TABLE:
        said[limit.section] += f" {limit.kind} {limit.text}".lower()
    vocabulary = {word for text in said.values() for word in re.findall(r"[a-z]{3,}", text)}
    for these in (words, [near for word in words for near in get_close_matches(word, vocabulary, 1, NEAR)]):
        pattern = [rf"(?<!\w){re.escape(word.removesuffix('s'))}" for word in these if word]
        share = {n: min((len(re.findall(p, t)) for p in pattern), default=0) / len(t) for n, t in said.items()}
        if found := [name for name in sorted(share, key=share.__getitem__, reverse=True) if share[name]]:
            return found[:3]
    return []


def sections() -> dict[str, str]:
    """The sections of the page on warnings by name, and the page on failures; links as texts with their pages."""
    _, *parts = re.split(r"(?m)^## ", _page("warnings"))
    named = [*(part.partition("\n") for part in parts), ("failures", "", _page("failures").partition("\n")[2])]
    return {name: text.strip() for name, _, text in named}


def _page(name: str) -> str:
    installed = Path(__file__).with_name(f"{name}.md")
    page = installed if installed.exists() else Path(__file__).parents[2] / FOLDER / f"{name}.md"
    return re.sub(r"\[([^\]]+)\]\(([^)]+)\)", _without_link, page.read_text(encoding="utf-8"))


def about(warnings: Sequence[PreflightWarning]) -> list[str]:
    """What to read about warnings, as a line; none if there are none."""
    return [f'about [...]: skmpm.explain("{warnings[0].section}"), or {WARNINGS}'] if warnings else []


def _without_link(link: re.Match[str]) -> str:
    text, target = link.groups()
    return f"{text}, {normpath(join(FOLDER, target))}"
