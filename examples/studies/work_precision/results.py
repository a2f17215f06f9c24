"""Runs with their errors, Pareto fronts and slopes, by the rules of docs/studies/work_precision.md."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import skmpm
from skmpm.sweep import Member as Ran

from . import scenes, speeds
from .meter import SIZES, Meter
from .parameters import DEFAULT, LEVELS, PRESETS, Setting, beside, neighbours, one_at_a_time, resolutions, sample
from .study import Member, plan

Result = dict[str, Any]

SCENES = ("cantilever", "hertz", "collision", "packing")
LIDS = tuple(speeds.RUNS)
BOTH = tuple(scenes.ELEMENTS)  # scenes that finite elements run, too
MOST = 512  # of a sample that is looked for
MARGIN = 1.3  # in cost, from which on a setting beats another
INFLUENCE = 0.1  # slope below which a parameter counts as without influence
COSTS = tuple(Meter(skmpm.linear.default).cost())


@dataclass(frozen=True)
class Run:
    """A run of the study."""

    scene: str
    setting: Setting
    whys: frozenset[str]
    status: str
    cost: dict[str, float]
    errors: dict[str, float]  # by quantity, and the largest
    source: str = ""  # hash of the source of the library that made it

    @property
    def error(self) -> float:
        """The largest of its errors, infinite if it did not finish."""
        return self.errors.get("largest", float("inf"))

    @property
    def seconds(self) -> float:
        """Processor time."""
        return self.cost["seconds"]


def key(setting: Setting) -> str:
    """A setting as a dictionary's key."""
    return json.dumps(setting, sort_keys=True)


@dataclass(frozen=True)
class Found:
    """All runs that are there, by scene and setting."""

    runs: dict[str, dict[str, Run]]

    def at(self, scene: str, setting: Setting) -> Run | None:
        """The run of a setting on a scene, with what makes no difference there put to its default."""
        return self.runs.get(scene, {}).get(key(scenes.setting_on(scene, setting)))

    def why(self, scene: str, why: str) -> list[Run]:
        """Runs of one kind."""
        return [run for run in self.runs.get(scene, {}).values() if why in run.whys]

    def floor(self, scene: str) -> float:
        """Error of the run nearly as fine as the reference; 0 where the reference is exact or nothing was run."""
        return max((run.error for run in self.why(scene, "second") if np.isfinite(run.error)), default=0.0)


def load(study: Path) -> Found:
    """Read the study; scenes without their reference have no errors and are left out."""
    members: dict[str, dict[str, list[Member]]] = {}
    for member in plan(list(scenes.CASES), MOST):
        members.setdefault(member.scene, {}).setdefault(key(member.setting), []).append(member)
    ran: dict[str, dict[str, list[Result]]] = {}
    for found in skmpm.Sweep.read(study):
        if found.status in ("finished", "failed") and found.columns:
            scene, setting = found.parameters["scene"], key(found.parameters["setting"])
            ran.setdefault(scene, {}).setdefault(setting, []).append(result_of(found))
    return Found({scene: of_scene(scene, each, ran) for scene, each in members.items()})


def result_of(member: Ran) -> Result:
    """The setting of a run, how it ended, what it measured position by position, and its cost per position."""
    columns, scene = member.columns, member.parameters["scene"]
    case = scenes.CASES[scene]
    status = f"failed: {member.error}" if member.status == "failed" else str(columns["status"][-1])
    total = {name: columns[name].max() if name in SIZES else columns[name].sum() / case.positions for name in COSTS}
    result = {"scene": scene, "setting": member.parameters["setting"], "status": status}
    result |= {"cost": {name: float(value) for name, value in total.items()}}
    if status == "finished" and case.run is None:
        result["measured"] = [json.loads(text) for text in columns["measured"]]
    elif status == "finished":
        names = (*COSTS, "t", "status")
        result["measured"] = [{name: column.tolist() for name, column in columns.items() if name not in names}]
    return result | {"library": member.manifest["versions"]["source"][:12]}


def of_scene(scene: str, members: dict[str, list[Member]], ran: dict[str, dict[str, list[Result]]]) -> dict[str, Run]:
    """The runs of one scene by setting; of one that was run several times, the fastest."""
    mine, against, known = ran.get(scene, {}), scenes.CASES[scene].against or scene, None
    read = {name: min(mine[name], key=lambda result: result["cost"]["seconds"]) for name in members if name in mine}
    reference = scenes.CASES[against].reference
    if reference is not None:
        results = ran.get(against, {}).get(key(scenes.setting_on(against, reference)), [{}])
        if "measured" not in results[0]:
            return {}
        known = results[0]["measured"]
    return {name: run_of(result, frozenset(m.why for m in members[name]), known) for name, result in read.items()}


def run_of(result: Result, whys: frozenset[str], known: Any) -> Run:
    """A result with its errors."""
    measured = result.get("measured")
    errors = {} if measured is None else scenes.errors_of(result["scene"], measured, known)
    return Run(result["scene"], result["setting"], whys, result["status"], result["cost"], errors, result["library"])


def front(runs: list[Run]) -> list[Run]:
    """Runs that no other beats in both, error and time; by time."""
    best, found = float("inf"), []
    for run in sorted(runs, key=lambda r: (r.seconds, r.error)):
        if run.error < best:
            best = run.error
            found.append(run)
    return found


@dataclass(frozen=True)
class Beating:
    """A setting and the scenes on which it beats `balanced`, with the ratio of costs."""

    setting: Setting
    ratios: dict[str, float]
    iterations: dict[str, float]  # the same ratio of Newton iterations


def beating(found: Found) -> list[Beating]:
    """All settings that beat `balanced` somewhere, those first that do on most scenes."""
    settings = [*one_at_a_time(), *resolutions(), *sample(MOST), *PRESETS.values()]
    settings += [setting for preset in PRESETS.values() for setting in neighbours(preset)]
    each = []
    for setting in {key(s): s for s in settings}.values():
        ratios = {scene: r for scene in SCENES if (r := gain(found, scene, setting)) > MARGIN}
        each.append(Beating(setting, ratios, {scene: gain(found, scene, setting, "newton") for scene in ratios}))
    return sorted((b for b in each if b.ratios), key=lambda b: (-len(b.ratios), -max(b.ratios.values())))


def gain(found: Found, scene: str, setting: Setting, cost: str = "seconds") -> float:
    """Cost of `balanced` over that of a setting which errs no more; 0 if it errs more or was not run."""
    mine, balanced = found.at(scene, setting), found.at(scene, PRESETS["balanced"])
    if mine is None or balanced is None or mine.error > max(balanced.error, found.floor(scene)):
        return 0.0
    return balanced.cost[cost] / max(mine.cost[cost], 1e-12)


def slope(found: Found, scene: str, preset: str, parameter: str) -> float:
    """Change of ln(error) with ln(parameter) between neighbours of a preset; of `cells`, with h. nan if not run."""
    pair = beside(PRESETS[preset], parameter)
    runs = [found.at(scene, setting) for setting in pair]
    errors = [run.error if run is not None else float("nan") for run in runs]
    if not np.isfinite(errors).all() or min(errors) <= 0.0:
        return float("nan")
    sign = -1.0 if parameter == "cells" else 1.0
    return float(sign * np.log(errors[1] / errors[0]) / np.log(pair[1][parameter] / pair[0][parameter]))


def dial_runs(found: Found, scene: str, parameter: str) -> list[tuple[Any, Run]]:
    """Levels of a parameter around the default of the study that were run, and that make a difference on a scene."""
    levels = LEVELS[parameter] if parameter in scenes.CASES[scene].parameters else ()
    runs = [(level, found.at(scene, DEFAULT | {parameter: level})) for level in levels]
    seen = {id(run) for _, run in runs}
    return [(level, run) for level, run in runs if run is not None] if len(seen) > 1 else []


def of_steps(found: Found, scene: str) -> list[Run]:
    """The runs of a lid with steps of a length that is given."""
    return [run for run in found.why(scene, "speed") if not run.setting["chosen"]]


def cheapest(runs: list[Run], error: float) -> Run | None:
    """The cheapest run within an error."""
    return min((run for run in runs if run.error <= error), key=lambda run: run.seconds, default=None)


def codes(found: Found, scene: str) -> dict[str, list[Run]]:
    """The runs of a scene by skmpm, without references, and by finite elements of true and of larger mass."""
    mine, others = (list(found.runs.get(name, {}).values()) for name in (scene, f"elements, {scene}"))
    return {
        "skmpm": [run for run in mine if not run.whys & {"reference", "second", "perturbed"}],
        "elements": [run for run in others if run.setting["mass"] == 1.0],
        "more mass": [run for run in others if run.setting["mass"] > 1.0],
    }
