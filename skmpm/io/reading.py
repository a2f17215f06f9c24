"""`read`: the frames of a recording as arrays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from skmpm.arrays import Array, Bools, Ints
from skmpm.io.blocks import KINDS
from skmpm.io.recording import open_file
from skmpm.optional import optional
from skmpm.representation import with_shapes

# Of scalars, vectors and tensors, by the number of dimensions of their arrays.
DIMENSIONS: dict[int, tuple[str, ...]] = {1: (), 2: ("axis",), 3: ("row", "column")}


@dataclass(frozen=True, eq=False, repr=False)
class Frame:
    """One time of a recording, in the precision of the file: positions double, fields single.

    Attributes
    ----------
    t : time [s]
    x : (2, n) positions of the material points [m]
    points : fields by point: body (n,), velocity [m/s] and displacement [m] (2, n), stress (3, 3, n) and pressure
        (n,) [Pa], volume (n,) [m2], det_F (n,), with materials with memory plastic_strain (n,)
    outlines : the smooth boundaries, loops of points (2, k) [m]; holes are loops of their own
    bodies : fields by loop, several for a body with holes: body, velocity and force (2, loops), and observables of
        the body, as `record` lists them
    contacts : fields by pair of bodies that touch, as `record` lists them, point and normal (2, k), and lines
        (k, 2, 2) [m] between them
    box : (2, 2) or (2, 1) edges of the periodic box as columns [m], None without one; bodies are
        those with centres in it
    walls : wall (k,), point [m], normal and force [N/m] (2, k) of the walls near the bodies, and their lines
        (k, 2, 2) [m]
    deformable : (bodies,) whether bodies deform
    boundary_points, held_points : indices of the material points on the outlines, loop after loop, and of those held
        by supports
    """

    t: float
    x: Array
    points: dict[str, NDArray[Any]]
    outlines: tuple[Array, ...]
    bodies: dict[str, NDArray[Any]]
    contacts: dict[str, NDArray[Any]]
    walls: dict[str, NDArray[Any]]
    box: Array | None
    deformable: Bools
    boundary_points: Ints
    held_points: Ints

    __repr__ = with_shapes


class Recording(Sequence[Frame]):
    """The frames of a recording, a sequence; each is read from the file when it is asked for.

    Attributes
    ----------
    path : the file
    t : times of the frames [s]
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with open_file(path, "r") as file:
            constants = ("deformable", "boundary_points", "held_points")
            self._constants = {name: file["skmpm"][name][()] for name in constants}
            steps = file["VTKHDF/Steps"]
            self.t: Array = steps["Values"][: steps.attrs["NSteps"]]  # times of the frames [s]

    def __len__(self) -> int:
        return int(self.t.size)

    @overload
    def __getitem__(self, k: int) -> Frame: ...
    @overload
    def __getitem__(self, k: slice) -> list[Frame]: ...
    def __getitem__(self, k: int | slice) -> Frame | list[Frame]:
        if isinstance(k, slice):
            return [self[i] for i in range(*k.indices(len(self)))]
        k = self._frame(k)
        with open_file(self.path, "r") as file:
            vtk = file["VTKHDF"]
            x, points, _, _ = _step(vtk["points"], k)
            boundary, _, bodies, loops = _step(vtk["bodies"], k)
            ends, _, contacts, _ = _step(vtk["contacts"], k)
            corners, _, walls, _ = _step(vtk["walls"], k)
            box = _step(vtk["box"], k)[0][:, 1::2] if "box" in vtk else None
        order = np.argsort([loop[0] for loop in loops])  # as in the scene, where holes do not come first
        closed = [loop[:-1] if loop[0] == loop[-1] else loop for loop in loops]
        outlines = tuple(boundary[:, closed[i]] for i in order)
        bodies = {name: values[..., order] for name, values in bodies.items()}
        contacts["lines"], walls["lines"] = (place.T.reshape(-1, 2, 2) for place in (ends, corners))
        return Frame(float(self.t[k]), x, points, outlines, bodies, contacts, walls, box, **self._constants)

    def _frame(self, k: int) -> int:
        """The number of a frame, counted from the end if negative."""
        if not -len(self) <= k < len(self):
            raise IndexError(f"{self.path}: there is no frame {k}; give one of {len(self)}, counted from 0")
        return k % len(self)

    def __iter__(self) -> Iterator[Frame]:
        return (self[k] for k in range(len(self)))

    def to_xarray(self) -> Any:
        """All frames as one `xarray.Dataset` over time ``t``, in memory.

        Fields of points have the dimension ``point`` and the coordinate ``body``. Fields by loop of the outlines are
        ``body_...`` with the dimension ``loop``. Contacts and walls, whose number changes, are ``contact_...`` and
        ``wall_...``, those of all frames one after the other; ``contact_t`` and ``wall_t`` are their times.

        Raises
        ------
        ImportError
            if xarray is not installed
        ValueError
            if the recording has no frames
        """
        xarray, frames = optional("xarray", "to_xarray", "tables"), list(self)
        if not frames:
            raise ValueError(f"{self.path}: the recording has no frames yet; write states first")
        data: dict[str, Any] = {"position": (("t", "axis", "point"), np.stack([frame.x for frame in frames]))}
        for prefix, kind, last in (("", "points", "point"), ("body_", "bodies", "loop")):
            for name, first in getattr(frames[0], kind).items():
                values = np.stack([getattr(frame, kind)[name] for frame in frames])
                data[prefix + name] = (("t", *DIMENSIONS[first.ndim], last), values)
        for prefix, kind in (("contact", "contacts"), ("wall", "walls")):
            parts = [getattr(frame, kind) for frame in frames]
            for name in (name for name in parts[0] if name != "lines"):
                values = np.concatenate([part[name] for part in parts], axis=-1)
                data[f"{prefix}_{name}"] = ((*DIMENSIONS[values.ndim], prefix), values)
            data[f"{prefix}_t"] = (prefix, np.repeat(self.t, [len(part["lines"]) for part in parts]))
        if boxes := [frame.box for frame in frames if frame.box is not None]:
            data["box"] = (("t", "axis", "edge"), np.stack(boxes))
        data["wall_index"] = data.pop("wall_wall")
        data["body_index"], data["body"] = ("loop", data.pop("body_body")[1][0]), ("point", data["body"][1][0])
        return xarray.Dataset(data, {"t": self.t, "axis": ["x", "y"]}).set_coords(["body", "contact_t", "wall_t"])

    def to_pyvista(self, k: int = -1) -> Any:
        """One frame as a `pyvista.MultiBlock` of points, bodies, contacts, walls and box.

        Parameters
        ----------
        k : number of the frame

        Returns
        -------
        the blocks

        Raises
        ------
        ImportError
            if pyvista is not installed
        IndexError
            if there is no such frame
        """
        reader = optional("pyvista", "to_pyvista").get_reader(str(self.path))
        reader.reader.SetStep(self._frame(k))
        return reader.read()

    def __repr__(self) -> str:
        return f"Recording({str(self.path)!r}, {len(self)} frames)"


def read(path: str | Path) -> Recording:
    """Open a recording: `for frame in read("run.vtkhdf")`, `read("run.vtkhdf")[-1]`.

    A run that continues may write while the file is read; frames that it adds are seen by another `read`.

    Parameters
    ----------
    path : the file

    Returns
    -------
    the recording, a sequence of frames

    Raises
    ------
    FileNotFoundError
        if there is no such file
    ValueError
        if it is not a recording
    ImportError
        if h5py is not installed

    Examples
    --------
    >>> import pathlib
    >>> import tempfile
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "run.vtkhdf")
    ...     with skmpm.record(path, scene) as film:
    ...         film.write(skmpm.initial(scene))
    ...     frame = skmpm.read(path)[-1]
    ...     print(frame.t)
    0.0
    """
    return Recording(Path(path))


def _step(block: Any, k: int) -> tuple[Array, dict[str, NDArray[Any]], dict[str, NDArray[Any]], list[NDArray[Any]]]:
    """Points (2, n), their data, those of cells, and the cells of a block at step k."""
    steps, constant = block["Steps"], bool(block.attrs["constant"])
    part, cells = 0 if constant else k, list[NDArray[Any]]()
    first, n = int(steps["PointOffsets"][k]), int(block["NumberOfPoints"][part])
    for i, kind in enumerate(KINDS):
        group = block[kind]
        count, size = int(group["NumberOfCells"][part]), int(group["NumberOfConnectivityIds"][part])
        begin, start = int(steps["CellOffsets"][k, i]), int(steps["ConnectivityIdOffsets"][k, i])
        ends = group["Offsets"][begin + part : begin + part + count + 1]
        cells += np.split(group["Connectivity"][start : start + size], ends[1:-1]) if count else []
    of_points = {name: _fields(data, first, n) for name, data in block["PointData"].items()}
    offsets = steps["CellDataOffsets"]
    of_cells = {name: _fields(data, int(offsets[name][k]), len(cells)) for name, data in block["CellData"].items()}
    return block["Points"][first : first + n, :2].T, of_points, of_cells, cells


def _fields(data: Any, first: int, count: int) -> NDArray[Any]:
    """Scalars (count,), vectors (2, count) or tensors (3, 3, count)."""
    values = data[first : first + count]
    if values.ndim == 1:
        return np.asarray(values)
    return np.asarray(values[:, :2].T if values.shape[1] == 3 else values.T.reshape(3, 3, -1))
