"""Table and checkpoint of a run, which are written together.

Rows are held back until a checkpoint is due. They are appended to the table first; then the checkpoint is replaced. A
process killed in between leaves rows that are later than the checkpoint, which `Records.opened` leaves out: the run
goes on from the checkpoint and writes them again.
"""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from skmpm.io import load, save
from skmpm.scene import State
from skmpm.sweep.run import Row, Value

TABLE, LAST = "table.csv", "last.checkpoint"
Column = NDArray[np.generic]


@dataclass(eq=False)
class Records:
    """The table of a run in its directory.

    An exception that a signal raises does no harm anywhere: `commit` may be repeated as long as `file` is as it was.
    """

    folder: Path
    names: list[str]  # of the columns
    file: tuple[int, bytes]  # bytes of the table that stay, and those that are held back to follow them

    @classmethod
    def opened(cls, folder: Path) -> tuple[Records, State | None]:
        """The records of a directory up to its checkpoint, and the state there; None if there is no checkpoint."""
        if not (folder / LAST).exists():
            return cls(folder, [], (0, b"")), None
        state = load(folder / LAST)
        table = (folder / TABLE).read_bytes() if (folder / TABLE).exists() else b""
        lines = _until(table, state.t)
        names = next(csv.reader([lines[0].decode()])) if lines else []
        return cls(folder, names, (len(b"".join(lines)), b"")), state

    def add(self, row: Row) -> None:
        """Hold a row back; ValueError if its columns are not those of the first."""
        header = b"" if self.names else _line(row)
        self.names = self.names or list(row)
        if list(row) != self.names:
            odd = sorted(set(row) ^ set(self.names)) or list(row)
            raise ValueError(f"a row has other columns than the first, or another order: {', '.join(odd)}")
        written, held = self.file
        self.file = written, held + header + _line(row.values())

    def commit(self, state: State | None) -> None:
        """Write the rows that were held back, then the checkpoint they belong to, each to the disk."""
        written, held = self.file
        path = self.folder / TABLE
        with path.open("r+b" if path.exists() else "w+b") as file:
            file.truncate(written)
            file.seek(written)
            file.write(held)
            file.flush()
            os.fsync(file.fileno())
        if state is not None:
            save(self.folder / LAST, state)
        self.file = written + len(held), b""

    def last_row(self) -> dict[str, Value] | None:
        """The last row that was written, read back; None if there is none."""
        table = (self.folder / TABLE).read_bytes()[: self.file[0]] if self.file[0] else b""
        columns = parsed(table.decode())
        return {name: column[-1].item() for name, column in columns.items()} or None


def _line(values: Iterable[object]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(list(values))
    return text.getvalue().encode()


def _until(table: bytes, t: float) -> list[bytes]:
    """The header and the rows up to a time, which is the first column."""
    lines = table.split(b"\n")[:-1]  # the last is empty, or was cut
    late = (k for k, line in enumerate(lines[1:], start=1) if float(line.partition(b",")[0]) > t)
    return [line + b"\n" for line in lines[: next(late, len(lines))]]


def read_table(folder: Path, *, finished: bool) -> dict[str, Column]:
    """Columns (rows,) of the table of a directory by name; of a run that has not finished, up to its checkpoint."""
    if not (folder / TABLE).exists():
        return {}
    table = (folder / TABLE).read_bytes()
    return parsed(table[: None if finished else Records.opened(folder)[0].file[0]].decode())


def parsed(text: str) -> dict[str, Column]:
    """Columns (rows,) of a table by name: of integers, numbers, truth values or texts."""
    rows = list(csv.reader(io.StringIO(text, newline="")))
    if len(rows) < 2:
        return {}
    return {name: _column(values) for name, *values in zip(*rows, strict=True)}


def _column(values: list[str]) -> Column:
    if set(values) <= {"True", "False"}:
        return np.array([value == "True" for value in values])
    numbers = [_number(value) for value in values]
    return np.array(values if None in numbers else numbers)


def _number(text: str) -> float | None:
    """The number that is written as this text; None if none is, as of "1e5", "1_000", "007" or "+7"."""
    for kind in (int, float):
        try:
            number = kind(text)
        except ValueError:
            continue
        if str(number) == text:
            return number
    return None
