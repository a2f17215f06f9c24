"""Sweeps: whatever interrupts a member or kills a worker, its table is that of a run that was not interrupted."""

import errno
import json
import logging
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import ensembles
import numpy as np
import pytest
from ensembles import DT, STEPS

import skmpm
from skmpm.io import PARTIAL
from skmpm.progress import Bar
from skmpm.sweep import directory, execution, records, run, workers
from skmpm.sweep.directory import MANIFEST
from skmpm.sweep.sweep import follow


@pytest.fixture(scope="module")
def client():
    """Two processes, which no test needs alone."""
    with workers.local_client(2) as client:
        yield client


TASK = execution.Task(Path(), {"speed": 1.0}, "this sweep", ("python",), {"name": "squeezed", "source": ""})


def task(folder, **chosen):
    folder.mkdir(exist_ok=True)
    return replace(TASK, folder=folder, parameters=chosen or TASK.parameters)


def text(folder):
    return (folder / records.TABLE).read_text()


def stops_after(steps):
    """A worker that is told to stop after so many steps."""
    left = iter(range(steps - 1))
    return execution.Worker(stopping=lambda: next(left, None) is None)


def test_a_sweep_in_two_processes_is_what_loops_by_hand_give(tmp_path):
    """Tables to the bit; manifests and states; finished members are not run again, and one is added."""
    out, members = tmp_path / "new" / "out", [{"speed": 1.0}, {"speed": 2.0}]
    found = skmpm.sweep(ensembles.squeezed, members, out=out, processes=2)
    assert [member.status for member in found] == ["finished", "finished"]
    for member in found:
        assert text(member.folder) == ensembles.by_hand(member.parameters["speed"])
        about = member.manifest
        assert about["parameters"] == {"speed": member.parameters["speed"]}
        assert about["versions"]["skmpm"] == skmpm.__version__
        assert about["sessions"][0]["command"][1:] == sys.argv
        assert about["sessions"][0]["seconds"] > 0.0
        assert about["build"]["name"] == "ensembles.squeezed"
    assert found["speed=2.0"].state().t == pytest.approx(STEPS * DT)
    table = found.table()
    assert list(table) == ["member", "finished", "speed", "t", "force", "steps", "newton"]
    assert table["force"].tolist() == [*found["speed=1.0"].columns["force"], *found["speed=2.0"].columns["force"]]
    assert set(table["member"][table["speed"] == 2.0]) == {"speed=2.0"}
    written = [(m.folder / name).stat().st_mtime_ns for m in found for name in (records.TABLE, MANIFEST)]
    again = skmpm.sweep(ensembles.squeezed, [*members, {"speed": 0.5}], out=out, processes=1)
    assert [(m.folder / name).stat().st_mtime_ns for m in found for name in (records.TABLE, MANIFEST)] == written
    assert len(again) == 3
    assert repr(again) == f"Sweep(3 members, rows {3 * STEPS})"
    assert [m.name for m in skmpm.Sweep.read(out)] == ["speed=0.5", "speed=1.0", "speed=2.0"]
    assert [m.name for m in again.where(speed=np.float64(2.0))] == ["speed=2.0"]


@pytest.mark.parametrize("options", [{}, {"dt": None}, {"every": 2.5 * DT}], ids=["dt", "chosen steps", "every"])
def test_wherever_a_run_is_interrupted_it_ends_as_if_it_was_not(tmp_path, options):
    """Cut after 1, 5 and 3 steps: table and state to the bit."""

    def build(speed):
        return replace(ensembles.squeezed(speed), **options)

    whole, cut = task(tmp_path / "whole"), task(tmp_path / "cut")
    assert execution.run_member(build, whole).status == "finished"
    for k, steps in enumerate((1, 5, 3)):
        assert execution.run_member(build, cut, stops_after(steps)).status == "interrupted"
        before = text(cut.folder)
        assert json.loads((cut.folder / MANIFEST).read_text())["status"] == "interrupted"
        assert len(json.loads((cut.folder / MANIFEST).read_text())["sessions"]) == k + 1
    assert text(whole.folder).startswith(before)
    assert before != text(whole.folder)
    assert execution.run_member(build, cut).status == "finished"
    assert text(cut.folder) == text(whole.folder)
    assert len(text(whole.folder).splitlines()) > 5
    same(cut.folder, whole.folder)


@pytest.mark.parametrize("error", [KeyError("force"), SystemExit(143)], ids=["an error", "SIGTERM"])
@pytest.mark.parametrize("every", [1.0, 3.5 * DT], ids=["its only row", "its last row"])
def test_the_row_of_the_last_state_is_made_up_for(tmp_path, error, every):
    """The last state is in the checkpoint and its row is not: the next run adds it."""
    whole, cut = task(tmp_path / "whole"), task(tmp_path / "cut")

    def build(speed, fails=False):
        made = replace(ensembles.squeezed(speed), every=every)

        def observed(scene, state):
            if fails and state.t > (STEPS - 0.5) * DT:
                raise error
            return made.observe(scene, state)

        return replace(made, observe=observed)

    execution.run_member(build, whole)
    if isinstance(error, SystemExit):
        with pytest.raises(SystemExit):
            execution.run_member(partial(build, fails=True), cut)
    else:
        assert execution.run_member(partial(build, fails=True), cut).status == "failed"
    assert text(cut.folder) != text(whole.folder)
    assert execution.run_member(build, cut).status == "finished"
    assert text(cut.folder) == text(whole.folder)


def same(first, second):
    one, other = (skmpm.load(folder / records.LAST) for folder in (first, second))
    for name in ("x", "v", "F", "C", "stress", "t"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name


@pytest.mark.parametrize("when", ["before the table", "in the table", "before the checkpoint", "after it"])
def test_a_kill_in_the_middle_of_writing(tmp_path, monkeypatch, when):
    """Of the second checkpoint: a process that ends there leaves what the next one goes on from."""
    whole, cut = task(tmp_path / "whole"), task(tmp_path / "cut")

    def build(speed):
        return replace(ensembles.squeezed(speed), checkpoint=0.0)  # after every step

    execution.run_member(build, whole)
    commit, save, count = records.Records.commit, records.save, iter(range(99))

    def die(*_):
        monkeypatch.setattr(records.Records, "commit", lambda *_: None)  # what is dead writes no more
        if when == "in the table":
            os.truncate(cut.folder / records.TABLE, (cut.folder / records.TABLE).stat().st_size - 3)
        raise execution.Interrupted

    def dies(self, state):
        if next(count) == 4:
            if when == "before the table":
                die()
            if when == "in the table":
                monkeypatch.setattr(records, "os", SimpleNamespace(fsync=die))
            if when == "before the checkpoint":
                monkeypatch.setattr(records, "save", die)
            if when == "after it":
                monkeypatch.setattr(records, "save", lambda *file: die(save(*file)))
        commit(self, state)

    monkeypatch.setattr(records.Records, "commit", dies)
    execution.run_member(build, cut)
    monkeypatch.undo()
    assert len(text(cut.folder).splitlines()) == {"before the table": 5}.get(when, 6)
    (cut.folder / ".skmpm-0.tmp").write_text("half a checkpoint")
    assert execution.run_member(build, cut).status == "finished"
    assert text(cut.folder) == text(whole.folder)
    assert sorted(path.name for path in cut.folder.iterdir()) == sorted(path.name for path in whole.folder.iterdir())
    same(cut.folder, whole.folder)


def test_a_signal_between_writing_and_noting_it_writes_nothing_twice(tmp_path, monkeypatch):
    """Raised after the checkpoint was saved, as a signal may; what ends the run writes once more."""
    cut, save, signals = task(tmp_path / "cut"), records.save, iter([True])

    def build(speed):
        return replace(ensembles.squeezed(speed), checkpoint=0.0)

    def saved(path, state):
        save(path, state)
        if next(signals, False):
            raise execution.Interrupted

    monkeypatch.setattr(records, "save", saved)
    assert execution.run_member(build, cut).status == "interrupted"
    assert len(text(cut.folder).splitlines()) == 2


def test_stop_and_keep(tmp_path):
    """The run ends at the first force above 200 N/m; the first above 110 N/m is kept; a kill changes neither."""

    def build(speed):
        return replace(
            ensembles.squeezed(speed),
            stop=lambda row: row["force"] > 200.0,
            keep={"loaded": lambda row: row["force"] > 110.0, "never": lambda row: row["force"] < 0.0},
        )

    cut = task(tmp_path / "cut")
    execution.run_member(build, cut, stops_after(3))
    assert execution.run_member(build, cut).status == "finished"
    force = records.read_table(cut.folder, finished=True)["force"]
    assert force[-2] <= 200.0 < force[-1]
    assert force.size < STEPS
    kept = skmpm.load(cut.folder / "loaded.checkpoint")
    assert kept.wall_force[1, 1] == force[force > 110.0][0]
    assert not (cut.folder / "never.checkpoint").exists()
    about = json.loads((cut.folder / MANIFEST).read_text())
    directory.write_manifest(cut.folder, about | {"status": "running"})  # killed just before this was changed
    assert execution.run_member(build, cut).status == "finished"
    assert records.read_table(cut.folder, finished=True)["force"].tolist() == force.tolist()


@pytest.mark.parametrize(
    "asked", [{"stop": lambda row: row["zzz"] > 0.0}, {"keep": {"a": lambda row: row["zzz"] > 0.0}}]
)
def test_a_column_that_does_not_exist_is_named_with_those_that_do(tmp_path, asked):
    ended = execution.run_member(lambda speed: replace(ensembles.squeezed(speed), **asked), task(tmp_path))
    assert ended.status == "failed"
    assert "stop or keep asks for a column 'zzz'; the columns are t, force, steps, newton" in ended.error


def staged(speed):
    """Squeezed in eight steps, then released as fast, in chosen steps; both keep the same columns."""

    def then(state):
        scene = ensembles.scene(-speed)
        start = skmpm.continued(ensembles.scene(speed), state, scene)
        return skmpm.Run(scene, until=14 * DT, observe=ensembles.force, start=start)

    return replace(ensembles.squeezed(speed), until=8 * DT, then=then)


def test_stages(tmp_path):
    """One after the other, as by hand; an interruption in either, or between them, makes no difference."""
    whole = task(tmp_path / "whole")
    assert execution.run_member(staged, whole).status == "finished"
    first, second = ensembles.scene(1.0), ensembles.scene(-1.0)
    *_, state = skmpm.simulate(first, dt=DT, until=8 * DT)
    skmpm.save(tmp_path / "by hand", state)
    start = skmpm.continued(first, skmpm.load(tmp_path / "by hand"), second)
    by_hand = [state, *skmpm.simulate(second, until=14 * DT, start=start)]
    table = records.read_table(whole.folder, finished=True)
    assert table["force"][7:].tolist() == [state.wall_force[1, 1] for state in by_hand]
    assert table["t"][-1] == pytest.approx(14 * DT)
    for steps in ((3, 3), (8, 1), (8, 2), (9, 1), (10,)):
        cut = task(tmp_path / f"cut {steps}")
        for number in steps:
            assert execution.run_member(staged, cut, stops_after(number)).status == "interrupted"
        assert execution.run_member(staged, cut).status == "finished"
        assert text(cut.folder) == text(whole.folder), steps
        same(cut.folder, whole.folder)


def test_a_kill_between_stages(tmp_path, monkeypatch):
    """After the last checkpoint of the first, before or after its end is kept."""
    whole = task(tmp_path / "whole")
    execution.run_member(staged, whole)
    for kept in (False, True):
        cut, save = task(tmp_path / f"cut {kept}"), execution.save

        def dies(path, state, kept=kept, save=save):
            if kept:
                save(path, state)
            raise execution.Interrupted

        monkeypatch.setattr(execution, "save", dies)
        assert execution.run_member(staged, cut).status == "interrupted"
        monkeypatch.undo()
        assert (cut.folder / "end_1.checkpoint").exists() == kept
        assert execution.run_member(staged, cut).status == "finished"
        assert text(cut.folder) == text(whole.folder)
        same(cut.folder, whole.folder)


def test_stages_that_are_refused(tmp_path):
    """One that begins before the one before has ended."""

    def build(speed):
        return replace(staged(speed), then=lambda state: ensembles.squeezed(speed))

    found = execution.run_member(build, task(tmp_path / "bad"))
    assert "begins before t = 4e-05 s" in found.error


def test_a_member_that_fails_is_named_and_does_not_stop_the_others(client, tmp_path, caplog):
    """One cannot be built, one fails after six steps, whose rows are kept; it is tried again from there."""
    members = [{"speed": speed} for speed in (0.0, 3.0, 1.0)]
    found = skmpm.sweep(ensembles.mixed, members, out=tmp_path, client=client)
    assert [member.status for member in found] == ["failed", "failed", "finished"]
    assert found.failed == {
        "speed=0.0": "SceneError: a lid that does not move",
        "speed=3.0": "ArithmeticError: no force",
    }
    assert re.search(r"sweep: speed=3.0 failed: ArithmeticError: no force \([123] of 3\)", caplog.text)
    assert [member.name for member in found.finished] == ["speed=1.0"]
    assert found["speed=3.0"].columns["steps"].tolist() == [1, 2, 3, 4, 5, 6]
    assert "in failing" in (tmp_path / "speed=3.0" / execution.FAILURE).read_text()
    assert repr(found) == f"Sweep(3 members, failed 2, rows {STEPS + 6})"
    assert found.table()["finished"].sum() == STEPS
    again = skmpm.sweep(ensembles.mixed, members[1:], out=tmp_path, client=client)
    assert again["speed=3.0"].columns["steps"].tolist() == [1, 2, 3, 4, 5, 6]
    assert len(again["speed=3.0"].manifest["sessions"]) == 2


@pytest.fixture
def meanwhile(monkeypatch):
    """Calls a function once, with the process of a member in a directory, when that has a checkpoint."""

    def start(folder, act):
        run_tasks, done = workers.run_tasks, []

        def watched(*arguments, **options):
            for news in run_tasks(*arguments, **options):
                if not done and (folder / records.LAST).exists():
                    done.append(directory.read_manifest(folder)["sessions"][-1]["process"])
                    act(done[0])
                yield news

        monkeypatch.setattr(workers, "run_tasks", watched)
        return done

    return start


@pytest.mark.parametrize("number", [signal.SIGKILL, pytest.param(signal.SIGTERM, marks=pytest.mark.nightly)])
def test_a_worker_that_ends_in_the_middle(client, tmp_path, meanwhile, number):
    """Killed, or told to end: its member goes on from its checkpoint, both tables are those of loops by hand."""
    members = [{"speed": speed, "slow": True} for speed in (1.0, 2.0)]
    done = meanwhile(tmp_path / "slow=True,speed=1.0", lambda process: os.kill(process, number))
    found = skmpm.sweep(ensembles.squeezed, members, out=tmp_path, client=client)
    assert [member.status for member in found] == ["finished"] * 2
    for member in found:
        assert text(member.folder) == ensembles.by_hand(member.parameters["speed"])
    sessions = found["slow=True,speed=1.0"].manifest["sessions"]
    first, *others = (session["process"] for session in sessions)  # Dask may close the worker that goes on, too
    assert first == done[0] and others and first not in others
    assert ("seconds" in sessions[0]) == (number == signal.SIGTERM), "only a killed one says nothing"


def test_an_interrupted_client_leaves_checkpoints(client, tmp_path, meanwhile):
    """As by Ctrl-C: workers end what they run and free its locks; the sweep goes on from there."""
    members = [{"speed": speed, "slow": True} for speed in (1.0, 2.0)]

    def stop(process):
        raise KeyboardInterrupt

    meanwhile(tmp_path / "slow=True,speed=1.0", stop)
    with pytest.raises(KeyboardInterrupt):
        skmpm.sweep(ensembles.squeezed, members, out=tmp_path, client=client)
    assert directory.read_manifest(tmp_path / "slow=True,speed=1.0")["status"] == "interrupted"
    for member in skmpm.sweep(ensembles.squeezed, members, out=tmp_path, client=client):
        assert text(member.folder) == ensembles.by_hand(member.parameters["speed"])


def dies(speed):
    if speed == 0.0:
        return {"n": 1}
    return os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.slow
def test_a_member_whose_process_always_dies_fails(tmp_path):
    """After three attempts, and alone: one that waits for the same worker is not taken for it."""
    found = skmpm.sweep(dies, [{"speed": 1.0}, {"speed": 0.0}], out=tmp_path, processes=1)
    error = "its process ended 3 times; was there enough memory?"
    assert found.failed == {"speed=1.0": error}
    assert found["speed=0.0"].status == "finished"
    assert [len(found[name].manifest["sessions"]) for name in found.failed] == [3]


SCRIPT = """
import os, pathlib
import ensembles, skmpm
def dies_once(speed, slow):
    try:
        pathlib.Path("begun").touch(exist_ok=False)
    except FileExistsError:
        return ensembles.squeezed(speed)
    os.kill(os.getpid(), 9)
members = [dict(speed=speed, slow={slow}) for speed in {speeds}]
print(skmpm.sweep({build}, members, out="out", processes=2))
"""


def script(folder, *paths, build="ensembles.squeezed", slow=True, speeds=(1.0, 2.0, 0.5)):
    """A script in a process group of its own, without the guard that processes which import it would need."""
    (folder / "script.py").write_text(SCRIPT.format(slow=slow, speeds=speeds, build=build))
    places = [*paths, Path(__file__).parent, Path(skmpm.__file__).parents[1]]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, places))}
    options = {"cwd": folder, "env": environment, "stdout": -1, "stderr": -1, "text": True}
    return subprocess.Popen(
        [sys.executable, "script.py"], preexec_fn=heed_interrupts, start_new_session=True, **options
    )


def heed_interrupts():
    """Where the tests run in the background of a shell, SIGINT is ignored, also by the processes that they start."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def heard(errors):
    """Lines of the standard error, but for warnings of the simulations themselves."""
    return [line for line in errors.splitlines() if not line.startswith(("preflight: ", "compiling loops "))]


def await_checkpoints(folders):
    deadline = time.monotonic() + 300.0
    while not all((folder / records.LAST).exists() for folder in folders) and time.monotonic() < deadline:
        time.sleep(0.05)


@pytest.mark.parametrize(
    ("send", "number"),
    [
        pytest.param(os.kill, signal.SIGTERM, id="SIGTERM", marks=pytest.mark.nightly),
        pytest.param(os.killpg, signal.SIGTERM, id="SIGTERM to all", marks=pytest.mark.nightly),
        pytest.param(os.killpg, signal.SIGINT, id="Ctrl-C"),
    ],
)
def test_a_signal_writes_checkpoints_and_the_sweep_goes_on_from_them(client, tmp_path, send, number):
    """To the first process, or to all: members that run are interrupted, the third is not begun; nothing is lost."""
    process, out = script(tmp_path), tmp_path / "out"
    running = [out / "slow=True,speed=1.0", out / "slow=True,speed=2.0"]
    await_checkpoints(running)
    send(process.pid, number)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == {signal.SIGTERM: 128 + signal.SIGTERM, signal.SIGINT: -signal.SIGINT}[number], errors
    assert heard(errors) == [] if number == signal.SIGTERM else errors.endswith("\nKeyboardInterrupt\n"), errors
    assert "distributed" not in errors, "Dask says nothing of its own"
    for folder in running:
        assert directory.read_manifest(folder)["status"] == "interrupted"
        assert 0.0 < skmpm.load(folder / records.LAST).t < STEPS * DT
    assert not (out / "slow=True,speed=0.5" / MANIFEST).exists()
    if send is os.killpg:
        return  # what is left is the same, and so is what goes on from it
    members = [{"speed": speed, "slow": True} for speed in (1.0, 2.0)]
    for member in skmpm.sweep(ensembles.squeezed, members, out=out, client=client):
        assert text(member.folder) == ensembles.by_hand(member.parameters["speed"])
        assert len(member.manifest["sessions"]) == 2


def test_a_killed_first_process_takes_its_workers_along(client, tmp_path):
    """Workers end and free their locks; the sweep goes on from their last checkpoints."""
    process, folder = script(tmp_path), tmp_path / "out" / "slow=True,speed=1.0"
    await_checkpoints([folder])
    process.kill()
    process.communicate()
    with directory.locked(folder, patience=60.0):
        assert directory.read_manifest(folder)["status"] == "running"
    found = skmpm.sweep(ensembles.squeezed, [{"speed": 1.0, "slow": True}], out=tmp_path / "out", client=client)
    assert text(found["slow=True,speed=1.0"].folder) == ensembles.by_hand(1.0)


def test_a_script_needs_no_guard_and_hears_nothing_of_dask(tmp_path):
    """Its `build` is sent as it is; neither the first processes nor those that replace killed ones import it."""
    found, errors = script(tmp_path, build="dies_once", slow=False, speeds=(1.0, 2.0)).communicate(timeout=300)
    assert (found, heard(errors)) == (f"Sweep(2 members, rows {2 * STEPS})\n", [])
    sessions = [directory.read_manifest(path)["sessions"] for path in (tmp_path / "out").iterdir()]
    assert sorted(map(len, sessions)) == [1, 2]


def test_without_the_extra_a_sweep_is_refused(tmp_path):
    (tmp_path / "distributed.py").write_text("raise ImportError('there is none')")
    _, errors = script(tmp_path, tmp_path).communicate(timeout=300)
    assert errors.endswith("SweepError: sweep runs on Dask: pip install 'skmpm[cluster]' (there is none)\n")
    assert not (tmp_path / "out").exists()


def test_a_local_client_leaves_the_process_as_it_was():
    """The module `__main__`, the environment, levels of logs and the default client; nothing warns of ports."""
    import distributed

    def seen():
        logs = [logging.getLogger(name).level for name in workers.LOGGERS]
        return sys.modules["__main__"], dict(os.environ), logs, distributed.client._get_global_client()

    before = seen()
    with socket.socket() as taken:
        with suppress(OSError):  # by somebody else
            taken.bind(("127.0.0.1", 8787))
            taken.listen()
        with workers.local_client(1) as client:
            assert client.submit(os.getpid).result() != os.getpid()
            assert sys.modules["__main__"] is not before[0]
    assert seen() == before


def test_a_process_that_takes_long_to_be_replaced_is_replaced():
    """Where Dask gives up a worker before another can have begun: a busy machine takes longer than 15 s."""
    import dask

    with dask.config.set({"distributed.deploy.lost-worker-timeout": "100 ms"}), workers.local_client(1) as client:
        first = client.submit(os.getpid).result()
        os.kill(first, signal.SIGKILL)
        assert client.submit(os.getpid, pure=False).result(timeout=120.0) != first
        assert client.cluster.workers, "the next one would not be replaced"


def test_one_directory_one_run(tmp_path, monkeypatch):
    """A lock that is held is refused with its holder, one of a process that ended is not; threads count too."""
    folder = tmp_path / "speed=1.0"
    folder.mkdir()
    begun = {"status": "running", "sessions": [directory.session()], "parameters": {"speed": 1.0}}
    directory.write_manifest(folder, begun | {"versions": directory.versions()})
    by = rf"speed=1.0 is in use by process {os.getpid()} on .* since 20"
    monkeypatch.setattr(execution, "PATIENCE", 0.5)
    with directory.locked(folder):
        with pytest.raises(skmpm.SweepError, match=by):
            skmpm.sweep(ensembles.squeezed, [{"speed": 1.0}], out=tmp_path)
        began = time.monotonic()
        with pytest.raises(skmpm.SweepError, match=by):
            execution.run_member(ensembles.squeezed, task(folder))
        assert time.monotonic() - began > 0.5, "a worker given up for dead is waited for"
    holds = (
        "from pathlib import Path\nfrom skmpm.sweep import directory\n"
        f"with directory.locked(Path({str(folder)!r})): print(1, flush=True); input()"
    )
    with subprocess.Popen([sys.executable, "-c", holds], stdout=-1, stdin=-1) as process:
        process.stdout.readline()
        with pytest.raises(skmpm.SweepError, match="is in use"), directory.locked(folder):
            pass
        process.kill()
    with directory.locked(folder):
        pass


def test_a_file_system_without_locks_is_warned_of(tmp_path, monkeypatch, caplog):
    def flock(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("fcntl.flock", flock)
    with directory.locked(tmp_path):
        assert "its file system has no locks ([Errno 37] No locks available)" in caplog.text


def test_directories_of_other_parameters_or_versions_are_refused(tmp_path):
    """By name, with what is other; a finished member is of no matter to the versions of other libraries."""
    finished = task(tmp_path / "speed=1.0")
    execution.run_member(ensembles.squeezed, finished)
    about = directory.read_manifest(finished.folder)

    def refused(changes, match):
        directory.write_manifest(finished.folder, about | changes)
        with pytest.raises(skmpm.SweepError, match=match):
            skmpm.sweep(ensembles.squeezed, [{"speed": 1.0}], out=tmp_path)

    refused({"parameters": {"speed": 2.0}}, r"speed=1.0 was made with other parameters, .*2.0.*; give another out")
    refused({"versions": about["versions"] | {"skmpm": "0.1"}}, "was made with skmpm 0.1, this is skmpm")
    refused({"versions": about["versions"] | {"source": "a"}}, "was made with source a, this is source")
    numpy = about["versions"] | {"numpy": "1.0"}
    refused({"versions": numpy, "status": "running"}, "was made with numpy 1.0, this is numpy")
    directory.write_manifest(finished.folder, about | {"versions": numpy})
    assert len(skmpm.sweep(ensembles.squeezed, [{"speed": 1.0}], out=tmp_path)) == 1
    (finished.folder / MANIFEST).write_text("{")
    with pytest.raises(skmpm.SweepError, match="is no manifest of a sweep"):
        skmpm.sweep(ensembles.squeezed, [{"speed": 1.0}], out=tmp_path)


def counted(a=None, k=0, x=None):
    """One row, with a column of the name of a parameter where that is not given."""
    return {"n": 1} if x is not None else {"n": 1, "x": 5.0}


def test_a_parameter_that_is_nan_is_that_of_the_run_before(client, tmp_path):
    for _ in range(2):
        found = skmpm.sweep(counted, [{"a": float("nan")}], out=tmp_path, client=client)
        assert found["a=nan"].status == "finished"
    assert len(found.where(a=float("nan"))) == 1


def test_a_column_with_the_name_of_a_parameter_of_another_member(client, tmp_path):
    """The parameter was lost; members without a parameter are not those in which it is None."""
    found = skmpm.sweep(counted, [{"k": 1, "x": 2.0}, {"k": 2}], out=tmp_path, client=client)
    np.testing.assert_array_equal(found.table()["x"], [2.0, 5.0])
    assert [len(found.where(x=value)) for value in (2.0, None)] == [1, 0]


def test_hidden_directories_and_files_of_the_user_stay(client, tmp_path):
    folder = tmp_path / "k=1"
    (folder / ".ipynb_checkpoints").mkdir(parents=True)
    (folder / ".note").write_text("mine")
    (folder / f"{PARTIAL}1").write_text("{")
    assert skmpm.sweep(counted, [{"k": 1}], out=tmp_path, client=client)["k=1"].status == "finished"
    assert sorted(path.name for path in folder.glob(".*")) == [".ipynb_checkpoints", ".note"]


@pytest.mark.parametrize(("source", "warned"), [("0" * 64, True), ("", False)], ids=["other", "unknown"])
def test_a_build_that_has_changed_is_warned_of(tmp_path, caplog, source, warned):
    finished = replace(task(tmp_path / "speed=1.0"), build={"name": "ensembles.squeezed", "source": source})
    execution.run_member(ensembles.squeezed, finished)
    skmpm.sweep(ensembles.squeezed, [{"speed": 1.0}], out=tmp_path)
    assert ("build has changed since 1 of the members were run" in caplog.text) == warned


def test_names_of_directories():
    """Readable where parameters are plain; nothing that is not the same has the same name."""
    names = {
        (("friction", 0.5), ("seed", 1)): "friction=0.5,seed=1",
        (("material", "gel"), ("on", True)): "material=gel,on=True",
        (("speed", 1e-05), ("dt", None)): "dt=None,speed=1e-05",
        (): "run",
    }
    for items, name in names.items():
        assert directory.name_of(directory.plain(dict(items))) == name
    odd = [
        {"a": 1}, {"a": 1.0}, {"a": "1"}, {"a": True}, {"a": "True"}, {"a": [1]}, {"a": "[1]"}, {"a": "b,c=1"},
        {"a": "b", "c": 1}, {"a": "é"}, {"a": "è"}, {"a": "x" * 300}, {"a": "x" * 301}, {"a": None}, {"a": "nan"},
        {"a": float("nan")}, {"a": {"b": 1}}, {"a": ""}, {"a": "../b"}, {"a=1,b": 1}, {"a": 1, "b": 1},
    ]  # fmt: skip
    found = [directory.name_of(directory.plain(each)) for each in odd]
    assert len({name.casefold() for name in found}) == len(odd)
    assert all(len(name) < 140 and "/" not in name for name in found)
    assert directory.plain({"b": np.float64(0.5), "a": [0, np.int64(1)], "c": (1, 2)}) == {
        "a": [0, 1],
        "b": 0.5,
        "c": [1, 2],
    }


def test_members_that_are_refused(tmp_path):
    with pytest.raises(skmpm.SweepError, match=r"two members have the directory speed=1.0"):
        skmpm.sweep(ensembles.squeezed, [{"speed": 1.0}, {"speed": np.float64(1.0)}], out=tmp_path)
    with pytest.raises(
        skmpm.SweepError, match="two members have the directory a: some file systems do not tell it from A"
    ):
        skmpm.sweep(ensembles.squeezed, {"A": {"speed": 1.0}, "a": {"speed": 2.0}}, out=tmp_path)
    with pytest.raises(skmpm.SweepError, match=r"a parameter is named 't', as a column of every table is"):
        skmpm.sweep(ensembles.squeezed, [{"t": 1.0}], out=tmp_path)
    with pytest.raises(skmpm.SweepError, match="the parameter 'gel' is a NeoHookean; parameters are numbers"):
        skmpm.sweep(ensembles.squeezed, [{"gel": ensembles.GEL}], out=tmp_path)
    with pytest.raises(skmpm.SweepError, match=r"'speed' is an array of shape \(2,\); give a member for each"):
        skmpm.sweep(ensembles.squeezed, [{"speed": np.array([1.0, 2.0])}], out=tmp_path)
    with pytest.raises(skmpm.SweepError, match=r"'speed' is an array"):
        skmpm.sweep(ensembles.squeezed, [{"speed": 1.0}, {"speed": [np.array([1.0])]}], out=tmp_path)
    with pytest.raises(skmpm.SweepError, match=r"a member is 1.0; give a dict"):
        skmpm.sweep(ensembles.squeezed, [1.0], out=tmp_path)
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_sent_is_named():
    """Functions of any kind pass, a lock does not."""
    lid, held = ensembles.scene(), {"lock": threading.Lock()}
    assert workers.pickled(lambda speed: skmpm.Run(lid, until=speed))
    with pytest.raises(skmpm.SweepError, match=r"build refers to what cannot be sent .*lock.*; make it inside build"):
        workers.pickled(lambda speed: held[speed])


def test_tables_that_build_makes_itself(client, tmp_path):
    """Rows of numbers, truth values and texts come back as they were; columns of several members are joined."""
    members = {"three": {"n": 3}, "two": {"n": 2, "name": "two\nlines"}}
    found = skmpm.sweep(ensembles.rows, members, out=tmp_path, client=client)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["three", "two"]
    assert [member.status for member in found] == ["finished"] * 2
    table = found.table()
    assert {name: column.tolist() for name, column in table.items() if name != "member"} == {
        "finished": [True] * 5,
        "n": [3, 3, 3, 2, 2],
        "name": ["", "", "", "two\nlines", "two\nlines"],
        "k": [0, 1, 2, 0, 1],
        "root": [0.0, 1.0, float(np.sqrt(2.0)), 0.0, 1.0],
        "even": [True, False, True, True, False],
        "text": ["a, 0", "a, 1", "a, 2", "two lines, 0", "two lines, 1"],
    }
    assert skmpm.Sweep(()).table() == {}
    with pytest.raises(skmpm.SweepError, match="no member has a parameter 'm'; they have n, name"):
        found.where(m=1)
    with pytest.raises(KeyError, match="'four' is none of the members three, two"):
        found["four"]
    with pytest.raises(FileNotFoundError, match="there is no directory"):
        skmpm.Sweep.read(tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("row", "match"),
    [
        ({"t": 1.0}, "the table has a column 't' already"),
        ({"speed": 1.0}, "the table has a column 'speed' already"),
        ({"stress": np.eye(2)}, "the value of 'stress' in a row is a ndarray; rows hold numbers and texts"),
        (1.0, "a row of the table is a float; observe and build return values by name"),
    ],
)
def test_rows_that_no_table_holds(tmp_path, row, match):
    def build(speed):
        return replace(ensembles.squeezed(speed), observe=lambda scene, state: row)

    assert match in execution.run_member(build, task(tmp_path / "bad")).error


def test_rows_have_the_same_columns(tmp_path):
    def build(speed):
        return replace(
            ensembles.squeezed(speed), observe=lambda scene, state: {"a": 1} if state.t < 2.5 * DT else {"b": 2}
        )

    found = execution.run_member(build, task(tmp_path / "bad"))
    assert found.error == "ValueError: a row has other columns than the first, or another order: a, b"


def test_runs_that_are_refused(tmp_path):
    scene = ensembles.scene()
    for options, match in (({"every": -1.0}, "every = -1.0"), ({"keep": {"last": bool}}, "'last' names no file")):
        with pytest.raises(ValueError, match=match):
            skmpm.Run(scene, until=1.0, **options)
    with pytest.raises(TypeError, match="expected a Scene, got a str"):
        skmpm.Run("scene", until=1.0)
    found = execution.run_member(lambda speed: 1.0, task(tmp_path / "bad"))
    assert "build returned a float; expected a Run, or rows of the table" in found.error
    for nothing in ([], {}):
        own = task(tmp_path / type(nothing).__name__)
        failed = execution.run_member(lambda speed, made=nothing: made, own)
        assert "build returned no rows, or an empty one" in failed.error
    with pytest.raises(skmpm.SweepError, match="is not there; give a directory that all workers share"):
        execution.run_member(ensembles.squeezed, replace(TASK, folder=tmp_path / "gone"))
    with pytest.raises(ValueError, match="processes = 0"):
        skmpm.sweep(ensembles.squeezed, [{"speed": 1.0}], out=tmp_path, processes=0)


def test_what_is_observed_unless_told_otherwise():
    """The numbers of `observe`."""
    scene = ensembles.scene()
    (state, *_) = skmpm.simulate(scene, dt=DT, until=2 * DT)
    assert run.observables(scene, state) == pytest.approx(skmpm.observe(scene, state).table(), nan_ok=True)


def test_rows_between_steps():
    """Multiples of `every` fall into steps by the state alone, whatever round-off makes of its time."""
    (state, *_) = skmpm.simulate(ensembles.scene(), dt=DT, until=DT)
    times = np.cumsum(np.full(30, 0.1))
    due = [run.row_due(0.3, replace(state, t=float(t), report=replace(state.report, dt=0.1))) for t in times]
    assert np.flatnonzero(due).tolist() == list(range(2, 30, 3))


def test_the_bar_of_a_sweep(capsys, monkeypatch, caplog):
    """Members that have ended, and those that run with their share; a failure leaves its line alone."""
    first, second = Path("speed=1.0"), Path("speed=2.0")
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    monkeypatch.setattr("skmpm.progress.EVERY", 0.0)

    def news():
        yield {first: execution.Outcome("failed", "KeyError: 'a'")}, {second: 0.5}
        yield {second: execution.Outcome("finished")}, {}

    tasks = [replace(TASK, folder=folder) for folder in (first, second)]
    with Bar(4, shown=True) as bar:
        ended = follow(news(), tasks, 4, bar)
    assert [outcome.status for outcome in ended.values()] == ["failed", "finished"]
    lines = [line.rstrip() for line in capsys.readouterr().err.split("\r") if "%" in line]
    assert lines[0].startswith(" 87.5 %") and lines[0].endswith("3 of 4 members  1 failed  speed=2.0 50 %")
    assert lines[-1].startswith("100.0 %") and lines[-1].endswith("4 of 4 members  1 failed")
    assert "sweep: speed=1.0 failed: KeyError: 'a' (3 of 4)" in caplog.text


def test_how_far_members_are(client, tmp_path):
    """Shares of the end come while members run."""
    tasks = [task(tmp_path / "cut", speed=1.0, slow=True)]

    def build(**chosen):
        made = ensembles.squeezed(**chosen)
        return replace(made, until=np.float64(made.until))  # no number that messages of Dask hold

    news = list(workers.run_tasks(client, workers.pickled(build), tasks, lasting=True))
    shares = [share for _, shares in news for share in shares.values()]
    assert 0.0 < shares[0] < shares[-1] <= 1.0
    assert news[-1][0] == {tasks[0].folder: execution.Outcome("finished")}


def test_one_blas_thread_whatever_is_set(tmp_path, monkeypatch):
    """In a worker process of an environment that allows four."""
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "4")
    found = skmpm.sweep(ensembles.blas, {"a": {}}, out=tmp_path, processes=1)
    assert not found.failed
    assert found["a"].columns["threads"].tolist() == [1] * found["a"].columns["threads"].size


def test_the_library_imports_no_dask():
    code = "import sys, skmpm; print([m for m in ('dask', 'distributed', 'cloudpickle') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout == "[]\n"


def test_a_stage_that_goes_on_does_not_ask_the_rows_of_the_one_before_whether_it_ends(tmp_path):
    """A lid goes down and up again until it is up; the last row of the first stage would end the second."""

    def pressed(speed):
        body = skmpm.Body(skmpm.disc((0.0, 1.0), 1.0, spacing=0.3), skmpm.NeoHookean(1e6, 0.3, 1000.0))
        walls = [skmpm.Wall((0, 0), (0, 1)), skmpm.Wall((0, 2.2), (0, -1), velocity=(0, speed))]
        return skmpm.Scene([body], cell=0.4, walls=walls)

    down, up = pressed(-1.0), pressed(1.0)
    options = {"dt": 2e-3, "every": 0.01, "observe": lambda scene, state: {"lid": float(state.walls[1, 1])}}

    def then(state):
        begun = skmpm.continued(down, state, up)
        return skmpm.Run(up, until=0.05, stop=lambda row: row["lid"] < 2.1901, start=begun, **options)

    def build():
        return skmpm.Run(down, until=0.01, then=then, **options)

    rows = []
    for name, steps in (("whole", None), ("interrupted", 7)):
        member, asked = replace(task(tmp_path / name), parameters={}), iter(range(1000))
        stopping = execution.Worker(stopping=lambda asked=asked, steps=steps: next(asked) + 1 == steps)
        first = execution.run_member(build, member, stopping)
        assert first.status == ("finished" if steps is None else "interrupted")
        assert execution.run_member(build, member).status == "finished"
        rows.append((member.folder / "table.csv").read_text())
    assert rows[0] == rows[1]
    assert len(rows[0].splitlines()) == 6


def test_what_is_bound_to_a_build_belongs_to_it():
    """Values of partials, of closures and of objects that are called: other ones gave the old tables in silence."""

    def enclosed(E):
        return lambda seed: {"E": E, "seed": seed}

    @dataclass
    class Built:
        E: float

        def __call__(self, seed):
            return {"E": self.E, "seed": seed}

    for bound in (lambda E: partial(dict, E=E), enclosed, Built):
        one, same, other = (directory.source_of(bound(E))["source"] for E in (1e6, 1e6, 2e6))
        assert one == same != other


def test_texts_of_rows_stay_texts():
    """Names that look like numbers as no number is written."""
    columns = records.parsed(b"a,b,c,d,e,f\n007,1e-07,-3,+7,1e5,nan\n010,0.5,10,+8,12e-4,1\n")
    texts, numbers = [["007", "010"], ["+7", "+8"], ["1e5", "12e-4"]], [[1e-07, 0.5], [-3, 10]]
    assert [columns[name].tolist() for name in "ade"] == texts
    assert [columns[name].tolist() for name in "bc"] == numbers
    assert columns["c"].dtype.kind == "i" and columns["f"].dtype.kind == "f"


@pytest.mark.parametrize("text", ["1e5", " lead", "a  b\t", "12e-4", 'said "so", twice', "\u2028"])
def test_texts_come_back_as_they_were_written(tmp_path, text):
    rows = records.Records(tmp_path)
    rows.add({"id": run.checked({"id": text}, frozenset())["id"]})
    rows.commit(None)
    assert records.read_table(tmp_path, finished=True)["id"].tolist() == [text]
    assert run.checked({"id": "two\nlines"}, frozenset()) == {"id": "two lines"}
