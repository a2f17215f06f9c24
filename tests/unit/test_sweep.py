"""Sweeps in processes of this machine: whatever interrupts a member, its table is that of a run that was not."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import ensembles
import numpy as np
import pytest
from ensembles import DT, STEPS

import skmpm
from skmpm.sweep import execution, lock, manifest, parameters, pickling, processes, records, run
from skmpm.sweep.errors import Interrupted, InUse
from skmpm.sweep.sweep import _Bar

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
    written = [(m.folder / name).stat().st_mtime_ns for m in found for name in (records.TABLE, manifest.FILE)]
    again = skmpm.sweep(ensembles.squeezed, [*members, {"speed": 0.5}], out=out, processes=1)
    assert [(m.folder / name).stat().st_mtime_ns for m in found for name in (records.TABLE, manifest.FILE)] == written
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
    assert execution.run_member(build, whole, execution.Worker()).status == "finished"
    for k, steps in enumerate((1, 5, 3)):
        assert execution.run_member(build, cut, stops_after(steps)).status == "interrupted"
        before = text(cut.folder)
        assert json.loads((cut.folder / manifest.FILE).read_text())["status"] == "interrupted"
        assert len(json.loads((cut.folder / manifest.FILE).read_text())["sessions"]) == k + 1
    assert text(whole.folder).startswith(before)
    assert before != text(whole.folder)
    assert execution.run_member(build, cut, execution.Worker()).status == "finished"
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

    execution.run_member(build, whole, execution.Worker())
    if isinstance(error, SystemExit):
        with pytest.raises(SystemExit):
            execution.run_member(partial(build, fails=True), cut, execution.Worker())
    else:
        assert execution.run_member(partial(build, fails=True), cut, execution.Worker()).status == "failed"
    assert text(cut.folder) != text(whole.folder)
    assert execution.run_member(build, cut, execution.Worker()).status == "finished"
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

    execution.run_member(build, whole, execution.Worker())
    commit, save, count = records.Records.commit, records.save, iter(range(99))

    def die(*_):
        monkeypatch.setattr(records.Records, "commit", lambda *_: None)  # what is dead writes no more
        if when == "in the table":
            os.truncate(cut.folder / records.TABLE, (cut.folder / records.TABLE).stat().st_size - 3)
        raise Interrupted

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
    execution.run_member(build, cut, execution.Worker())
    monkeypatch.undo()
    assert len(text(cut.folder).splitlines()) == {"before the table": 5}.get(when, 6)
    (cut.folder / ".skmpm-0.tmp").write_text("half a checkpoint")
    assert execution.run_member(build, cut, execution.Worker()).status == "finished"
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
            raise Interrupted

    monkeypatch.setattr(records, "save", saved)
    assert execution.run_member(build, cut, execution.Worker()).status == "interrupted"
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
    assert execution.run_member(build, cut, execution.Worker()).status == "finished"
    force = records.read_table(cut.folder, finished=True)["force"]
    assert force[-2] <= 200.0 < force[-1]
    assert force.size < STEPS
    kept = skmpm.load(cut.folder / "loaded.checkpoint")
    assert kept.wall_force[1, 1] == force[force > 110.0][0]
    assert not (cut.folder / "never.checkpoint").exists()
    about = json.loads((cut.folder / manifest.FILE).read_text())
    manifest.write(cut.folder, about | {"status": "running"})  # killed just before this was changed
    assert execution.run_member(build, cut, execution.Worker()).status == "finished"
    assert records.read_table(cut.folder, finished=True)["force"].tolist() == force.tolist()


@pytest.mark.parametrize(
    ("asked", "by"),
    [
        ({"stop": lambda row: row["zzz"] > 0.0}, "stop"),
        ({"keep": {"a": lambda row: row["zzz"] > 0.0}}, r"keep\['a'\]"),
    ],
)
def test_a_column_that_does_not_exist_is_named_with_those_that_do(tmp_path, asked, by):
    ended = execution.run_member(
        lambda speed: replace(ensembles.squeezed(speed), **asked), task(tmp_path), execution.Worker()
    )
    assert ended.status == "failed"
    assert re.search(rf"{by} asks for a column 'zzz'; the columns are t, force, steps, newton", ended.error)


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
    assert execution.run_member(staged, whole, execution.Worker()).status == "finished"
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
        assert execution.run_member(staged, cut, execution.Worker()).status == "finished"
        assert text(cut.folder) == text(whole.folder), steps
        same(cut.folder, whole.folder)


def test_a_kill_between_stages(tmp_path, monkeypatch):
    """After the last checkpoint of the first, before or after its end is kept."""
    whole = task(tmp_path / "whole")
    execution.run_member(staged, whole, execution.Worker())
    for kept in (False, True):
        cut, save = task(tmp_path / f"cut {kept}"), execution.save

        def dies(path, state, kept=kept, save=save):
            if kept:
                save(path, state)
            raise Interrupted

        monkeypatch.setattr(execution, "save", dies)
        assert execution.run_member(staged, cut, execution.Worker()).status == "interrupted"
        monkeypatch.undo()
        assert (cut.folder / "end_1.checkpoint").exists() == kept
        assert execution.run_member(staged, cut, execution.Worker()).status == "finished"
        assert text(cut.folder) == text(whole.folder)
        same(cut.folder, whole.folder)


def test_stages_that_are_refused(tmp_path):
    """One that begins before the one before has ended."""

    def build(speed):
        return replace(staged(speed), then=lambda state: ensembles.squeezed(speed))

    found = execution.run_member(build, task(tmp_path / "bad"), execution.Worker())
    assert "begins before t = 4e-05 s" in found.error


def test_a_member_that_fails_is_named_and_does_not_stop_the_others(tmp_path, caplog):
    """One cannot be built, one fails after six steps, whose rows are kept; it is tried again from there."""
    members = [{"speed": speed} for speed in (0.0, 3.0, 1.0)]
    found = skmpm.sweep(ensembles.mixed, members, out=tmp_path, processes=1)
    assert [member.status for member in found] == ["failed", "failed", "finished"]
    assert found.failed == {
        "speed=0.0": "SceneError: a lid that does not move",
        "speed=3.0": "ArithmeticError: no force",
    }
    assert "sweep: speed=3.0 failed: ArithmeticError: no force (2 of 3)" in caplog.text
    assert [member.name for member in found.finished] == ["speed=1.0"]
    assert found["speed=3.0"].columns["steps"].tolist() == [1, 2, 3, 4, 5, 6]
    assert "in failing" in (tmp_path / "speed=3.0" / execution.FAILURE).read_text()
    assert repr(found) == f"Sweep(3 members, failed 2, rows {STEPS + 6})"
    assert found.table()["finished"].sum() == STEPS
    again = skmpm.sweep(ensembles.mixed, members[1:], out=tmp_path, processes=1)
    assert again["speed=3.0"].columns["steps"].tolist() == [1, 2, 3, 4, 5, 6]
    assert len(again["speed=3.0"].manifest["sessions"]) == 2


def test_a_killed_process_is_replaced(tmp_path):
    """SIGKILL in the middle: the member goes on in another process, from its checkpoint."""
    started, killed = time.monotonic(), []
    events = processes.in_processes(
        pickling.pickled(ensembles.squeezed), [task(tmp_path / "cut", speed=1.0, slow=True)], 1
    )
    for event in events:  # noqa: B007
        assert time.monotonic() < started + 300.0
        holder = lock._holder(tmp_path / "cut") if (tmp_path / "cut" / records.LAST).exists() else {}
        if holder and not killed:
            killed.append(holder["process"])
            os.kill(holder["process"], signal.SIGKILL)
    assert event.status == "finished"
    assert text(tmp_path / "cut") == ensembles.by_hand(1.0)
    sessions = json.loads((tmp_path / "cut" / manifest.FILE).read_text())["sessions"]
    assert [entry["process"] == killed[0] for entry in sessions] == [True, False]


def test_a_killed_first_process_takes_its_workers_along(tmp_path):
    """Workers write checkpoints, free their locks and end; the sweep goes on from there."""
    process, out = script(tmp_path), tmp_path / "out"
    folder, deadline = out / "slow=True,speed=1.0", time.monotonic() + 300.0
    while not (folder / records.LAST).exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    process.kill()
    process.communicate()
    while json.loads((folder / manifest.FILE).read_text())["status"] == "running" and time.monotonic() < deadline:
        time.sleep(0.05)
    assert json.loads((folder / manifest.FILE).read_text())["status"] == "interrupted"
    found = skmpm.sweep(ensembles.squeezed, [{"speed": 1.0, "slow": True}], out=out, processes=1)
    assert text(found["slow=True,speed=1.0"].folder) == ensembles.by_hand(1.0)


def dies(**_):
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_member_whose_process_always_dies_fails(tmp_path):
    found = skmpm.sweep(dies, [{"speed": 1.0}], out=tmp_path, processes=1)
    assert found.failed == {"speed=1.0": "its process ended 3 times, by SIGKILL; was there enough memory?"}


SCRIPT = """
import sys
import ensembles, skmpm
if {guard}:
    members = [dict(speed=speed, slow={slow}) for speed in {speeds}]
    print(skmpm.sweep(ensembles.squeezed, members, out="out", processes=2))
"""


def script(folder, guard="__name__ == '__main__'", *paths, slow=True, speeds=(1.0, 2.0, 0.5)):
    (folder / "script.py").write_text(SCRIPT.format(guard=guard, slow=slow, speeds=speeds))
    places = [*paths, Path(__file__).parent, Path(skmpm.__file__).parents[1]]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, places))}
    options = {"cwd": folder, "env": environment, "stdout": -1, "stderr": -1, "text": True}
    return subprocess.Popen([sys.executable, "script.py"], preexec_fn=heed_interrupts, **options)


def heed_interrupts():
    """Where the tests run in the background of a shell, SIGINT is ignored, also by the processes that they start."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_writes_checkpoints_and_the_sweep_goes_on_from_them(tmp_path, number):
    """To the first process only: both members that run are interrupted, the third is not begun; nothing is lost."""
    process, out = script(tmp_path), tmp_path / "out"
    running = [out / "slow=True,speed=1.0", out / "slow=True,speed=2.0"]
    deadline = time.monotonic() + 300.0
    while not all((folder / records.LAST).exists() for folder in running) and time.monotonic() < deadline:
        time.sleep(0.05)
    process.send_signal(number)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == {signal.SIGTERM: 128 + signal.SIGTERM, signal.SIGINT: -signal.SIGINT}[number], errors
    for folder in running:
        about = json.loads((folder / manifest.FILE).read_text())
        assert about["status"] == "interrupted"
        lock.check_free(folder)
        assert 0.0 < skmpm.load(folder / records.LAST).t < STEPS * DT
    assert not (out / "slow=True,speed=0.5" / manifest.FILE).exists()
    if number == signal.SIGINT:
        return  # what is left is the same, and so is what goes on from it
    members = [{"speed": speed, "slow": True} for speed in (1.0, 2.0)]
    found = skmpm.sweep(ensembles.squeezed, members, out=out, processes=2)
    for member in found:
        assert text(member.folder) == ensembles.by_hand(member.parameters["speed"])
        assert len(member.manifest["sessions"]) == 2


def test_a_script_needs_a_guard_only_without_cloudpickle(tmp_path):
    """Then it is told of it; else workers import no script, which may come from a terminal as well."""
    small = {"slow": False, "speeds": (1.0,)}
    found, errors = script(tmp_path, "True", **small).communicate(timeout=300)
    assert found == f"Sweep(1 members, rows {STEPS})\n", errors
    (tmp_path / "without").mkdir()
    (tmp_path / "without" / "cloudpickle.py").write_text("raise ImportError")
    shutil.rmtree(tmp_path / "out")
    _, errors = script(tmp_path, "True", tmp_path / "without", **small).communicate(timeout=300)
    assert "SweepError: sweep is called by a script that a worker process imports; call it below" in errors
    assert "ended with exit code 1 before it began" in errors
    guarded = script(tmp_path, "__name__ == '__main__'", tmp_path / "without", **small)
    found, errors = guarded.communicate(timeout=300)
    assert found == f"Sweep(1 members, rows {STEPS})\n", errors


def test_one_directory_one_run(tmp_path):
    """A lock that is held is refused with its holder, one of a process that ended is not; threads count too."""
    folder = tmp_path / "speed=1.0"
    folder.mkdir()
    with lock.locked(folder, "another sweep"):
        with pytest.raises(InUse, match=rf"speed=1.0 is in use by process {os.getpid()} on .* since 20"):
            skmpm.sweep(ensembles.squeezed, [{"speed": 1.0}], out=tmp_path)
        assert (
            "is in use by process" in execution.run_member(ensembles.squeezed, task(folder), execution.Worker()).error
        )
        began = time.monotonic()
        with pytest.raises(InUse), lock.locked(folder, "another sweep", patience=0.5):
            pass
        assert time.monotonic() - began > 0.5, "its own sweep is waited for"
    assert (folder / lock.FILE).exists()
    lock.check_free(folder)
    holds = (
        "from pathlib import Path\nfrom skmpm.sweep import lock\n"
        f"with lock.locked(Path({str(folder)!r}), 'x'): print(1, flush=True); input()"
    )
    with subprocess.Popen([sys.executable, "-c", holds], stdout=-1, stdin=-1) as process:
        process.stdout.readline()
        with pytest.raises(InUse, match=f"by process {process.pid}"):
            lock.check_free(folder)
        process.kill()
    lock.check_free(folder)


def test_directories_of_other_parameters_or_versions_are_refused(tmp_path):
    """By name, with what is other; a finished member is of no matter to the versions of other libraries."""
    finished = task(tmp_path / "speed=1.0")
    execution.run_member(ensembles.squeezed, finished, execution.Worker())
    about = manifest.read(finished.folder)

    def refused(changes, match):
        manifest.write(finished.folder, about | changes)
        with pytest.raises(skmpm.SweepError, match=match):
            skmpm.sweep(ensembles.squeezed, [{"speed": 1.0}], out=tmp_path)

    refused({"parameters": {"speed": 2.0}}, r"speed=1.0 was made with other parameters, .*2.0.*; give another out")
    refused({"versions": about["versions"] | {"skmpm": "0.1"}}, "was made with skmpm 0.1, this is skmpm")
    refused({"versions": about["versions"] | {"source": "a"}}, "was made with source a, this is source")
    numpy = about["versions"] | {"numpy": "1.0"}
    refused({"versions": numpy, "status": "running"}, "was made with numpy 1.0, this is numpy")
    manifest.write(finished.folder, about | {"versions": numpy})
    assert len(skmpm.sweep(ensembles.squeezed, [{"speed": 1.0}], out=tmp_path)) == 1
    (finished.folder / manifest.FILE).write_text("{")
    with pytest.raises(skmpm.SweepError, match="is no manifest of a sweep"):
        skmpm.sweep(ensembles.squeezed, [{"speed": 1.0}], out=tmp_path)


def counted(a=None, k=0, x=None):
    """One row, with a column of the name of a parameter where that is not given."""
    return {"n": 1} if x is not None else {"n": 1, "x": 5.0}


def test_a_parameter_that_is_nan_is_that_of_the_run_before(tmp_path):
    for _ in range(2):
        found = skmpm.sweep(counted, [{"a": float("nan")}], out=tmp_path)
        assert found["a=nan"].status == "finished"
    assert len(found.where(a=float("nan"))) == 1


def test_a_column_with_the_name_of_a_parameter_of_another_member(tmp_path):
    """The parameter was lost; members without a parameter are not those in which it is None."""
    found = skmpm.sweep(counted, [{"k": 1, "x": 2.0}, {"k": 2}], out=tmp_path)
    np.testing.assert_array_equal(found.table()["x"], [2.0, 5.0])
    assert [len(found.where(x=value)) for value in (2.0, None)] == [1, 0]


def test_hidden_directories_and_files_of_the_user_stay(tmp_path):
    folder = tmp_path / "k=1"
    (folder / ".ipynb_checkpoints").mkdir(parents=True)
    (folder / ".note").write_text("mine")
    (folder / f"{manifest.PARTIAL}1").write_text("{")
    assert skmpm.sweep(counted, [{"k": 1}], out=tmp_path)["k=1"].status == "finished"
    assert sorted(path.name for path in folder.glob(".*")) == [".ipynb_checkpoints", ".note"]


@pytest.mark.parametrize(("source", "warned"), [("0" * 64, True), ("", False)], ids=["other", "unknown"])
def test_a_build_that_has_changed_is_warned_of(tmp_path, caplog, source, warned):
    finished = replace(task(tmp_path / "speed=1.0"), build={"name": "ensembles.squeezed", "source": source})
    execution.run_member(ensembles.squeezed, finished, execution.Worker())
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
        assert parameters.directory(parameters.plain(dict(items))) == name
    odd = [
        {"a": 1}, {"a": 1.0}, {"a": "1"}, {"a": True}, {"a": "True"}, {"a": [1]}, {"a": "[1]"}, {"a": "b,c=1"},
        {"a": "b", "c": 1}, {"a": "é"}, {"a": "è"}, {"a": "x" * 300}, {"a": "x" * 301}, {"a": None}, {"a": "nan"},
        {"a": float("nan")}, {"a": {"b": 1}}, {"a": ""}, {"a": "../b"}, {"a=1,b": 1}, {"a": 1, "b": 1},
    ]  # fmt: skip
    found = [parameters.directory(parameters.plain(each)) for each in odd]
    assert len({name.casefold() for name in found}) == len(odd)
    assert all(len(name) < 140 and "/" not in name for name in found)
    assert parameters.plain({"b": np.float64(0.5), "a": [0, np.int64(1)], "c": (1, 2)}) == {
        "a": [0, 1],
        "b": 0.5,
        "c": [1, 2],
    }


def test_members_that_are_refused(tmp_path):
    with pytest.raises(skmpm.SweepError, match=r"two members have the directory speed=1.0"):
        skmpm.sweep(ensembles.squeezed, [{"speed": 1.0}, {"speed": np.float64(1.0)}], out=tmp_path)
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


def test_what_cannot_be_pickled_is_named(monkeypatch):
    """With cloudpickle functions of any kind pass, a lock does not; without it the lambda is named."""
    lid, held = ensembles.scene(), {"lock": threading.Lock()}

    def with_lambda(speed):
        return skmpm.Run(lid, until=speed)

    def with_lock(speed):
        return held[speed]

    assert pickling.pickled(with_lambda)
    with pytest.raises(
        skmpm.SweepError, match=r"held\['lock'\] is of type lock, which cannot be sent .*; build it inside"
    ):
        pickling.pickled(with_lock)
    monkeypatch.setitem(sys.modules, "cloudpickle", None)
    assert pickling.pickled(ensembles.squeezed)
    with pytest.raises(
        skmpm.SweepError, match=r"build is the function .*with_lambda at line .*define functions at the top"
    ):
        pickling.pickled(with_lambda)
    there = r"build\(lid=\).walls\[1\].velocity is a lambda at line \d+ of .*ensembles.py.*pip install"
    with pytest.raises(skmpm.SweepError, match=there):
        pickling.pickled(partial(ensembles.squeezed, lid=lid))
    with pytest.raises(skmpm.SweepError, match=r"build is a lambda at line .*define functions at the top level"):
        pickling.pickled(lambda speed: speed)


def test_tables_that_build_makes_itself(tmp_path):
    """Rows of numbers, truth values and texts come back as they were; columns of several members are joined."""
    members = {"three": {"n": 3}, "two": {"n": 2, "name": "two\nlines"}}
    found = skmpm.sweep(ensembles.rows, members, out=tmp_path, processes=1)
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

    assert match in execution.run_member(build, task(tmp_path / "bad"), execution.Worker()).error


def test_rows_have_the_same_columns(tmp_path):
    def build(speed):
        return replace(
            ensembles.squeezed(speed), observe=lambda scene, state: {"a": 1} if state.t < 2.5 * DT else {"b": 2}
        )

    found = execution.run_member(build, task(tmp_path / "bad"), execution.Worker())
    assert found.error == "ValueError: a row has other columns than the first, or another order: a, b"


def test_runs_that_are_refused(tmp_path):
    scene = ensembles.scene()
    for options, match in (({"every": -1.0}, "every = -1.0"), ({"keep": {"last": bool}}, "'last' names no file")):
        with pytest.raises(ValueError, match=match):
            skmpm.Run(scene, until=1.0, **options)
    with pytest.raises(TypeError, match="expected a Scene, got a str"):
        skmpm.Run("scene", until=1.0)
    found = execution.run_member(lambda speed: 1.0, task(tmp_path / "bad"), execution.Worker())
    assert "build returned a float; expected a Run, or rows of the table" in found.error
    for nothing in ([], {}):
        own = task(tmp_path / type(nothing).__name__)
        failed = execution.run_member(lambda speed, made=nothing: made, own, execution.Worker())
        assert "build returned no rows, or an empty one" in failed.error
    gone = execution.run_member(ensembles.squeezed, replace(TASK, folder=tmp_path / "gone"), execution.Worker())
    assert "is not there; give a directory that all workers share" in gone.error
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


def test_the_line_of_progress():
    """Members that have ended, those that run with their share, and what is left of the time."""
    bar = _Bar(4, 1, shown=False)
    bar.show(execution.Outcome(replace(TASK, folder=Path("speed=1.0")), "failed"))
    bar.show((replace(TASK, folder=Path("speed=2.0")), 0.5))
    bar._began -= 30.0
    assert bar.line().startswith("2 of 4 members  1 failed  ETA 0:30  speed=2.0 50 %")


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
        assert execution.run_member(build, member, execution.Worker()).status == "finished"
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
        one, same, other = (manifest.source_of(bound(E))["source"] for E in (1e6, 1e6, 2e6))
        assert one == same != other


def test_texts_of_rows_stay_texts():
    """Names that look like numbers as no number is written."""
    columns = records.parsed("a,b,c,d,e,f\n007,1e-07,-3,+7,1e5,nan\n010,0.5,10,+8,12e-4,1\n")
    texts, numbers = [["007", "010"], ["+7", "+8"], ["1e5", "12e-4"]], [[1e-07, 0.5], [-3, 10]]
    assert [columns[name].tolist() for name in "ade"] == texts
    assert [columns[name].tolist() for name in "bc"] == numbers
    assert columns["c"].dtype.kind == "i" and columns["f"].dtype.kind == "f"


@pytest.mark.parametrize("text", ["1e5", " lead", "a  b\t", "12e-4", 'said "so", twice', "\u2028"])
def test_texts_come_back_as_they_were_written(tmp_path, text):
    rows = records.Records(tmp_path, [], (0, b""))
    rows.add({"id": run.checked({"id": text}, frozenset())["id"]})
    rows.commit(None)
    assert records.read_table(tmp_path, finished=True)["id"].tolist() == [text]
    assert run.checked({"id": "two\nlines"}, frozenset()) == {"id": "two lines"}
