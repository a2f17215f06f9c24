"""How `build` reaches the workers: pickled, by cloudpickle where there is one; an error names what cannot be."""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from typing import Any

from skmpm.sweep.errors import SweepError

Dumps = Callable[[object], bytes]


def by_value() -> bool:
    """Whether functions of the script that is run are sent with what they refer to: by cloudpickle."""
    try:
        import cloudpickle  # noqa: F401
    except ImportError:
        return False
    return True


def pickled(build: Callable[..., object]) -> bytes:
    """The function as bytes that `pickle.loads` reads; SweepError names what in it cannot be pickled."""
    dumps: Dumps = pickle.dumps
    remedy = "define functions at the top level of a module, or install cloudpickle: pip install 'skmpm[cluster]'"
    if by_value():
        import cloudpickle

        dumps, remedy = cloudpickle.dumps, "build it inside the function"
    try:
        return dumps(build)
    except Exception as error:
        name, culprit = _culprit("build", build, dumps)
        raise SweepError(
            f"{name} is {_described(culprit)}, which cannot be sent to another process; {remedy} ({error})"
        ) from error


def _culprit(name: str, value: object, dumps: Dumps, depth: int = 6) -> tuple[str, object]:
    """The smallest part of a value that cannot be pickled, with its name."""
    by_name = dumps is pickle.dumps and inspect.isfunction(value)  # then its variables are of no matter
    for part, inner in _parts(name, value) if depth and not by_name else ():
        try:
            dumps(inner)
        except Exception:
            return _culprit(part, inner, dumps, depth - 1)
    return name, value


def _parts(name: str, value: object) -> Iterator[tuple[str, object]]:
    """What a value is made of: variables of functions that are no part of a module, fields, items."""
    if isinstance(value, partial):
        yield f"{name}.func", value.func
        yield from ((f"{name}({key}=)", item) for key, item in value.keywords.items())
        yield from ((f"{name}({k})", item) for k, item in enumerate(value.args))
    elif inspect.isfunction(value):
        used: Mapping[str, Any] = {**inspect.getclosurevars(value).globals, **inspect.getclosurevars(value).nonlocals}
        yield from used.items()
        yield from ((f"a default of {name}", item) for item in value.__defaults__ or ())
    elif is_dataclass(value) and not isinstance(value, type):
        yield from ((f"{name}.{f.name}", getattr(value, f.name)) for f in fields(value))
    elif isinstance(value, Mapping):
        yield from ((f"{name}[{key!r}]", item) for key, item in value.items())
    elif isinstance(value, list | tuple):
        yield from ((f"{name}[{k}]", item) for k, item in enumerate(value))


def _described(value: object) -> str:
    if inspect.isfunction(value):
        where = f"at line {value.__code__.co_firstlineno} of {value.__code__.co_filename}"
        return f"a lambda {where}" if value.__name__ == "<lambda>" else f"the function {value.__qualname__} {where}"
    return f"of type {type(value).__name__}"
