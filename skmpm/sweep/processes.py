"""Members in worker processes of this machine: one member at a time in each, replaced where one is killed."""

from __future__ import annotations

import os
import pickle
import signal
import sys
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from time import monotonic
from types import FrameType, ModuleType

from skmpm.parallel import available
from skmpm.sweep.errors import Interrupted, SweepError
from skmpm.sweep.execution import Outcome, Task, Worker, run_member
from skmpm.sweep.pickling import by_value

ATTEMPTS = 3  # of a member whose process is killed, as by a lack of memory
TICK = 0.5  # [s] between looks at what has happened, and between reports of progress

Event = Outcome | tuple[Task, float] | None  # an end, a share that is done, or nothing new


@dataclass(eq=False)
class _Process:
    """A worker process, and what it is busy with."""

    process: BaseProcess
    connection: Connection
    ready: bool = False
    task: Task | None = None


def in_processes(build: bytes, tasks: list[Task], count: int | None) -> Iterator[Event]:
    """Run tasks in at most so many processes, as many as there are cores if None, and say what happens.

    When the iterator is closed, by the end of the caller or an exception, the processes write checkpoints and end.
    """
    count = min(available() if count is None else count, len(tasks))
    queue, attempts = deque(tasks), dict.fromkeys((task.folder for task in tasks), 0)
    workers = [_started(build, max(1, available() // count)) for _ in range(count)]
    begun = False
    try:
        while workers and (queue or any(worker.task is not None for worker in workers)):
            yield None
            for connection in wait([worker.connection for worker in workers], TICK):
                worker = next(w for w in workers if w.connection is connection)
                try:
                    message = worker.connection.recv()
                except (EOFError, OSError):
                    workers.remove(worker)
                    if not begun:
                        raise _unable(worker) from None
                    yield from _ended(worker, queue, attempts)
                    if queue and len(workers) < count:
                        workers.append(_started(build, max(1, available() // count)))
                    continue
                if isinstance(message, tuple):
                    yield message
                    continue
                if isinstance(message, str):  # build cannot be read
                    raise SweepError(message)
                if isinstance(message, Outcome):
                    yield message
                begun, worker.ready, worker.task = True, True, None
                if isinstance(message, Outcome) and message.status == "interrupted":
                    workers.remove(worker)
                elif queue:
                    worker.task = queue.popleft()
                    worker.connection.send(worker.task)
        for task in queue:  # all workers were told to end
            yield Outcome(task, "interrupted")
    finally:
        for worker in workers:
            worker.process.terminate()
        for worker in workers:
            worker.process.join()


def _started(build: bytes, threads: int) -> _Process:
    context = get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(there, build, threads), daemon=True, name="skmpm sweep")
    with _without_script() if by_value() else nullcontext():
        process.start()
    there.close()
    return _Process(process, here)


@contextmanager
def _without_script() -> Iterator[None]:
    """Within it processes start without importing the script that is run: they need nothing of it."""
    script = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = script


def _ended(worker: _Process, queue: deque[Task], attempts: dict[Path, int]) -> Iterator[Outcome]:
    """What becomes of the member of a process that ended without a word: it is tried again, or has failed.

    A process that ended before it took one counts for the next, so that not for ever new ones are started.
    """
    worker.process.join()
    task = queue.popleft() if queue and not worker.ready else worker.task
    if task is None:
        return
    attempts[task.folder] += 1
    if attempts[task.folder] < ATTEMPTS:
        queue.appendleft(task)
        return
    code = worker.process.exitcode or 0
    by = signal.Signals(-code).name if code < 0 else f"exit code {code}"
    yield Outcome(task, "failed", f"its process ended {ATTEMPTS} times, by {by}; was there enough memory?")


def _unable(worker: _Process) -> SweepError:
    """The error where no process has begun."""
    worker.process.join()
    return SweepError(
        f"a worker process ended with exit code {worker.process.exitcode} before it began; without cloudpickle a"
        " script calls sweep below `if __name__ == '__main__':`, because worker processes import it"
    )


def _serve(connection: Connection, build: bytes, threads: int) -> None:
    """The loop of a worker process."""
    parent = os.getppid()
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to all; the first process decides
        signal.signal(signal.SIGTERM, _interrupt)
        try:
            function = pickle.loads(build)
        except Exception as error:
            connection.send(f"a worker process cannot import build: {type(error).__name__}: {error}")
            return
        connection.send(True)
        while True:
            task = connection.recv()
            reporter = _Reporter(connection, task)
            outcome = run_member(function, task, Worker(threads, 0.0, lambda: os.getppid() != parent, reporter))
            connection.send(outcome)
            if outcome.status == "interrupted":
                return
    except (EOFError, OSError, Interrupted):  # nobody listens, or nothing was under way
        return


@dataclass
class _Reporter:
    """Sends how far a member is, twice a second; where nobody listens, the member is interrupted."""

    connection: Connection
    task: Task
    sent: float = 0.0

    def __call__(self, share: float) -> None:
        if monotonic() - self.sent > TICK:
            self.sent = monotonic()
            try:
                self.connection.send((self.task, share))
            except OSError:
                raise Interrupted from None


def _interrupt(number: int, frame: FrameType | None) -> None:
    """End what is under way, once."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise Interrupted
