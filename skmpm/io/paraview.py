"""Time series for ParaView (5.12 or later): one temporal VTKHDF file that grows with the run.

Format: VTKHDF 2.0, type PolyData (docs.vtk.org, "VTKHDF file format"). Points and fields of every step are
appended to extendible datasets; cells do not change, are written once and referred to by all steps.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skmpm.io.checkpoint import writable
from skmpm.material import determinant
from skmpm.scene import Scene, State, stress_zz

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

CELLS = ("Vertices", "Lines", "Polygons", "Strips")  # in the order of the format's offsets
FIELDS = {"velocity": (3,), "stress": (9,), "pressure": (), "volume": (), "det_F": ()}  # components


@contextmanager
def record(path: str | Path, scene: Scene, *, append: bool = False) -> Iterator[Recorder]:
    """Record states for ParaView; `with record("run.vtkhdf", scene) as film: film.write(state)`.

    The file can be read after every `write`, also while the run continues (a reader that meets an unfinished write
    must read again) and after it is killed. It holds one vertex per material point, a polygon through the boundary of
    every body (lines, if the body has holes), and at the points

    - velocity (3) [m/s], z = 0
    - stress (9) [Pa], Cauchy, row by row, tension positive; zz is that of plane strain, xz = yz = 0
    - pressure [Pa], -(xx + yy)/2, compression positive
    - volume [m2], det_F, and body (integer)

    Positions have double precision, fields single. Polygons are coloured by their boundary points only.

    Parameters
    ----------
    path : the file; ParaView recognises the suffix .vtkhdf
    scene : the scene whose states are written
    append : continue an existing file after its last complete step; steps from the time of the first state written
        on, which a restart from an earlier checkpoint computes again, are replaced

    Raises
    ------
    ImportError
        if h5py is not installed
    FileNotFoundError, IsADirectoryError
        if the directory of the file does not exist, or the path is a directory
    ValueError
        if the file to be continued is not a recording of this scene
    """
    path = writable(path)
    again = append and path.exists()
    with _open(path, "r+" if again else "w") as file:
        if again:
            _check(path, file, scene)
        else:
            _create(file, scene)
        yield Recorder(path, scene, file)


class Recorder:
    """An open recording: see `record`."""

    def __init__(self, path: Path, scene: Scene, file: Any) -> None:
        self._path, self._scene, self._file = path, scene, file
        self._vtk = file["VTKHDF"]
        self._steps = int(self._vtk["Steps"].attrs["NSteps"])
        self._earlier = self._vtk["Steps/Values"][: self._steps]  # times of the run that is continued
        self._t = -np.inf

    def write(self, state: State) -> None:
        """Append a state and flush it to the file.

        Raises
        ------
        ValueError
            if the state does not belong to this scene, or is not later than the last one written
        """
        n = int(self._scene.offsets[-1])
        if state.x.shape != (2, n):
            raise ValueError(
                f"{self._path}: the state has {state.x.shape[1]} points, the scene {n}; record its states"
            )
        self._go_to(state.t)
        k, steps = self._steps, self._vtk["Steps"]
        for name, values in _point_data(self._scene, state).items():
            data = self._vtk["Points"] if name == "Points" else self._vtk["PointData"][name]
            data.resize((k + 1) * n, axis=0)
            data[k * n :] = values
        for name, value in _offsets(k, state.t, n).items():
            steps[name].resize(k + 1, axis=0)
            steps[name][k] = value
        # The step counts only when it is complete in the file: a run may be killed at any line.
        self._file.flush()
        self._steps = steps.attrs["NSteps"] = k + 1
        self._file.flush()

    def _go_to(self, t: float) -> None:
        """Check that time increases; drop the steps of an earlier run that are computed again."""
        if not t > self._t:
            raise ValueError(f"{self._path}: t = {t} s is not later than {self._t} s; write states in order")
        kept = int(np.count_nonzero(self._earlier < t))
        if kept < self._earlier.size:
            self._steps = self._vtk["Steps"].attrs["NSteps"] = kept
            self._file.flush()
        self._earlier, self._t = self._earlier[:0], t


def _open(path: Path, mode: str) -> Any:
    try:
        import h5py
    except ImportError as error:
        raise ImportError('record needs h5py; install it with: pip install "skmpm[io]"') from error
    try:
        # No lock: ParaView can read the file while it grows.
        return h5py.File(path, mode, locking=False)
    except OSError as error:
        if mode == "w":
            raise
        raise ValueError(f"{path}: cannot be continued ({error}); record to a new file with append=False") from error


def _create(file: Any, scene: Scene) -> None:
    n = int(scene.offsets[-1])
    vtk = file.create_group("VTKHDF")
    vtk.attrs["Version"], vtk.attrs["Type"] = np.array([2, 0]), np.bytes_("PolyData")
    vtk["NumberOfPoints"] = np.array([n])
    for name, loops in _cells(scene).items():
        cells = vtk.create_group(name)
        offsets = np.cumsum([0, *map(len, loops)])
        cells["NumberOfCells"] = np.array([len(loops)])
        cells["NumberOfConnectivityIds"] = offsets[-1:]
        cells["Offsets"] = offsets
        cells["Connectivity"] = np.concatenate([np.zeros(0, dtype=np.int64), *loops])
    _growing(vtk, "Points", (3,), np.float64, n)
    vtk["PointData/body"] = scene.owner
    for name, shape in FIELDS.items():
        _growing(vtk, f"PointData/{name}", shape, np.float32, n)
    steps = vtk.create_group("Steps")
    steps.attrs["NSteps"] = 0
    for name, value in _offsets(0, 0.0, n).items():
        steps.create_dataset(
            name, (0, *value.shape), value.dtype, maxshape=(None, *value.shape), chunks=(256, *value.shape)
        )
    file.flush()


def _growing(group: Any, name: str, shape: tuple[int, ...], dtype: type, n: int) -> None:
    """Create a dataset that grows by one chunk per step."""
    sizes = {"shape": (0, *shape), "maxshape": (None, *shape), "chunks": (n, *shape), "dtype": dtype}
    group.create_dataset(name, **sizes, compression="gzip", compression_opts=1, shuffle=True)


def _offsets(k: int, t: float, n: int) -> dict[str, NDArray[Any]]:
    """Entries of step k: its time, and the offsets of its data; the part, its cells and `body` do not change."""
    entries: dict[str, Any] = {
        "Values": float(t),
        "NumberOfParts": 1,
        "PartOffsets": 0,
        "PointOffsets": k * n,
    }
    entries |= {"CellOffsets": [0] * len(CELLS), "ConnectivityIdOffsets": [0] * len(CELLS)}
    entries |= {"PointDataOffsets/body": 0, **{f"PointDataOffsets/{name}": k * n for name in FIELDS}}
    return {name: np.asarray(value) for name, value in entries.items()}


def _cells(scene: Scene) -> dict[str, list[Ints]]:
    """The points of the cells of each type."""
    cells: dict[str, list[Ints]] = {name: [] for name in CELLS}
    cells["Vertices"] = list(np.arange(scene.offsets[-1])[:, None])
    for first, body in zip(scene.offsets, scene.bodies, strict=False):
        loops = body.points.outline
        if _has_hole(body.points.x, loops):
            cells["Lines"] += [first + np.append(loop, loop[0]) for loop in loops]
        else:
            cells["Polygons"] += [first + loop for loop in loops]
    return cells


def _has_hole(x: Array, loops: tuple[Ints, ...]) -> bool:
    """Whether a loop is clockwise, with negative signed area (shoelace formula)."""
    for loop in loops:
        a, b = x[:, loop], x[:, np.roll(loop, -1)]
        if float(np.sum(a[0] * b[1] - a[1] * b[0])) < 0.0:
            return True
    return False


def _check(path: Path, file: Any, scene: Scene) -> None:
    """Raise ValueError unless the file is a recording of this scene."""
    try:
        vtk = file["VTKHDF"]
        same = np.array_equal(vtk["PointData/body"], scene.owner)
        whole = set(FIELDS) <= set(vtk["PointData"]) and "NSteps" in vtk["Steps"].attrs
    except KeyError as error:
        raise ValueError(f"{path}: not a recording ({error}); record to a new file with append=False") from error
    if not (same and whole):
        raise ValueError(f"{path}: a recording of another scene; record to a new file with append=False")


def _point_data(scene: Scene, state: State) -> dict[str, Array]:
    """The fields of a state that are written, points first."""
    sigma, zero = state.stress, np.zeros(state.x.shape[1])
    sigma_zz = stress_zz(scene, state)
    rows = [[sigma[0, 0], sigma[0, 1], zero], [sigma[1, 0], sigma[1, 1], zero], [zero, zero, sigma_zz]]
    return {
        "Points": np.stack([*state.x, zero], axis=1),
        "velocity": np.stack([*state.v, zero], axis=1),
        "stress": np.stack([entry for row in rows for entry in row], axis=1),
        "pressure": -0.5 * (sigma[0, 0] + sigma[1, 1]),
        "volume": state.volume,
        "det_F": determinant(state.F),
    }
