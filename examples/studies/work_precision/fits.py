"""Laws of the error, fitted to the study's runs: the basis of `skmpm.suggest`.

    error = c n^-p + d s

n is R/h, R the radius of the smallest body, and s the length of a step: dt c / R, c the speed of pressure waves,
where bodies move freely, the displacement of the lid over R where it drives them. There is one law for each spacing
of points that pays: 0.74 h in contact, 0.5 h in collisions on fine grids and within bodies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from skmpm.material import wave_speed
from skmpm.preflight.suggest import LAWS, Law

from . import discs, speeds
from .parameters import BALANCED
from .results import LIDS, Found, Run, of_steps

Array = NDArray[np.float64]

SCENES = {"bending": "cantilever", "pressing": "hertz", "impact": "collision", "packing": "packing"}
SIZES = {"cantilever": 2.0 / np.sqrt(3.0), "packing": discs.SMALLEST / discs.MEAN}  # R of `suggest` over the scene's
STEERED = ("cells", "spacing", "pace")
COARSEST = 3.0  # R/h, on coarser grids errors follow no law
NEAR = 0.05  # spacings that count as the same [cells]
BEST = 1e-3  # errors below are those of the reference
STEEPEST = 2.0  # power: cells are bilinear


@dataclass(frozen=True)
class Fit:
    """A law and the runs it was fitted to."""

    law: Law
    runs: list[Run]
    scatter: float  # factor within which it holds, root mean square of logarithms
    worst: float  # the largest factor


def fits(found: Found) -> dict[str, list[Fit]]:
    """All laws, by kind of scene, as far as their runs are there."""
    free, driven = free_time(found), driven_time(found)
    each = {
        kind: [
            fitted(chosen(found, SCENES[kind], law.spacing), law.spacing, driven if kind == "packing" else free)
            for law in laws
        ]
        for kind, laws in LAWS.items()
    }
    return {kind: [fit for fit in both if fit is not None] for kind, both in each.items()}


def chosen(found: Found, scene: str, spacing: float) -> list[Run]:
    """Runs that differ from `balanced` in R/h, spacing and dt only, at about this spacing; one of equal ones."""
    runs = [run for run in found.runs.get(scene, {}).values() if np.isfinite(run.error) and run.error > BEST]
    runs = [run for run in runs if plain(run) and abs(run.setting["spacing"] - spacing) < NEAR]
    return list({tuple(run.setting[name] for name in STEERED): run for run in runs}.values())


def plain(run: Run) -> bool:
    """Whether nothing else differs; tolerances of `balanced` and below make no difference that shows."""
    names = {name for name, level in run.setting.items() if level != BALANCED[name]}
    looser = {name for name in names if name.endswith("_tol") and run.setting[name] > BALANCED["newton_tol"]}
    coarse = run.setting["cells"] < COARSEST
    return not coarse and {name for name in names if not name.endswith("_tol")} <= set(STEERED) and not looser


def resolution(run: Run) -> tuple[float, float]:
    """R/h and the length of a step."""
    n, step_control = SIZES.get(run.scene, 1.0) * run.setting["cells"], run.setting["pace"]
    if run.scene == "collision":
        return n, step_control * discs.COLLISION_DT * wave_speed(discs.LAWS["own"]) / discs.R
    if run.scene == "packing":
        return n, discs.stride(discs.RADII, 1.0 / discs.START - 1.0 / discs.END, run.cost["steps"])
    return n, discs.stride(speeds.RADII, speeds.STRAIN / speeds.REST, run.cost["steps"]) if run.scene in LIDS else 0.0


def free_time(found: Found) -> float:
    """Constant d of free motion, from all collisions at the default's spacing; nan of too few runs."""
    fit = fitted(chosen(found, "collision", BALANCED["spacing"]), BALANCED["spacing"])
    return float("nan") if fit is None else fit.law.time


def driven_time(found: Found) -> float:
    """Constant d of what is driven, from the lids: geometric mean of error over length of steps."""
    runs = [run for lid in LIDS for run in of_steps(found, lid) if run.error > BEST]
    return float(np.exp(np.mean([np.log(run.error / resolution(run)[1]) for run in runs]))) if runs else float("nan")


def fitted(runs: list[Run], spacing: float, time: float | None = None) -> Fit | None:
    """Least squares of logarithms; None of fewer runs than constants."""
    if len(runs) < 4 or (time is not None and np.isnan(time)):
        return None
    n, s = np.array([resolution(run) for run in runs]).T
    error = np.array([run.error for run in runs])

    def law(p: Array) -> Law:
        return Law(spacing, float(np.exp(p[0])), float(p[1]), float(np.exp(p[2])) if time is None else time)

    def off(p: Array) -> Array:
        return np.asarray(np.log(law(p)(n, s) / error))

    bounds = ([-6.0, 0.5, -6.0], [6.0, STEEPEST, 3.0])
    starts = [np.array([np.log(error.max() * 4.0**p), p, -1.0]) for p in (1.0, 1.9)]
    best = min((least_squares(off, x, bounds=bounds, loss="soft_l1") for x in starts), key=lambda t: t.cost)
    rest = off(best.x)
    return Fit(law(best.x), runs, *np.exp([np.sqrt(np.mean(rest**2)), np.abs(rest).max()]).tolist())
