"""Members as tasks of a Dask client, on whatever it spans; the only module that imports dask."""

from __future__ import annotations

import pickle
import signal
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from time import monotonic, sleep
from typing import Any

from skmpm.sweep.errors import InUse
from skmpm.sweep.execution import Outcome, Task, Worker, run_member
from skmpm.sweep.lock import check_free
from skmpm.sweep.processes import TICK, Event

PATIENCE = 180.0  # [s] for a lock that a worker given up for dead holds; a lease of NFS is 90 s
PLUGIN = "skmpm-sweep"


def on_client(client: Any, build: bytes, tasks: list[Task]) -> Iterator[Event]:
    """Run tasks on the workers of a `distributed.Client`, and say what happens.

    When the iterator is closed, by the end of the caller or an exception, the tasks write checkpoints and end.
    """
    news: deque[tuple[int, float]] = deque()
    topic = f"skmpm-sweep-{tasks[0].sweep}"
    client.register_plugin(_plugin(), name=PLUGIN)
    client.subscribe_topic(topic, lambda event: news.append(event[1]))
    futures = {
        client.submit(_task, build, task, k, topic, key=f"{topic}-{k}", pure=False): task
        for k, task in enumerate(tasks)
    }
    try:
        while futures:
            sleep(0.2 * TICK)
            for future in [future for future in futures if future.done()]:
                yield _outcome(future, futures.pop(future))
            while news:
                k, share = news.popleft()
                yield tasks[k], share
            yield None
    finally:
        client.unsubscribe_topic(topic)
        client.cancel(list(futures))
        _await_locks([task.folder for task in futures.values()])


def _outcome(future: Any, task: Task) -> Outcome:
    """What a task returned, or why it did not."""
    if future.status == "finished":
        outcome: Outcome = future.result()
        return outcome
    if future.status == "error":
        error = future.exception()
        return Outcome(task, "failed", f"{type(error).__name__}: {error}")
    return Outcome(task, "interrupted", f"Dask {future.status} it")


def _await_locks(folders: list[Path], patience: float = 60.0) -> None:
    """Wait until tasks that were cancelled have ended their step and written their checkpoints."""
    deadline = monotonic() + patience
    for folder in folders:
        while monotonic() < deadline:
            try:
                check_free(folder)
                break
            except InUse:
                sleep(0.1)


def _task(build: bytes, task: Task, k: int, topic: str) -> Outcome:
    """Run a member on a worker; it moves to another one if this one closes."""
    from distributed import Reschedule, Status, get_worker

    worker = get_worker()
    key, told = worker.get_current_task(), 0.0

    def closing() -> bool:
        return worker.status not in (Status.running, Status.paused)

    def cancelled() -> bool:
        state = worker.state.tasks.get(key)
        return state is None or state.state == "cancelled"

    def report(share: float) -> None:
        nonlocal told
        if monotonic() - told > TICK and not closing():
            told = monotonic()
            worker.log_event(topic, (k, share))

    about = Worker(patience=PATIENCE, stopping=lambda: closing() or cancelled(), report=report)
    outcome = run_member(pickle.loads(build), task, about)
    if outcome.status == "interrupted" and closing():
        raise Reschedule
    return outcome


def _plugin() -> Any:
    """A plugin by which SIGTERM closes a worker, so that its tasks write checkpoints; without it, it ends at once."""
    from distributed import WorkerPlugin

    class Sigterm(WorkerPlugin):
        def setup(self, worker: Any) -> None:
            def close() -> None:
                worker.loop.add_callback(worker.close, nanny=False, reason="SIGTERM")

            with suppress(ValueError, RuntimeError, NotImplementedError):  # not the main thread, or Windows
                worker.loop.asyncio_loop.add_signal_handler(signal.SIGTERM, close)

    return Sigterm()
