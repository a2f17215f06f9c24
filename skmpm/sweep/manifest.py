"""The manifest of a member: what made its table, and how far it is."""

from __future__ import annotations

import hashlib
import inspect
import json
import os
import pickle
import platform
from collections.abc import Callable, Iterable, Iterator, Mapping
from datetime import datetime
from functools import cache, partial
from importlib.metadata import PackageNotFoundError, version
from inspect import getsource
from itertools import chain
from pathlib import Path
from socket import gethostname
from typing import Any

from skmpm.sweep.errors import SweepError
from skmpm.sweep.parameters import same

FILE = "manifest.json"
PARTIAL = f".{FILE}."  # while it is written, then the process
PACKAGES = ("numpy", "scipy", "numba", "scikit-fem", "pyamg")
About = dict[str, Any]


def read(folder: Path) -> About | None:
    """The manifest of a directory; None if there is none."""
    path = folder / FILE
    if not path.exists():
        return None
    try:
        return dict(json.loads(path.read_text()))
    except ValueError as error:
        raise SweepError(
            f"{path} is no manifest of a sweep ({error}); delete {folder}, or give another out"
        ) from error


def write(folder: Path, about: Mapping[str, Any]) -> None:
    """Replace the manifest of a directory."""
    partial = folder / f"{PARTIAL}{os.getpid()}"
    partial.write_text(json.dumps(about, indent=1) + "\n")
    partial.replace(folder / FILE)


def check(folder: Path, about: Mapping[str, Any], parameters: Mapping[str, Any]) -> None:
    """SweepError if a directory was made with other parameters or by another version of the library.

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
    return {"skmpm": _version("skmpm"), "source": source}


def versions() -> dict[str, str]:
    """Versions of all that results depend on."""
    return {**library(), "python": platform.python_version(), **{name: _version(name) for name in PACKAGES}}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"


def source_of(build: Callable[..., object]) -> dict[str, str]:
    """Name of a function, and a hash of its source and of what is bound to it; without one where it has no source."""
    function: Any = build
    while isinstance(function, partial):
        function = function.func
    name = f"{getattr(function, '__module__', '')}.{getattr(function, '__qualname__', type(function).__qualname__)}"
    try:
        getsource(function)
    except (OSError, TypeError):
        if inspect.isroutine(function):
            return {"name": name, "source": ""}
    return {"name": name, "source": hashlib.sha256(b"\0".join(_parts(build))).hexdigest()}


def _parts(value: object, within: frozenset[int] = frozenset()) -> Iterator[bytes]:
    """What a value is: of functions their source, what they enclose and their defaults, of others their pickle.

    `within` are the values that it is a part of, which may be a part of it again.
    """
    held: Iterable[object] = ()
    if id(value) in within:
        return
    if isinstance(value, partial):
        held = (value.func, *value.args, *chain(*sorted(value.keywords.items())))
    elif inspect.isfunction(value):
        yield _source(value)
        enclosed = chain(*inspect.getclosurevars(value).nonlocals.items())
        held = (*(value.__defaults__ or ()), *chain(*(value.__kwdefaults__ or {}).items()), *enclosed)
    elif inspect.ismethod(value):
        held = value.__self__, value.__func__
    else:
        yield _source(type(value))
        try:
            yield pickle.dumps(value)
        except Exception:  # whatever it is, it is sent by other means: by what it holds
            yield type(value).__qualname__.encode()
            held = chain(*sorted(getattr(value, "__dict__", {}).items()))
    for part in held:
        yield from _parts(part, within | {id(value)})


def _source(of: Any) -> bytes:
    try:
        return getsource(of).encode()
    except (OSError, TypeError):
        return str(getattr(of, "__qualname__", "")).encode()


def session(command: list[str]) -> About:
    """Where and when a run is begun or resumed."""
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    return {"began": now, "host": gethostname(), "process": os.getpid(), "command": command}
