"""Time series for ParaView (6.0 or later): one temporal VTKHDF file that grows with the run."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skmpm.io.blocks import VERSION, Block, blocks_of, growing, write
from skmpm.io.checkpoint import writable
from skmpm.optional import optional
from skmpm.scene import Scene, State, check_scene

CONSTANT = ("points", "bodies")  # blocks whose cells do not change


@contextmanager
def record(path: str | Path, scene: Scene, *, append: bool = False) -> Iterator[Recorder]:
    """Record states for ParaView; `with record("run.vtkhdf", scene) as film: film.write(state)`.

    Parameters
    ----------
    path : the file; ParaView recognises the suffix .vtkhdf
    scene : the scene whose states are written
    append : continue an existing file after its last complete step; steps from the time of the first state written
        on, which a restart from an earlier checkpoint computes again, are replaced

    Yields
    ------
    the recorder, whose `write` takes states

    Raises
    ------
    ImportError
        if h5py is not installed
    FileNotFoundError, IsADirectoryError
        if the directory of the file does not exist, or the path is a directory
    ValueError
        if the file to be continued is not a recording of this scene

    Notes
    -----
    The file can be read after every `write`, also while the run continues (a reader that meets an unfinished write
    must read again) and after it is killed. `read` returns its frames as arrays. It has five blocks:

    - points: a vertex per material point, with velocity [m/s], displacement since t = 0 [m], stress (9, Cauchy, row
      by row, tension positive; zz is that of plane strain) and pressure -(xx + yy)/2 [Pa], both elastic, without what
      viscosity adds, volume [m2], det_F, body; with materials with memory their plastic_strain
    - bodies: the smooth boundaries, polygons or, around holes, lines, with data of the body: velocity of the centre
      of mass, resultant force of the contacts [N/m], pressure and deviatoric_stress (of contacts), coordination,
      volume_ratio and aspect_ratio as in `observe`, body
    - contacts: a line between the centres of each pair of bodies that touch, to the contact on walls, with first and
      second body (walls -1, -2, ...), normal_force and tangential_force [N/m], mobilised_friction, length [m],
      mean contact point [m] and normal as `network` defines them
    - walls: a line for each wall near the bodies, with wall (-1, -2, ...), a point [m], the normal, and the force of
      the bodies on it [N/m]
    - box: the periodic box, if there is one; bodies are drawn where their centres lie in it

    Positions have double precision, fields single. Nothing is compressed, which would take as long as a step; of a
    finished run ``h5repack -f SHUF -f GZIP=1 run.vtkhdf smaller.vtkhdf`` makes a file of 60 % of the size.

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
    ...         for state in skmpm.simulate(scene, dt=1e-3, until=3e-3):
    ...             film.write(state)
    ...     print(len(skmpm.read(path)))
    3
    """
    check_scene("record", scene)
    path = writable(path)
    again = append and path.exists()
    with open_file(path, "r+" if again else "w") as file:
        if again:
            _check(path, file, scene)
        else:
            _create(file, scene)
        yield Recorder(path, scene, file)


class Recorder:
    """An open recording, to which `write` appends states; `record` opens it."""

    def __init__(self, path: Path, scene: Scene, file: Any) -> None:
        self._path, self._scene, self._file = path, scene, file
        self._vtk = file["VTKHDF"]
        self._steps = int(self._vtk["Steps"].attrs["NSteps"])
        self._earlier = self._vtk["Steps/Values"][: self._steps]  # times of the run that is continued
        self._blocks = {name: Block(self._vtk[name]) for name in self._vtk["Assembly"]}
        self._t = -np.inf

    def write(self, state: State) -> None:
        """Append a state and flush it to the file.

        Parameters
        ----------
        state : of the scene, later than the last one written

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
        blocks = blocks_of(self._scene, state)
        self._go_to(state.t)
        k = self._steps
        for name, data in blocks.items():
            if name not in self._blocks:
                self._blocks[name] = Block.create(self._vtk, name, data, constant=name in CONSTANT)
                self._vtk["Assembly"][name] = optional("h5py", "record", "io").SoftLink(f"/VTKHDF/{name}")
            self._blocks[name].append(k, state.t, data)
        write(self._vtk["Steps/Values"], k, [state.t])
        # The step counts only when it is complete in the file: a run may be killed at any line.
        self._file.flush()
        self._count(k + 1)

    def _count(self, steps: int) -> None:
        """Say how many steps are complete; the blocks may have more than the file, never fewer."""
        for block in self._blocks.values():
            block.count(steps)
        self._steps = self._vtk["Steps"].attrs["NSteps"] = steps
        self._file.flush()

    def _go_to(self, t: float) -> None:
        """Check that time increases; drop the steps of an earlier run that are computed again."""
        if not t > self._t:
            raise ValueError(f"{self._path}: t = {t} s is not later than {self._t} s; write states in order")
        kept = int(np.count_nonzero(self._earlier < t))
        if kept < self._earlier.size:
            self._count(kept)
        self._earlier, self._t = self._earlier[:0], t


def open_file(path: Path, mode: str) -> Any:
    """An open HDF5 file; ValueError if it is to be read or continued and is no recording."""
    h5py = optional("h5py", "read" if mode == "r" else "record", "io")
    done, remedy = "continued", "record to a new file with append=False"
    if mode == "r":
        done, remedy = "read", "give a file of `record`"
    try:
        # No lock: ParaView can read the file while it grows.
        file = h5py.File(path, mode, locking=False)
    except OSError as error:
        if mode == "w":
            raise
        if isinstance(error, FileNotFoundError):
            raise FileNotFoundError(f"{path}: there is no such file; {remedy}") from error
        raise ValueError(f"{path}: cannot be {done} ({error}); {remedy}") from error
    if mode != "w" and not ("skmpm/held_points" in file and "NSteps" in file.get("VTKHDF/Steps", file).attrs):
        file.close()
        raise ValueError(f"{path}: not a recording; {remedy}")
    return file


def _create(file: Any, scene: Scene) -> None:
    vtk = file.create_group("VTKHDF", track_order=True)
    vtk.attrs["Version"], vtk.attrs["Type"] = VERSION, np.bytes_("MultiBlockDataSet")
    vtk.create_group("Assembly", track_order=True)
    for name, values in _constants(scene).items():
        file[f"skmpm/{name}"] = values
    steps = vtk.create_group("Steps")
    steps.attrs["NSteps"] = 0
    growing(steps, "Values", np.zeros(0))
    file.flush()


def _constants(scene: Scene) -> dict[str, NDArray[Any]]:
    """What every frame has of the scene."""
    return {
        "body": scene.owner,
        "deformable": scene.deformable,
        "boundary_points": scene.outlines.point,
        "held_points": scene.held_points,
    }


def _check(path: Path, file: Any, scene: Scene) -> None:
    """Raise ValueError unless the recording is one of this scene."""
    if not all(np.array_equal(file[f"skmpm/{name}"], values) for name, values in _constants(scene).items()):
        raise ValueError(f"{path}: a recording of another scene; record to a new file with append=False")
