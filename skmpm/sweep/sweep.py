"""`sweep`: run the members of an ensemble to their ends."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterable, Iterator, Mapping
from multiprocessing import current_process
from pathlib import Path
from time import perf_counter
from typing import Any
from uuid import uuid4

from skmpm.run import exit_at_sigterm
from skmpm.sweep import manifest
from skmpm.sweep.errors import SweepError
from skmpm.sweep.execution import Build, Outcome, Task
from skmpm.sweep.lock import check_free
from skmpm.sweep.parameters import check_names, checked_name, directory, plain
from skmpm.sweep.pickling import pickled
from skmpm.sweep.processes import Event, in_processes
from skmpm.sweep.results import Sweep, read_member

WIDTH = 110  # characters; the line before is overwritten

_log = logging.getLogger("skmpm")


def sweep(
    build: Build,
    members: Iterable[Mapping[str, Any]] | Mapping[str, Mapping[str, Any]],
    *,
    out: str | Path,
    client: Any = None,
    processes: int | None = None,
    progress: bool = False,
) -> Sweep:
    """Run every member of an ensemble to its end, in processes of this machine or on a Dask cluster.

    ``build(**member)`` returns a `Run`: the scene, the end, what to observe. It is called where the member runs. It
    may also return the table itself, a row (dict of numbers and texts) or several, where a member is no single
    simulation; such a member is done at once, without checkpoints.

    Each member has a directory in `out`, named after its parameters unless `members` gives a name, with
    ``manifest.json`` (parameters, versions, command, times), ``table.csv`` and ``last.checkpoint``. Called again, a
    sweep skips members that have finished and goes on with the others from their checkpoints, those that failed
    included. Rows are written together with the checkpoint they belong to: whenever and however a run is ended, the
    table is at last that of a run that was not, to the bit. What SIGTERM or Ctrl-C ends writes checkpoints first.

    A member that fails does not stop the others; `Sweep.failed` and the logger "skmpm" name it and its error. One
    whose process is killed goes on from its checkpoint in another, three times at most.

    Parameters
    ----------
    build : function of the parameters of a member. It is pickled, by cloudpickle if that is installed; without it,
        the function is one of a module, and a script calls `sweep` below ``if __name__ == "__main__":``
    members : dicts of parameters: numbers, texts, None, lists and dicts of these; or a dict of such dicts, by the
        names of their directories
    out : directory of the results, created if needed; of a cluster, one that all its workers share
    client : `distributed.Client`, on whose workers the members run (extra ``cluster``); None: on this machine
    processes : on this machine, how many members run at a time; None: as many as the process may use cores. BLAS uses
        one thread in each, and the bodies of a scene are divided among the cores that are left
    progress : show on a terminal or in a notebook how many members have finished, how far the others are, and the ETA

    Raises
    ------
    SweepError
        before anything runs: if two members are the same, if a parameter is of another type or named ``member``,
        ``finished`` or ``t``, as columns of the table are, if `build` cannot be pickled, if a directory was made with
        other parameters or another version of the library, or is in use
    """
    if getattr(current_process(), "_inheriting", False):
        raise SweepError("sweep is called by a script that a worker process imports; call it below"
                         " `if __name__ == '__main__':`, or install cloudpickle")  # fmt: skip
    if processes is not None and processes < 1:
        raise ValueError(f"sweep: processes = {processes}; give a number of at least 1, or None for all cores")
    tasks, function = _tasks(build, members, Path(out).resolve()), pickled(build)
    left = _left(tasks)
    ended: dict[Path, Outcome] = {}
    with exit_at_sigterm(wanted=True):
        events = _events(function, left, client, processes) if left else iter(())
        bar = _Bar(len(tasks), len(tasks) - len(left), shown=progress)
        try:
            for event in events:
                bar.show(event)
                if isinstance(event, Outcome):
                    ended[event.task.folder] = event
                    _report(event, len(tasks) - len(left) + len(ended), len(tasks))
        finally:
            getattr(events, "close", lambda: None)()
            bar.end()
    return Sweep(tuple(_result(task, ended.get(task.folder)) for task in tasks))


def _tasks(
    build: Build, members: Iterable[Mapping[str, Any]] | Mapping[str, Mapping[str, Any]], out: Path
) -> list[Task]:
    """A task for each member, in their order; SweepError if two are the same."""
    about = uuid4().hex, (sys.executable, *sys.argv), manifest.source_of(build)
    tasks: dict[str, Task] = {}
    named = members.items() if isinstance(members, Mapping) else ((None, member) for member in members)
    for given, member in named:
        parameters = plain(member)
        check_names(parameters)
        name = directory(parameters) if given is None else checked_name(given)
        if name.casefold() in tasks:  # which some file systems do not tell apart
            raise SweepError(f"two members have the directory {name}: their parameters are the same; give each once")
        tasks[name.casefold()] = Task(out / name, parameters, *about)
    return list(tasks.values())


def _left(tasks: list[Task]) -> list[Task]:
    """The tasks that have not finished; their directories are made."""
    left, other = [], 0
    for task in tasks:
        task.folder.mkdir(parents=True, exist_ok=True)
        about = manifest.read(task.folder)
        if about is not None:
            manifest.check(task.folder, about, task.parameters)
            sources = {about.get("build", {}).get("source"), task.build["source"]}
            other += len(sources) == 2 and all(sources)  # there is none of what was typed in
        if about is None or about["status"] != "finished":
            check_free(task.folder)
            left.append(task)
    if other:
        _log.warning(
            "sweep: build has changed since %d of the members were run; what is in their directories stays as it is."
            " Delete them, or give another out, to run them again",
            other,
        )
    return left


def _events(build: bytes, tasks: list[Task], client: Any, processes: int | None) -> Iterator[Event]:
    if client is None:
        return in_processes(build, tasks, processes)
    from skmpm.sweep.cluster import on_client  # dask is an extra

    return on_client(client, build, tasks)


def _report(outcome: Outcome, done: int, of: int) -> None:
    """Log the end of a member."""
    level = logging.WARNING if outcome.status == "failed" else logging.INFO
    error = f": {outcome.error}" if outcome.error else ""
    _log.log(level, "sweep: %s %s%s (%d of %d)", outcome.task.folder.name, outcome.status, error, done, of)


def _result(task: Task, outcome: Outcome | None) -> Any:
    return read_member(task.folder, *(("", "") if outcome is None else (outcome.status, outcome.error)))


class _Bar:
    """One line: how many members have ended, the running ones with the share that is done, and the ETA."""

    def __init__(self, total: int, done: int, *, shown: bool) -> None:
        self._total, self._done, self._failed, self._began = total, done, 0, perf_counter()
        self._first = done
        self._shares: dict[str, float] = {}
        self._shown = shown and (sys.stderr.isatty() or "ipykernel" in sys.modules)

    def show(self, event: Event) -> None:
        """Take an event in, and redraw the line."""
        if isinstance(event, Outcome):
            self._done, self._failed = self._done + 1, self._failed + (event.status == "failed")
            self._shares.pop(event.task.folder.name, None)
        elif event is not None:
            self._shares[event[0].folder.name] = event[1]
        ends = isinstance(event, Outcome) and event.status == "failed"  # its error follows, on a line of its own
        if self._shown:
            sys.stderr.write("\r" + self.line().ljust(WIDTH)[:WIDTH] + "\n" * ends)
            sys.stderr.flush()

    def line(self) -> str:
        """What is shown."""
        done = self._done - self._first + sum(self._shares.values())
        left = (perf_counter() - self._began) * (self._total - self._first - done) / max(done, 1e-9)
        parts = [f"{self._done} of {self._total} members"]
        parts += [f"{self._failed} failed"] if self._failed else []
        parts += [f"ETA {int(left // 60)}:{int(left % 60):02d}"] if done > 0.0 else []
        return "  ".join([*parts, *(f"{name} {100.0 * share:.0f} %" for name, share in self._shares.items())])

    def end(self) -> None:
        """Leave the line."""
        if self._shown:
            sys.stderr.write("\n")
