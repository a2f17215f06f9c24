"""`sweep`: run the members of an ensemble to their ends."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterable, Mapping
from contextlib import closing, nullcontext
from pathlib import Path
from typing import Any
from uuid import uuid4

from skmpm.parallel import available
from skmpm.progress import Bar
from skmpm.simulation import exit_at_sigterm
from skmpm.sweep import directory
from skmpm.sweep.directory import SweepError
from skmpm.sweep.execution import Build, Outcome, Task
from skmpm.sweep.results import Sweep, read_member

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
    included. Rows are written together with their checkpoint: however often a run is interrupted, its final table is
    that of an uninterrupted run, to the bit. At SIGTERM or Ctrl-C members write checkpoints before they end.

    A member that fails does not stop the others; `Sweep.failed` and the logger "skmpm" name it and its error. One
    whose process is killed goes on from its checkpoint in another; killed three times, it has failed.

    Parameters
    ----------
    build : function of the parameters of a member, of a module, a script or a notebook; it is sent by cloudpickle
    members : dicts of parameters: numbers, texts, None, lists and dicts of these; or a dict of such dicts, by the
        names of their directories
    out : directory of the results, created if needed; of a cluster, one that all its workers share
    client : `distributed.Client`, on whose workers the members run; None: on processes of this machine
    processes : how many members run at a time on this machine; None: one for each core that the process may use. BLAS
        uses one thread in each, and the bodies of a scene are divided among the cores that are left
    progress : show on a terminal or in a notebook how many members have finished, how far the others are, and the ETA

    Returns
    -------
    the members, with their tables

    Raises
    ------
    SweepError
        before anything runs: if two members are the same, if a parameter is of another type or named ``member``,
        ``finished`` or ``t``, as columns of the table are, if `build` cannot be pickled, if a directory was made with
        other parameters or another version of the library, or is in use; and without the extra ``cluster``

    Examples
    --------
    >>> import skmpm
    >>> def build(E):
    ...     material = skmpm.NeoHookean(E=E, nu=0.3, density=1000)
    ...     body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), material)
    ...     return skmpm.Run(skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81)), until=1e-2, dt=1e-3)
    >>> result = skmpm.sweep(build, [{"E": 1e6}, {"E": 2e6}], out="results")  # doctest: +SKIP
    >>> len(result.members)  # doctest: +SKIP
    2
    """
    try:
        from skmpm.sweep import workers  # which imports dask
    except ImportError as error:
        raise SweepError(f"sweep runs on Dask: pip install 'skmpm[cluster]' ({error})") from None
    if processes is not None and processes < 1:
        raise ValueError(f"sweep: processes = {processes}; give a number of at least 1, or None for all cores")
    function = workers.pickled(build)
    tasks = _tasks(build, members, Path(out).resolve())
    left = _left(tasks)
    ended: dict[Path, Outcome] = {}
    if left:
        count = min(available() if processes is None else processes, len(left))
        threads = max(1, available() // count) if client is None else 1
        with (
            exit_at_sigterm(wanted=True),
            workers.local_client(count) if client is None else nullcontext(client) as used,
            closing(workers.run_tasks(used, function, left, threads=threads, lasting=client is not None)) as news,
            Bar(len(tasks), shown=progress) as bar,
        ):
            ended = follow(news, left, len(tasks), bar)
    return Sweep(tuple(read_member(task.folder, *ended.get(task.folder, ())) for task in tasks))


def _tasks(
    build: Build, members: Iterable[Mapping[str, Any]] | Mapping[str, Mapping[str, Any]], out: Path
) -> list[Task]:
    """A task for each member, in their order; SweepError if two are the same."""
    about = uuid4().hex, (sys.executable, *sys.argv), directory.source_of(build)
    tasks: dict[str, Task] = {}
    named = members.items() if isinstance(members, Mapping) else ((None, member) for member in members)
    for given, member in named:
        parameters = directory.plain(member)
        name = directory.name_of(parameters, given)
        if (other := tasks.get(name.casefold())) is not None:
            why = "their parameters are the same; give each once"
            if other.folder.name != name:
                why = f"some file systems do not tell it from {other.folder.name}; give other names"
            raise SweepError(f"two members have the directory {name}: {why}")
        tasks[name.casefold()] = Task(out / name, parameters, *about)
    return list(tasks.values())


def _left(tasks: list[Task]) -> list[Task]:
    """The tasks that have not finished; their directories are made."""
    left, other = [], 0
    for task in tasks:
        task.folder.mkdir(parents=True, exist_ok=True)
        about = directory.read_manifest(task.folder)
        if about:
            directory.check_made_by(task.folder, about, task.parameters)
            sources = {about.get("build", {}).get("source"), task.build["source"]}
            other += len(sources) == 2 and all(sources)  # there is none of what was typed in
        if about.get("status") != "finished":
            with directory.locked(task.folder):
                left.append(task)
    if other:
        _log.warning(
            "sweep: build has changed since %d of the members were run; what is in their directories stays as it is."
            " Delete them, or give another out, to run them again",
            other,
        )
    return left


def follow(
    news: Iterable[tuple[dict[Path, Outcome], dict[Path, float]]], tasks: list[Task], total: int, bar: Bar
) -> dict[Path, Outcome]:
    """How the members ended; until then a bar shows how far they are, and the log how each ends."""
    earlier, failed = total - len(tasks), 0
    ended: dict[Path, Outcome] = {}
    for new, shares in news:
        for folder, outcome in new.items():
            ended[folder] = outcome
            level = logging.INFO
            if outcome.status == "failed":
                level, failed = logging.WARNING, failed + 1
                bar.make_room()
            error = f": {outcome.error}" if outcome.error else ""
            done = earlier + len(ended)
            _log.log(level, "sweep: %s %s%s (%d of %d)", folder.name, outcome.status, error, done, total)
        done = earlier + len(ended)
        facts = [f"{done} of {total} members", *([f"{failed} failed"] if failed else [])]
        bar.show(done + sum(shares.values()), *facts, *(f"{f.name} {100.0 * s:.0f} %" for f, s in shares.items()))
    return ended
