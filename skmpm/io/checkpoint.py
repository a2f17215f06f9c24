"""Checkpoints: a State in one file, bit for bit; loading never executes code.

The file is an uncompressed .npz archive. Each array is a member named by its field ("state.x",
"state.contacts.gap"). The member "header" is JSON text: the format's tag and schema, the library's version
and the tree of the state's fields, in which an array is given by its member's name and its order in memory,
any other value by itself. The member "sha256" is the digest of the header and of all arrays: names, types,
shapes and bytes.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import UnionType
from typing import IO, Any, Union, cast, get_args, get_origin, get_type_hints
from uuid import uuid4

import numpy as np
from numpy.typing import NDArray

from skmpm.scene import State
from skmpm.values import text_and_attributes

AnyArray = NDArray[Any]

FORMAT = "skmpm checkpoint"
PARTIAL = ".skmpm-"  # begin of the names of files that are being written
SCHEMA = 8  # increased when earlier files can no longer be read
LEFT_OUT = frozenset({"derived"})  # fields that follow from others
ARRAY = "@array"  # marks an array in the tree; no field is named so


class CheckpointError(ValueError):
    """A file that is not a valid checkpoint: names the path, the problem and the remedy.

    Examples
    --------
    >>> import pathlib
    >>> import tempfile
    >>> import skmpm
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "run.checkpoint")
    ...     path.touch()
    ...     try:
    ...         state = skmpm.load(path)
    ...     except skmpm.CheckpointError as error:
    ...         print(str(error)[:10])
    checkpoint
    """

    def __init__(self, path: Path, problem: str, remedy: str) -> None:
        super().__init__(f"checkpoint {path}: {problem}; {remedy}")

    __reduce__ = text_and_attributes


def save(path: str | Path, state: State) -> None:
    """Write a checkpoint; an existing file is replaced atomically.

    All fields except `derived` are kept, bit for bit, including nested dataclasses and dicts.

    Parameters
    ----------
    path : the file, exactly
    state : the state

    Raises
    ------
    OSError
        if the file cannot be written; an existing file is then unchanged
    TypeError
        if the state holds anything but numbers, texts, None, arrays, tuples, dicts and dataclasses

    Examples
    --------
    >>> import pathlib
    >>> import tempfile
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> state = skmpm.step(scene, skmpm.initial(scene), 1e-3)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     skmpm.save(pathlib.Path(folder, "run.checkpoint"), state)
    ...     again = skmpm.load(pathlib.Path(folder, "run.checkpoint"))
    >>> bool((again.x == state.x).all())
    True
    """
    arrays: dict[str, AnyArray] = {}
    tree = _tree(state, "state", arrays)
    about = {"format": FORMAT, "schema": SCHEMA, "skmpm": sys.modules["skmpm"].__version__, "state": tree}
    header = json.dumps(about).encode()
    digest = np.frombuffer(_digest(header, arrays), dtype=np.uint8)
    members = {"header": np.frombuffer(header, dtype=np.uint8), "sha256": digest, **arrays}
    with replacing(Path(path)) as file:
        np.savez(file, **members)  # type: ignore[arg-type]


def load(path: str | Path) -> State:
    """Read a checkpoint written by `save`; `step` rebuilds the fields that are not saved.

    Parameters
    ----------
    path : the file

    Returns
    -------
    the state

    Raises
    ------
    OSError
        if the file cannot be opened
    CheckpointError
        if the file is not a checkpoint, is truncated or damaged, or was written by a newer version

    Examples
    --------
    >>> import pathlib
    >>> import tempfile
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> state = skmpm.step(scene, skmpm.initial(scene), 1e-3)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     skmpm.save(pathlib.Path(folder, "run.checkpoint"), state)
    ...     again = skmpm.load(pathlib.Path(folder, "run.checkpoint"))
    >>> again.t
    0.001
    >>> *_, state = skmpm.simulate(scene, dt=1e-3, until=2e-3, start=again)
    """
    path = Path(path)
    with path.open("rb") as file:
        members = _members(path, file)
    about = _header(path, members)
    try:
        return cast(State, _built(State, about["state"], members))
    except Exception as error:
        raise CheckpointError(
            path,
            f"its fields are not those of a State of this version ({error})",
            f"load it with skmpm {about.get('skmpm')}, which wrote it",
        ) from error


def _tree(value: Any, name: str, arrays: dict[str, AnyArray]) -> Any:
    """Convert a value to JSON types; its arrays are added to `arrays`."""
    if is_dataclass(value) and not isinstance(value, type):
        value = {f.name: getattr(value, f.name) for f in fields(value) if f.name not in LEFT_OUT}
    if isinstance(value, Mapping):
        if not all(isinstance(key, str) for key in value):
            raise TypeError(f"save: the keys of {name} are {list(value)}; a checkpoint holds only text as keys")
        return {key: _tree(item, f"{name}.{key}", arrays) for key, item in value.items()}
    if isinstance(value, tuple):
        return [_tree(item, f"{name}.{i}", arrays) for i, item in enumerate(value)]
    if isinstance(value, np.ndarray) and value.dtype.kind in "biufcSU":
        arrays[name] = value
        return {ARRAY: name, "axes": _axes(value)}
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(
        f"save: {name} is a {type(value).__name__}; a checkpoint holds numbers, texts, None, arrays of these,"
        " tuples, dicts and dataclasses"
    )


def _axes(array: AnyArray) -> list[int]:
    """The axes from slow to fast in memory, kept because the round-off of sums depends on it."""
    return [int(axis) for axis in np.argsort(-np.abs(array.strides), kind="stable")]


def _built(kind: Any, tree: Any, members: dict[str, AnyArray]) -> Any:
    """Inverse of `_tree`, by the declared type of the value; fields missing in the file take their default."""
    if isinstance(tree, list):
        return tuple(_built(Any, item, members) for item in tree)
    if not isinstance(tree, dict):
        return tree
    if ARRAY in tree:
        axes = tree["axes"]
        return members[tree[ARRAY]].transpose(axes).copy(order="C").transpose(np.argsort(axes))
    options = get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)
    made = next((option for option in options if is_dataclass(option)), None)
    if made is None:
        inner = next((get_args(option)[-1] for option in options if get_origin(option) is dict), Any)
        return {key: _built(inner, item, members) for key, item in tree.items()}
    hints = get_type_hints(made)
    unknown = sorted(tree.keys() - hints.keys())
    if unknown:
        raise TypeError(f"{getattr(made, '__name__', made)} has no field {', '.join(unknown)}")
    return cast(Any, made)(**{name: _built(hints[name], item, members) for name, item in tree.items()})


def _digest(header: bytes, arrays: Mapping[str, AnyArray]) -> bytes:
    """SHA-256 of the header and of the arrays: names, types, shapes and bytes."""
    digest = hashlib.sha256(header)
    for name, array in sorted(arrays.items()):
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.digest()


def _members(path: Path, file: IO[bytes]) -> dict[str, AnyArray]:
    """Read all arrays of the archive; CRCs are checked first, so that no damaged size is used."""
    start = file.read(4)
    if start != b"PK\x03\x04":
        raise CheckpointError(path, "it is empty" if not start else "it is not a checkpoint", _GIVE)
    file.seek(0)
    try:
        with zipfile.ZipFile(file) as archive:
            damaged = archive.testzip()
            if damaged is not None:
                raise ValueError(f"member {damaged} fails its check sum")
        file.seek(0)
        with np.load(file, allow_pickle=False) as archive:
            return dict(archive)
    except Exception as error:  # damaged archives raise many types of exceptions
        raise CheckpointError(path, f"it is cut short or damaged ({error})", _GO_BACK) from error


def _header(path: Path, members: dict[str, AnyArray]) -> dict[str, Any]:
    """Remove and return the header of an intact checkpoint that this version can read."""
    header, digest = members.pop("header", None), members.pop("sha256", None)
    if header is None or digest is None:
        raise CheckpointError(path, "it is an archive of other arrays, not a checkpoint", _GIVE)
    text = header.tobytes()
    if _digest(text, members) != digest.tobytes():
        raise CheckpointError(path, "its contents do not match its check sum: bits have changed", _GO_BACK)
    try:
        about = dict(json.loads(text))
    except ValueError as error:
        raise CheckpointError(path, f"its header is not JSON ({error})", _GIVE) from error
    if about.get("format") != FORMAT:
        raise CheckpointError(path, f"its format is {about.get('format')!r}, not {FORMAT!r}", _GIVE)
    if about.get("schema") != SCHEMA:
        raise CheckpointError(
            path,
            f"its schema is {about.get('schema')}, this version reads {SCHEMA}; it was written by"
            f" skmpm {about.get('skmpm')}",
            "load it with that version" + (" or a later one" if about.get("schema", 0) > SCHEMA else ""),
        )
    return about


_GIVE = "give a file written by skmpm.save"
_GO_BACK = "go back to an earlier checkpoint or start the run again"


def writable(path: str | Path) -> Path:
    """The resolved path; FileNotFoundError or IsADirectoryError if no file can be written there."""
    path = Path(path).resolve()
    if path.is_dir():
        raise IsADirectoryError(f"{path} is a directory; give a file in it")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: there is no directory {path.parent}; create it first")
    return path


@contextmanager
def replacing(path: Path) -> Iterator[IO[bytes]]:
    """Yield a file that replaces `path` once it is written to disk; it is removed on failure."""
    path = writable(path)
    temporary = path.parent / f"{PARTIAL}{uuid4().hex}.tmp"
    try:
        with temporary.open("xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    _sync_directory(path.parent)


def _sync_directory(directory: Path) -> None:
    """Make the new name survive a loss of power, where the system supports it (Windows does not)."""
    with suppress(OSError):
        handle = os.open(directory, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
