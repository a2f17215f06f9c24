"""The parameters of the study: their levels, the presets, one parameter at a time, and a sample over all of them.

A *setting* is a dictionary with a level for every parameter. Levels are relative to the scene: `cells` per radius,
`spacing` of points in cells, `pace` in the scene's own time step, so that one setting means the same on every scene.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.stats import qmc

import skmpm
from skmpm.contact import point_to_curve, shared_grid

Setting = dict[str, Any]

NEVER = float("inf")
DEFAULT: Setting = {  # what runs differ from; `Scheme()` with a tighter `newton_tol`
    "cells": 5.0,  # R/h
    "spacing": 0.74,  # of material points [cells]
    "pace": 1.0,  # time step, in that of the scene
    "chosen": False,  # by the library instead (dt=None)
    "theta": 1.0,
    "anchor": NEVER,
    "contact": "outlines",
    "material": "own",  # or "other": linear for finite strain and the other way round
    "mean_dilatation": None,  # by Poisson's ratio
    "ghost": 0.005,
    "fitted": True,
    "newton_tol": 1e-6,
    "contact_tol": 1e-6,
    "linear": "default",
    "walls": "planes",  # or "points": rigid bodies of material points
    "perturbed": 0.0,  # of where bodies start, at random [R]; it shows how far results are determined
}
LEVELS: dict[str, tuple[Any, ...]] = {  # one at a time, the default among them
    "cells": (2.5, 3.2, 4.0, 5.0, 6.3, 8.0, 10.0, 12.5),
    "spacing": (1.0, 0.74, 0.5, 0.35, 0.25),
    "pace": (4.0, 2.0, 1.0, 0.5, 0.25, 0.125),
    "chosen": (False, True),
    "theta": (1.0, 0.75, 0.5),
    "anchor": (NEVER, 0.2, 0.0),
    "contact": ("outlines", "shared_grid"),
    "material": ("own", "other"),
    "mean_dilatation": (None, False, True),
    "ghost": (0.0, 0.001, 0.005, 0.02, 0.1),
    "fitted": (True, False),
    "newton_tol": (1e-8, 1e-6, 1e-4, 1e-3, 1e-2),
    "contact_tol": (1e-8, 1e-6, 1e-4, 1e-2),
    "linear": ("default", "amg", "direct"),
    "walls": ("planes", "points"),
}
SAMPLED = LEVELS | {  # in the sample; what is there more than once is drawn more often
    "cells": (3.2, 4.0, 5.0, 6.3, 8.0),
    "pace": (4.0, 2.0, 1.0, 0.5, 0.25),
    "chosen": (False,) * 4 + (True,),
    "anchor": (NEVER, NEVER, 0.2, 0.0),
    "contact": ("outlines",) * 5 + ("shared_grid",),
    "material": ("own",) * 4 + ("other",),
    "ghost": (0.001, 0.005, 0.02, 0.1),
    "newton_tol": (1e-6, 1e-4, 1e-2),
    "contact_tol": (1e-6, 1e-4, 1e-2),
    "mean_dilatation": (None, None, False),
    "linear": ("default",) * 4 + ("amg", "direct"),
    "walls": ("planes", "planes", "points"),
}
BALANCED: Setting = DEFAULT | {"newton_tol": 1e-3}
PRESETS: dict[str, Setting] = {
    "fast": DEFAULT | {"cells": 3.2, "pace": 4.0, "newton_tol": 1e-2},
    "balanced": BALANCED,
    "accurate": DEFAULT | {"cells": 10.0, "spacing": 0.5, "pace": 0.25},
}
LAW_SPACINGS, LAW_CELLS = (0.74, 0.5), (3.2, 4.0, 5.0, 6.3, 8.0, 10.0)  # what laws are fitted to
SLOPES = {"cells": 0.8, "pace": 2.0, "spacing": 1.4, "contact_tol": 10.0}  # factors to both sides of each preset
CONTACTS = {"outlines": point_to_curve, "shared_grid": shared_grid}
SEED = 8  # of the sample


def consistent(setting: Setting) -> Setting:
    """The setting, with what others ask for: shared nodes need body grids rebuilt at every step."""
    forced = {"anchor": 0.0} if setting["contact"] == "shared_grid" else {}
    return setting | forced


def scheme_of(setting: Setting, *, inertia: bool, solver: skmpm.linear.Linear | None = None) -> skmpm.Scheme:
    """The scheme of a setting; `solver` instead of its own, to count what it does."""
    return skmpm.Scheme(
        theta=setting["theta"] if inertia else 1.0,
        anchor=setting["anchor"],
        contact=CONTACTS[setting["contact"]],
        ghost=setting["ghost"],
        moment_fitting=setting["fitted"],
        mean_dilatation=setting["mean_dilatation"],
        inertia=inertia,
        newton_tol=setting["newton_tol"],
        contact_tol=setting["contact_tol"],
        gap_tol=max(skmpm.Scheme().gap_tol, setting["contact_tol"]),
        linear=solver or linear_of(setting),
    )


def linear_of(setting: Setting) -> skmpm.linear.Linear:
    """The linear solver of a setting."""
    solver: skmpm.linear.Linear = getattr(skmpm.linear, setting.get("linear", "default"))
    return solver


def effective(setting: Setting, matters: frozenset[str], *, inertia: bool) -> Setting:
    """The setting with what makes no difference on a scene put to its default; `matters` lists its parameters."""
    idle = set(DEFAULT) - matters
    idle |= {"theta", "chosen"} if not inertia else {"pace"} if setting["chosen"] else set()
    found = consistent(setting | {name: DEFAULT[name] for name in idle})
    return found if inertia else found | {"pace": min(found["pace"], 1.0)}  # one step a load, or several


def one_at_a_time() -> list[Setting]:
    """Every level of every parameter, all others at their default."""
    found = [DEFAULT | {name: level} for name, levels in LEVELS.items() for level in levels]
    return [consistent(setting) for setting in found]


def neighbours(preset: Setting) -> list[Setting]:
    """What the slopes at a preset are measured from: four parameters, each a step to both sides."""
    return [setting for name in SLOPES for setting in beside(preset, name)]


def beside(preset: Setting, name: str) -> list[Setting]:
    """A step of a parameter to both sides of a preset."""
    return [preset | {name: float(f"{preset[name] * step:.3g}")} for step in (1.0 / SLOPES[name], SLOPES[name])]


def resolutions() -> list[Setting]:
    """What laws of the error are fitted to."""
    return [BALANCED | {"spacing": spacing, "cells": cells} for spacing in LAW_SPACINGS for cells in LAW_CELLS]


def sample(runs: int) -> list[Setting]:
    """Settings over all parameters at once: scrambled Sobol sequence; a larger sample begins with a smaller."""
    points = qmc.Sobol(len(SAMPLED), rng=np.random.default_rng(SEED)).random_base2(
        int(np.ceil(np.log2(max(runs, 2))))
    )
    found = []
    for point in points[:runs]:
        drawn = {name: levels[int(u * len(levels))] for u, (name, levels) in zip(point, SAMPLED.items(), strict=True)}
        found.append(consistent(DEFAULT | drawn))
    return found
