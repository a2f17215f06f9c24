"""Measure what docs/verification shows: `python tests/verification/draw.py [module ...]`, by default every module.

A module is the part of a file's name after `test_`. It takes part if it has `rows()`, a list of `ledger.Row`, and
optionally `figures(folder)`, which draws PNG files and returns {file name: caption}.
"""

import csv
import json
import sys
from dataclasses import asdict, fields
from importlib import import_module

from ledger import Row
from verification_pages import GROUPS, KEPT, write

MODULES = tuple(name for modules in GROUPS.values() for name in modules)


def measure(name):
    """Run one module and keep what it found."""
    module = import_module(f"test_{name}")
    rows, captions = module.rows(), module.figures(KEPT) if hasattr(module, "figures") else {}
    with (KEPT / f"{name}.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, [f.name for f in fields(Row)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
    (KEPT / f"{name}.json").write_text(json.dumps(captions, indent=1) + "\n")


if __name__ == "__main__":
    KEPT.mkdir(exist_ok=True)
    for chosen in sys.argv[1:] or MODULES:
        measure(chosen)
    write()
