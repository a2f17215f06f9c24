"""The work-precision study: what an error costs, parameter by parameter, on four scenes.

    export OPENBLAS_NUM_THREADS=1
    python -m examples.studies.work_precision --out out/work_precision  # all of it, and the page, which says how long
    python -m examples.studies.work_precision --scenes hertz --runs 16   # a scene, a small sample
    python -m examples.studies.work_precision page --study out/work_precision  # the page from what has been run

Every run is a member of `skmpm.sweep` with a directory in --out: its setting, and a table of what it measured and
cost. What is there is not run again, so an interrupted study goes on where it was, and a larger --runs adds to the
sample. A run that fails or takes too long says so in its table. Scenes are defined in `scenes.py`, parameters in
`parameters.py`.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import skmpm
from skmpm.sweep import Member as Ran

from .. import pages, sweeps
from . import competitor, scenes
from .meter import Meter, TooLong
from .parameters import DEFAULT, PRESETS, Setting, linear_of, neighbours, one_at_a_time, resolutions, sample

SHARE = {"packing": 0.5}  # of the sample, where runs are long
LATE = ("sample", "law", "slope", "second")  # what comes last there
SHORT, REPEATS = 0.5, 2  # runs of less processor time [s] are repeated, for the clock is not that good
KINDS = ("reference", "preset", "one", "perturbed", "speed", *LATE)


@dataclass(frozen=True)
class Member:
    """One run of the study."""

    scene: str
    setting: Setting
    why: str  # one of `KINDS`
    again: int = 0  # how often it was run before, for a shorter time

    @property
    def name(self) -> str:
        """Of its directory."""
        digest = hashlib.sha256(json.dumps(self.setting, sort_keys=True).encode()).hexdigest()[:12]
        return f"{self.scene.replace(' ', '_')}_{digest}{f'_{self.again}' if self.again else ''}"

    @property
    def parameters(self) -> dict[str, Any]:
        """Of `build`."""
        return {"scene": self.scene, "setting": self.setting} | ({"again": self.again} if self.again else {})


def plan(names: list[str], runs: int) -> list[Member]:
    """All runs of some scenes; a run that is wanted for several reasons is listed for each."""
    members = []
    for name in names:
        case = scenes.CASES[name]
        known = [("reference", case.reference), ("second", case.second)]
        members += [Member(name, scenes.setting_on(name, s), why) for why, s in known if s is not None]
        for why, settings in wanted(name, runs):
            members += [Member(name, s, why) for s in dict_unique(name, settings)]
    return sorted(members, key=lambda m: m.scene in SHARE and m.why in LATE)


def wanted(name: str, runs: int) -> list[tuple[str, list[Setting]]]:
    """Settings to run on a scene, and why."""
    case = scenes.CASES[name]
    if case.settings:
        return [("speed", list(case.settings))]
    drawn = sample(max(1, round(runs * SHARE.get(name, 1.0)))) if runs else []
    perturbed = [DEFAULT | {"perturbed": size} for size in (1e-9, 1e-4)] if "perturbed" in case.parameters else []
    slopes = [setting for preset in PRESETS.values() for setting in neighbours(preset)]
    return [
        ("preset", list(PRESETS.values())),
        ("one", one_at_a_time()),
        ("perturbed", perturbed),
        ("sample", drawn),
        ("law", resolutions()),
        ("slope", slopes),
    ]


def dict_unique(name: str, settings: list[Setting]) -> list[Setting]:
    """The settings as far as they make a difference on a scene, each once."""
    return list({json.dumps(s, sort_keys=True): s for s in (scenes.setting_on(name, s) for s in settings)}.values())


def build(scene: str, setting: Setting, again: int = 0, *, kept: Path) -> skmpm.Run | list[dict[str, Any]]:
    """A member of the sweep: a long run, or rows of what was measured at the positions and what it cost."""
    warm()
    case, meter = scenes.CASES[scene], Meter(linear_of(setting))
    fine = [scenes.setting_on(scene, s) for s in (case.reference, case.second) if s is not None]
    limit = 0.0 if setting in fine else case.limit
    if case.run is None:
        return measure(scene, setting, limit)
    run = case.run(setting, meter, kept)
    return replace(run, observe=partial(observe, run.observe, meter, limit), stop=is_too_long)


def observe(
    look: Callable[..., dict[str, Any]], meter: Meter, limit: float, scene: skmpm.Scene, state: skmpm.State
) -> dict[str, Any]:
    """A row of a long run, with what it cost since the row before."""
    status = f"too long: more than {limit:g} s" if limit and meter.seconds > limit else "finished"
    return {"status": status, **look(scene, state), **meter.taken()}


def is_too_long(row: Any) -> bool:
    """Whether a long run is to end here."""
    return bool(row["status"] != "finished")


def measure(scene: str, setting: Setting, limit: float) -> list[dict[str, Any]]:
    """Rows, a position each: what was measured, as JSON, and what it cost; or one that says how the run ended."""
    meter = Meter(linear_of(setting), limit)
    try:
        found = scenes.measured(scene, setting, meter)
    except TooLong as stopped:
        return [{"status": f"too long: {stopped}", "measured": "", **meter.cost()}]
    except (skmpm.StepFailed, skmpm.SceneError) as failure:
        return [{"status": f"failed: {failure}", "measured": "", **meter.cost()}]
    if meter.seconds < SHORT:
        repeated = [scenes.measured(scene, setting, Meter(linear_of(setting))) for _ in range(REPEATS)]
        found = min([found, *repeated], key=lambda each: sum(one["cost"]["seconds"] for one in each))
    return [{"status": "finished", "measured": json.dumps(one["found"]), **one["cost"]} for one in found]


@cache
def warm() -> None:
    """Let a new process do everything once, so that its first run costs what others do."""
    logging.getLogger("skmpm").setLevel(logging.ERROR)
    collide = scenes.CASES["hertz"].measure
    assert collide is not None
    collide(DEFAULT | {"cells": 2.5}, 0, Meter(skmpm.linear.default))
    competitor.packing(competitor.DEFAULT | {"mesh": 2}, 0, Meter(skmpm.linear.default))


def main(options: argparse.Namespace) -> None:
    """Run what is missing, print what was run, and write the page."""
    from . import page

    members: dict[str, Member] = {}
    for member in plan(options.scenes, options.runs):
        if member.why in (options.only or KINDS):
            members.setdefault(member.name, member)
    there = {name for name in members if (options.out / name).exists()}
    if options.retime:
        members = {again.name: again for again in (repeated(members[name], options.out) for name in there)}
    parameters = {name: member.parameters for name, member in members.items()}
    found = sweeps.run(partial(build, kept=options.out.resolve() / "kept"), parameters, options)
    for ran in found:
        if ran.name not in there:
            print(described(members[ran.name], ran))
    page.write(options.out, options.docs)


def described(member: Member, ran: Ran) -> str:
    """A line on what a member was, cost, and how it ended."""
    about = {name: value for name, value in member.setting.items() if value != DEFAULT[name]}
    ended = ran.error or (ran.columns["status"][-1] if ran.columns else ran.status)
    return f"{member.scene} {member.why} {about}: {sum(ran.columns.get('seconds', [])):.2f} s, {ended[:60]}"


def repeated(member: Member, out: Path) -> Member:
    """The same once more, of a name that nothing in the directory has."""
    while (out / member.name).exists():
        member = replace(member, again=member.again + 1)
    return member


def parser() -> argparse.ArgumentParser:
    """Options; the defaults are the study of `docs/studies/work_precision.md`."""
    options = pages.parser(__doc__, "work_precision.md")
    options.add_argument("--scenes", nargs="+", choices=list(scenes.CASES), default=list(scenes.CASES))
    options.add_argument("--runs", type=int, default=96, help="size of the sample; half of it on the packing")
    options.add_argument("--only", nargs="*", choices=KINDS, default=[], help="kinds of runs; all, if none is named")
    options.add_argument("--retime", action="store_true", help="run what is there again and keep the shorter times")
    options.add_argument("--out", type=Path, default=Path("out/work_precision"), help="directory of the results")
    sweeps.add_processes(options)
    return options
