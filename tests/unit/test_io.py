"""Checkpoints are exact and damage is detected; recordings are read back by VTK and by h5py."""

import json
import pickle
import signal
import subprocess
import sys
import zipfile
from dataclasses import dataclass, fields, is_dataclass, make_dataclass, replace
from typing import get_type_hints

import h5py
import numpy as np
import pytest
import pyvista
import vtk
from hypothesis import given, settings
from hypothesis import strategies as st
from vtk.util.numpy_support import vtk_to_numpy

import skmpm
from skmpm.io import CheckpointError, checkpoint, load, read, record, save
from skmpm.io import blocks as vtkhdf
from skmpm.material import LinearElastic, NeoHookean, Rigid
from skmpm.observe import network, observe
from skmpm.points import Points, box, disc
from skmpm.scene import Body, Contacts, Periodic, Report, Scene, State, Support, Wall, stress_zz
from skmpm.scheme import Scheme
from skmpm.step.algorithm import step
from skmpm.step.initial_state import initial

DT = 2e-5


def discs(material=NeoHookean(1e6, 0.3, 1000.0)):  # noqa: B008
    """Two discs and two walls that squeeze them."""
    bodies = [
        Body(disc((0.0, 0.0), 1e-3, spacing=2e-4), material, spin=30.0),
        Body(disc((2e-3, 0.0), 1e-3, spacing=3e-4), material, velocity=(-1.0, 0.0)),
    ]
    walls = [Wall((-1e-3, 0), (1, 0), velocity=(1, 0)), Wall((0, -1e-3), (0, 1), friction=0.3)]
    return Scene(bodies, cell=4e-4, walls=walls, friction=0.2)


def run(scene, steps, state=None, scheme=Scheme(), dt=DT):  # noqa: B008
    states = [initial(scene, scheme=scheme) if state is None else state]
    for _ in range(steps):
        states.append(step(scene, states[-1], dt, scheme=scheme))
    return states


@pytest.fixture(scope="module")
def states():
    return run(discs(), 4)


@pytest.fixture(scope="module")
def tiny():
    ring = disc((0.0, 0.0), 1e-3, spacing=5e-4)
    return initial(Scene([Body(ring, LinearElastic(1e6, 0.3, 1e3))], cell=1e-3))


def leaves(value, name="state"):
    """All values of a state by name, without what follows from them."""
    if is_dataclass(value):
        for f in fields(value):
            if f.name != "derived":
                yield from leaves(getattr(value, f.name), f"{name}.{f.name}")
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from leaves(item, f"{name}[{key}]")
    else:
        yield name, value


def assert_same(a, b, without=()):
    """Equal bit for bit: names, types, shapes, bytes, memory order."""
    one, other = dict(leaves(a)), dict(leaves(b))
    assert list(one) == list(other)
    for name, value in one.items():
        if any(word in name for word in without):
            continue
        assert type(value) is type(other[name]), name
        if isinstance(value, np.ndarray):
            assert value.dtype == other[name].dtype, name
            assert value.shape == other[name].shape, name
            assert np.all(np.diff(np.abs(value.strides)) <= 0) == np.all(np.diff(np.abs(other[name].strides)) <= 0), (
                name
            )
        assert np.asarray(value).tobytes() == np.asarray(other[name]).tobytes(), name


# --- checkpoints ---


def test_every_field_but_derived_comes_back_bit_for_bit(tmp_path, states):
    path = tmp_path / "run.checkpoint"
    save(path, states[-1])
    again = load(path)
    assert isinstance(again, State)
    assert again.derived is None
    assert_same(again, states[-1])
    assert again.contacts.key.size > 0
    assert again.report.seconds == states[-1].report.seconds != {}
    assert [p.name for p in tmp_path.iterdir()] == ["run.checkpoint"]  # exactly this name, nothing left over


def test_a_checkpoint_names_the_version_that_wrote_it(tmp_path, tiny):
    """An editable installation has the version in its metadata that was installed."""
    save(tmp_path / "s", tiny)
    with np.load(tmp_path / "s") as members:
        assert json.loads(members["header"].tobytes())["skmpm"] == skmpm.__version__


def test_awkward_numbers_and_memory_orders_come_back(tmp_path, tiny):
    nan = np.uint64(0x7FF800000000BEEF).view(np.float64)
    odd = np.array([nan, -0.0, np.inf, 5e-324, np.pi])
    F = np.arange(4.0 * odd.size).reshape(2, odd.size, 2).transpose(0, 2, 1)  # neither C nor Fortran order
    state = replace(tiny, t=-0.0, mass=odd, F=F, x=np.asfortranarray(tiny.x), v=tiny.v[:, ::-1])
    save(tmp_path / "s", state)
    again = load(tmp_path / "s")
    assert_same(again, state)
    assert again.F.strides == F.strides
    assert str(again.t) == "-0.0"


def test_a_new_field_is_saved_without_being_listed(tmp_path, tiny, monkeypatch):
    @dataclass(frozen=True)
    class Controller:
        dt: float
        history: np.ndarray

    new = [
        ("controller", Controller | None, None),
        ("nothing", Controller | None, None),
        ("by_body", dict[str, Controller], None),
        ("empty", dict[str, float], None),
        ("pair", tuple[int, str], (0, "")),
        ("flag", bool, False),
        ("late", float, 3.0),
    ]
    More = make_dataclass("More", new, bases=(State,), frozen=True)  # noqa: N806
    old = {f.name: getattr(tiny, f.name) for f in fields(State)}
    control = Controller(0.1, np.arange(3))
    given_ = {
        "controller": control,
        "by_body": {"a.b/ü": control},
        "empty": {},
        "pair": (7, "x"),
        "flag": True,
    }
    state = More(**old, **given_)
    save(tmp_path / "s", state)
    monkeypatch.setattr(checkpoint, "State", More)
    again = load(tmp_path / "s")
    assert_same(again, state)
    assert isinstance(again.by_body["a.b/ü"], Controller)
    assert again.nothing is None
    # An older file lacks the new fields: they take their defaults.
    save(tmp_path / "old", tiny)
    assert load(tmp_path / "old").late == 3.0
    # A newer file has fields that this version does not know: dropping them would spoil the restart.
    monkeypatch.undo()
    with pytest.raises(CheckpointError, match=r"no field by_body.*load it with skmpm"):
        load(tmp_path / "s")


def test_all_hints_of_a_state_can_be_resolved():
    assert get_type_hints(State)["report"] is Report


@pytest.mark.parametrize("bad", [object(), [1.0], lambda: 0, np.array([object()])])
def test_what_cannot_be_saved_is_named(tmp_path, tiny, bad):
    with pytest.raises(TypeError, match=r"state\.x is a"):
        save(tmp_path / "s", replace(tiny, x=bad))
    assert not list(tmp_path.iterdir())


def test_keys_must_be_text(tmp_path, tiny):
    with pytest.raises(TypeError, match=r"keys of state\.report\.seconds are \[1\]"):
        save(tmp_path / "s", replace(tiny, report=Report(seconds={1: 0.0})))


def test_any_cut_is_found(tmp_path, tiny):
    path = tmp_path / "s"
    save(path, tiny)
    whole = path.read_bytes()
    for size in [0, 1, 3, 4, 5, 30, 100, len(whole) // 2, len(whole) - 22, len(whole) - 1]:
        path.write_bytes(whole[:size])
        with pytest.raises(CheckpointError, match=r"checkpoint .*s: it is (cut short|empty|not a checkpoint)"):
            load(path)


@settings(max_examples=150)
@given(data=st.data())
def test_a_flipped_bit_is_found_or_harmless(tmp_path_factory, tiny, data):
    path = tmp_path_factory.mktemp("flip") / "s"
    save(path, tiny)
    content = bytearray(path.read_bytes())
    content[data.draw(st.integers(0, len(content) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    path.write_bytes(content)
    try:
        again = load(path)
    except CheckpointError as error:
        assert str(path) in str(error)
    else:
        assert_same(again, tiny)  # a bit that says nothing about the state, such as a date


def rewritten(path, change):
    """Write the archive anew, its own check sums intact, after `change` of its members."""
    with np.load(path) as archive:
        members = dict(archive)
    change(members)
    with path.open("wb") as file:
        np.savez(file, **members)


def test_a_changed_number_in_an_intact_archive_is_found(tmp_path, tiny):
    def nudge(members):
        members["state.x"][0, 0] = np.nextafter(members["state.x"][0, 0], 1.0)

    def retype(members):
        members["state.body"] = members["state.body"].view(np.uint64)

    def reshape(members):
        members["state.F"] = members["state.F"].reshape(4, -1)

    def swap(members):
        members["state.x"], members["state.v"] = members["state.v"], members["state.x"]

    for change in (nudge, retype, reshape, swap, lambda members: members.pop("state.mass")):
        save(tmp_path / "s", tiny)
        rewritten(tmp_path / "s", change)
        with pytest.raises(CheckpointError, match="bits have changed; go back to an earlier checkpoint"):
            load(tmp_path / "s")


def forged(path, **changes):
    """Change the header and sign it anew."""

    def change(members):
        about = json.loads(members["header"].tobytes()) | changes
        header = json.dumps(about).encode()
        arrays = {name: a for name, a in members.items() if name.startswith("state.")}
        members["header"] = np.frombuffer(header, dtype=np.uint8)
        members["sha256"] = np.frombuffer(checkpoint._digest(header, arrays), dtype=np.uint8)

    rewritten(path, change)


def test_newer_and_foreign_files_say_so(tmp_path, tiny):
    path = tmp_path / "s"
    save(path, tiny)
    forged(path)
    assert_same(load(path), tiny)  # the forger signs well
    newer = checkpoint.SCHEMA + 1
    forged(path, schema=newer, skmpm="9.1")
    schemas = rf"schema is {newer}, this version reads {newer - 1}; "
    with pytest.raises(CheckpointError, match=schemas + r".* skmpm 9\.1; load it with .* or a later one"):
        load(path)
    forged(path, schema=newer - 2, skmpm="0.1")
    with pytest.raises(CheckpointError, match=r"skmpm 0\.1; load it with that version$"):
        load(path)
    forged(path, schema=checkpoint.SCHEMA, format="other")
    with pytest.raises(CheckpointError, match=r"format is 'other'.*written by skmpm\.save"):
        load(path)
    forged(path, format=checkpoint.FORMAT, state={"t": 0.0})
    with pytest.raises(CheckpointError, match="missing"):
        load(path)
    for write in (
        lambda: path.write_text("hello"),
        lambda: path.write_bytes(pickle.dumps(tiny.x)),
        lambda: np.savez(path.with_suffix(".npz"), x=tiny.x),
    ):
        write()
        if path.with_suffix(".npz").exists():
            path.with_suffix(".npz").replace(path)
        with pytest.raises(CheckpointError, match=r"not a checkpoint; give a file written by skmpm\.save"):
            load(path)


class Bomb:
    """Runs when it is unpickled."""

    def __reduce__(self):
        return exec, ("raise SystemExit('code was executed')",)


def test_loading_never_executes_code(tmp_path):
    path = tmp_path / "s"
    with path.open("wb") as file:
        np.savez(file, header=np.array([Bomb()], dtype=object), allow_pickle=True)
    with pytest.raises(CheckpointError, match="damaged"):
        load(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("header", pickle.dumps(Bomb()))
    with pytest.raises(CheckpointError, match="not a checkpoint"):
        load(path)


def test_a_failed_save_leaves_the_old_checkpoint(tmp_path, states, monkeypatch):
    path = tmp_path / "s"
    save(path, states[0])

    def full(file, **members):
        file.write(b"half of it")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(checkpoint.np, "savez", full)
    with pytest.raises(OSError, match="No space left"):
        save(path, states[1])
    assert [p.name for p in tmp_path.iterdir()] == ["s"]
    monkeypatch.undo()
    assert_same(load(path), states[0])


def test_paths(tmp_path, tiny):
    with pytest.raises(FileNotFoundError, match="there is no directory"):
        save(tmp_path / "none" / "s", tiny)
    with pytest.raises(FileNotFoundError):
        load(tmp_path / "s")
    (tmp_path / "link").symlink_to(tmp_path / "target")
    save(str(tmp_path / "link"), tiny)  # a str is as good as a Path
    assert (tmp_path / "link").is_symlink()
    assert_same(load(tmp_path / "target"), tiny)


@pytest.mark.parametrize(
    ("material", "scheme"),
    [
        (NeoHookean(1e6, 0.3, 1000.0), Scheme()),
        (LinearElastic(1e6, 0.3, 1000.0), Scheme()),
        (NeoHookean(1e6, 0.3, 1000.0), Scheme(anchor=0.0)),
        (NeoHookean(1e6, 0.3, 1000.0), Scheme.nezamabadi2017()),
    ],
    ids=["default", "linear", "anchor-0", "nezamabadi2017"],
)
def test_a_restart_is_bit_exact(tmp_path, material, scheme):
    scene = discs(material)
    straight = run(scene, 20, scheme=scheme)
    save(tmp_path / "s", straight[10])
    again = run(scene, 10, load(tmp_path / "s"), scheme)
    # What a step cost is not what it found: a kept factor has to be made again.
    assert_same(again[-1], straight[-1], without=("seconds", "report.factorisations"))


def test_a_static_run_goes_on_to_the_bit(tmp_path):
    """Two discs that nothing holds but a floor and a lid: their equilibria depend on round-off of the strains."""
    bodies = [Body(disc((0.0, y), 1e-3, spacing=2.5e-4), NeoHookean(1e6, 0.3, 1000.0)) for y in (1e-3, 3e-3)]
    walls = [Wall((0, 0), (0, 1)), Wall((0, 4e-3), (0, -1), velocity=(0, -0.1))]
    scene, static = Scene(bodies, cell=3e-4, walls=walls, friction=0.5), Scheme(inertia=False)
    straight = run(scene, 5, scheme=static, dt=1e-4)
    save(tmp_path / "s", straight[3])
    again = run(scene, 2, load(tmp_path / "s"), static, dt=1e-4)
    assert_same(again[-1], straight[-1], without=("seconds", "report.factorisations"))


# --- recordings ---


def as_vtk_sees(path):
    """All steps: a list of (time, blocks), each block with its points, cells by kind and data."""
    reader = vtk.vtkHDFReader()
    assert reader.CanReadFile(str(path))
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS()) or ()
    if reader.GetNumberOfSteps() == 1:  # then VTK tells no time
        with h5py.File(path) as file:
            times = file["VTKHDF/Steps/Values"][:].tolist()
    assert reader.GetNumberOfSteps() == len(times)
    steps = []
    for k, t in enumerate(times):
        reader.SetStep(k)
        reader.Update()
        blocks = reader.GetOutputDataObject(0)
        names = [blocks.GetMetaData(i).Get(vtk.vtkCompositeDataSet.NAME()) for i in range(blocks.GetNumberOfBlocks())]
        steps.append((t, {name: _block(blocks.GetBlock(i)) for i, name in enumerate(names)}))
    return steps


def _block(grid):
    return {
        "x": vtk_to_numpy(grid.GetPoints().GetData()).copy() if grid.GetNumberOfPoints() else np.zeros((0, 3)),
        "cells": [
            [[ids.GetId(i) for i in range(ids.GetNumberOfIds())] for ids in _cells(array)]
            for array in (grid.GetVerts(), grid.GetLines(), grid.GetPolys(), grid.GetStrips())
        ],
        **_data(grid.GetPointData()),
        **_data(grid.GetCellData()),
    }


def _data(fields):
    return {
        fields.GetArrayName(i): vtk_to_numpy(fields.GetArray(i)).copy() for i in range(fields.GetNumberOfArrays())
    }


def _cells(array):
    for i in range(array.GetNumberOfCells()):
        ids = vtk.vtkIdList()
        array.GetCellAtId(i, ids)
        yield ids


def write(path, scene, states, **options):
    with record(path, scene, **options) as film:
        for state in states:
            film.write(state)


def test_vtk_reads_what_was_written(tmp_path, states):
    scene = discs()
    write(tmp_path / "run.vtkhdf", scene, states)
    steps = as_vtk_sees(tmp_path / "run.vtkhdf")
    assert [t for t, _ in steps] == [state.t for state in states]
    for (_, blocks), state in zip(steps, states, strict=True):
        n, data = state.body.size, blocks["points"]
        np.testing.assert_array_equal(data["x"], np.vstack([state.x, np.zeros(n)]).T)
        np.testing.assert_allclose(data["velocity"], np.vstack([state.v, np.zeros(n)]).T, rtol=1e-6)
        moved = np.vstack([state.x - scene.initial_positions, np.zeros(n)]).T
        np.testing.assert_allclose(data["displacement"], moved, rtol=1e-6)
        np.testing.assert_array_equal(data["body"], state.body)
        np.testing.assert_allclose(data["volume"], state.volume, rtol=1e-6)
        np.testing.assert_allclose(data["det_F"], np.linalg.det(state.F.T), rtol=1e-6)
        stress = data["stress"].reshape(n, 3, 3)
        scale = float(np.abs(state.stress).max())
        np.testing.assert_allclose(stress[:, :2, :2], state.stress.transpose(2, 0, 1), atol=1e-6 * scale)
        assert not stress[:, 2, :2].any()
        assert not stress[:, :2, 2].any()
        pressure = -0.5 * np.trace(stress[:, :2, :2], axis1=1, axis2=2)
        np.testing.assert_allclose(data["pressure"], pressure, atol=1e-6 * scale)
        assert data["cells"] == [[[p] for p in range(n)], [], [], []]
    assert np.abs(steps[-1][1]["points"]["x"] - steps[0][1]["points"]["x"]).max() > 1e-5  # it moved


def test_pyvista_reads_what_was_written(tmp_path, states):
    path = tmp_path / "run.vtkhdf"
    write(path, discs(), states)
    reader = pyvista.get_reader(path)
    for k, state in enumerate(states):
        reader.reader.SetStep(k)  # pyvista has no times of its own for this reader
        blocks = reader.read()
        assert reader.reader.GetTimeValue() == state.t
        assert blocks.keys() == ["points", "bodies", "contacts", "walls"]
        np.testing.assert_array_equal(blocks["points"].points[:, :2].T, state.x)
        np.testing.assert_allclose(blocks["points"]["velocity"][:, :2].T, state.v, rtol=1e-6, atol=1e-30)
        assert blocks["bodies"].n_cells == 2 and blocks["walls"].n_cells == 2


def test_a_frame_is_handed_to_pyvista(tmp_path, states):
    write(tmp_path / "run.vtkhdf", discs(), states)
    recording = read(tmp_path / "run.vtkhdf")
    for k in (0, -1):
        np.testing.assert_array_equal(recording.to_pyvista(k)["points"].points[:, :2].T, states[k].x)
    with pytest.raises(IndexError, match=rf"no frame {len(states)}; give one of {len(states)}, counted from 0"):
        recording.to_pyvista(len(states))
    with pytest.raises(IndexError, match="no frame -99;"):
        recording[-99]


def test_a_run_is_one_dataset(tmp_path, states):
    """Fields by time and point as in the frames; contacts of all frames with their times."""
    write(tmp_path / "s", discs(), states)
    recording = read(tmp_path / "s")
    run = recording.to_xarray()
    last = run.sel(t=states[-1].t)
    np.testing.assert_array_equal(last.position, states[-1].x)
    np.testing.assert_allclose(last.velocity.sel(axis="y"), states[-1].v[1], rtol=1e-6, atol=1e-30)
    assert run.stress.dims == ("t", "row", "column", "point")
    np.testing.assert_array_equal(run.body, states[0].body)
    assert run.body_pressure.shape == (len(states), 2) and run.body_index.values.tolist() == [0, 1]
    for frame in recording:
        at = run.contact_t == frame.t
        np.testing.assert_array_equal(run.contact_normal_force[at], frame.contacts["normal_force"])
        np.testing.assert_array_equal(run.wall_point[:, run.wall_t == frame.t], frame.walls["point"])
    write(tmp_path / "none", discs(), [])
    with pytest.raises(ValueError, match="no frames yet"):
        read(tmp_path / "none").to_xarray()


def test_walls_are_lines_that_move(tmp_path, states):
    """One to the left of the discs, which moves, and one below, each to the end of the other."""
    write(tmp_path / "s", discs(), states)
    for frame, state in zip(read(tmp_path / "s"), states, strict=True):
        assert frame.walls["wall"].tolist() == [-1, -2]
        np.testing.assert_allclose(frame.walls["point"].T, state.walls, rtol=1e-6)
        np.testing.assert_allclose(frame.walls["normal"].T, state.wall_normals)
        np.testing.assert_allclose(frame.walls["force"].T, state.wall_force, rtol=1e-6)
        corner = [state.walls[0, 0], -1e-3]
        upright, floor = frame.walls["lines"]
        assert min(np.hypot(*(upright - corner).T)) < 1e-15 and min(np.hypot(*(floor - corner).T)) < 1e-15
        assert np.ptp(upright[:, 0]) < 1e-15 and np.ptp(floor[:, 1]) < 1e-15
        assert upright[:, 1].max() > 1e-3 and floor[:, 0].max() > 3e-3
    assert states[-1].wall_force.any()


def test_bodies_are_smooth_polygons_with_data_of_the_body(tmp_path, states):
    """Every fourth point is a boundary point; the area within is that of `observe`, to a thousandth."""
    scene = discs()
    write(tmp_path / "s", scene, states)
    for (_, blocks), state in zip(as_vtk_sees(tmp_path / "s"), states, strict=True):
        bodies, seen, place = blocks["bodies"], observe(scene, state).bodies, scene.outlines.point
        np.testing.assert_array_equal(bodies["x"][::4, :2].T, state.x[:, place])
        assert [len(kind) for kind in bodies["cells"]] == [0, 0, 2, 0] and bodies["body"].tolist() == [0, 1]
        for b, loop in enumerate(bodies["cells"][2]):
            x, y = bodies["x"][loop, :2].T
            area = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
            assert area == pytest.approx(seen.area[b], rel=1e-3)
        for name in ("pressure", "deviatoric_stress", "coordination", "volume_ratio", "aspect_ratio"):
            np.testing.assert_allclose(bodies[name], getattr(seen, name), rtol=1e-6, atol=1e-30)
        momentum = [
            np.average(state.v[:, state.body == b], axis=1, weights=state.mass[state.body == b]) for b in (0, 1)
        ]
        np.testing.assert_allclose(bodies["velocity"][:, :2], momentum, rtol=1e-6, atol=1e-12)
        np.testing.assert_allclose(bodies["force"][:, :2].T, state.body_force, rtol=1e-6, atol=1e-12)
    assert states[-1].body_force.any()


def test_contacts_are_lines_whose_number_changes(tmp_path, states):
    scene, last = discs(), replace(states[-1], t=1.0, contacts=Contacts.none())
    states, counts = [replace(last, t=-1.0), *states, last], []
    write(tmp_path / "s", scene, states)
    for (_, blocks), state in zip(as_vtk_sees(tmp_path / "s"), states, strict=True):
        pairs, lines = network(scene, state), blocks["contacts"]
        counts.append(pairs.size)
        assert lines["cells"][1] == [[2 * i, 2 * i + 1] for i in range(pairs.size)]
        np.testing.assert_array_equal(lines["first"], pairs.bodies[0])
        np.testing.assert_array_equal(lines["second"], pairs.bodies[1])
        np.testing.assert_allclose(lines["normal_force"], pairs.force[0], rtol=1e-6)
        np.testing.assert_allclose(lines["tangential_force"], pairs.force[1], rtol=1e-6)
        np.testing.assert_allclose(lines["point"][:, :2].T, pairs.centre, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(lines["normal"][:, :2].T, pairs.normal, rtol=1e-6, atol=1e-9)
        apart = np.diff(lines["x"].reshape(-1, 2, 3)[:, :, :2], axis=1)[:, 0].T
        np.testing.assert_allclose(apart, -pairs.branch, atol=1e-12)
    assert counts[0] == counts[-1] == 0 < counts[1]


def test_read_returns_what_was_written(tmp_path, states):
    scene = discs()
    write(tmp_path / "s", scene, states)
    recording = read(tmp_path / "s")
    assert len(recording) == len(states) and recording.t.tolist() == [state.t for state in states]
    assert [frame.t for frame in recording] == recording.t.tolist()
    assert "5 frames" in repr(recording) and len(repr(recording[0])) < 700
    for frame, state in zip(recording, states, strict=True):
        np.testing.assert_array_equal(frame.x, state.x)
        np.testing.assert_allclose(frame.points["stress"][:2, :2], state.stress, rtol=1e-6, atol=1e-3)
        np.testing.assert_allclose(frame.points["velocity"], state.v, rtol=1e-6, atol=1e-30)
        boundary = np.concatenate(frame.outlines, axis=1)
        np.testing.assert_array_equal(boundary[:, ::4], state.x[:, scene.outlines.point])
        assert frame.bodies["body"].tolist() == [0, 1]
        pairs = network(scene, state)
        assert frame.contacts["lines"].shape == (pairs.size, 2, 2)
        np.testing.assert_allclose(frame.contacts["normal_force"], pairs.force[0], rtol=1e-6)
    np.testing.assert_array_equal(recording[-1].x, states[-1].x)
    assert [frame.t for frame in recording[1:3]] == [state.t for state in states[1:3]]
    with pytest.raises(IndexError):
        recording[len(states)]


def test_what_cannot_be_read_is_explained(tmp_path, tiny):
    with pytest.raises(FileNotFoundError, match="none: there is no such file; give a file of `record`"):
        read(tmp_path / "none")
    (tmp_path / "text").write_text("hello")
    with pytest.raises(ValueError, match=r"text: cannot be read .*; give a file of `record`"):
        read(tmp_path / "text")
    with h5py.File(tmp_path / "other", "w") as file:
        file["x"] = 1
    with pytest.raises(ValueError, match="other: not a recording; give a file of `record`"):
        read(tmp_path / "other")


@pytest.mark.parametrize("law", [LinearElastic, NeoHookean])
def test_out_of_plane_stress_is_that_of_plane_strain(tmp_path, law):
    """Small uniform strain: sigma_zz = lambda tr(eps) for both laws, here to first order."""
    scene = Scene([Body(disc((0.0, 0.0), 1.0, spacing=0.5), law(1e6, 0.3, 1e3))], cell=1.0)
    state = initial(scene)
    eps = np.array([[2e-6, 1e-6], [1e-6, -5e-6]])
    F = np.repeat((np.eye(2) + eps)[:, :, None], state.body.size, axis=2)
    state = replace(state, F=F, stress=scene.bodies[0].material.stress(F))
    write(tmp_path / "s", scene, [state])
    zz = read(tmp_path / "s")[0].points["stress"][2, 2]
    np.testing.assert_allclose(zz, scene.bodies[0].material.lame[0] * np.trace(eps), rtol=1e-4)


@pytest.mark.parametrize("nu", [0.45, 0.499])
def test_out_of_plane_stress_has_the_mean_dilatation_as_the_plane_has(nu):
    """A block squeezed between rough plates by 1e-6, where both laws are one: zz differed by 9 % of the largest."""
    stress = []
    for law in (LinearElastic, NeoHookean):
        plates = [
            Support(lambda x: x[1] < 1e-9),
            Support(lambda x: x[1] > 1.0 - 1e-9, displacement=lambda t: (0, -t)),
        ]
        block = Scene([Body(box((0, 0), (1, 1), spacing=1 / 16), law(1e6, nu, 1e3))], cell=1 / 8, supports=plates)
        scheme = Scheme(inertia=False, newton_tol=1e-9)
        state = step(block, initial(block, scheme=scheme), 1e-6, scheme=scheme)
        stress.append(np.stack([state.stress[0, 0], stress_zz(block, state)]))
    np.testing.assert_allclose(*stress, rtol=0.0, atol=1e-4 * np.abs(stress[1]).max())


def test_walls_are_where_the_bodies_are_in_a_periodic_box(tmp_path):
    """After seven periods both are shown in the first."""
    plates = [Wall((0, 0), (0, 1)), Wall((0, 2e-3), (0, -1))]
    body = Body(disc((30e-3, 1e-3), 1e-3, spacing=2e-4), NeoHookean(1e6, 0.3, 1000.0))
    scene = Scene([body], cell=4e-4, walls=plates, periodic=Periodic(4e-3, None))
    write(tmp_path / "s", scene, [initial(scene)])
    (frame,) = read(tmp_path / "s")
    x = frame.walls["lines"][:, :, 0]
    assert x.min() < frame.x[0].min() and frame.x[0].max() < x.max() < 8e-3


def test_bodies_with_holes_get_lines_and_rigid_bodies_no_stress(tmp_path):
    """Lines come before polygons in data of cells: the body of each is its own."""
    square = np.array([[0.0, 3, 3, 0, 1, 1, 2, 2], [0.0, 0, 3, 3, 1, 2, 2, 1]])
    solid = Points(square[:, :4] + np.array([[10.0], [0.0]]), np.ones(4), (np.arange(4),))
    frame = Points(square, np.ones(8), (np.arange(4), np.arange(4, 8)))
    cloud = Points(square + np.array([[5.0], [0.0]]), np.ones(8))
    bodies = [
        Body(solid, Rigid(1.0), motion=(0, 0, 0)),
        Body(frame, Rigid(1.0), motion=(0, 0, 0)),
        Body(cloud, LinearElastic(1e6, 0.3, 1e3)),
    ]
    scene = Scene(bodies, cell=1.0)
    write(tmp_path / "s", scene, [initial(scene, scheme=Scheme.nezamabadi2017())])
    _, blocks = as_vtk_sees(tmp_path / "s")[0]
    outlines = blocks["bodies"]
    assert outlines["cells"] == [[], [[*range(16, 32), 16], [*range(32, 48), 32]], [[*range(16)]], []]
    assert outlines["body"].tolist() == [1, 1, 0]
    assert not blocks["points"]["stress"].any()
    assert [loop.shape for loop in read(tmp_path / "s")[0].outlines] == [(2, 16)] * 3


def test_layout_of_the_file(tmp_path, states):
    """Cells that do not change are written once, and offsets say where each step begins."""
    path, n, k = tmp_path / "s", states[0].body.size, len(states)
    write(path, discs(), states)
    with h5py.File(path) as file:
        assert file["VTKHDF"].attrs["Type"] == b"MultiBlockDataSet"
        group = file["VTKHDF/points"]
        assert group.attrs["Type"] == b"PolyData" and group.attrs["Version"].tolist() == [2, 3]
        assert group["Vertices/Connectivity"].shape == (n,) and group["NumberOfPoints"][:].tolist() == [n]
        for data in (group["Points"], group["PointData/stress"]):
            assert data.shape[0] == n * k
        for steps in (group["Steps"], file["VTKHDF/Steps"], file["VTKHDF/contacts/Steps"]):
            assert steps.attrs["NSteps"] == k
        assert group["Steps/PointOffsets"][:].tolist() == [n * i for i in range(k)]
        assert group["Steps/PointDataOffsets/velocity"][:].tolist() == [n * i for i in range(k)]
        assert group["Steps/CellOffsets"].shape == (k, 4)
        for name in ("PartOffsets", "CellOffsets", "ConnectivityIdOffsets"):
            assert not group["Steps"][name][:].any()


def test_no_chunk_is_compressed_and_one_of_a_large_block_is_a_step(tmp_path):
    """A compressed chunk takes as long as a step, and if a run is killed while it is written again it is lost."""
    fields = {"stress": np.zeros((5000, 9), dtype=np.float32)}
    first = vtkhdf.PolyData(np.zeros((5000, 3)), {"Vertices": np.arange(5000)[:, None]}, fields)
    chunks = {}
    with h5py.File(tmp_path / "s.h5", "w") as file:
        for name, constant in (("fixed", True), ("changing", False)):
            block = vtkhdf.Block.create(file, name, first, constant=constant)
            block.append(0, 0.0, first)
            chunks[name] = file[f"{name}/PointData/stress"].chunks
            assert file[f"{name}/PointData/stress"].compression is None
    assert chunks == {"fixed": (5000, 9), "changing": (256, 9)}


def test_append_continues_and_a_new_file_is_the_default(tmp_path, states):
    path, scene = tmp_path / "s", discs()
    write(path, scene, states[:2], append=True)  # nothing there yet
    write(path, scene, states[2:], append=True)
    assert read(path).t.tolist() == [state.t for state in states]
    write(path, scene, [], append=True)
    assert len(read(path)) == len(states)
    write(path, scene, states[1:2])
    assert read(path).t.tolist() == [states[1].t]


def test_append_replaces_what_a_restart_computes_again(tmp_path, states):
    path, scene = tmp_path / "s", discs()
    write(path, scene, states)
    marked = [replace(state, v=state.v + 1.0) for state in states[2:4]]
    write(path, scene, marked, append=True)
    steps = read(path)
    assert steps.t.tolist() == [state.t for state in states[:4]]
    np.testing.assert_allclose(steps[1].points["velocity"], states[1].v, atol=1e-6)
    np.testing.assert_allclose(steps[3].points["velocity"], states[3].v + 1.0, atol=1e-6)
    assert len(as_vtk_sees(path)) == 4
    for frame, state in zip(steps, states[:2], strict=False):
        np.testing.assert_allclose(frame.contacts["normal_force"], network(scene, state).force[0], rtol=1e-6)


def test_a_state_that_is_refused_leaves_the_file_as_it_is(tmp_path, states):
    path, scene = tmp_path / "s", discs()
    write(path, scene, states)
    other = replace(scene, walls=[*scene.walls, Wall((0.0, -1.0), (0.0, 1.0))])
    with pytest.raises(ValueError, match="the state has"):
        write(path, other, [states[2]], append=True)
    assert read(path).t.tolist() == [state.t for state in states]


def test_an_unfinished_step_does_not_count(tmp_path, states, monkeypatch):
    """The run dies after the fields are written, before the step is counted."""
    path, scene = tmp_path / "s", discs()

    def die(block, steps):
        if steps == 3:
            raise KeyboardInterrupt
        count(block, steps)

    count = vtkhdf.Block.count
    monkeypatch.setattr(vtkhdf.Block, "count", die)
    with pytest.raises(KeyboardInterrupt):
        write(path, scene, states)
    monkeypatch.undo()
    assert len(read(path)) == 2
    write(path, scene, states[2:], append=True)
    steps = read(path)
    assert len(steps) == len(states)
    np.testing.assert_array_equal(steps[-1].x, states[-1].x)
    assert len(as_vtk_sees(path)) == len(states)


def test_a_killed_run_leaves_a_readable_file_that_can_be_continued(tmp_path, states):
    """Read between two writes, the file open (VTK does not survive the middle of one); killed wherever it is."""
    path, scene = tmp_path / "s", discs()
    save(tmp_path / "state", states[-1])
    code = f"""
import itertools, sys
sys.path.insert(0, {str(__file__.rpartition("/")[0])!r})
from dataclasses import replace
from test_io import discs, load, record
state = load({str(tmp_path / "state")!r})
with record({str(path)!r}, discs()) as film:
    for k in itertools.count():
        film.write(replace(state, t=float(k)))
        print(k, flush=True)
        if k == 5:
            sys.stdin.readline()
"""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", code], text=True, **pipes) as process:
        for line in process.stdout:
            if int(line) == 5:
                assert len(as_vtk_sees(path)) == len(read(path)) == 6
                process.stdin.write("go on\n")
                process.stdin.flush()
            if int(line) == 9:
                process.send_signal(signal.SIGKILL)
                break
        last = int([line, *process.stdout.readlines()][-1])
    steps = read(path)
    assert len(steps) > last
    np.testing.assert_array_equal(steps[-1].x, states[-1].x)
    write(path, scene, [replace(states[0], t=1e9)], append=True)
    assert read(path).t.tolist() == [*map(float, range(len(steps))), 1e9]
    assert len(as_vtk_sees(path)) == len(steps) + 1


def test_misuse_of_a_recording_is_explained(tmp_path, states):
    path, scene = tmp_path / "s", discs()
    with pytest.raises(FileNotFoundError, match=r"there is no directory .*none; create it first"):
        write(tmp_path / "none" / "s", scene, [])
    with record(path, scene) as film:
        film.write(states[1])
        for late in (states[1], states[0], replace(states[1], t=float("nan"))):
            with pytest.raises(ValueError, match="is not later than 2e-05 s; write states in order"):
                film.write(late)
        with pytest.raises(ValueError, match="the state has 3 points, the scene"):
            film.write(replace(states[2], x=states[2].x[:, :3]))
        film.write(states[2])
    assert len(read(path)) == 2
    other = replace(scene, bodies=scene.bodies[:1])
    with pytest.raises(ValueError, match="another scene; record to a new file"):
        write(path, other, [], append=True)
    with h5py.File(path, "w") as file:
        file["x"] = 1
    with pytest.raises(ValueError, match="not a recording"):
        write(path, scene, [], append=True)
    path.write_text("hello")
    with pytest.raises(ValueError, match="cannot be continued"):
        write(path, scene, [], append=True)
    assert path.read_text() == "hello"


def test_without_h5py_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(ImportError, match=r'pip install "skmpm\[io\]"'), record(tmp_path / "s", discs()):
        pass
    assert not list(tmp_path.iterdir())


def test_a_library_that_is_not_installed_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    pairs = network(discs(), initial(discs()))
    with pytest.raises(ImportError, match=r'to_pandas needs pandas; install it with: pip install "skmpm\[tables\]"'):
        pairs.to_pandas()


def test_tables_become_data_frames(states):
    pairs, found = network(discs(), states[-1]), observe(discs(), states[-1])
    for of in (pairs, found.bodies):
        frame = of.to_pandas()
        assert frame.columns.tolist() == list(of.table())
        for name, column in of.table().items():
            np.testing.assert_array_equal(frame[name], column)
    assert found.to_pandas()["aspect_ratio"] == found.aspect_ratio
