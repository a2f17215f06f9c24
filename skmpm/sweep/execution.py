"""What a worker does: carry one member to its end in its directory, from its checkpoint if there is one."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import chain, count
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

from skmpm.io import PARTIAL, load, save
from skmpm.linear import one_thread
from skmpm.scene import State
from skmpm.sweep import manifest
from skmpm.sweep.errors import Interrupted, SweepError
from skmpm.sweep.lock import locked
from skmpm.sweep.parameters import RESERVED, TIME
from skmpm.sweep.records import Records
from skmpm.sweep.run import Row, Rows, Run, Value, checked, row_due

Build = Callable[..., Run | Row | Rows]
FAILURE = "error.txt"


@dataclass(frozen=True)
class Task:
    """One member, as it is sent to a worker."""

    folder: Path
    parameters: dict[str, Any]
    sweep: str  # identifies the sweep, see `lock`
    command: tuple[str, ...]
    build: dict[str, str]  # name and source of `build`


@dataclass(frozen=True)
class Outcome:
    """How a member ended: finished, failed or interrupted."""

    task: Task
    status: str
    error: str = ""


@dataclass(frozen=True)
class Worker:
    """What a member may ask of the process that runs it."""

    threads: int = 1  # among which bodies are divided, unless the scheme says so
    patience: float = 0.0  # [s] to wait for a lock of the same sweep
    stopping: Callable[[], bool] = lambda: False
    report: Callable[[float], None] = lambda share: None


def run_member(build: Build, task: Task, worker: Worker) -> Outcome:
    """Run a member to its end, and say how it ended; only `Interrupted` passes, where nothing has begun."""
    folder = task.folder
    try:
        if not folder.is_dir():
            raise SweepError(f"{folder} is not there; give a directory that all workers share, as out")
        with locked(folder, task.sweep, worker.patience), one_thread():
            return _locked(build, task, worker)
    except Exception as error:
        return Outcome(task, "failed", _message(error))


def _locked(build: Build, task: Task, worker: Worker) -> Outcome:
    """The same, with the lock held: the manifest tells how it ended."""
    folder, before = task.folder, manifest.read(task.folder)
    if before is not None:
        manifest.check(folder, before, task.parameters)
        if before["status"] == "finished":
            return Outcome(task, "finished")
    about: dict[str, Any] = {
        "parameters": task.parameters,
        "build": task.build,
        "versions": manifest.versions(),
        "status": "running",
        "error": "",
        "sessions": [*(before or {}).get("sessions", []), manifest.session(list(task.command))],
    }
    manifest.write(folder, about)
    unfinished = chain.from_iterable(folder.glob(f"{begin}*") for begin in (manifest.PARTIAL, PARTIAL))
    for left in (folder / FAILURE, *unfinished):  # by a process killed while it wrote
        left.unlink(missing_ok=True)
    began, spent = perf_counter(), process_time()
    status, text = "finished", ""
    try:
        _carry_out(build, task, worker)
    except Interrupted:
        status = "interrupted"
    except Exception as error:
        status, text = "failed", _message(error)
        (folder / FAILURE).write_text(traceback.format_exc())
    about["sessions"][-1] |= {
        "seconds": round(perf_counter() - began, 3),
        "processor_seconds": round(process_time() - spent, 3),
    }
    manifest.write(folder, about | {"status": status, "error": text})
    return Outcome(task, status, text)


def _message(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"


def _carry_out(build: Build, task: Task, worker: Worker) -> None:
    """Build and run; a table that `build` returns is written as it is."""
    made = build(**task.parameters)
    reserved = RESERVED | task.parameters.keys()
    if isinstance(made, Run):
        _simulate(made, task.folder, reserved, worker)
        return
    if not isinstance(made, Mapping | list | tuple):
        raise TypeError(
            f"build returned a {type(made).__name__}; expected a Run, or rows of the table: a dict or several"
        )
    rows = [made] if isinstance(made, Mapping) else made
    if not rows or not all(rows):
        raise ValueError("build returned no rows, or an empty one, which no table would show; raise what is wrong")
    records = Records(task.folder, [], (0, b""))
    for row in rows:
        records.add(checked(row, reserved))
    records.commit(None)


def _simulate(run: Run, folder: Path, reserved: frozenset[str], worker: Worker) -> None:
    """Carry a run to its end, stage by stage; whatever ends it, the last state and its rows are written.

    The state at the end of a stage is read back before the next one is made of it, so that an interruption makes no
    difference.
    """
    records, state = Records.opened(folder)
    for stage in count(1):
        end = folder / f"end_{stage}.checkpoint"
        if not end.exists():
            state = _advance(run, records, state, reserved, worker)
            if run.then is None:
                return
            if state is None:
                raise ValueError("a stage without steps has no state that the next one could begin with")
            save(end, state)
        elif run.then is None:
            raise SweepError(f"{folder} has run a stage more than build has now; give another out, or delete it")
        ended = load(end)
        run = run.then(ended)
        if run.start is None or run.start.t < ended.t:
            raise ValueError(f"a stage begins before t = {ended.t:g} s, the end of the one before; give its start")
        state = None if state is None or state.t <= run.start.t else state


def _advance(
    run: Run, records: Records, state: State | None, reserved: frozenset[str], worker: Worker
) -> State | None:
    """One stage, from a state within it or, if that is None, from its start; the last state."""
    row, start = records.last_row(), run.start if state is None else state
    scheme = run.scheme if run.scheme.threads is not None else replace(run.scheme, threads=worker.threads)
    saved = perf_counter()
    seen = state is None or (row is not None and row["t"] == state.t)  # else it is a row of the stage before
    ended = state is not None and row is not None and seen and _stops(run, row)
    states = () if ended else run.simulate(run.scene, until=run.until, dt=run.dt, scheme=scheme, start=start)
    state = start
    try:
        for new in states:
            seen = row_due(run.every, new)
            if seen:
                ended = _observe(run, records, new, reserved)
            state = new
            worker.report(state.t / run.until)
            if ended:
                break
            if worker.stopping():
                raise Interrupted
            if perf_counter() - saved > run.checkpoint:
                records.commit(state)
                saved = perf_counter()
        if state is not None and not seen:
            _observe(run, records, state, reserved)
    finally:
        if state is not None:
            records.commit(state)
    return state


def _observe(run: Run, records: Records, state: State, reserved: frozenset[str]) -> bool:
    """Add the row of a state, keep the state if it is to be kept, and say whether the run ends with it."""
    row = {TIME: state.t, **checked(run.observe(run.scene, state), reserved | {TIME})}
    for name, wanted in run.keep.items():
        path = records.folder / f"{name}.checkpoint"
        if not path.exists() and wanted(_Columns(row, f"keep[{name!r}]")):
            save(path, state)
    records.add(row)
    return _stops(run, row)


def _stops(run: Run, row: Row) -> bool:
    return run.stop is not None and bool(run.stop(_Columns(row, "stop")))


class _Columns(dict[str, Value]):
    """A row as `stop` and `keep` see it: a missing column is named, with those that there are."""

    def __init__(self, row: Row, asked_by: str) -> None:
        super().__init__(row)
        self._asked_by = asked_by

    def __missing__(self, name: str) -> Value:
        raise KeyError(f"Run: {self._asked_by} asks for a column {name!r}; the columns are {', '.join(self)}")
