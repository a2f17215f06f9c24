"""The members of the study: groups of runs by kind, in the order in which they are run.

The members that most figures need come first, those at R/h = 8, which take longest, last: a study that is stopped has
whole groups, and goes on with the others when it is called again.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any, NamedTuple

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
FINE = 8  # cells per mean radius of the finer grid; the others have 5


class Group(NamedTuple):
    """Runs of a kind: what they are, and their parameters by member."""

    title: str
    members: Callable[[argparse.Namespace], dict[str, Options]]


def members(options: argparse.Namespace) -> dict[str, Options]:
    """Parameters of `study.build` by member."""
    found: dict[str, Options] = {}
    for group in GROUPS.values():
        found |= group.members(options)
    common = {"discs": options.discs, "start": options.start, "until": options.until}
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


def quasistatic(options: argparse.Namespace) -> dict[str, Options]:
    """A slow lid; steps are chosen."""
    return packings("quasistatic", options.seeds, {"speed": options.slow, "dt": None})


def periodic(options: argparse.Namespace) -> dict[str, Options]:
    """Both edges of a periodic box shorten, each as fast as the slow lid."""
    return packings("periodic", options.seeds, {"speed": options.slow, "dt": None, "periodic": True})


def lids(options: argparse.Namespace) -> dict[str, Options]:
    """The first packing under lids four times as fast and 2.5 times as slow."""
    found: dict[str, Options] = {}
    for speed in LIDS:
        found |= packings(f"lid{speed:g}", 1, {"speed": speed, "dt": None})
    return found


def fast(options: argparse.Namespace) -> dict[str, Options]:
    """The published lid, and steps of 8 us."""
    return packings("fast", options.seeds, {"speed": LID, "dt": 8e-6})


def poisson(options: argparse.Namespace) -> dict[str, Options]:
    """Other Poisson's ratios, without friction."""
    found: dict[str, Options] = {}
    for nu in RATIOS:
        slow: Options = {"speed": options.slow, "dt": None, "nu": nu}
        slow |= {"until": min(options.until, CLOSED)} if nu > 0.49 else {}
        found |= packings(f"nu{nu:g}", min(options.seeds, 2), slow, (0.0,))
    return found


def regridded(options: argparse.Namespace) -> dict[str, Options]:
    """What forgetting stress at cell crossings does, at 2 m/s."""
    return packings("regridded", 1, {"speed": LID, "dt": 8e-6, "scheme": "regridded"}, (0.5,))


def shared_grid(options: argparse.Namespace) -> dict[str, Options]:
    """The published method, in steps of 0.5 us, with a third of the discs."""
    return {
        f"shared_grid_mu{friction:g}_r{cells}": {
            **resolved(cells),
            "friction": friction,
            "scheme": "nezamabadi2017",
            "speed": LID,
            "dt": 0.5e-6,
            "start": 0.55,
            "until": 0.85,
            "discs": max(options.discs // 3, 10),
        }
        for friction, cells in (*((0.0, cells) for cells in CELLS), (0.5, CELLS[0]))
    }


def fine(options: argparse.Namespace) -> dict[str, Options]:
    """The quasi-static packings on a finer grid."""
    seeds = options.seeds if options.fine_seeds is None else options.fine_seeds
    return packings("fine", seeds, {"speed": options.slow, "dt": None, **resolved(FINE)})


def resolved(cells: int) -> Options:
    """Cell and spacing for so many cells per mean radius [m]."""
    cell = RADIUS / cells
    return {"cell": cell, "spacing": SPACING * cell}


GROUPS = {
    "quasistatic": Group("quasi-static, uniaxial", quasistatic),
    "periodic": Group("quasi-static, isotropic", periodic),
    "lid": Group("other quasi-static lids", lids),
    "fast": Group("lid at 2 m/s", fast),
    "nu": Group("other Poisson's ratios", poisson),
    "regridded": Group("body grids rebuilt at every step", regridded),
    "shared_grid": Group("mode of Nezamabadi et al. (2017)", shared_grid),
    "fine": Group("quasi-static, uniaxial, R/h = 8", fine),
}
