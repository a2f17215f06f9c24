"""Workers of Dask on which members run: those of a client, or processes of this machine."""

from __future__ import annotations

import logging
import os
import pickle
import signal
import sys
from collections.abc import Generator, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic, sleep
from types import ModuleType
from typing import Any

import cloudpickle
import dask
from distributed import Client, KilledWorker, LocalCluster, Reschedule, Status, WorkerPlugin, get_worker

from skmpm.sweep.directory import SweepError, locked, read_manifest
from skmpm.sweep.execution import Build, Outcome, Task, Worker, described, run_member

TICK = 0.5  # [s] between reports of a member
LAST_STEP = 60.0  # [s] that members have to end a step when they are interrupted
PLUGIN = "skmpm-sweep"
LOGGERS = ("distributed", "distributed.client", "distributed.gc")  # with levels of their own
LOCAL = {  # what Dask presumes of clusters, and what is not so on one machine
    "distributed.deploy.lost-worker-timeout": "365 days",  # after which a process is not replaced any more
    "distributed.scheduler.allowed-failures": 10,  # members count themselves how often they were killed
    "distributed.scheduler.no-workers-timeout": "10 minutes",  # else nothing says that none can be started
    "distributed.worker.profile.enabled": False,  # it asks every 10 ms what members do
    "distributed.scheduler.worker-ttl": None,  # a process that sleeps with its machine is not dead
}

News = tuple[dict[Path, Outcome], dict[Path, float]]  # how some members ended, and the shares of others


def pickled(build: Build) -> bytes:
    """The function as bytes that `pickle.loads` reads, with what it refers to unless a module has it."""
    try:
        return bytes(cloudpickle.dumps(build))
    except Exception as error:
        raise SweepError(
            f"build refers to what cannot be sent to a worker ({error}); make it inside build"
        ) from error


@contextmanager
def local_client(processes: int) -> Iterator[Any]:
    """A client of so many worker processes of this machine, which end with it.

    Processes that are spawned import the script that is `__main__`, which would begin the sweep again. They need
    nothing of it, so within the context `__main__` is an empty module. Dask logs nothing in it, and the environment,
    in which Dask sets variables, is afterwards what it was.
    """
    script, environment = sys.modules["__main__"], frozenset(os.environ)
    sys.modules["__main__"] = ModuleType("__main__")
    levels = {name: logging.getLogger(name).level for name in LOGGERS}
    for name in LOGGERS:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        with (
            dask.config.set(LOCAL),
            LocalCluster(
                n_workers=processes,
                threads_per_worker=1,
                memory_limit=0,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                scheduler_kwargs={"dashboard": False},
                silence_logs=logging.CRITICAL,
            ) as cluster,
            Client(cluster, set_as_default=False) as client,
        ):
            yield client
    finally:
        sys.modules["__main__"] = script
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)
        for name in os.environ.keys() - environment:
            del os.environ[name]


def run_tasks(
    client: Any, build: bytes, tasks: list[Task], *, threads: int = 1, lasting: bool
) -> Generator[News, None, None]:
    """Run tasks on the workers of a client; yield how some ended since the last time, and the shares of others.

    Closed, by the end of the caller or an exception, it interrupts what runs: members write checkpoints and end. It
    waits for all members if the workers are `lasting`, else only for those that have steps behind them.
    """
    topic, shares = f"skmpm-sweep-{tasks[0].sweep}", dict[Path, float]()
    client.register_plugin(_Signals(), name=PLUGIN)
    client.subscribe_topic(topic, lambda event: shares.update([(tasks[event[1][0]].folder, event[1][1])]))
    futures = {
        client.submit(_run, build, task, k, threads, topic, key=f"{topic}-{k}", pure=False): task.folder
        for k, task in enumerate(tasks)
    }
    try:
        while futures:
            sleep(0.1)
            done = [(future, futures.pop(future)) for future in list(futures) if future.done()]
            ended = {folder: _outcome(future, folder) for future, folder in done}
            left = set(futures.values())
            yield ended, {folder: share for folder, share in list(shares.items()) if folder in left}
    finally:
        client.unsubscribe_topic(topic)
        client.cancel(list(futures))
        deadline = monotonic() + LAST_STEP
        for folder in futures.values():
            if lasting or folder in shares:
                with suppress(SweepError), locked(folder, max(deadline - monotonic(), 0.0)):
                    pass


def _outcome(future: Any, folder: Path) -> Outcome:
    """How a member ended; its manifest says so, and not a result, which would be lost with the worker that has it."""
    if future.status == "finished":
        about = read_manifest(folder)
        return Outcome(about["status"], about["error"])
    if future.status != "error":
        return Outcome("interrupted", f"Dask {future.status} it")
    error = future.exception()
    if isinstance(error, KilledWorker):
        return Outcome("failed", f"its workers ended {error.allowed_failures + 1} times; was there enough memory?")
    return Outcome("failed", described(error))


def _run(build: bytes, task: Task, number: int, threads: int, topic: str) -> None:
    """Run a member on a worker; it moves to another one if this one closes."""
    worker = get_worker()
    key, told = worker.get_current_task(), 0.0

    def closing() -> bool:
        return worker.status not in (Status.running, Status.paused)

    def stopping() -> bool:
        state = worker.state.tasks.get(key)
        return closing() or state is None or state.state == "cancelled"

    def report(share: float) -> None:
        nonlocal told
        if monotonic() - told > TICK and not closing():
            told = monotonic()
            worker.log_event(topic, (number, float(share)))

    outcome = run_member(pickle.loads(build), task, Worker(threads, stopping, report))
    if outcome.status == "interrupted" and closing():
        raise Reschedule


class _Signals(WorkerPlugin):
    """SIGTERM closes a worker, so that its members write checkpoints; without it, the worker ends at once.

    SIGINT is left to the process of its nanny, if it has one: a terminal sends it to both.
    """

    def setup(self, worker: Any) -> None:
        def close() -> None:
            worker.loop.add_callback(worker.close, nanny=False, reason="SIGTERM")

        with suppress(ValueError, RuntimeError, NotImplementedError):  # not the main thread, or Windows
            worker.loop.asyncio_loop.add_signal_handler(signal.SIGTERM, close)
            if worker.nanny:
                signal.signal(signal.SIGINT, signal.SIG_IGN)
