"""The members of the study: groups of runs by kind, in the order in which they are run.

The members that most figures need come first, those at R/h = 8, which take longest, last: a study that is stopped has
whole groups, and goes on with the others when it is called again.
"""

from __future__ import annotations

import argparse
from typing import Any

Options = dict[str, Any]

FRICTIONS = (0.0, 0.5, 0.1)  # of discs
LID, SLOW = 2.0, 0.005  # speed of the lid, as published and quasi-static [m/s]
LIDS = (0.02, 0.002)  # of the lids whose rate must not matter [m/s]
RATIOS = (0.3, 0.495)  # of Poisson, beside that of all others, 0.45
# Nominal solid fraction at which runs with ratios above 0.49 end. Such discs hardly lose area: at 0.996, or 0.989 as
# they are then, fifty of them have closed all pores, and steps become a thousandth as long before one fails.
CLOSED = 0.97
CELLS = (6, 8, 10)  # per mean radius, of the runs in the mode of Nezamabadi et al. (2017)
RADIUS = 0.95e-3  # mean [m]
SPACING = 0.14 / 0.19  # of points, over the cell
PUBLISHED: Options = {"scheme": "nezamabadi2017", "speed": LID, "dt": 0.5e-6, "start": 0.55, "until": 0.85}
FINE = 8  # cells per mean radius of the finer grid; the others have 5


GROUPS = {
    "quasistatic": "quasi-static, uniaxial",
    "periodic": "quasi-static, isotropic",
    "lid": "other quasi-static lids",
    "fast": "lid at 2 m/s",
    "nu": "other Poisson's ratios",
    "regridded": "body grids rebuilt at every step",
    "shared_grid": "mode of Nezamabadi et al. (2017)",
    "fine": "quasi-static, uniaxial, R/h = 8",
}  # what runs are by how their names begin, in the order of the pages


def members(options: argparse.Namespace) -> dict[str, Options]:
    """Parameters of `study.build` by member."""
    common = {"discs": options.discs, "start": options.start, "until": options.until}
    fast, slow = {"speed": LID, "dt": 8e-6}, {"speed": options.slow, "dt": None}
    found = packings("quasistatic", options.seeds, slow)
    found |= packings("periodic", options.seeds, slow | {"periodic": True})  # both edges, as fast as the slow lid
    for speed in LIDS:
        found |= packings(f"lid{speed:g}", 1, slow | {"speed": speed})
    found |= packings("fast", options.seeds, fast)
    for nu in RATIOS:
        end = {"until": min(options.until, CLOSED)} if nu > 0.49 else {}
        found |= packings(f"nu{nu:g}", min(options.seeds, 2), slow | {"nu": nu} | end, (0.0,))
    found |= packings("regridded", 1, fast | {"scheme": "regridded"}, (0.5,))
    for friction, cells in (*((0.0, cells) for cells in CELLS), (0.5, CELLS[0])):
        published = PUBLISHED | {"discs": max(options.discs // 3, 10), "friction": friction}
        found[f"shared_grid_mu{friction:g}_r{cells}"] = published | resolved(cells)
    found |= packings("fine", min(options.seeds, options.fine_seeds), slow | resolved(FINE))
    return {name: common | chosen for name, chosen in found.items()}


def group_of(name: str) -> str:
    """The group that a member belongs to by its name; an empty text if there is none."""
    return max((group for group in GROUPS if name.startswith(group)), key=len, default="")


def name_of(kind: str, friction: float, seed: int) -> str:
    """Name of a packing."""
    return f"{kind}_mu{friction:g}_seed{seed}"


def packings(kind: str, seeds: int, chosen: Options, frictions: tuple[float, ...] = FRICTIONS) -> dict[str, Options]:
    """All frictions of the first packing, then of the second, and so on."""
    return {
        name_of(kind, friction, seed): {**chosen, "friction": friction, "seed": seed}
        for seed in range(seeds)
        for friction in frictions
    }


def resolved(cells: int) -> Options:
    """Cell and spacing for so many cells per mean radius [m]."""
    cell = RADIUS / cells
    return {"cell": cell, "spacing": SPACING * cell}
