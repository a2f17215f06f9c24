"""Ranges of bodies in threads.

Bodies are independent of each other until contact couples them, and whatever is computed for one body is computed in
the same order in any range, so that results do not depend on the number of threads. Only loops that hold no lock gain
by it: compiled ones.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache

import numpy as np
from numpy.typing import NDArray

# Ranges per thread, so that threads end together although one of them waits for a core. Less work than that of a
# range of this size is not worth a thread: handing it over takes 30 us, its factorisation a millisecond.
RANGES = 4
SMALLEST_RANGE = 3_000  # unknowns

_threads: ContextVar[int] = ContextVar("threads", default=1)


@contextmanager
def threads(count: int | None) -> Iterator[None]:
    """Within it bodies are divided among so many threads; None: as many as this process may use cores."""
    token = _threads.set(available() if count is None else count)
    try:
        yield
    finally:
        _threads.reset(token)


def available() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def over_bodies(work: Callable[[int, int], None], offsets: NDArray[np.int64]) -> None:
    """Call work(first, last) for ranges of bodies that together are all; body b has offsets[b]:offsets[b + 1].

    The calling thread works, too, and waits for no thread that has not begun: on a busy machine it does everything.
    """
    bodies, size = offsets.size - 1, int(offsets[-1] - offsets[0])
    count = min(RANGES * _threads.get(), bodies, size // SMALLEST_RANGE) if _threads.get() > 1 else 1
    if count <= 1:
        work(0, bodies)
        return
    cuts = np.searchsorted(offsets, offsets[0] + size * np.arange(1, count) / count).tolist()
    ranges = iter(list(zip([0, *cuts], [*cuts, bodies], strict=True)))

    def drain() -> None:
        for first, last in ranges:
            work(first, last)

    helpers = [_pool(_threads.get() - 1).submit(drain) for _ in range(_threads.get() - 1)]
    try:
        drain()
    finally:
        for helper in helpers:
            if not helper.cancel():
                helper.result()


@cache
def _pool(count: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(count, thread_name_prefix="skmpm")


if hasattr(os, "register_at_fork"):  # threads do not live on in a forked process
    os.register_at_fork(after_in_child=_pool.cache_clear)
