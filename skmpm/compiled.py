"""Compilation of loops over points, unknowns and contacts to machine code (numba)."""

from __future__ import annotations

import functools
import hashlib
import logging
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from numba import config, njit
from numba.core.caching import IndexDataCacheFile, NullCache
from numba.core.compiler import CompileResult
from numba.core.dispatcher import Dispatcher
from numba.misc.appdirs import AppDirs

P = ParamSpec("P")
R = TypeVar("R")

_log = logging.getLogger("skmpm")


def compiled(kernel: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of numbers and arrays when it is first called, and keep the result on disk.

    Sums may be reordered, so results differ from those of the interpreted function by round-off. Kernels hold no
    lock, and none of them tests for inf or nan, which reordering excludes. The result is kept in NUMBA_CACHE_DIR,
    beside the source or in the user's cache directory: in the first of them that can be written. It is read from all.

    Kernels that others call are inlined there. Else there are two copies, one in the library of the caller, with sums
    in different orders; that which is loaded first is used, so that a process which compiles and one which reads the
    cache would differ by round-off. For the same reason kernels do not call functions of NumPy that sum. Different
    caches may still differ by round-off, since the compiler orders sums as it likes.
    """
    found: Callable[P, R] = _cached(njit(nogil=True, fastmath=True, forceinline=True)(kernel))
    return found


def compiled_in_order(kernel: Callable[P, R]) -> Callable[P, R]:
    """Compile as `compiled` does, with sums in the order as written, for small differences of terms near one."""
    found: Callable[P, R] = _cached(njit(nogil=True, forceinline=True)(kernel))
    return found


def _cached(kernel: Any) -> Any:
    """The kernel with a cache that is renewed when its module changes, or one with kernels that its module calls.

    Numba's own cache looks at the module of the kernel alone, but those of other modules are inlined too. It needs a
    directory that can be written, also to read.
    """
    called: list[Any] = [value for value in kernel.py_func.__globals__.values() if isinstance(value, Dispatcher)]
    kernel._sources = {kernel.py_func.__code__.co_filename}.union(*(other._sources for other in called))
    kernel._cache = _Cache(kernel.py_func, b"".join(_digest(source) for source in sorted(kernel._sources)))
    return kernel


@functools.cache
def _digest(source: str) -> bytes:
    """Of the text, not of its time: images and archives round the latter."""
    return hashlib.sha256(Path(source).read_bytes()).digest()


class _Cache(NullCache):
    """The compiled variants of a kernel, by types of arguments and processor, in files of numba's format."""

    def __init__(self, kernel: Any, stamp: bytes) -> None:
        source = Path(kernel.__code__.co_filename)
        name = f"{source.stem}.{kernel.__qualname__}-{kernel.__code__.co_firstlineno}.{sys.implementation.cache_tag}"
        of_source = f"{source.parent.name}_{hashlib.sha256(str(source.parent).encode()).hexdigest()}"
        user = Path(AppDirs(appname="numba", appauthor=False).user_cache_dir, of_source)
        given = [Path(config.CACHE_DIR, of_source)] if config.CACHE_DIR else []
        places = *given, source.parent / "__pycache__", user
        self._files = {place: IndexDataCacheFile(str(place), name, stamp) for place in places}

    def load_overload(self, signature: Any, target: Any) -> Any:
        """The compiled variant for these types, None if there is none."""
        target.refresh()
        for file in self._files.values():
            with suppress(OSError):  # a directory that cannot be read
                if (found := file.load((signature, target.codegen().magic_tuple()))) is not None:
                    return CompileResult._rebuild(target, *found)
        _warn_once(
            "compiling loops of skmpm: about a minute for all of them; `python -m skmpm.warmup` compiles beforehand"
            " what common scenes need"
        )
        return None

    def save_overload(self, signature: Any, variant: Any) -> None:
        """Keep a compiled variant in the first directory that can be written."""
        for place, file in self._files.items():
            with suppress(OSError):
                place.mkdir(parents=True, exist_ok=True)
                file.save((signature, variant.codegen.magic_tuple()), variant._reduce())
                return
        _warn_once(
            "compiled loops of skmpm are not kept for later runs, since neither its directory nor the user's cache"
            " directory can be written; set NUMBA_CACHE_DIR to a directory that can"
        )


@functools.cache
def _warn_once(text: str) -> None:
    _log.warning(text)
