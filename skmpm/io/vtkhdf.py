"""A block of a temporal VTKHDF file: polygonal data that grow by one step at a time.

Format: VTKHDF 2.3, MultiBlockDataSet of PolyData (docs.vtk.org, "VTKHDF file format"). Points and fields of every
step are appended to extendible datasets; cells that do not change are written once and referred to by all steps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

VERSION = np.array([2, 3])
KINDS = ("Vertices", "Lines", "Polygons", "Strips")  # in the order of the format's offsets, and of data of cells
COMPRESSED = 4096  # rows of a step from which on they are compressed: small chunks cost more than they hold
CHUNK = 256  # rows, at least


@dataclass(frozen=True, eq=False)
class PolyData:
    """One step of a block: points, the cells that connect them, and data of both."""

    points: Array  # (n, 3) [m]
    cells: Mapping[str, Sequence[Ints] | Ints]  # by kind, the points of each
    of_points: Mapping[str, NDArray[Any]] = field(default_factory=dict)  # (n, ...)
    of_cells: Mapping[str, NDArray[Any]] = field(default_factory=dict)  # (cells, ...), lines before polygons


class Block:
    """A block of an open file."""

    def __init__(self, group: Any) -> None:
        self._group = group
        self._constant = bool(group.attrs["constant"])

    @classmethod
    def create(cls, root: Any, name: str, first: PolyData, *, constant: bool) -> Block:
        """A new block without steps, for steps like `first`, all with its cells and as many points if `constant`."""
        group = root.create_group(name)
        group.attrs["Version"], group.attrs["Type"] = VERSION, np.bytes_("PolyData")
        group.attrs["constant"] = constant
        _growing(group, "NumberOfPoints", np.zeros(0, dtype=np.int64))
        _growing(group, "Points", first.points, constant=constant)
        for kind in KINDS:
            cells = group.create_group(kind)
            for part in ("NumberOfCells", "NumberOfConnectivityIds", "Offsets", "Connectivity"):
                _growing(cells, part, np.zeros(0, dtype=np.int64))
        for place, data in (("PointData", first.of_points), ("CellData", first.of_cells)):
            group.create_group(place)
            for key, values in data.items():
                _growing(group[place], key, values, constant=constant)
        steps = group.create_group("Steps")
        steps.attrs["NSteps"] = 0
        for name_, shape in (("Values", ()), ("PartOffsets", ()), ("NumberOfParts", ()), ("PointOffsets", ()),
                             ("CellOffsets", (4,)), ("ConnectivityIdOffsets", (4,))):  # fmt: skip
            _growing(steps, name_, np.zeros((0, *shape), dtype=np.float64 if name_ == "Values" else np.int64))
        for place in ("PointData", "CellData"):
            offsets = steps.create_group(f"{place}Offsets")
            for key in group[place]:
                _growing(offsets, key, np.zeros(0, dtype=np.int64))
        block = cls(group)
        if constant:
            _write(group["NumberOfPoints"], 0, [first.points.shape[0]])
            block._append_cells(0, first.cells)
        return block

    def append(self, k: int, t: float, data: PolyData) -> None:
        """Write step k at time t [s], which becomes the last one; it counts once `count` says so."""
        group, steps = self._group, self._group["Steps"]
        before = int(steps["PointOffsets"][k - 1]) + self._rows("PointData", k - 1) if k else 0
        part, cells = 0 if self._constant else k, np.zeros((2, 4), dtype=np.int64)
        if not self._constant:
            _write(group["NumberOfPoints"], k, [data.points.shape[0]])
            cells = self._append_cells(k, data.cells)
        _write(group["Points"], before, data.points)
        row = {"Values": t, "PartOffsets": part, "NumberOfParts": 1, "PointOffsets": before}
        for name, value in (row | {"CellOffsets": cells[0], "ConnectivityIdOffsets": cells[1]}).items():
            _write(steps[name], k, np.asarray(value)[None])
        for place, values in (("PointData", data.of_points), ("CellData", data.of_cells)):
            for key, column in values.items():
                offsets = steps[f"{place}Offsets"][key]
                start = int(offsets[k - 1]) + self._rows(place, k - 1) if k else 0
                _write(group[place][key], start, column)
                _write(offsets, k, [start])

    def count(self, steps: int) -> None:
        """Say how many steps are complete."""
        self._group["Steps"].attrs["NSteps"] = steps

    def _rows(self, place: str, k: int) -> int:
        """Rows of data of step k."""
        part = 0 if self._constant else k
        if place == "PointData":
            return int(self._group["NumberOfPoints"][part])
        return sum(int(self._group[kind]["NumberOfCells"][part]) for kind in KINDS)

    def _append_cells(self, k: int, cells: Mapping[str, Sequence[Ints] | Ints]) -> Ints:
        """Write the cells of part k; return where they and their connectivity begin, (2, 4)."""
        begin = np.zeros((2, 4), dtype=np.int64)
        for i, kind in enumerate(KINDS):
            group, loops = self._group[kind], cells.get(kind, ())
            count, size = (group[part][:k] for part in ("NumberOfCells", "NumberOfConnectivityIds"))
            # Parts without cells get room for one: VTK takes steps whose cells begin at one place for one part.
            begin[:, i] = np.maximum(count, 1).sum(), size.sum()
            ends = np.cumsum([0, *map(len, loops)])
            _write(group["NumberOfCells"], k, [len(loops)])
            _write(group["NumberOfConnectivityIds"], k, [ends[-1]])
            _write(group["Offsets"], int(begin[0, i]) + k, ends if len(loops) else [0, 0])  # every part has one more
            _write(group["Connectivity"], int(begin[1, i]), np.concatenate([np.zeros(0, dtype=np.int64), *loops]))
        return begin


def _growing(group: Any, name: str, like: NDArray[Any], *, constant: bool = False) -> None:
    """Create an empty dataset that grows by rows like these, in every step as many if `constant`.

    Then a chunk is a step, and is compressed if it is large. A compressed chunk that is written again changes its
    size, which the file notes later: of a run that is killed in between it cannot be read. No other is compressed.
    """
    values = np.asarray(like)
    kind = np.float64 if name in ("Points", "Values") else np.int64 if values.dtype.kind in "iub" else np.float32
    sizes = {"shape": (0, *values.shape[1:]), "maxshape": (None, *values.shape[1:]), "dtype": kind}
    chunks = (max(values.shape[0], CHUNK), *values.shape[1:])
    compressed = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
    large = constant and values.shape[0] >= COMPRESSED
    group.create_dataset(name, **sizes, chunks=chunks, **(compressed if large else {}))


def _write(data: Any, start: int, values: Any) -> None:
    """Write rows from `start` on, which become the last ones."""
    rows = np.asarray(values)
    data.resize(start + rows.shape[0], axis=0)
    data[start:] = rows
