"""A lock on the directory of a member, which the kernel releases when the process that holds it ends."""

from __future__ import annotations

import errno
import json
import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from socket import gethostname
from time import monotonic, sleep

from skmpm.sweep.errors import InUse

FILE = "lock"
FAR = 2**30  # byte that is locked on Windows, where a locked one cannot be read
UNSUPPORTED = {errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP}  # by the file system

_log = logging.getLogger("skmpm")


@contextmanager
def locked(folder: Path, owner: str, patience: float = 0.0) -> Iterator[None]:
    """Hold the lock of a directory.

    `owner` identifies a sweep: while another process of the same one holds the lock, as that of a worker given up for
    dead, it is waited for, at most `patience` [s]. InUse, which names the holder, if it is held by another.
    """
    handle = os.open(folder / FILE, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        deadline = monotonic() + patience
        while not _acquired(handle):
            holder = _holder(folder)
            if holder.get("sweep") != owner or monotonic() > deadline:
                raise InUse(_described(folder, holder))
            sleep(0.2)
        about = {"sweep": owner, "process": os.getpid(), "host": gethostname(), "since": _now()}
        os.ftruncate(handle, 0)
        os.lseek(handle, 0, os.SEEK_SET)
        os.write(handle, json.dumps(about).encode())
        yield
    finally:
        os.close(handle)


def check_free(folder: Path) -> None:
    """InUse if the lock of a directory is held."""
    if (folder / FILE).exists():
        handle = os.open(folder / FILE, os.O_RDWR)
        try:
            if not _acquired(handle):
                raise InUse(_described(folder, _holder(folder)))
        finally:
            os.close(handle)


def _acquired(handle: int) -> bool:
    """Take the lock of an open file, if it is free."""
    try:
        if sys.platform == "win32":
            import msvcrt

            os.lseek(handle, FAR, os.SEEK_SET)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)  # of this opening, so threads exclude each other too
    except (BlockingIOError, PermissionError):
        return False
    except OSError as error:
        if error.errno not in UNSUPPORTED:
            raise
        _log.warning("sweep: its file system has no locks (%s); do not start a sweep twice at a time", error)
    return True


def _holder(folder: Path) -> dict[str, str]:
    try:
        return dict(json.loads((folder / FILE).read_text()))
    except (OSError, ValueError):
        return {}  # just taken, or of a system that lets no other read it


def _described(folder: Path, holder: dict[str, str]) -> str:
    by = "process {process} on {host} since {since}".format_map(holder) if "process" in holder else "another process"
    return f"{folder} is in use by {by}; wait for it to end, or give another out"


def _now() -> str:
    return datetime.now().astimezone().isoformat(timespec="seconds")
