"""The directory of a member: its name, its manifest, which says what made it, and its lock."""

from __future__ import annotations

import errno
import hashlib
import inspect
import io
import json
import logging
import os
import pickle
import platform
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import datetime
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from socket import gethostname
from typing import Any

import numpy as np

from skmpm.io import replacing

MANIFEST, LOCK = "manifest.json", "lock"
LONGEST = 120  # characters of a name; file systems take 255
PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9_.+-]*")  # a text that stands for itself: not a number, no separator
GIVEN = re.compile(r"[A-Za-z0-9_+=,-][A-Za-z0-9_.+=,-]*")  # a name that is given
WORDS = {"true", "false", "none", "nan", "inf", "infinity"}  # read as values
RESERVED = frozenset({"member", "finished"})  # columns of the table of all members
TIME = "t"  # column of the rows of a run
PACKAGES = ("numpy", "scipy", "numba", "scikit-fem", "pyamg")
UNSUPPORTED = {errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP}  # by a file system without locks

_log = logging.getLogger("skmpm")


class SweepError(ValueError):
    """A sweep that cannot be run as asked: names the member or the object, and the remedy.

    Examples
    --------
    >>> import skmpm
    >>> try:
    ...     skmpm.sweep(lambda E: {"stiffness": E}, [{"E": 1e6}, {"E": 1e6}], out="results")
    ... except skmpm.SweepError as error:
    ...     print(str(error)[:32])
    two members have the directory E
    """


def plain(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters as JSON knows them, sorted by name; SweepError if one is no number, text or list of them."""
    if not isinstance(parameters, Mapping) or not all(isinstance(name, str) for name in parameters):
        raise SweepError(f"a member is {parameters!r}; give a dict of parameters by name")
    return {name: _plain(name, parameters[name]) for name in sorted(parameters)}


def _plain(name: str, value: Any) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, list | tuple):
        return [_plain(name, item) for item in value]
    if isinstance(value, Mapping):
        return plain(value)
    if isinstance(value, np.ndarray):
        raise SweepError(
            f"the parameter {name!r} is an array of shape {value.shape}; give a member for each of its values or, as"
            f" one value, the list {name}.tolist()"
        )
    raise SweepError(
        f"the parameter {name!r} is a {type(value).__name__}; parameters are numbers, texts, None, lists and dicts of"
        " these, from which build makes objects"
    )


def same(one: Any, other: Any) -> bool:
    """Whether two plain parameters, or dicts of them, are equal; nan is equal to nan."""
    return bool(one == other) or json.dumps(one, sort_keys=True) == json.dumps(other, sort_keys=True)


def name_of(parameters: Mapping[str, Any], given: str | None = None) -> str:
    """Name of the directory of plain parameters, as "friction=0.5,seed=1", unless one is given.

    Where that would be too long or could stand for other parameters, a hash of them follows. SweepError if a
    parameter is named as a column of every table, or if the given name names no directory.
    """
    for name in sorted(parameters.keys() & (RESERVED | {TIME})):
        raise SweepError(f"a parameter is named {name!r}, as a column of every table is; give it another name")
    if given is not None:
        if not isinstance(given, str) or not GIVEN.fullmatch(given):
            raise SweepError(f"{given!r} names no directory; use letters, digits and . _ + = , -")
        return given
    texts = {k: json.dumps(v) if isinstance(v, list | dict) else str(v) for k, v in parameters.items()}
    name = ",".join(f"{key}={text}" for key, text in texts.items()) or "run"
    if len(name) <= LONGEST and all(PLAIN.fullmatch(key) and _exact(parameters[key]) for key in parameters):
        return name
    digest = hashlib.sha256(json.dumps(parameters, sort_keys=True).encode()).hexdigest()[:10]
    return f"{re.sub(r'[^A-Za-z0-9_.+=,-]', '-', name)[:LONGEST].rstrip('.,')}-{digest}"


def _exact(value: Any) -> bool:
    """Whether no other value has the same text in a name."""
    if isinstance(value, str):
        return bool(PLAIN.fullmatch(value)) and value.lower() not in WORDS
    return not isinstance(value, list | dict)


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest of a directory; empty if there is none."""
    path = folder / MANIFEST
    try:
        return dict(json.loads(path.read_text())) if path.exists() else {}
    except (ValueError, TypeError) as error:
        raise SweepError(
            f"{path} is no manifest of a sweep ({error}); delete {folder}, or give another out"
        ) from error


def write_manifest(folder: Path, about: Mapping[str, Any]) -> None:
    """Replace the manifest of a directory."""
    with replacing(folder / MANIFEST) as file:
        file.write(f"{json.dumps(about, indent=1)}\n".encode())


def check_made_by(folder: Path, about: Mapping[str, Any], parameters: Mapping[str, Any]) -> None:
    """SweepError if the manifest of a directory has other parameters or another version of the library.

    A run that has not finished goes on only with the same versions of all that its results depend on.
    """
    remedy = "give another out, or delete the directory"
    if not same(about.get("parameters"), parameters):
        raise SweepError(f"{folder} was made with other parameters, {about.get('parameters')}; {remedy}")
    then, now = about.get("versions", {}), library() if about.get("status") == "finished" else versions()
    other = [name for name in now if then.get(name) != now[name]]
    if other:
        old, new = (", ".join(f"{name} {str(v.get(name))[:12]}" for name in other) for v in (then, now))
        raise SweepError(f"{folder} was made with {old}, this is {new}: results would be of both; {remedy}")


@cache
def library() -> dict[str, str]:
    """Version of the library, and a hash of its source, which tells versions under development apart."""
    root = Path(__file__).parents[1]
    source = hashlib.sha256(b"".join(path.read_bytes() for path in sorted(root.rglob("*.py")))).hexdigest()
    return {"skmpm": sys.modules["skmpm"].__version__, "source": source}


def versions() -> dict[str, str]:
    """Versions of all that results depend on."""
    return {**library(), "python": platform.python_version(), **{name: version(name) for name in PACKAGES}}


def session() -> dict[str, Any]:
    """Where and when a run is begun or resumed."""
    began = datetime.now().astimezone().isoformat(timespec="seconds")
    return {"began": began, "host": gethostname(), "process": os.getpid()}


def source_of(build: Callable[..., object]) -> dict[str, str]:
    """Name of a function, and a hash of its source and of what is bound to it, empty where there is no source."""
    function: Any = build
    while isinstance(function, partial):
        function = function.func
    name = f"{getattr(function, '__module__', '')}.{getattr(function, '__qualname__', type(function).__qualname__)}"
    file = io.BytesIO()
    try:
        _SourcePickler(file, protocol=4).dump(build)
    except Exception:  # typed in, or nothing that can be sent
        return {"name": name, "source": ""}
    return {"name": name, "source": hashlib.sha256(file.getvalue()).hexdigest()}


class _SourcePickler(pickle.Pickler):
    """Writes functions as their source with what is bound to them, and classes as their source."""

    def reducer_override(self, value: Any) -> Any:
        if inspect.isfunction(value):
            bound = value.__defaults__, value.__kwdefaults__, inspect.getclosurevars(value).nonlocals
            return tuple, ((inspect.getsource(value), bound),)
        if inspect.isclass(value):
            with suppress(OSError, TypeError):  # one that is built in goes by its name
                return str, (inspect.getsource(value),)
        return NotImplemented


@contextmanager
def locked(folder: Path, patience: float = 0.0) -> Iterator[None]:
    """Hold the lock of a directory, which the system releases when the process ends.

    SweepError, which names the holder, if another has it for longer than `patience` [s].
    """
    import locket

    lock = locket.lock_file(folder / LOCK, timeout=patience)
    try:
        lock.acquire()
    except locket.LockError:
        holder = (read_manifest(folder).get("sessions") or [{"seconds": 0.0}])[-1]
        known = "seconds" not in holder  # else the holder has just begun
        by = "process {process} on {host} since {began}".format_map(holder) if known else "another process"
        raise SweepError(f"{folder} is in use by {by}; wait for it to end, or give another out") from None
    except OSError as error:
        if error.errno not in UNSUPPORTED:
            raise
        _log.warning("sweep: its file system has no locks (%s); do not start a sweep twice at a time", error)
        yield
        return
    try:
        yield
    finally:
        lock.release()
