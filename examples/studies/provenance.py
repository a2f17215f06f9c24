"""What made the members of a study: the command, the version of the library, and the time it took."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from datetime import datetime, timedelta
from typing import Any

from skmpm.sweep import Member

DIRECTORIES = ("--out", "--docs", "--study", "--processes")  # options that results do not depend on


def made(members: Iterable[Member], module: str) -> str:
    """A paragraph that names them, with a warning if there is more than one version."""
    manifests = [about for member in members if (about := member.manifest).get("sessions")]
    if not manifests:
        return "Nothing has been run yet."
    sessions = [session for about in manifests for session in about["sessions"]]
    processor, wall = (sum(float(s.get(name, 0.0)) for s in sessions) for name in ("processor_seconds", "seconds"))
    begun = [datetime.fromisoformat(session["began"]) for session in sessions]
    ended = [b + timedelta(seconds=float(s.get("seconds", 0.0))) for b, s in zip(begun, sessions, strict=True)]
    commands = dict.fromkeys(command(session["command"], module) for session in sessions)
    parts = [
        f"Made by {listed(list(commands), module)}. {count(len(manifests))} took {hours(processor)} of processor time"
        f" ({hours(wall)} of their processes). The first was begun on {min(begun):%d %B %Y}, and the last ended"
        f" {hours((max(ended) - min(begun)).total_seconds())} later."
    ]
    return " ".join([*parts, versions(manifests)])


def listed(commands: list[str], module: str) -> str:
    """One command, or the options of a few: a study that was run in parts."""
    if len(commands) == 1:
        return f"`{commands[0]}`"
    if len(commands) > 4:
        return f"`python -m {module}`, in {len(commands)} parts"
    options = (text.removeprefix(f"python -m {module}").strip() for text in commands)
    parts = ", ".join(f"`{each}`" if each else "without options" for each in options)
    return f"`python -m {module}`, in parts ({parts})"


def versions(manifests: list[dict[str, Any]]) -> str:
    """The version of the library, or a warning that there are several."""
    named = [about.get("versions", {}) for about in manifests]
    found = Counter((str(n.get("skmpm", "unknown")), str(n.get("source", "unknown"))[:12]) for n in named)
    if len(found) == 1:
        version, source = next(iter(found))
        return f"All with one version of the library, skmpm {version}, source {source}."
    each = ", ".join(f"skmpm {version}, source {source} ({count})" for (version, source), count in found.items())
    return f"**Warning: {len(found)} versions of the library made these members**: {each}."


def command(arguments: list[str], module: str) -> str:
    """A command as it is typed, without its directories."""
    kept, skip = [], False
    for word in arguments[2:]:  # after the interpreter and the file
        name = word.split("=")[0]
        if name in DIRECTORIES:
            skip = "=" not in word
        elif skip:
            skip = False
        else:
            kept.append(word)
    return " ".join(["python -m", module, *kept])


def count(members: int) -> str:
    """How many there are."""
    return f"{members} member{'s' if members > 1 else ''}"


def hours(seconds: float) -> str:
    """A duration."""
    return f"{seconds / 3600.0:.1f} h" if seconds >= 3600.0 else f"{seconds / 60.0:.0f} min"
