"""`Sweep`: the results of all members, as one table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from skmpm.io import load
from skmpm.optional import data_frame
from skmpm.representation import line
from skmpm.scene import State
from skmpm.sweep.directory import MANIFEST, SweepError, plain, read_manifest, same
from skmpm.sweep.records import LAST, Column, read_table


@dataclass(frozen=True, eq=False)
class Member:
    """One member of a `Sweep`.

    Attributes
    ----------
    folder : its directory, named after its parameters
    parameters : those of `build`, sorted by name
    status : "finished", "failed", "interrupted", or "running" where its process was killed or runs elsewhere
    error : why it failed, or an empty text
    columns : its table by name, (rows,) each; empty without rows
    """

    folder: Path
    parameters: dict[str, Any]
    status: str
    error: str
    columns: dict[str, Column] = field(repr=False)

    @property
    def name(self) -> str:
        """Name of the directory."""
        return self.folder.name

    @property
    def rows(self) -> int:
        """Rows of its table."""
        return next(iter(self.columns.values())).size if self.columns else 0

    @property
    def manifest(self) -> dict[str, Any]:
        """Parameters, versions, command and times, as read from its file."""
        return read_manifest(self.folder)

    def state(self, name: str = "last") -> State:
        """The last state of a member, or one that `Run.keep` kept.

        Parameters
        ----------
        name : "last", or the name of the kept state

        Returns
        -------
        the state

        Raises
        ------
        FileNotFoundError
            if there is none
        """
        return load(self.folder / (LAST if name == "last" else f"{name}.checkpoint"))


@dataclass(frozen=True, eq=False, repr=False)
class Sweep:
    """The members of a sweep and their tables; `sweep` returns it.

    Attributes
    ----------
    members : the members in the order of the parameters given to `sweep`

    Examples
    --------
    >>> import skmpm
    >>> result = skmpm.sweep(lambda E: {"stiffness": E}, [{"E": 1e6}, {"E": 2e6}], out="results")  # doctest: +SKIP
    >>> len(result.members), len(result.failed)  # doctest: +SKIP
    (2, 0)
    """

    members: tuple[Member, ...]

    @classmethod
    def read(cls, out: str | Path) -> Sweep:
        """Read a directory that `sweep` wrote, as far as its members have come.

        Parameters
        ----------
        out : the directory

        Returns
        -------
        the members, sorted by name

        Raises
        ------
        FileNotFoundError
            if there is no such directory
        """
        if not Path(out).is_dir():
            raise FileNotFoundError(f"Sweep.read: there is no directory {out}")
        return cls(tuple(read_member(path.parent) for path in sorted(Path(out).glob(f"*/{MANIFEST}"))))

    def __iter__(self) -> Iterator[Member]:
        return iter(self.members)

    def __len__(self) -> int:
        return len(self.members)

    def __getitem__(self, name: str) -> Member:
        """The member of a name; KeyError if there is none."""
        found = {member.name: member for member in self.members}
        if name not in found:
            raise KeyError(f"{name!r} is none of the members {', '.join(found)}")
        return found[name]

    @property
    def failed(self) -> dict[str, str]:
        """Errors of the members that failed, by name."""
        return {member.name: member.error for member in self.members if member.status == "failed"}

    @property
    def finished(self) -> Sweep:
        """The members that have finished."""
        return Sweep(tuple(member for member in self.members if member.status == "finished"))

    def where(self, **parameters: Any) -> Sweep:
        """Members with given parameters.

        Parameters
        ----------
        parameters : values by name

        Returns
        -------
        these members

        Raises
        ------
        SweepError
            if no member has a parameter of that name
        """
        for name in parameters:
            if not any(name in member.parameters for member in self.members):
                known = sorted({key for member in self.members for key in member.parameters})
                raise SweepError(f"where: no member has a parameter {name!r}; they have {', '.join(known) or 'none'}")
        wanted = plain(parameters)

        def chosen(own: Mapping[str, Any]) -> bool:
            return all(name in own and same(own[name], value) for name, value in wanted.items())

        return Sweep(tuple(member for member in self.members if chosen(member.parameters)))

    to_pandas = data_frame

    def table(self) -> dict[str, Column]:
        """Columns (rows,) of all members below each other by name, as `pandas.DataFrame` takes them.

        ``member`` (its name), ``finished`` (whether it is), the parameters, then the columns of the rows. What a
        member does not have is nan among numbers and an empty text among texts.
        """
        parts = [
            {"member": m.name, "finished": m.status == "finished", **m.parameters, **m.columns} for m in self.members
        ]
        names = dict.fromkeys(name for m in self.members for name in ("member", "finished", *m.parameters))
        names |= dict.fromkeys(name for m in self.members for name in m.columns)
        rows = [member.rows for member in self.members]
        return {name: _joined([part.get(name) for part in parts], rows) for name in names}

    def __repr__(self) -> str:
        facts: dict[str, object] = {"": f"{len(self.members)} members"}
        for status in ("failed", "interrupted", "running"):
            count = sum(member.status == status for member in self.members)
            facts |= {status: count} if count else {}
        return line("Sweep", facts | {"rows": sum(member.rows for member in self.members)})


def read_member(folder: Path, status: str = "", error: str = "") -> Member:
    """A member from its directory; `status` and `error` replace those of its manifest."""
    about = read_manifest(folder) or {"parameters": {}, "status": status, "error": error}
    columns = read_table(folder, finished=about["status"] == "finished")
    return Member(folder, about["parameters"], status or about["status"], error or about["error"], columns)


def _joined(parts: Sequence[Any], rows: Sequence[int]) -> Column:
    """Columns, or values that are the same in every row, below each other; None stands for what is not there."""
    sized = [(str(p) if isinstance(p, list | dict) else p, n) for p, n in zip(parts, rows, strict=True)]
    there = [np.full(n, part) for part, n in sized if part is not None]
    texts = any(column.dtype.kind == "U" for column in there)
    left = iter(there)
    columns = [np.full(n, "" if texts else np.nan) if part is None else next(left) for part, n in sized]
    return np.concatenate([column.astype(str) for column in columns] if texts else columns)
