"""The figures of docs/studies/work_precision.md."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from .parameters import COURANT, PRESETS
from .results import LIDS, SCENES, Found, dial_runs, front, of_steps

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.ticker import LogFormatterSciNotation

MARKS = {"fast": "v", "balanced": "o", "accurate": "^"}
STEERED = {"cells": "C0", "spacing": "C1", "pace": "C2"}
STEPS = (("implicit", False, False, "o-"), ("explicit", True, False, "x--"), ("chosen", False, True, "k*"))
LIMIT = 3.0  # errors above are drawn there


def fronts(found: Found, path: Path) -> None:
    """Error against cost: all runs, what no other beats, and the presets."""
    fig, axes = plt.subplots(2, 2, figsize=(11, 8), layout="constrained")
    for axis, scene in zip(axes.ravel(), SCENES, strict=True):
        every = found.runs.get(scene, {}).values()
        runs = [r for r in every if np.isfinite(r.error) and not r.whys & {"reference", "second"}]
        for why, colour, size in (("sample", "0.75", 9), ("one", "C0", 14), ("slope", "C4", 9)):
            chosen = [r for r in runs if why in r.whys and not r.setting["explicit"]]
            axis.scatter(*of(chosen), s=size, color=colour, label=LABELS[why], zorder=2)
        axis.scatter(*of([r for r in runs if r.setting["explicit"]]), s=22, color="C3", marker="x", label="explicit")
        best = front(runs)
        axis.step(*of(best), where="post", color="k", lw=0.8, label="front", zorder=1)
        for name, setting in PRESETS.items():
            run = found.at(scene, setting)
            if run is not None and np.isfinite(run.error):
                axis.plot(*of([run]), MARKS[name], color="C1", ms=10, mec="k", label=name, zorder=3)
        finish(axis, scene, found.floor(scene))
    axes[0, 0].legend(fontsize=7)
    fig.savefig(path, dpi=80)
    plt.close(fig)


LABELS = {"sample": "sample", "one": "one parameter", "slope": "beside presets"}


def of(runs: list[Any]) -> tuple[list[float], list[float]]:
    """Cost and error."""
    return [r.seconds for r in runs], [min(r.error, LIMIT) for r in runs]


def finish(axis: Any, scene: str, floor: float) -> None:
    """Scales, labels, the floor."""
    axis.set(title=scene, xlabel="processor time [s]", ylabel="relative error")
    if np.isfinite(axis.dataLim.minpos).all():  # something was run
        axis.set(xscale="log", yscale="log")
        axis.xaxis.set_minor_formatter(LogFormatterSciNotation(minor_thresholds=(0.9, 0.3)))
    axis.grid(which="both", lw=0.2)
    if floor > 0.1 * axis.dataLim.y0:  # else it would take most of the picture
        axis.axhline(floor, color="0.5", ls=":", lw=1.0)


def parameters(found: Found, path: Path) -> None:
    """Error and cost along the three parameters of resolution, around the default."""
    fig, axes = plt.subplots(1, len(SCENES), figsize=(16, 3.8), layout="constrained")
    for axis, scene in zip(axes, SCENES, strict=True):
        for parameter, colour in STEERED.items():
            runs = [(level, r) for level, r in dial_runs(found, scene, parameter) if np.isfinite(r.error)]
            axis.plot(*of([r for _, r in runs]), ".-", color=colour, label=parameter, lw=1.0)
            for level, r in (*runs[:1], *runs[1:][-1:]):
                axis.annotate(f"{level:g}", (r.seconds, min(r.error, LIMIT)), fontsize=7, color=colour)
        finish(axis, scene, found.floor(scene))
        axis.legend(fontsize=7)
    fig.savefig(path, dpi=80)
    plt.close(fig)


def speeds(found: Found, path: Path) -> None:
    """Error against cost of implicit and explicit steps, by the speed of the lid."""
    fig, axes = plt.subplots(1, len(LIDS), figsize=(16, 3.8), layout="constrained", sharey=True)
    for axis, scene in zip(axes, LIDS, strict=True):
        for label, explicit, chosen, style in STEPS:
            runs = [r for r in of_steps(found, scene, explicit, chosen) if np.isfinite(r.error)]
            runs.sort(key=lambda r: r.cost["steps"])
            axis.plot(*of(runs), style, lw=1.0, label=label)
            for r in runs if explicit else []:
                axis.annotate(f"{COURANT[r.setting['pace']]:g} h/c", (r.seconds, min(r.error, LIMIT)), fontsize=7)
        finish(axis, f"{scene} m/s", 0.0)
        axis.legend(fontsize=7)
    fig.savefig(path, dpi=80)
    plt.close(fig)
