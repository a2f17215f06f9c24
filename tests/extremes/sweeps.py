"""Vary parameters over their range: `python tests/extremes/sweeps.py [parameter ...] [--processes n]`, default all.

Each setting is run on the scenes and kept in docs/studies/stability/<parameter>.csv; what is there is not run again,
unless `--fresh` deletes it first.
Then docs/studies/stability.md gets its table, a file of failures and one map per parameter: `sweeps.py draw` does
only that.
"""

from __future__ import annotations

import argparse
import json
import logging
import signal
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from time import process_time

import numpy as np
from checks import Outcome, examine
from published import difference
from scenes import SCENES, Case, Parameters, crush, gap_of
from settings import ALL, COLUMNS, KEPT, LIMIT, SWEEPS, WORST, Setting, columns, read, write

import skmpm
from skmpm.sweep.directory import library

PHYSICS = (
    "nu",
    "stiffness_ratio",
    "density_ratio",
    "friction",
    "closing",
    "solid_fraction",
    "bodies",
    "shape",
    "seed",
)


def case_of(name: str, setting: Setting) -> Case:
    """The scene of a setting."""
    return (SCENES | {"crush": crush})[name](Parameters(**setting.parameters))


def limited(case: Case, seconds: int, **options: int) -> Outcome:
    """Examine a case with `options`; "too long" when it has not ended after so much processor time."""

    def stop(*_):
        raise TimeoutError

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        return examine(case, **options)
    except TimeoutError:
        return Outcome(kind="too long", message=f"not done within {seconds} s")
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def finer(case: Case) -> Case:
    """The same physics with half the time step and half the cell (a squeeze: 5/7 of it), at most the defaults'."""
    d, usual, share = case.parameters, Parameters(), 0.5 if case.name == "collision" else 5.0 / 7.0
    cells = max(d.cells, usual.cells) / share
    step = 0.5 * min(d.dt_c_h / d.cells, usual.dt_c_h / usual.cells)
    fine = Parameters(
        **{name: getattr(d, name) for name in PHYSICS},
        gap=gap_of(d),
        cells=cells,
        dt_c_h=step * cells,
        mean_dilatation=d.nu > 0.49,
        steps=100_000,
    )
    until = min(case.until, case.until if case.name == "squeeze" else 20.0 * d.length / d.speed)
    return replace(SCENES[case.name](fine), until=until)


def reference(case: Case) -> dict[str, float]:
    """What a case should end with: free fall in closed form, else of a finer run, kept in references.json."""
    d = case.parameters
    if case.name == "fall":
        time = case.until * d.speed / d.length
        return {"velocity x": 0.0, "velocity y": -0.1 * time, "spin": 0.25}
    fine = finer(case)
    key = f"{fine.name} {fine.until:.9g} {fine.parameters}"
    path = KEPT / "references.json"
    known = json.loads(path.read_text()) if path.exists() else {}
    if not known.get(key):
        outcome = limited(fine, 4 * LIMIT)
        known = json.loads(path.read_text()) if path.exists() else {}
        known[key] = outcome.ends if outcome.kind == "right" else {}
        path.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n")
    return known[key]


def measure(name: str, setting: Setting) -> dict[str, str]:
    """One row of a table: a scene at a setting. Only a fall is compared at once: it needs no other run."""
    start, case, error = process_time(), None, np.nan
    try:
        case = case_of(name, setting)
    except ValueError as refused:  # SceneError among them
        kind = "SceneError" if isinstance(refused, skmpm.SceneError) else "wrong"
        outcome = Outcome(kind=kind, message=str(refused))
    else:
        outcome = limited(case, setting.limit)
    seconds = process_time() - start
    if name == "fall" and outcome.kind == "right":
        error = difference(outcome.ends, reference(case), name)
    row = {
        "setting": setting.label,
        "scene": name,
        "kind": outcome.kind,
        "steps": str(outcome.steps),
        "retries": str(outcome.retries),
        "newton": f"{outcome.newton:.2f}",
        "reached": f"{outcome.reached:.3g}",
        "error": f"{error:.2g}",
        "seconds": f"{seconds:.2g}",
    }
    row |= {key: f"{outcome.worst.get(key, np.nan):.2g}" for key in WORST}
    return row | {
        "library": version(),
        "violations": "; ".join(outcome.violations),
        "message": outcome.message,
        "ends": json.dumps(outcome.ends),
    }


def version() -> str:
    """Version and source of the library."""
    names = library()
    return f"skmpm {names['skmpm']}, source {names['source'][:12]}"


def sweep(parameter: str, again: Sequence[str] = ()) -> None:
    """Run what is missing of a parameter, and what ended in one of the ways named."""
    rows = [row for row in read(parameter) if row["kind"] not in again]
    done = {(row["setting"], row["scene"]) for row in rows}
    for setting, name in columns(parameter):
        if (setting.label, name) not in done:
            rows.append(measure(name, setting))
            show(parameter, rows[-1])
            write(parameter, rows)


def compare(parameter: str, scenes: Sequence[str] = ALL) -> None:
    """Find the errors of what ended right, where there is a reference to find."""
    rows = {(row["setting"], row["scene"]): row for row in read(parameter)}
    for setting, name in columns(parameter):
        row = rows.get((setting.label, name))
        if not (row and name in scenes and setting.compared and row["kind"] == "right" and row["error"] == "nan"):
            continue
        case = case_of(name, setting)
        row["error"] = f"{difference(json.loads(row['ends']), reference(case), name):.2g}"
        show(parameter, row)
        write(parameter, list(rows.values()))


def show(parameter: str, row: dict[str, str]) -> None:
    """One line on the terminal."""
    print(parameter, *(row[c] for c in COLUMNS), row["violations"], row["message"], flush=True)  # noqa: T201


def turn(parameter: str, again: Sequence[str], *, errors: bool) -> None:
    """All of one parameter."""
    sweep(parameter, again)
    if errors:
        compare(parameter)


def main() -> None:
    """Run the parameters named, then draw all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parameters", nargs="*", help=f"of {', '.join(SWEEPS)}; or draw")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--again", nargs="*", default=(), help="repeat runs with this outcome: wrong, StepFailed ...")
    parser.add_argument("--no-errors", action="store_true", help="leave out the finer runs")
    parser.add_argument("--fresh", action="store_true", help="delete first what is there of the parameters")
    given = parser.parse_args()
    KEPT.mkdir(exist_ok=True)
    logging.getLogger("skmpm").setLevel(logging.ERROR)  # retries are counted
    wanted = [d for d in given.parameters or SWEEPS if d != "draw"]
    for path in [KEPT / f"{d}.csv" for d in wanted if given.fresh]:
        path.unlink(missing_ok=True)
    if given.fresh and set(wanted) == set(SWEEPS):
        (KEPT / "references.json").unlink(missing_ok=True)
    work = partial(turn, again=given.again, errors=not given.no_errors)
    if given.processes == 1:
        for parameter in wanted:
            work(parameter)
    else:
        with ProcessPoolExecutor(given.processes) as processes:
            list(processes.map(work, wanted))
    from maps import page  # needs matplotlib

    page()


if __name__ == "__main__":
    main()
