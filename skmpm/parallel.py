"""Ranges of bodies, and of what else is independent of each other, in threads.

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
from itertools import pairwise

import numpy as np

from skmpm.arrays import Ints

# Ranges per thread, so that threads end together although one of them waits for a core. Less work than that of a
# range of this size is not worth a thread: handing it over takes 30 us, its factorisation a millisecond.
RANGES = 4
SMALLEST_RANGE = 3_000  # unknowns, or points

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


def over_bodies(work: Callable[[int, int], None], offsets: Ints) -> None:
    """Call work(first, last) for ranges of bodies that together are all; body b has offsets[b]:offsets[b + 1]."""
    bodies, size = offsets.size - 1, int(offsets[-1] - offsets[0])
    count = min(_ranges(size), bodies)
    cuts = np.searchsorted(offsets, offsets[0] + size * np.arange(1, count) / count).tolist() if count > 1 else []
    _divide(work, [0, *cuts, bodies])


def over_points(work: Callable[[int, int], None], size: int) -> None:
    """Call work(first, last) for ranges that together are 0:size, of points or others that take the same work.

    They begin at multiples of 64: compiled loops take several points at once, and what is left at their end alone.
    """
    count = _ranges(size)
    _divide(work, [*(64 * (size * k // (64 * count)) for k in range(count)), size])


def _ranges(size: int) -> int:
    return max(1, min(RANGES * _threads.get(), size // SMALLEST_RANGE)) if _threads.get() > 1 else 1


def _divide(work: Callable[[int, int], None], cuts: list[int]) -> None:
    """Call work(first, last) for the ranges between cuts that are not empty.

    The calling thread works, too, and waits for no thread that has not begun: on a busy machine it does everything.
    """
    cuts = [cuts[0], *(end for begin, end in pairwise(cuts) if end > begin)]
    if len(cuts) <= 2:
        work(cuts[0], cuts[-1])
        return
    ranges = iter(list(pairwise(cuts)))

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
