"""Compilation of loops over points, unknowns and contacts to machine code (numba)."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from numba import njit
from numba.core import event
from numba.core.dispatcher import Dispatcher

P = ParamSpec("P")
R = TypeVar("R")

_log = logging.getLogger("skmpm")


def compiled(kernel: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of numbers and arrays when it is first called, and keep the result on disk.

    Sums may be reordered, so results differ from those of the interpreted function by round-off. Kernels hold no
    lock, and none of them tests for inf or nan, which reordering excludes. The cache lies beside the source or, where
    that cannot be written, in the user's cache directory or in NUMBA_CACHE_DIR.

    Kernels that others call are inlined there. Else there are two copies, one in the library of the caller, with sums
    in different orders; that which is loaded first is used, so that a process which compiles and one which reads the
    cache would differ by round-off. For the same reason kernels do not call functions of NumPy that sum. Different
    caches may still differ by round-off, since the compiler orders sums as it likes.
    """
    found: Callable[P, R] = _stamped(njit(cache=True, nogil=True, fastmath=True, forceinline=True)(kernel))
    return found


def compiled_in_order(kernel: Callable[P, R]) -> Callable[P, R]:
    """The same with sums in the order in which they are written, for small differences of terms near one."""
    found: Callable[P, R] = _stamped(njit(cache=True, nogil=True, forceinline=True)(kernel))
    return found


def _stamped(kernel: Any) -> Any:
    """The kernel with a cache that is renewed when a module of kernels changes that its own module calls.

    Numba renews it when the module of the kernel itself changes, but those of other modules are inlined too.
    """
    called: list[Any] = [value for value in kernel.py_func.__globals__.values() if isinstance(value, Dispatcher)]
    kernel._sources = {kernel.py_func.__code__.co_filename}.union(*(other._sources for other in called))
    stats = [Path(source).stat() for source in sorted(kernel._sources)]
    kernel._cache._cache_file._source_stamp = tuple((stat.st_mtime, stat.st_size) for stat in stats)
    return kernel


class _Announcement(event.Listener):
    """Says once why the first step after an installation takes long."""

    def on_start(self, event: object) -> None:
        """Log that kernels are compiled."""
        unregister()
        _log.warning(
            "compiling loops of skmpm, which are kept for later runs: half a minute for all of them;"
            " `python -m skmpm.warmup` compiles beforehand what common scenes need"
        )

    def on_end(self, event: object) -> None:
        """Nothing."""


_announcement = _Announcement()


def unregister() -> None:
    """Say nothing about later compilations."""
    if _announcement in event._registered["numba:compile"]:
        event.unregister("numba:compile", _announcement)


event.register("numba:compile", _announcement)
