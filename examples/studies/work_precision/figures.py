"""The figures of docs/studies/work_precision.md."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import LogFormatterSciNotation

from ..pages import picture
from . import results
from .parameters import PRESETS
from .results import BOTH, SCENES, Found, dial_runs, front

MARKS = {"fast": "v", "balanced": "o", "accurate": "^"}
STEERED = {"cells": "C0", "spacing": "C1", "pace": "C2"}
LIMIT = 3.0  # errors above are drawn there


def fronts(found: Found, path: Path) -> None:
    """Error against cost: all runs, what no other beats, and the presets."""
    fig, axes = plt.subplots(2, 2, figsize=(11, 8), layout="constrained")
    for axis, scene in zip(axes.ravel(), SCENES, strict=True):
        every = found.runs.get(scene, {}).values()
        runs = [r for r in every if np.isfinite(r.error) and not r.whys & {"reference", "second"}]
        for why, colour, size in (("sample", "0.75", 9), ("one", "C0", 14), ("slope", "C4", 9)):
            chosen = [r for r in runs if why in r.whys]
            axis.scatter(*of(chosen), s=size, color=colour, label=LABELS[why], zorder=2)
        best = front(runs)
        axis.step(*of(best), where="post", color="k", lw=0.8, label="front", zorder=1)
        for name, setting in PRESETS.items():
            run = found.at(scene, setting)
            if run is not None and np.isfinite(run.error):
                axis.plot(*of([run]), MARKS[name], color="C1", ms=10, mec="k", label=name, zorder=3)
        finish(axis, scene, found.floor(scene))
    axes[0, 0].legend(fontsize=7)
    picture(fig, path, 80)


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
    picture(fig, path, 80)


def codes(found: Found, path: Path) -> None:
    """Error against cost of this library and of explicit finite elements."""
    fig, axes = plt.subplots(1, len(BOTH), figsize=(18, 3.8), layout="constrained", sharey=True)
    for axis, scene in zip(axes, BOTH, strict=True):
        for (name, runs), style in zip(results.codes(found, scene).items(), ("C0o", "C3x", "C1+"), strict=True):
            known = [run for run in runs if np.isfinite(run.error)]
            axis.plot(*of(known), style, ms=4, label=name)
            axis.step(*of(front(known)), style[:2], where="post", lw=1.0)
        finish(axis, f"{scene}{' m/s' * ('squeeze' in scene)}", found.floor(scene))
        axis.legend(fontsize=7)
    picture(fig, path, 80)
