"""What is recorded of a state: blocks of a temporal VTKHDF file, which grow by one step at a time.

Blocks are points, bodies, contacts and walls. Format: VTKHDF 2.3, MultiBlockDataSet of PolyData (docs.vtk.org,
"VTKHDF file format"). Points and fields of every step are appended to extendible datasets; cells that do not change
are written once and referred to by all steps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skmpm import outline
from skmpm.arrays import Array, Ints
from skmpm.material import determinant
from skmpm.observe import force_lines, network, observe
from skmpm.scene import Scene, State, box_corners, into_box, plastic_strain, stress_zz, view_of, wall_lines

VERSION = np.array([2, 3])
KINDS = ("Vertices", "Lines", "Polygons", "Strips")  # in the order of the format's offsets, and of data of cells
CHUNK = 256  # rows, at least
PARTS = 4  # lines between two boundary points of a recorded outline
OF_CONTACTS = ("first", "second", "normal_force", "tangential_force", "mobilised_friction", "length")
OF_BODIES = ("pressure", "deviatoric_stress", "coordination", "volume_ratio", "aspect_ratio")


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
        growing(group, "NumberOfPoints", np.zeros(0, dtype=np.int64))
        growing(group, "Points", first.points, constant=constant)
        for kind in KINDS:
            cells = group.create_group(kind)
            for part in ("NumberOfCells", "NumberOfConnectivityIds", "Offsets", "Connectivity"):
                growing(cells, part, np.zeros(0, dtype=np.int64))
        for place, data in (("PointData", first.of_points), ("CellData", first.of_cells)):
            group.create_group(place)
            for key, values in data.items():
                growing(group[place], key, values, constant=constant)
        steps = group.create_group("Steps")
        steps.attrs["NSteps"] = 0
        for key in ("Values", "PartOffsets", "NumberOfParts", "PointOffsets", "CellOffsets", "ConnectivityIdOffsets"):
            of_kinds = key in ("CellOffsets", "ConnectivityIdOffsets")
            growing(steps, key, np.zeros((0, len(KINDS)) if of_kinds else 0, dtype=np.int64))
        for place in ("PointData", "CellData"):
            offsets = steps.create_group(f"{place}Offsets")
            for key in group[place]:
                growing(offsets, key, np.zeros(0, dtype=np.int64))
        block = cls(group)
        if constant:
            write(group["NumberOfPoints"], 0, [first.points.shape[0]])
            block._append_cells(0, first.cells)
        return block

    def append(self, k: int, t: float, data: PolyData) -> None:
        """Write step k at time t [s], which becomes the last one; it counts once `count` says so."""
        group, steps = self._group, self._group["Steps"]
        before = int(steps["PointOffsets"][k - 1]) + self._rows("PointData", k - 1) if k else 0
        part, cells = 0 if self._constant else k, np.zeros((2, 4), dtype=np.int64)
        if not self._constant:
            write(group["NumberOfPoints"], k, [data.points.shape[0]])
            cells = self._append_cells(k, data.cells)
        write(group["Points"], before, data.points)
        row = {"Values": t, "PartOffsets": part, "NumberOfParts": 1, "PointOffsets": before}
        for name, value in (row | {"CellOffsets": cells[0], "ConnectivityIdOffsets": cells[1]}).items():
            write(steps[name], k, np.asarray(value)[None])
        for place, values in (("PointData", data.of_points), ("CellData", data.of_cells)):
            for key, column in values.items():
                offsets = steps[f"{place}Offsets"][key]
                start = int(offsets[k - 1]) + self._rows(place, k - 1) if k else 0
                write(group[place][key], start, column)
                write(offsets, k, [start])

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
            write(group["NumberOfCells"], k, [len(loops)])
            write(group["NumberOfConnectivityIds"], k, [ends[-1]])
            write(group["Offsets"], int(begin[0, i]) + k, ends if len(loops) else [0, 0])  # every part has one more
            write(group["Connectivity"], int(begin[1, i]), np.concatenate([np.zeros(0, dtype=np.int64), *loops]))
        return begin


def growing(group: Any, name: str, like: NDArray[Any], *, constant: bool = False) -> None:
    """Create an empty dataset that grows by rows like these, in every step as many if `constant`: a chunk of it.

    Chunks are not compressed: that takes as long as a step. A compressed one that is written again changes its size,
    which the file notes later: of a run that is killed in between it cannot be read.
    """
    values = np.asarray(like)
    kind = np.float64 if name in ("Points", "Values") else np.int64 if values.dtype.kind in "iub" else np.float32
    rows = max(values.shape[0], CHUNK) if constant else CHUNK
    shape, chunks = (0, *values.shape[1:]), (rows, *values.shape[1:])
    group.create_dataset(name, shape, kind, maxshape=(None, *shape[1:]), chunks=chunks)


def write(data: Any, start: int, values: Any) -> None:
    """Write rows from `start` on, which become the last ones."""
    rows = np.asarray(values)
    data.resize(start + rows.shape[0], axis=0)
    data[start:] = rows


def blocks_of(scene: Scene, state: State) -> dict[str, PolyData]:
    """The blocks of a state by name."""
    shift = into_box(state.centres, state.box)
    x = state.x + shift[:, state.body]
    blocks = {
        "points": _points(scene, state, x),
        "bodies": _bodies(scene, state, x),
        "contacts": _contacts(scene, state, shift),
        "walls": _walls(state, x),
    }
    return blocks if state.box is None else blocks | {"box": _box(state.box)}


def _points(scene: Scene, state: State, x: Array) -> PolyData:
    """One vertex per material point where it is shown, x (2, n) [m]: with its body in the periodic box."""
    sigma, zero = state.stress, np.zeros(state.x.shape[1])
    rows = [[sigma[0, 0], sigma[0, 1], zero], [sigma[1, 0], sigma[1, 1], zero], [zero, zero, stress_zz(scene, state)]]
    data = {
        "body": scene.owner,
        "velocity": _in_space(state.v),
        "displacement": _in_space(state.x - scene.initial_positions),
        "stress": np.stack([entry for row in rows for entry in row], axis=1),
        "pressure": -0.5 * (sigma[0, 0] + sigma[1, 1]),
        "volume": state.volume,
        "det_F": determinant(state.F),
    }
    if state.internal.size:
        data["plastic_strain"] = plastic_strain(scene, state.internal)
    return PolyData(_in_space(x), {"Vertices": np.arange(x.shape[1])[:, None]}, data)


def _bodies(scene: Scene, state: State, x: Array) -> PolyData:
    """The smooth boundaries: a polygon per body, lines for those with holes, with data of the body."""
    place = scene.outlines.point
    curve = outline.polylines(scene.outlines, scene.initial_positions[:, place], x[:, place], PARTS)
    owner = curve.outlines.body[curve.loops[:-1]]
    loops = [np.arange(*curve.loops[i : i + 2]) for i in range(owner.size)]
    single = np.bincount(owner, minlength=len(scene.bodies))[owner] == 1
    lines = [np.append(loop, loop[0]) for loop, one in zip(loops, single, strict=True) if not one]
    cells: dict[str, Sequence[Ints] | Ints] = {
        "Lines": lines,
        "Polygons": [loop for loop, one in zip(loops, single, strict=True) if one],
    }
    body = np.concatenate([owner[~single], owner[single]])
    seen = observe(scene, state).bodies
    start, mass = scene.offsets[:-1], np.add.reduceat(state.mass, scene.offsets[:-1])
    velocity = np.add.reduceat(state.mass * state.v, start, axis=1) / mass
    data = {"body": body, "velocity": _in_space(velocity[:, body]), "force": _in_space(state.body_force[:, body])}
    return PolyData(_in_space(curve.x), cells, {}, data | {name: getattr(seen, name)[body] for name in OF_BODIES})


def _contacts(scene: Scene, state: State, shift: Array) -> PolyData:
    """A line for each pair of bodies that touch, between their centres, with its forces."""
    pairs = network(scene, state)
    ends = force_lines(scene, state, pairs)
    number = np.arange(2 * pairs.size)
    table = pairs.table()
    data = {name: table[name] for name in OF_CONTACTS}
    data |= {"point": _in_space(pairs.centre + shift[:, pairs.bodies[0]]), "normal": _in_space(pairs.normal)}
    return PolyData(_in_space(ends.reshape(-1, 2).T), {"Lines": number.reshape(-1, 2)}, {}, data)


def _walls(state: State, x: Array) -> PolyData:
    """A line for each wall near the points where they are shown, x (2, n) [m]."""
    lines, walls = wall_lines(state.walls, state.wall_normals, view_of(x, state.walls, state.wall_normals))
    point, normal = state.walls[walls].T, state.wall_normals[walls].T
    force = _in_space(state.wall_force[walls].T)
    data = {"wall": -1 - walls, "point": _in_space(point), "normal": _in_space(normal), "force": force}
    cells = {"Lines": np.arange(2 * walls.size).reshape(-1, 2)}
    return PolyData(_in_space(lines.reshape(-1, 2).T), cells, {}, data)


def _box(box: Array) -> PolyData:
    """The periodic box as a closed line, its edge if it has only one."""
    corners = box_corners(box, np.zeros((2, 1)))[:, : 2 * box.shape[1]]
    return PolyData(_in_space(corners), {"Lines": [np.append(np.arange(corners.shape[1]), 0)]}, {}, {})


def _in_space(vectors: Array) -> Array:
    """Vectors (2, k) with a third component 0, (k, 3)."""
    return np.stack([*vectors, np.zeros(vectors.shape[1])], axis=1)
