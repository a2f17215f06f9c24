"""The work-precision study: what an error costs, parameter by parameter, on four scenes.

    export OPENBLAS_NUM_THREADS=1
    python -m examples.studies.work_precision --out out/work_precision  # all of it; its page says how long it takes
    python -m examples.studies.work_precision --scenes hertz --runs 16   # a scene, a small sample
    python -m examples.studies.work_precision page --study out/work_precision  # the page from what has been run

Every run leaves a json file in --out: its setting, what it measured, what it cost. What is there is not run again, so
an interrupted study goes on where it was, and a larger --runs adds to the sample. A run that fails or takes too long
says so in its file. Scenes are defined in `tradeoff_scenes.py`, parameters in `parameters.py`.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import logging
import os
import platform
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import skmpm

from . import scenes
from .meter import Meter, TooLong, limited
from .parameters import DEFAULT, PRESETS, Setting, linear_of, neighbours, one_at_a_time, resolutions, sample

PACKAGES = ("skmpm", "numpy", "scipy", "scikit-fem", "pyamg")
SHARE = {"packing": 0.5}  # of the sample, where runs are long
LATE = ("sample", "law", "slope", "second")  # what comes last there
SIZES = ("unknowns", "points", "overlap")  # the largest of the positions, not their mean
SHORT, REPEATS = 0.5, 2  # runs of less processor time [s] are repeated, for the clock is not that good
KINDS = ("reference", "preset", "one", "perturbed", "speed", *LATE)


@dataclass(frozen=True)
class Member:
    """One run of the study."""

    scene: str
    setting: Setting
    why: str  # one of `KINDS`
    limit: float  # processor time [s]; 0: none

    @property
    def name(self) -> str:
        """Of its file."""
        return hashlib.sha256(json.dumps(self.setting, sort_keys=True).encode()).hexdigest()[:12]


def plan(names: list[str], runs: int) -> list[Member]:
    """All runs of some scenes; a run that is wanted for several reasons is listed for each."""
    members = []
    for name in names:
        case = scenes.CASES[name]
        known = [("reference", case.reference), ("second", case.second)]
        members += [Member(name, scenes.setting_on(name, s), why, 0.0) for why, s in known if s is not None]
        for why, settings in wanted(name, runs):
            members += [Member(name, s, why, case.limit) for s in dict_unique(name, settings)]
    return sorted(members, key=lambda m: m.scene in SHARE and m.why in LATE)


def wanted(name: str, runs: int) -> list[tuple[str, list[Setting]]]:
    """Settings to run on a scene, and why."""
    case = scenes.CASES[name]
    if case.settings:
        return [("speed", list(case.settings))]
    drawn = sample(max(1, round(runs * SHARE.get(name, 1.0)))) if runs else []
    if not case.inertia:  # explicit steps take a thousand times as long there, as one at a time shows
        drawn = [setting | {"explicit": False} for setting in drawn]
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


def measure(member: Member, out: Path) -> dict[str, Any]:
    """Run one member; what it measured and cost, or how it ended."""
    meter = Meter(linear_of(member.setting))
    folder = out / "kept" / f"{member.scene}_{member.name}" if member.why in ("reference", "second") else None
    if member.why == "speed" or member.scene.startswith("lid"):
        folder = out / "kept"
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    result: dict[str, Any] = {"scene": member.scene, "setting": member.setting, "status": "finished"}
    try:
        with limited(member.limit):
            result["measured"] = scenes.run(member.scene, member.setting, meter, folder)
    except TooLong as stopped:
        result["status"] = f"too long: {stopped}"
    except (skmpm.StepFailed, skmpm.SceneError) as failure:
        result["status"] = f"failed: {failure}"
    cost = meter.cost()
    if result["status"] == "finished" and cost["seconds"] < SHORT:
        cost["seconds"] = min(cost["seconds"], *(again(member) for _ in range(REPEATS)))
    positions = scenes.CASES[member.scene].positions
    mean = {name: value if name in SIZES else value / positions for name, value in cost.items()}
    return result | {"cost": mean, "library": library()}


def again(member: Member) -> float:
    """Processor time of the same run once more."""
    meter = Meter(linear_of(member.setting))
    scenes.run(member.scene, member.setting, meter)
    return meter.seconds


def warm() -> None:
    """Let a new process do everything once, so that its first run costs what others do."""
    logging.getLogger("skmpm").setLevel(logging.ERROR)
    scenes.CASES["hertz"].run(DEFAULT | {"cells": 2.5}, 0, Meter(skmpm.linear.default), None)


def library() -> str:
    """A hash of the library's source."""
    root = Path(skmpm.__file__).parent
    return hashlib.sha256(b"".join(p.read_bytes() for p in sorted(root.rglob("*.py")))).hexdigest()[:12]


def file_of(member: Member, out: Path) -> Path:
    """Where the result of a member is."""
    return out / member.scene.replace(" ", "_") / f"{member.name}.json"


def main(options: argparse.Namespace) -> None:
    """Run what is missing."""
    members = [m for m in plan(options.scenes, options.runs) if m.why in (options.only or KINDS)]
    first: dict[Path, Member] = {}
    for member in members:
        first.setdefault(file_of(member, options.out), member)
    left = [(path, member) for path, member in first.items() if path.exists() == options.retime]
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "manifest.json").write_text(json.dumps(manifest(), indent=1))
    print(f"{len(left)} runs to do", flush=True)
    with ProcessPoolExecutor(options.processes, mp_context=get_context("spawn"), initializer=warm) as pool:
        waiting = [(path, member, pool.submit(measure, member, options.out)) for path, member in left]
        for k, (path, member, future) in enumerate(waiting, start=1):
            result = faster(future.result(), path)
            path.parent.mkdir(parents=True, exist_ok=True)
            partial = path.with_suffix(".part")
            partial.write_text(json.dumps(result))
            partial.replace(path)
            about = {n: v for n, v in member.setting.items() if v != DEFAULT[n]}
            spent, ended = result["cost"]["seconds"], result["status"][:60]
            print(f"{k}/{len(left)} {member.scene} {member.why} {about}: {spent:.2f} s, {ended}", flush=True)


def faster(result: dict[str, Any], path: Path) -> dict[str, Any]:
    """The result with the smaller of its time and that of an earlier run."""
    if path.exists():
        before = json.loads(path.read_text())["cost"]["seconds"]
        result["cost"]["seconds"] = min(result["cost"]["seconds"], before)
    return result


def manifest() -> dict[str, Any]:
    """Versions of what the study ran with."""
    packages = {name: version(name) for name in PACKAGES}
    return {"python": platform.python_version(), "machine": platform.machine(), "library": library(), **packages}


def parser() -> argparse.ArgumentParser:
    """Options; the defaults are the study of `docs/studies/work_precision.md`."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--scenes", nargs="+", choices=list(scenes.CASES), default=list(scenes.CASES))
    options.add_argument("--runs", type=int, default=96, help="size of the sample; half of it on the packing")
    options.add_argument("--only", nargs="*", choices=KINDS, default=[], help="kinds of runs; all, if none is named")
    options.add_argument("--retime", action="store_true", help="run what is there again and keep the shorter times")
    options.add_argument("--processes", type=int, default=os.cpu_count(), help="runs at a time")
    options.add_argument("--out", type=Path, default=Path("out/work_precision"), help="directory of the results")
    return options
