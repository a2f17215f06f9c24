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
from dataclasses import dataclass, field
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
    """The table of a run in its directory; `commit` may be repeated after an error in it."""

    folder: Path
    names: list[str] = field(default_factory=list)  # of the columns
    size: int = 0  # bytes of the table that stay
    held: bytes = b""  # rows that are held back, to follow them

    @classmethod
    def opened(cls, folder: Path) -> tuple[Records, State | None]:
        """The records of a directory up to its checkpoint, and the state there; None if there is no checkpoint."""
        if not (folder / LAST).exists():
            return cls(folder), None
        state = load(folder / LAST)
        table = (folder / TABLE).read_bytes() if (folder / TABLE).exists() else b""
        lines = table.split(b"\n")[:-1]  # the last is empty, or was cut
        late = (k for k, line in enumerate(lines[1:], start=1) if float(line.partition(b",")[0]) > state.t)
        kept = [line + b"\n" for line in lines[: next(late, len(lines))]]
        names = next(csv.reader([kept[0].decode()])) if kept else []
        return cls(folder, names, sum(map(len, kept))), state

    def add(self, row: Row) -> None:
        """Hold a row back; ValueError if its columns are not those of the first."""
        if not self.names:
            self.names, self.held = list(row), _line(row)
        if list(row) != self.names:
            odd = sorted(set(row) ^ set(self.names)) or list(row)
            raise ValueError(f"a row has other columns than the first, or another order: {', '.join(odd)}")
        self.held += _line(row.values())

    def commit(self, state: State | None) -> None:
        """Write the rows that were held back, then the checkpoint they belong to, each to the disk."""
        with (self.folder / TABLE).open("ab") as file:
            file.truncate(self.size)
            file.write(self.held)
            file.flush()
            os.fsync(file.fileno())
        if state is not None:
            save(self.folder / LAST, state)
        self.size, self.held = self.size + len(self.held), b""

    def last_row(self) -> dict[str, Value]:
        """The last row that was written, read back; empty if there is none."""
        table = (self.folder / TABLE).read_bytes()[: self.size] if self.size else b""
        return {name: column[-1].item() for name, column in parsed(table).items()}


def _line(values: Iterable[object]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(list(values))
    return text.getvalue().encode()


def read_table(folder: Path, *, finished: bool) -> dict[str, Column]:
    """Columns (rows,) of the table of a directory by name; of a run that has not finished, up to its checkpoint."""
    if not (folder / TABLE).exists():
        return {}
    return parsed((folder / TABLE).read_bytes()[: None if finished else Records.opened(folder)[0].size])


def parsed(table: bytes) -> dict[str, Column]:
    """Columns (rows,) of a table by name: of integers, numbers, truth values or texts."""
    rows = list(csv.reader(io.StringIO(table.decode(), newline="")))
    return {name: _column(values) for name, *values in zip(*rows, strict=True)} if len(rows) > 1 else {}


def _column(texts: list[str]) -> Column:
    if set(texts) <= {"True", "False"}:
        return np.array([text == "True" for text in texts])
    numbers = [_number(text) for text in texts]
    return np.array(texts if None in numbers else numbers)


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
