"""Measure what docs/verification.md shows: `python tests/verification/draw.py [module ...]`, by default every module.

A module is the part of a file's name after `test_`. It takes part if it has `rows()`, a list of `ledger.Row`, and
optionally `figures(folder)`, which draws PNG files and returns {file name: caption}.
"""

import csv
import json
import sys
from dataclasses import asdict, fields
from importlib import import_module
from pathlib import Path

from ledger import Row

HERE = Path(__file__).resolve().parent
DOCS = HERE.parents[1] / "docs"
KEPT = DOCS / "verification"
MODULES = (
    "materials",
    "viscosity",
    "patch",
    "fem_elasticity",
    "locking",
    "mean_dilatation",
    "thin_parts",
    "slits",
    "long_steps",
    "large_deflection",
    "manufactured",
    "dynamics",
    "explicit",
    "galilean",
    "onset",
    "hertz",
    "contact_pressure",
    "contact_patch",
    "ironing",
    "friction",
    "rolling",
    "collision",
    "adhesion",
    "pile",
    "corners",
    "arch",
    "self_contact",
    "contact_solver",
    "interpenetration",
    "four_walls",
    "jamming",
)
HEAD = """# Verification

Every claim about bulk and contact is compared with a closed form, a rate or another code. Each row below is measured
by the function that its test calls, with larger sizes where the test uses a short version. A missed goal is marked as
such, with its measured figure and the reason.

`python tests/verification/draw.py` repeats the measurements and writes this page and its figures. Only the packings
of 100 and 300 discs are read from tables in docs/verification/packings, which `tests/verification/packings.py` made
in two hours with the version of their commit.
"""


def measure(name):
    """Run one module and keep what it found."""
    module = import_module(f"test_{name}")
    rows, captions = module.rows(), module.figures(KEPT) if hasattr(module, "figures") else {}
    with (KEPT / f"{name}.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, [f.name for f in fields(Row)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
    (KEPT / f"{name}.json").write_text(json.dumps(captions, indent=1) + "\n")


def page():
    """Write docs/verification.md from what is kept of every module."""
    columns = [f.name for f in fields(Row)]
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    pictures = []
    for name in MODULES:
        if not (KEPT / f"{name}.json").exists():
            continue
        with (KEPT / f"{name}.csv").open(newline="") as file:
            rows = list(csv.DictReader(file))
        lines += ["| " + " | ".join(row[c].replace("|", "\\|") for c in columns) + " |" for row in rows]
        captions = json.loads((KEPT / f"{name}.json").read_text())
        pictures += [f"![{text}](verification/{file})\n\n*{text}*\n" for file, text in captions.items()]
    (DOCS / "verification.md").write_text("\n".join([HEAD, *lines, "", *pictures]).rstrip() + "\n")


if __name__ == "__main__":
    KEPT.mkdir(exist_ok=True)
    for chosen in sys.argv[1:] or MODULES:
        measure(chosen)
    page()
