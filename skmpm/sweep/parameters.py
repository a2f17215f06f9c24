"""Parameters of members: what they may be, and the name of the directory that follows from them."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from skmpm.sweep.errors import SweepError

LONGEST = 120  # characters of a name; file systems take 255
PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9_.+-]*")  # a text that stands for itself: not a number, no separator
NAME = re.compile(r"[A-Za-z0-9_+=,-][A-Za-z0-9_.+=,-]*")  # of a directory that is given
RESERVED = frozenset({"member", "finished"})  # columns of the table of all members
TIME = "t"  # column of the rows of a run
WORDS = {"true", "false", "none", "nan", "inf", "infinity"}  # read as values


def plain(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters as JSON knows them, sorted by name; SweepError if one is no number, text or list of them."""
    if not isinstance(parameters, Mapping) or not all(isinstance(name, str) for name in parameters):
        raise SweepError(f"a member is {parameters!r}; give a dict of parameters by name")
    return {name: _plain(name, parameters[name]) for name in sorted(parameters)}


def _plain(name: str, value: Any) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, np.ndarray):
        raise SweepError(
            f"the parameter {name!r} is an array of shape {value.shape}; give a member for each of its values or, as"
            f" one value, the list {name}.tolist()"
        )
    if isinstance(value, list | tuple):
        return [_plain(name, item) for item in value]
    if isinstance(value, Mapping):
        return plain(value)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise SweepError(
        f"the parameter {name!r} is a {type(value).__name__}; parameters are numbers, texts, None, lists and dicts of"
        " these, from which build makes objects"
    )


def same(one: Any, other: Any) -> bool:
    """Whether two plain parameters, or dicts of them, are equal; nan is equal to nan."""
    return bool(one == other) or json.dumps(one, sort_keys=True) == json.dumps(other, sort_keys=True)


def check_names(parameters: Mapping[str, Any]) -> None:
    """SweepError if a parameter has the name of a column that every table has."""
    for name in sorted(parameters.keys() & (RESERVED | {TIME})):
        raise SweepError(f"a parameter is named {name!r}, as a column of every table is; give it another name")


def directory(parameters: Mapping[str, Any]) -> str:
    """Name of the directory of plain parameters: "friction=0.5,seed=1".

    Where that would be too long or could stand for other parameters, a hash of them follows.
    """
    parts = [_text(value) for value in parameters.values()]
    name = ",".join(f"{key}={text}" for key, (text, _) in zip(parameters, parts, strict=True)) or "run"
    exact = all(unique for _, unique in parts) and all(PLAIN.fullmatch(key) for key in parameters)
    if exact and len(name) <= LONGEST:
        return name
    digest = hashlib.sha256(json.dumps(parameters, sort_keys=True).encode()).hexdigest()[:10]
    return f"{re.sub(r'[^A-Za-z0-9_.+=,-]', '-', name)[:LONGEST].rstrip('.,')}-{digest}"


def checked_name(name: str) -> str:
    """The name of a directory that is given; SweepError if it is none."""
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise SweepError(f"{name!r} names no directory; use letters, digits and . _ + = , -")
    return name


def _text(value: Any) -> tuple[str, bool]:
    """A value in a name, and whether no other value has the same text."""
    if isinstance(value, str):
        return value, bool(PLAIN.fullmatch(value)) and value.lower() not in WORDS
    if isinstance(value, list | dict):
        return json.dumps(value), False
    return str(value), True
