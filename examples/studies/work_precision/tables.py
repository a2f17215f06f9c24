"""The tables of docs/studies/work_precision.md."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np

from skmpm.preflight.suggest import LAWS

from . import competitor, fits, results, scenes
from .parameters import BALANCED, DEFAULT, PRESETS, SLOPES, Setting
from .results import (
    BOTH,
    INFLUENCE,
    MARGIN,
    SCENES,
    Beating,
    Found,
    Run,
    cheapest,
    dial_runs,
    slope,
)

COUNTS = ("steps", "newton", "factorisations", "contact", "products", "unknowns", "points", "work")
PRICED = (0.2, 0.1, 0.05, 0.02, 0.01)  # errors that are looked up
SHOWN = 15  # settings that beat `balanced`
TIMED = 0.5  # processor time of `balanced` [s] from which on `fast` is judged
Line = tuple[str, ...]


def table(head: Line, lines: list[Line]) -> str:
    """A markdown table."""
    return "\n".join("| " + " | ".join(row) + " |" for row in [head, ("---",) * len(head), *lines]) + "\n"


def number(value: float, digits: int = 2) -> str:
    """A number, or what stands for none."""
    if np.isnan(value):
        return "-"
    return f"{value:.{digits}g}" if np.isfinite(value) else "failed"


def percent(run: Run | None) -> str:
    """An error in per cent, or how the run ended."""
    if run is None:
        return "-"
    return number(100.0 * run.error) if np.isfinite(run.error) else run.status.split(":")[0]


def about(setting: Setting, than: Setting = DEFAULT) -> str:
    """What differs from another setting."""
    texts = {name: f"{v:g}" if isinstance(v, float) else str(v) for name, v in setting.items() if v != than[name]}
    return ", ".join(f"{name} {text}" for name, text in texts.items()) or "as the default"


def verdict(good: list[bool | None]) -> str:
    """Met, missed, or not known yet."""
    if any(g is False for g in good):
        return "**missed**"
    return "not run" if any(g is None for g in good) else "met"


def ran(found: Found) -> str:
    """How much of the study is there."""
    lines = []
    for scene in scenes.CASES:
        runs = list(found.runs.get(scene, {}).values())
        ends = [sum(r.status.startswith(word) for r in runs) for word in ("finished", "failed", "too long")]
        sample = len(found.why(scene, "sample"))
        lines.append((scene, str(len(runs)), str(sample), *map(str, ends), number(100.0 * found.floor(scene))))
    return table(("scene", "runs", "of the sample", "finished", "failed", "too long", "floor %"), lines)


def presets(found: Found) -> str:
    """Error and cost of the presets."""
    lines, good = [], {"fast": [], "accurate": []}  # type: tuple[list[Line], dict[str, list[bool | None]]]
    for scene in SCENES:
        runs = {name: found.at(scene, setting) for name, setting in PRESETS.items()}
        fast, balanced, accurate = runs.values()
        cells = [f"{percent(r)} % / {number(r.seconds) if r else '-'} s" for r in runs.values()]
        if balanced is None or fast is None or accurate is None:
            lines.append((scene, *cells, "-", "-"))
            good["fast"].append(None)
            good["accurate"].append(None)
            continue
        cheaper, better = balanced.seconds / fast.seconds, accurate.error / balanced.error
        if balanced.seconds > TIMED:
            good["fast"].append(cheaper >= 3.0)
        good["accurate"].append(better <= 1.0 / 3.0 or accurate.error <= found.floor(scene))
        lines.append((scene, *cells, number(cheaper), number(better)))
    head = (
        "scene",
        *(f"{name}: error / cost" for name in PRESETS),
        "cost balanced / fast",
        "error accurate / balanced",
    )
    goals = [
        (f"`fast` costs a third of `balanced` or less where that takes over {TIMED:g} s", verdict(good["fast"])),
        (
            "`accurate` has a third of its error or less, or less than the floor, on every scene",
            verdict(good["accurate"]),
        ),
    ]
    settings = [(name, about(setting)) for name, setting in PRESETS.items()]
    return "\n".join([table(("preset", "setting"), settings), table(head, lines), table(("goal", ""), goals)])


def prices(found: Found) -> str:
    """The cheapest run within each error, and what it costs beside `balanced`."""
    lines = []
    for scene in SCENES:
        balanced = found.at(scene, PRESETS["balanced"])
        for error in PRICED if balanced else ():
            runs = [r for r in found.runs[scene].values() if r.error <= error and "reference" not in r.whys]
            best = min(runs, key=lambda r: r.seconds, default=None)
            if best is not None and balanced is not None:
                cost = f"{number(best.seconds)} s", number(best.seconds / balanced.seconds)
                lines.append((scene, f"{100.0 * error:g}", *cost, percent(best), about(best.setting)))
    return table(("scene", "error at most %", "cost", "over `balanced`", "its error %", "setting"), lines)


def counts(found: Found) -> str:
    """What the presets cost on every machine."""
    lines = []
    for scene in SCENES:
        for name, setting in PRESETS.items():
            run = found.at(scene, setting)
            if run is not None:
                lines.append((scene, name, *(number(run.cost[count], 3) for count in COUNTS)))
    return table(("scene", "preset", *COUNTS), lines)


def beaters(found: Found, settings: list[Beating]) -> str:
    """Settings that beat `balanced`."""
    several = [b for b in settings if len(b.ratios) > 1]
    good: list[bool | None] = [None if not found.why(s, "sample") else True for s in SCENES] + [not several]
    by_scene = [(scene, str(sum(scene in b.ratios for b in settings))) for scene in SCENES]
    goal = [(f"no setting beats `balanced` by more than {MARGIN} on more than one scene", verdict(good))]
    lines = [(about(b.setting), *(ratio(b, scene) for scene in SCENES)) for b in settings[:SHOWN]]
    return "\n".join(
        [
            table(("goal", ""), goal),
            f"{len(several)} settings do on more than one scene; by scene:\n",
            table(("scene", "settings that beat it"), by_scene),
            "Those that do on most scenes, and by most; ratios of cost, in brackets of Newton iterations:\n",
            table(("setting", *SCENES), lines),
        ]
    )


def ratio(one: Beating, scene: str) -> str:
    """By how much a setting is cheaper."""
    return f"{number(one.ratios[scene])} ({number(one.iterations[scene])})" if scene in one.ratios else "-"


def parameters(found: Found) -> str:
    """Every level of every parameter around the default: error, and cost over that of the default."""
    lines = []
    for parameter in DEFAULT:
        if parameter == "perturbed":
            continue
        runs = {scene: dict(dial_runs(found, scene, parameter)) for scene in SCENES}
        for level in dict.fromkeys(level for each in runs.values() for level in each):
            cells = [relative(each.get(level), found.at(s, DEFAULT)) for s, each in runs.items()]
            name = f"{level:g}" if isinstance(level, float) else str(level)
            lines.append((parameter, name, *cells))
    return table(("parameter", "level", *SCENES), lines)


def relative(run: Run | None, balanced: Run | None) -> str:
    """Error in per cent, and cost over that of `balanced`."""
    if run is None or balanced is None:
        return ""
    if not np.isfinite(run.error):
        return run.status.split(":")[0]
    return f"{percent(run)} % / {number(run.seconds / balanced.seconds)}"


def limits(found: Found) -> str:
    """Slopes at the presets, and what has the largest."""
    lines = []
    for scene in SCENES:
        for preset in PRESETS:
            slopes = {parameter: slope(found, scene, preset, parameter) for parameter in SLOPES}
            known = {parameter: abs(s) for parameter, s in slopes.items() if np.isfinite(s) and abs(s) > INFLUENCE}
            most = max(known, key=lambda d: known[d]) if known else "-"
            lines.append(
                (
                    scene,
                    preset,
                    *(number(0.0 if abs(s) < 0.005 else s) for s in slopes.values()),
                    {"cells": "h"}.get(most, most),
                )
            )
    return table(("scene", "preset", "h", "dt", "spacing", "contact_tol", "steepest"), lines)


def laws(found: Found) -> str:
    """Fitted constants beside those of `skmpm.suggest`."""
    lines = []
    for kind, each in fits.fits(found).items():
        for fit in each:
            used = next(law for law in LAWS[kind] if law.spacing == fit.law.spacing)
            terms = [
                f"{number(a)} ({number(b)})" for a, b in zip(astuple(fit.law)[1:], astuple(used)[1:], strict=True)
            ]
            counts = str(len(fit.runs)), number(fit.scatter), number(fit.worst)
            lines.append((kind, fits.SCENES[kind], f"{used.spacing:g}", *terms, *counts))
    head = ("law", "scene", "spacing [cells]", "c", "p", "d", "runs", "holds within a factor (rms)", "worst")
    return table(head, lines)


def codes(found: Found) -> str:
    """The cheapest runs of this library and of explicit finite elements, and what they cost over the first."""
    lines = []
    for scene in BOTH:
        for error in PRICED:
            mine, *others = (cheapest(runs, error) for runs in results.codes(found, scene).values())
            cells = [priced(mine, BALANCED), *(priced(run, competitor.DEFAULT) for run in others)]
            ratios = [number(run.seconds / mine.seconds) if run and mine else "-" for run in others]
            lines.append((scene, f"{100.0 * error:g}", *cells, *ratios))
    head = ("scene", "error at most %", "skmpm", "finite elements", "with more mass", "over skmpm", "with more mass")
    return table(head, lines)


def priced(run: Run | None, than: Setting) -> str:
    """Cost, error and setting."""
    return f"{number(run.seconds)} s, {percent(run)} %, {about(run.setting, than)}" if run else "-"
