"""Members of the study beside its page, so that it goes on, and is drawn again, on another machine.

    python -m examples.studies.packing_ensemble archive              # what has finished, from out/study to the page
    python -m examples.studies.packing_ensemble archive --restore    # back to out/study, before the page is drawn
    python -m examples.studies.packing_ensemble archive --restore --version 0.3.0rc1    # before the study goes on

A file has what makes a finished member: its manifest, without names of directories and machines, its table, and what
its states told (`stages.measured`). The states are left out, which pictures of packings are drawn from: restored
members keep those that there are. `study` does not run restored members again, and refuses those of another version:
with `--version` only members of one are restored, and the others run anew.
"""

from __future__ import annotations

import argparse
import csv
import io
import json
import lzma
from pathlib import Path
from typing import Any

from .. import pages, provenance
from . import stages
from .curves import read

FOLDER, SUFFIX = Path("packing_ensemble") / "members", ".json.xz"
DIGITS, DIGITS_OF_TIME = 7, 10  # of numbers in a table; times resolve steps of a millionth of the run
HERE = ("host", "process")  # of a session: what says nothing about results


def store(out: Path, docs: Path) -> list[str]:
    """Write the members that have finished beside the page; their names."""
    folder, found = docs / FOLDER, read(out)
    finished = [ran for ran in found.ran if ran.status == "finished" and found.get(ran.name)]
    folder.mkdir(parents=True, exist_ok=True)
    for ran in finished:
        about = {
            "manifest": anonymous(ran.manifest),
            "stages": stages.measured(found.members[ran.name]),
            "table": rounded((ran.folder / "table.csv").read_text()),
        }
        (folder / f"{ran.name}{SUFFIX}").write_bytes(lzma.compress(json.dumps(about).encode()))
    return [ran.name for ran in finished]


def restore(docs: Path, out: Path, version: str | None = None) -> list[str]:
    """Make the directories of members, all or those of a version, that are only beside the page; their names."""
    made = []
    for path in sorted((docs / FOLDER).glob(f"*{SUFFIX}")):
        name = path.name.removesuffix(SUFFIX)
        if (out / name).exists():
            continue
        about = json.loads(lzma.decompress(path.read_bytes()))
        if version not in (None, about["manifest"]["versions"]["skmpm"]):
            continue
        (out / name).mkdir(parents=True)
        (out / name / "table.csv").write_text(about["table"])
        (out / name / stages.MEASURES).write_text(json.dumps(about["stages"]))
        (out / name / "manifest.json").write_text(json.dumps(about["manifest"], indent=1) + "\n")
        made.append(name)
    return made


def rounded(table: str) -> str:
    """A table with fewer digits; the first column is time."""
    header, *rows = csv.reader(io.StringIO(table))
    lines = [header]
    for t, *values in rows:
        lines.append([f"{float(t):.{DIGITS_OF_TIME}g}", *(f"{float(value):.{DIGITS}g}" for value in values)])
    return "".join(",".join(line) + "\n" for line in lines)


def anonymous(manifest: dict[str, Any]) -> dict[str, Any]:
    """A manifest whose sessions name no directory and no machine."""
    sessions = []
    for session in manifest["sessions"]:
        words = provenance.command(session["command"], "examples.studies.packing_ensemble").split()
        kept = {key: value for key, value in session.items() if key not in HERE}
        sessions.append(kept | {"command": ["python", "packing_ensemble", *words[3:]]})
    return manifest | {"sessions": sessions}


def main(options: argparse.Namespace) -> None:
    """Store or restore, and say what."""
    folders = options.docs, options.study
    names = restore(*folders, options.version) if options.restore else store(*folders[::-1])
    print(f"{len(names)} members: {', '.join(names) or '-'}")


def parser() -> argparse.ArgumentParser:
    """Where the study is, and where the page."""
    options = pages.parser(__doc__, "packing_ensemble.md", Path("out/study"))
    options.add_argument("--restore", action="store_true", help="from the page to the directory")
    options.add_argument("--version", help="of skmpm, whose members are restored; None: all")
    return options
