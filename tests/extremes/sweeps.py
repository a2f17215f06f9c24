"""Turn every dial to its ends: `python tests/extremes/sweeps.py [dial ...] [--processes n]`, by default every dial.

Each setting is run on the scenes and kept in docs/stability/<dial>.csv; what is there is not run again. Then
docs/stability.md gets its table, its list of failures and one map per dial: `sweeps.py draw` does only that.
"""

from __future__ import annotations

import argparse
import csv
import json
import logging
import signal
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from time import process_time

import numpy as np
from checks import Outcome, difference, examine
from scenes import SCENES, Case, Dials, crush, gap_of

PAGE = Path(__file__).resolve().parents[2] / "docs" / "stability.md"
KEPT = PAGE.with_suffix("")
LIMIT = 120  # [s] for a run; beyond it is "too long"
COLOURS = {
    "right": "#8fc98f",
    "StepFailed": "#f2b866",
    "SceneError": "#8fb4dd",
    "wrong": "#e0605e",
    "too long": "#bbbbbb",
}
COLUMNS = ("setting", "scene", "kind", "steps", "retries", "newton", "reached", "error", "seconds")
WORST = ("momentum", "energy gained", "residual", "overlap", "behind a wall")
TEXTS = ("violations", "message")
ALL = (*SCENES,)
BOXES = {"shape": "box", "points_per_cell": 2.25, "bodies": 4, "solid_fraction": 1.02}

POINTS = {"shape": "point", "cells": 0.5, "solid_fraction": 1.1}


@dataclass(frozen=True)
class Setting:
    """One column of a map."""

    label: str
    dials: dict = field(default_factory=dict)
    scenes: tuple[str, ...] = ALL
    limit: int = LIMIT  # [s]
    compared: bool = True  # with a fine reference


def along(name, values, *, scenes=ALL, **others):
    """One setting for each value of a dial."""
    return [Setting(f"{value:g}", {name: value, **others}, scenes) for value in values]


def few(name, value, steps, scenes=ALL, limit=LIMIT):
    """A costly setting: some steps only, without a reference."""
    return Setting(f"{value:g}", {name: value, "steps": steps}, scenes, limit, compared=False)


def locked(nu):
    """Poisson's ratio with the cure against locking."""
    return Setting(f"{nu:g} cured", {"nu": nu, "locking": True})


def of_bodies(n, **options):
    """A number of bodies, coarse if they are many."""
    if n <= 30:
        return Setting(f"{n}", {"bodies": n, **options}, compared=False)
    steps = {100: 30, 300: 10, 1000: 5, 3000: 3}[n]
    return Setting(
        f"{n}", {"bodies": n, "cells": 3.0, "steps": steps, "closing": 0.2, **options}, limit=1200, compared=False
    )


SWEEPS = {
    "dt": [
        *along("dt_c_h", (1e-3, 1e-2, 0.1), steps=20),
        *along("dt_c_h", (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 100.0, 300.0, 1000.0)),
    ],
    "nu": [
        *along("nu", (-0.9, -0.5, 0.0, 0.3, 0.45, 0.49)),
        *(s for nu in (0.499, 0.4999, 0.49999) for s in (*along("nu", (nu,)), locked(nu))),
    ],
    "stiffness": along("stiffness_ratio", (1.0, 10.0, 1e2, 1e3, 1e4, 1e6, 1e8)),
    "density": along("density_ratio", (1.0, 10.0, 1e2, 1e3, 1e4, 1e6, 1e8)),
    "friction": along("friction", (0.0, 1e-6, 0.01, 0.1, 0.5, 1.0, 2.0, 10.0, 100.0)),
    "closing": along("closing", (1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.04, 0.1, 0.3, 1.0)),
    "points": [
        *along("points_per_cell", (0.5, 1.0, 1.83, 4.0, 9.0)),
        few("points_per_cell", 25.0, 20),
        few("points_per_cell", 100.0, 5),
    ],
    "cells": [
        *along("cells", (1.5, 2.0, 3.0, 5.0, 8.0)),
        few("cells", 12.0, 20),
        few("cells", 20.0, 10),
        few("cells", 40.0, 5, ("fall", "collision")),
        few("cells", 80.0, 3, ("fall", "collision")),
    ],
    "offset": [
        Setting("centre on a node", {"offset": (0.0, 0.0)}),
        Setting("centre on an edge", {"offset": (0.5, 0.0)}),
        Setting("centre in a cell", {"offset": (0.5, 0.5)}),
        Setting("1e-15 off a node", {"offset": (1e-15, -1e-15)}),
        Setting("1e-9 off a node", {"offset": (-1e-9, 1e-9)}),
        Setting("1e3 cells away", {"origin": (1e3, -1e3)}),
        Setting("1e6 cells away", {"origin": (1e6, -1e6)}),
        Setting("on a node, 1e6 away", {"origin": (1e6, 1e6), "offset": (0.0, 0.0)}),
        Setting("boxes on the grid", {**BOXES, "offset": (0.0, 0.0)}, compared=False),
        Setting("boxes in the cells", {**BOXES, "offset": (0.5, 0.5)}, compared=False),
        Setting("boxes, 1e6 away", {**BOXES, "offset": (0.0, 0.0), "origin": (1e6, 1e6)}, compared=False),
    ],
    "fraction": [
        *along("solid_fraction", (0.75, 0.8, 0.85, 0.9, 0.95, 1.0, 1.05, 1.1), scenes=("squeeze",)),
        *(
            Setting(f"{f:g} smooth", {"solid_fraction": f, "friction": 0.0}, ("squeeze",), compared=False)
            for f in (0.9, 1.0, 1.1)
        ),
    ],
    "bodies": [
        *(of_bodies(n) for n in (1, 2, 3, 12, 30, 100, 300, 1000, 3000)),
        *(
            Setting(f"{n} points", {**POINTS, "bodies": n}, compared=False)
            for n in (1, 12, 100)
        ),
        Setting("points by outlines", {**POINTS, "outlined": True, "bodies": 2}, compared=False),
        Setting("crushed", {}, ("crush",), compared=False),
        Setting("crushed, smooth", {"friction": 0.0}, ("crush",), compared=False),
        Setting("crushed at c", {"closing": 1.0}, ("crush",), compared=False),
    ],
}  # fmt: skip
TITLES = {
    "dt": "time step dt c / h",
    "nu": "Poisson's ratio",
    "stiffness": "stiffness of every second body over the others",
    "density": "density of every second body over the others",
    "friction": "friction",
    "closing": "closing speed / c",
    "points": "points per cell",
    "cells": "R / h",
    "offset": "place on the grid",
    "fraction": "nominal solid fraction at the end",
    "bodies": "bodies",
}


PHYSICS = (
    "nu",
    "stiffness_ratio",
    "density_ratio",
    "friction",
    "closing",
    "solid_fraction",
    "bodies",
    "shape",
    "seed",
)
SOLE = {"fall": 1, "collision": 2, "squeeze": 12, "crush": 0}  # bodies of scenes that are compared


def case_of(name: str, setting: Setting) -> Case:
    """The scene of a setting."""
    return (SCENES | {"crush": crush})[name](Dials(**setting.dials))


def limited(case: Case, seconds: int) -> Outcome:
    """Examine a case; "too long" when it is not done in time."""

    def stop(*_):
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        return examine(case)
    except TimeoutError:
        return Outcome(kind="too long", message=f"not done within {seconds} s")
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def finer(case: Case) -> Case:
    """The same physics with half the time step and half the cell (a squeeze: 5/7 of it), at most the defaults'."""
    d, usual, share = case.dials, Dials(), 0.5 if case.name == "collision" else 5.0 / 7.0
    cells = max(d.cells, usual.cells) / share
    step = 0.5 * min(d.dt_c_h / d.cells, usual.dt_c_h / usual.cells)
    fine = Dials(
        **{name: getattr(d, name) for name in PHYSICS},
        gap=gap_of(d),
        cells=cells,
        dt_c_h=step * cells,
        locking=d.nu > 0.49,
        steps=100_000,
    )
    until = min(case.until, case.until if case.name == "squeeze" else 20.0 * d.length / d.speed)
    return replace(SCENES[case.name](fine), until=until)


def reference(case: Case) -> dict[str, float]:
    """What a case should end with: free fall in closed form, else of a finer run, kept in references.json."""
    d = case.dials
    if case.name == "fall":
        time = case.until * d.speed / d.length
        return {"velocity x": 0.0, "velocity y": -0.1 * time, "spin": 0.25}
    fine = finer(case)
    key = f"{fine.name} {fine.until:.9g} {fine.dials}"
    path = KEPT / "references.json"
    known = json.loads(path.read_text()) if path.exists() else {}
    if not known.get(key):
        outcome = limited(fine, 4 * LIMIT)
        known = json.loads(path.read_text()) if path.exists() else {}
        known[key] = outcome.ends if outcome.kind == "right" else {}
        path.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n")
    return known[key]


def measure(name: str, setting: Setting) -> dict[str, str]:
    """One row of a table: a scene at a setting."""
    start = process_time()
    try:
        case = case_of(name, setting)
    except ValueError as error:  # SceneError among them
        kind = "SceneError" if type(error).__name__ in ("SceneError", "PackingError") else "wrong"
        outcome, case = Outcome(kind=kind, message=str(error)), None
    else:
        outcome = limited(case, setting.limit)
    seconds = process_time() - start
    error = np.nan
    if outcome.kind == "right" and (setting.compared or name == "fall") and len(case.scene.bodies) == SOLE[name]:
        error = difference(outcome.ends, reference(case), name)
    row = {
        "setting": setting.label,
        "scene": name,
        "kind": outcome.kind,
        "steps": outcome.steps,
        "retries": outcome.retries,
        "newton": f"{outcome.newton:.2f}",
        "reached": f"{outcome.reached:.3g}",
        "error": f"{error:.2g}",
        "seconds": f"{seconds:.2g}",
    }
    row |= {key: f"{outcome.worst.get(key, np.nan):.2g}" for key in WORST}
    return row | {"violations": "; ".join(outcome.violations), "message": outcome.message}


def sweep(dial: str, again: Sequence[str] = ()) -> None:
    """Run what is missing of a dial, and what ended in one of the ways named."""
    path = KEPT / f"{dial}.csv"
    rows = [row for row in read(dial) if row["kind"] not in again]
    done = {(row["setting"], row["scene"]) for row in rows}
    for setting, name in columns(dial):
        if (setting.label, name) not in done:
            row = {key: str(value) for key, value in measure(name, setting).items()}
            print(dial, *(row[c] for c in COLUMNS), row["violations"], row["message"], flush=True)  # noqa: T201
            rows.append(row)
            place = {(s.label, name): i for i, (s, name) in enumerate(columns(dial))}
            rows.sort(key=lambda row: place.get((row["setting"], row["scene"]), -1))
            with path.open("w", newline="") as file:
                writer = csv.DictWriter(file, [*COLUMNS, *WORST, *TEXTS], lineterminator="\n")
                writer.writeheader()
                writer.writerows(rows)


def columns(dial: str) -> list[tuple[Setting, str]]:
    """Every setting with every scene."""
    return [(setting, name) for setting in SWEEPS[dial] for name in setting.scenes]


def read(dial: str) -> list[dict[str, str]]:
    """The rows of a dial that have been run."""
    path = KEPT / f"{dial}.csv"
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def main() -> None:
    """Run the dials named, then draw all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dials", nargs="*", help=f"of {', '.join(SWEEPS)}; or draw")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--again", nargs="*", default=(), help="run anew what ended so: wrong, StepFailed ...")
    given = parser.parse_args()
    KEPT.mkdir(exist_ok=True)
    logging.getLogger("skmpm").setLevel(logging.ERROR)  # retries are counted
    wanted = [d for d in given.dials or SWEEPS if d != "draw"]
    if given.processes == 1:
        for dial in wanted:
            sweep(dial, given.again)
    else:
        with ProcessPoolExecutor(given.processes) as processes:
            list(processes.map(partial(sweep, again=given.again), wanted))


if __name__ == "__main__":
    main()
