"""One member, carried to its end in its directory, from its checkpoint if there is one."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, NamedTuple

from skmpm.io import PARTIAL, load, save
from skmpm.linear.solver import one_thread
from skmpm.scene import State
from skmpm.sweep import directory
from skmpm.sweep.directory import RESERVED, TIME, SweepError, locked
from skmpm.sweep.records import Records
from skmpm.sweep.run import Row, Rows, Run, Value, checked, row_due

ATTEMPTS = 3  # of a member whose process is killed, as by a lack of memory
PATIENCE = 180.0  # [s] for a lock that a worker given up for dead holds; a lease of NFS is 90 s
FAILURE = "error.txt"

Build = Callable[..., Run | Row | Rows]


@dataclass(frozen=True)
class Task:
    """One member, as it is sent to a worker."""

    folder: Path
    parameters: dict[str, Any]
    sweep: str  # identifies the call of `sweep`
    command: tuple[str, ...]
    build: dict[str, str]  # name and source of `build`


class Outcome(NamedTuple):
    """How a member ended: "finished", "failed" or "interrupted"; and why it failed."""

    status: str
    error: str = ""


@dataclass(frozen=True)
class Worker:
    """What a member is given by the worker that runs it: threads, and functions that it calls after every step."""

    threads: int = 1  # among which bodies are divided, unless the scheme says so
    stopping: Callable[[], bool] = lambda: False
    report: Callable[[float], None] = lambda share: None


class Interrupted(BaseException):
    """Ends a member between two steps; no error, so that none handles it as one."""


def run_member(build: Build, task: Task, worker: Worker = Worker()) -> Outcome:
    """Run a member to its end, unless it has finished; its manifest says how it ended, as what is returned.

    SweepError if the directory is not there, is in use, or was made with other parameters or another version.
    """
    folder = task.folder
    if not folder.is_dir():
        raise SweepError(f"{folder} is not there; give a directory that all workers share, as out")
    with locked(folder, PATIENCE), one_thread():
        before = directory.read_manifest(folder)
        if before:
            directory.check_made_by(folder, before, task.parameters)
        if before.get("status") == "finished":
            return Outcome("finished")
        sessions = before.get("sessions", [])
        killed = sum(session.get("sweep") == task.sweep and "seconds" not in session for session in sessions)
        if killed == ATTEMPTS:
            outcome = Outcome("failed", f"its process ended {killed} times; was there enough memory?")
            directory.write_manifest(folder, before | outcome._asdict())
            return outcome
        return _run_session(build, task, sessions, worker)


def _run_session(build: Build, task: Task, earlier: list[dict[str, Any]], worker: Worker) -> Outcome:
    """Run a member from where it is, with the lock held; the manifest tells how that ended."""
    folder = task.folder
    session = {**directory.session(), "command": task.command, "sweep": task.sweep}
    about: dict[str, Any] = {
        "parameters": task.parameters,
        "build": task.build,
        "versions": directory.versions(),
        "status": "running",
        "error": "",
        "sessions": [*earlier, session],
    }
    directory.write_manifest(folder, about)
    for left in (folder / FAILURE, *folder.glob(f"{PARTIAL}*")):  # by a process killed while it wrote
        left.unlink(missing_ok=True)
    began, spent = perf_counter(), process_time()
    outcome = Outcome("finished")
    try:
        _carry_out(build, task, worker)
    except Interrupted:
        outcome = Outcome("interrupted")
    except Exception as error:
        outcome = Outcome("failed", described(error))
        (folder / FAILURE).write_text(traceback.format_exc())
    session["seconds"] = round(perf_counter() - began, 3)
    session["processor_seconds"] = round(process_time() - spent, 3)
    directory.write_manifest(folder, about | outcome._asdict())
    return outcome


def described(error: BaseException) -> str:
    """An error as a text: its type and what it says."""
    return f"{type(error).__name__}: {error}"


def _carry_out(build: Build, task: Task, worker: Worker) -> None:
    """Build and run; a table that `build` returns is written as it is."""
    made = build(**task.parameters)
    reserved = RESERVED | task.parameters.keys()
    if isinstance(made, Run):
        _simulate(made, task, reserved, worker)
        return
    if not isinstance(made, Mapping | list | tuple):
        raise TypeError(
            f"build returned a {type(made).__name__}; expected a Run, or rows of the table: a dict or several"
        )
    rows = [made] if isinstance(made, Mapping) else made
    if not rows or not all(rows):
        raise ValueError("build returned no rows, or an empty one, which no table would show; raise what is wrong")
    records = Records(task.folder)
    for row in rows:
        records.add(checked(row, reserved))
    records.commit(None)


def _simulate(run: Run, task: Task, reserved: frozenset[str], worker: Worker) -> None:
    """Carry a run to its end, stage by stage; whatever ends it, the last state and its rows are written.

    The state at the end of a stage is read back before the next one is made of it, so that an interruption makes no
    difference.
    """
    folder = task.folder
    records, state = Records.opened(folder)
    for stage in count(1):
        end = folder / f"end_{stage}.checkpoint"
        if not end.exists():
            if run.scheme.threads is None:
                run = replace(run, scheme=replace(run.scheme, threads=worker.threads))
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
    seen = state is None or (bool(row) and row["t"] == state.t)  # else it is a row of the stage before
    ended = state is not None and bool(row) and seen and _stops(run, row)
    states = () if ended else run.simulate(run.scene, until=run.until, dt=run.dt, scheme=run.scheme, start=start)
    state, saved = start, perf_counter()
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
        if not path.exists() and wanted(_Columns(row)):
            save(path, state)
    records.add(row)
    return _stops(run, row)


def _stops(run: Run, row: Row) -> bool:
    return run.stop is not None and bool(run.stop(_Columns(row)))


class _Columns(dict[str, Value]):
    """A row as `stop` and `keep` see it: a missing column is named, with those that there are."""

    def __missing__(self, name: str) -> Value:
        raise KeyError(f"Run: stop or keep asks for a column {name!r}; the columns are {', '.join(self)}")
