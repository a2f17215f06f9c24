"""The tables of docs/studies/work_precision.md."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np

from skmpm.preflight.suggest import LAWS

from ..pages import table
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
CHEAPEST = ("cost [s]", "error [%]", "setting")  # of a run
PRICED = (0.2, 0.1, 0.05, 0.02, 0.01)  # errors that are looked up
TIMED = 0.5  # processor time of `balanced` [s] from which on `fast` is judged
Line = tuple[str, ...]


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


def ran(found: Found) -> list[Line]:
    """How much of the study is there, the header first."""
    lines = [("scene", "runs", "of the sample", "finished", "failed", "too long", "floor [%]")]
    for scene in scenes.CASES:
        runs = list(found.runs.get(scene, {}).values())
        ends = [sum(r.status.startswith(word) for r in runs) for word in ("finished", "failed", "too long")]
        sample = len(found.why(scene, "sample"))
        lines.append((scene, str(len(runs)), str(sample), *map(str, ends), number(100.0 * found.floor(scene))))
    return lines


def presets(found: Found) -> str:
    """Error and cost of the presets."""
    lines, good = [], {"fast": [], "accurate": []}  # type: tuple[list[Line], dict[str, list[bool | None]]]
    for scene in SCENES:
        runs = [found.at(scene, setting) for setting in PRESETS.values()]
        costs = (number(run.seconds) if run else "-" for run in runs)
        lines.append((scene, *map(percent, runs), *costs))
        fast, balanced, accurate = runs
        if balanced is None or fast is None or accurate is None:
            good["fast"].append(None)
            good["accurate"].append(None)
            continue
        if balanced.seconds > TIMED:
            good["fast"].append(balanced.seconds / fast.seconds >= 3.0)
        good["accurate"].append(accurate.error / balanced.error <= 1.0 / 3.0 or accurate.error <= found.floor(scene))
    head = ("scene", *(f"{name} [%]" for name in PRESETS), *(f"{name} [s]" for name in PRESETS))
    goals = (
        f"- `fast` costs a third of `balanced` or less where that takes over {TIMED:g} s: {verdict(good['fast'])}.\n"
        "- `accurate` has a third of its error or less, or less than the floor, on every scene:"
        f" {verdict(good['accurate'])}.\n"
    )
    return f"{table(head, lines)}\n\n{goals}"


def prices(found: Found) -> list[Line]:
    """The cheapest run within each error, and what it costs beside `balanced`; the header first."""
    lines: list[Line] = [("scene", "error at most [%]", "cost [s]", "over balanced", "its error [%]", "setting")]
    for scene in SCENES:
        balanced = found.at(scene, PRESETS["balanced"])
        for error in PRICED if balanced else ():
            best = affordable(found, scene, error)
            if best is not None and balanced is not None:
                cost = number(best.seconds), number(best.seconds / balanced.seconds)
                lines.append((scene, f"{100.0 * error:g}", *cost, percent(best), about(best.setting)))
    return lines


def affordable(found: Found, scene: str, error: float) -> Run | None:
    """The cheapest run within an error, references left out."""
    return cheapest([r for r in found.runs.get(scene, {}).values() if "reference" not in r.whys], error)


def priced(found: Found) -> str:
    """Cost of the cheapest run within each error."""
    lines = []
    for scene in SCENES:
        best = [affordable(found, scene, error) for error in PRICED]
        lines.append((scene, *(number(run.seconds) if run else "-" for run in best)))
    return table(("scene", *(f"{100.0 * error:g} % [s]" for error in PRICED)), lines)


def counts(found: Found) -> list[Line]:
    """What the presets cost on every machine, the header first."""
    lines: list[Line] = [("scene", "preset", *COUNTS)]
    for scene in SCENES:
        for name, setting in PRESETS.items():
            run = found.at(scene, setting)
            if run is not None:
                lines.append((scene, name, *(number(run.cost[count], 3) for count in COUNTS)))
    return lines


def beaters(found: Found, settings: list[Beating]) -> str:
    """Whether settings beat `balanced`, and how many on each scene."""
    several = [b for b in settings if len(b.ratios) > 1]
    good: list[bool | None] = [None if not found.why(s, "sample") else True for s in SCENES] + [not several]
    goal = f"No setting beats `balanced` by more than {MARGIN} on more than one scene: {verdict(good)}."
    by_scene = {scene: sum(scene in b.ratios for b in settings) for scene in SCENES}
    alone = ", ".join(f"{count} on `{scene}`" for scene, count in by_scene.items() if count) or "none"
    return f"{goal} {len(several)} do. Settings that beat it on a scene: {alone}."


def beating(settings: list[Beating]) -> list[Line]:
    """The settings that beat `balanced`, the header first: ratios of cost, and of Newton iterations."""
    head = ("setting", *SCENES, *(f"{scene}, Newton iterations" for scene in SCENES))
    return [
        head,
        *(
            (about(b.setting), *(number(ratio.get(s, np.nan)) for ratio in (b.ratios, b.iterations) for s in SCENES))
            for b in settings
        ),
    ]


def parameters(found: Found) -> list[Line]:
    """Every level of every parameter around the default: error, and cost over that of the default; a header first."""
    lines: list[Line] = [("parameter", "level", *(f"{s}, {what}" for s in SCENES for what in ("error [%]", "cost")))]
    for parameter in DEFAULT:
        if parameter == "perturbed":
            continue
        runs = {scene: dict(dial_runs(found, scene, parameter)) for scene in SCENES}
        for level in dict.fromkeys(level for each in runs.values() for level in each):
            cells = [cell for s, each in runs.items() for cell in relative(each.get(level), found.at(s, DEFAULT))]
            name = f"{level:g}" if isinstance(level, float) else str(level)
            lines.append((parameter, name, *cells))
    return lines


def relative(run: Run | None, balanced: Run | None) -> Line:
    """Error in per cent, and cost over that of `balanced`."""
    if run is None or balanced is None:
        return "", ""
    return percent(run), number(run.seconds / balanced.seconds) if np.isfinite(run.error) else ""


def slopes(found: Found) -> list[Line]:
    """Slopes at the presets, and what has the largest, the header first."""
    lines: list[Line] = [("scene", "preset", "h", "dt", "spacing", "contact_tol", "steepest")]
    for scene in SCENES:
        for preset in PRESETS:
            by_parameter = {parameter: slope(found, scene, preset, parameter) for parameter in SLOPES}
            known = {
                parameter: abs(s) for parameter, s in by_parameter.items() if np.isfinite(s) and abs(s) > INFLUENCE
            }
            most = max(known, key=lambda d: known[d]) if known else "-"
            lines.append(
                (
                    scene,
                    preset,
                    *(number(0.0 if abs(s) < 0.005 else s) for s in by_parameter.values()),
                    {"cells": "h"}.get(most, most),
                )
            )
    return lines


def limits(lines: list[Line]) -> str:
    """What has the largest slope, by scene and preset."""
    steepest = {line[:2]: line[-1] for line in lines[1:]}
    return table(("scene", *PRESETS), [(scene, *(steepest[scene, preset] for preset in PRESETS)) for scene in SCENES])


def laws(found: Found) -> str:
    """Fitted constants beside those of `skmpm.suggest`."""
    lines = []
    for kind, each in fits.fits(found).items():
        for fit in each:
            used = next(law for law in LAWS[kind] if law.spacing == fit.law.spacing)
            constants = (number(value) for law in (fit.law, used) for value in astuple(law)[1:])
            lines.append((kind, f"{used.spacing:g}", *constants, number(fit.scatter), number(fit.worst)))
    names = ("c", "p", "d")
    head = ("law", "spacing [h]", *names, *(f"{name} used" for name in names), "rms factor", "worst factor")
    return table(head, lines)


def codes(found: Found) -> list[Line]:
    """The cheapest runs of this library and of explicit finite elements, and what they cost over the first."""
    which = ("skmpm", "elements", "elements with more mass")
    head = ("scene", "error at most [%]", *(f"{code}, {what}" for code in which for what in CHEAPEST))
    lines: list[Line] = [(*head, "elements over skmpm", "with more mass over skmpm")]
    for scene in BOTH:
        for error in PRICED:
            runs = [cheapest(each, error) for each in results.codes(found, scene).values()]
            than = (BALANCED, competitor.DEFAULT, competitor.DEFAULT)
            cells = (cell for run, default in zip(runs, than, strict=True) for cell in price(run, default))
            lines.append((scene, f"{100.0 * error:g}", *cells, *over(runs)))
    return lines


def code_ratios(found: Found) -> str:
    """Cost of finite elements over that of this library, by error."""
    lines = []
    for scene in BOTH:
        ratios = [over([cheapest(runs, e) for runs in results.codes(found, scene).values()]) for e in PRICED]
        names = (scene, f"{scene}, more mass")
        for name, each in zip(names, zip(*ratios, strict=True), strict=True):
            if name == scene or set(each) != {"-"}:
                lines.append((name, *each))
    return table(("scene", *(f"{100.0 * error:g} %" for error in PRICED)), lines)


def over(runs: list[Run | None]) -> Line:
    """Cost of the others over that of the first."""
    mine, *others = runs
    return tuple(number(run.seconds / mine.seconds) if run and mine else "-" for run in others)


def price(run: Run | None, than: Setting) -> Line:
    """Cost, error and setting."""
    return (number(run.seconds), percent(run), about(run.setting, than)) if run else ("-", "-", "-")
