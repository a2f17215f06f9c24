"""What a step costs: by phases, beside one sparse LU of the same matrix, and as scenes grow.

    python -m examples.studies.benchmark                  # everything: its page says how long it takes
    python -m examples.studies.benchmark --discs 100 300  # some sizes only
    python -m examples.studies.benchmark --page           # the page from what has been measured

Every workload runs in a process of its own, with one BLAS thread, and leaves a json file in --out; those that are
there are not run again, so an interrupted benchmark resumes (after a change of the library give another --out). The
page, its table and its figure are made of these files. The workloads are defined in `scenes.py` and
measured in `measure.py`.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from time import perf_counter
from typing import Any

from skmpm.parallel import available

from .. import pages
from . import page
from .scenes import layout

ROOT = pages.DOCS.parents[1]
QUICK = {
    "discs": [10, 20],
    "main": 20,
    "tile": 10,
    "cells": [3.0],
    "single": [300, 1000],
    "steps": 2,
    "memory_steps": 160,
    "members": 2,
}
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
KEEP_PAGES = {"MALLOC_MMAP_THRESHOLD_": str(2**32), "MALLOC_TRIM_THRESHOLD_": str(2**34)}  # glibc [bytes]
Setups = dict[str, dict[str, Any]]


def plan(options: argparse.Namespace) -> Setups:
    """All workloads by name, in the order in which they run."""
    cells, friction, repeats = options.cells[0], options.friction[0], options.steps
    sizes = [(discs, cells, friction) for discs in options.discs]
    sizes += [(options.main, cells, mu) for mu in options.friction] + [
        (options.main, c, friction) for c in options.cells
    ]
    tiles: Setups = {}
    packings: Setups = {}
    for discs, c, mu in dict.fromkeys(sizes):
        part, shared = layout(discs, options.tile)[0], {"cells": c, "friction": mu}
        tiles[f"tile_{part}_{c:g}_{mu:g}"] = {"kind": "tile", "discs": part, **shared}
        packings[f"dense_{discs}_{c:g}_{mu:g}"] = {
            "kind": "dense", "discs": discs, **shared, "tile": options.tile, "repeats": repeats
        }  # fmt: skip
    free: Setups = {
        f"free_{law}": {"kind": "free", "discs": options.main, "cells": cells, "law": law, "repeats": repeats}
        for law in ("LinearElastic", "NeoHookean")
    }
    single: Setups = {f"single_{points}": {"kind": "single", "about": points} for points in options.single}
    memory: Setups = {"memory": {"kind": "memory", "discs": 4, "cells": 3.0, "steps": options.memory_steps}}
    ensembles: Setups = {
        f"ensemble_{processes}": {"kind": "ensemble", "discs": options.tile, "members": options.members,
                                  "processes": processes}
        for processes in sorted({1, available()})
    }  # fmt: skip
    setups = {**free, **tiles, **packings, **single, **memory, **ensembles}
    return {name: {**setup, "keep_pages": options.keep_pages} for name, setup in setups.items()}


def kept(path: Path, setup: dict[str, Any]) -> dict[str, Any] | None:
    """What was measured of this workload, if it was."""
    found = json.loads(path.read_text()) if path.exists() else None
    return found if found is not None and setup.items() <= found.items() else None


def run(setups: Setups, out: Path, cache: Path) -> None:
    """Measure what has not been measured, one process after the other."""
    out.mkdir(parents=True, exist_ok=True)
    for name, setup in setups.items():
        path = out / f"{name}.json"
        if kept(path, setup) is not None:
            continue
        began = perf_counter()
        where = [str(place.resolve()) for place in (path, cache)]
        command = [sys.executable, "-m", f"{__package__}.measure", json.dumps(setup), *where]
        environment = {**os.environ, **ONE_THREAD, **(KEEP_PAGES if setup["keep_pages"] else {})}
        code = subprocess.run(command, env=environment, cwd=ROOT, check=False).returncode
        print(f"{name}: {perf_counter() - began:.0f} s" + (f", failed ({code})" if code else ""), flush=True)


def main(options: argparse.Namespace) -> None:
    """Run what is missing, then write the page."""
    if options.quick:
        vars(options).update(QUICK)
    setups = plan(options)
    if not options.page:
        run(setups, options.out, options.cache or options.out / "tiles")
    results = {name: found for name, setup in setups.items() if (found := kept(options.out / f"{name}.json", setup))}
    page.write(results, options, options.docs)


def parser() -> argparse.ArgumentParser:
    """The options."""
    options = pages.parser(__doc__, "performance.md and how_large.md")
    add = options.add_argument
    add(
        "--discs",
        type=int,
        nargs="+",
        default=[10, 30, 100, 300, 1000, 3000, 10_000],
        help="sizes of the dense packings",
    )
    add("--main", type=int, default=300, help="discs where laws, friction and cells are compared")
    add("--tile", type=int, default=100, help="discs of the tile that larger packings are made of")
    add("--cells", type=float, nargs="+", default=[5.0, 8.0], help="per mean radius; those after the first: --main")
    add("--friction", type=float, nargs="+", default=[0.5, 0.0], help="coefficients; those after the first: --main")
    add("--single", type=int, nargs="*", default=[1000, 10_000, 100_000, 1_000_000], help="points of single bodies")
    add("--steps", type=int, default=5, help="measured of every packing")
    add("--memory-steps", type=int, default=2000, help="of the small scene whose memory is watched")
    add("--members", type=int, default=4, help="of the ensemble, in one process and in as many as there are cores")
    add("--cache", type=Path, default=None, help="directory of the tiles (out/tiles)")
    add("--out", type=Path, default=Path("out/benchmark"), help="directory of the results")
    add("--keep-pages", action="store_true", help="let glibc keep freed memory instead of asking for fresh pages")
    add("--quick", action="store_true", help="everything in small, to see that it works")
    add("--page", action="store_true", help="write the page only")
    return options
