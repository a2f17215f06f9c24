"""Every parameter with its settings, and the tables of results."""

from __future__ import annotations

import csv
from dataclasses import dataclass, field
from pathlib import Path

from scenes import SCENES

PAGE = Path(__file__).resolve().parents[2] / "docs" / "studies" / "stability.md"
KEPT = PAGE.with_suffix("")
LIMIT = 120  # [s] of the processor for a run; beyond it is "too long"
COLUMNS = ("setting", "scene", "kind", "steps", "retries", "newton", "reached", "error", "seconds")
WORST = ("momentum", "energy gained", "residual", "overlap", "behind a wall")
TEXTS = ("library", "violations", "message", "ends")  # library: version and source
ALL = (*SCENES,)
BOXES = {"shape": "box", "points_per_cell": 2.25, "bodies": 4, "solid_fraction": 1.02}

POINTS = {"shape": "point", "cells": 0.5, "solid_fraction": 1.1}


@dataclass(frozen=True)
class Setting:
    """One column of a map."""

    label: str
    parameters: dict = field(default_factory=dict)
    scenes: tuple[str, ...] = ALL
    limit: int = LIMIT  # [s] of the processor
    compared: bool = True  # with a fine reference


def along(name, values, *, scenes=ALL, **others):
    """One setting for each value of a parameter."""
    return [Setting(f"{value:g}", {name: value, **others}, scenes) for value in values]


def few(name, value, steps, scenes=ALL, limit=LIMIT):
    """A costly setting: some steps only, without a reference."""
    return Setting(f"{value:g}", {name: value, "steps": steps}, scenes, limit, compared=False)


def locked(nu):
    """Poisson's ratio with mean dilatation, against locking."""
    return Setting(f"{nu:g} mean dilatation", {"nu": nu, "mean_dilatation": True})


def of_bodies(n, **options):
    """A number of bodies, coarse if they are many."""
    if n <= 30:
        return Setting(f"{n}", {"bodies": n, **options}, compared=False)
    steps = {100: 30, 300: 15, 1000: 8, 3000: 5}[n]
    return Setting(f"{n}", {"bodies": n, "cells": 3.0, "steps": steps, **options}, limit=1200, compared=False)


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
        few("points_per_cell", 25.0, 30),
        few("points_per_cell", 100.0, 10),
    ],
    "cells": [
        *along("cells", (1.5, 2.0, 3.0, 5.0, 8.0)),
        few("cells", 12.0, 60),
        few("cells", 20.0, 20),
        few("cells", 40.0, 15, ("fall", "collision")),
        few("cells", 80.0, 5, ("fall", "collision")),
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
            Setting(f"{f:g} frictionless", {"solid_fraction": f, "friction": 0.0}, ("squeeze",), compared=False)
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
        Setting("crushed, frictionless", {"friction": 0.0}, ("crush",), compared=False),
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
    "offset": "position on the grid",
    "fraction": "nominal solid fraction at the end",
    "bodies": "bodies",
}


def columns(parameter: str) -> list[tuple[Setting, str]]:
    """Every setting with every scene."""
    return [(setting, name) for setting in SWEEPS[parameter] for name in setting.scenes]


def read(parameter: str) -> list[dict[str, str]]:
    """The rows of a parameter that have been run."""
    path = KEPT / f"{parameter}.csv"
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return [{"library": "", **row} for row in csv.DictReader(file)]  # older rows have none


def write(parameter: str, rows: list[dict[str, str]]) -> None:
    """Keep the rows of a parameter, in the order of its settings."""
    place = {(s.label, name): i for i, (s, name) in enumerate(columns(parameter))}
    rows.sort(key=lambda row: place.get((row["setting"], row["scene"]), -1))
    with (KEPT / f"{parameter}.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, [*COLUMNS, *WORST, *TEXTS], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
