"""Sweeps on a Dask cluster of two worker processes on this machine, which are killed or told to end."""

import json
import os
import signal

import distributed
import ensembles
import pytest
from ensembles import DT, STEPS

import skmpm
from skmpm.sweep import lock, manifest, records


@pytest.fixture(scope="module")
def client():
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None, memory_limit=0
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def text(member):
    return (member.folder / records.TABLE).read_text()


def once_begun(folder, act):
    """A member function for `events`: acts once, when the member in a directory has a checkpoint."""
    done = []

    def look():
        if not done and (folder / records.LAST).exists():
            done.append(lock._holder(folder)["process"])
            act(done[0])

    return done, look


@pytest.fixture
def meanwhile(monkeypatch):
    """Calls a function whenever the sweep looks for news."""

    def start(look):
        bar = skmpm.sweep.__globals__["_Bar"]
        show = bar.show
        monkeypatch.setattr(bar, "show", lambda self, event: (look(), show(self, event))[1])

    return start


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_worker_that_ends_in_the_middle(client, tmp_path, meanwhile, number):
    """Killed, or told to end: its member goes on from its checkpoint, both tables are those of loops by hand."""
    members = [{"speed": speed, "slow": True} for speed in (1.0, 2.0)]
    done, look = once_begun(tmp_path / "slow=True,speed=1.0", lambda process: os.kill(process, number))
    meanwhile(look)
    found = skmpm.sweep(ensembles.squeezed, members, out=tmp_path, client=client)
    assert [member.status for member in found] == ["finished"] * 2
    for member in found:
        assert text(member) == ensembles.by_hand(member.parameters["speed"])
    sessions = found["slow=True,speed=1.0"].manifest["sessions"]
    first, *others = (session["process"] for session in sessions)  # Dask may close the worker that goes on, too
    assert first == done[0] and others and first not in others
    assert ("seconds" in sessions[0]) == (number == signal.SIGTERM), "only a killed one says nothing"


def test_a_member_that_fails(client, tmp_path):
    """It is named; the others finish; closures and lambdas reach the workers; finished members are skipped."""
    failing, limit = ensembles.failing, 6.5 * DT

    def build(speed):
        if speed == 0.0:
            raise skmpm.SceneError("a lid that does not move")
        look = (lambda *of: failing(*of)) if speed == 3.0 else ensembles.force
        return skmpm.Run(ensembles.scene(speed), until=STEPS * DT + 0.0 * limit, dt=DT, observe=look)

    members = [{"speed": speed} for speed in (0.0, 3.0, 1.0)]
    found = skmpm.sweep(build, members, out=tmp_path, client=client)
    assert found.failed == {
        "speed=0.0": "SceneError: a lid that does not move",
        "speed=3.0": "ArithmeticError: no force",
    }
    assert text(found["speed=1.0"]) == ensembles.by_hand(1.0)
    written = (tmp_path / "speed=1.0" / manifest.FILE).stat().st_mtime_ns
    skmpm.sweep(build, members, out=tmp_path, client=client)
    assert (tmp_path / "speed=1.0" / manifest.FILE).stat().st_mtime_ns == written


def test_an_interrupted_client_leaves_checkpoints(client, tmp_path, meanwhile):
    """As by Ctrl-C: workers end what they run and free its locks; the sweep goes on from there in processes."""
    members = [{"speed": speed, "slow": True} for speed in (1.0, 2.0)]

    def stop(process):
        raise KeyboardInterrupt

    _, look = once_begun(tmp_path / "slow=True,speed=1.0", stop)
    meanwhile(look)
    with pytest.raises(KeyboardInterrupt):
        skmpm.sweep(ensembles.squeezed, members, out=tmp_path, client=client)
    about = json.loads((tmp_path / "slow=True,speed=1.0" / manifest.FILE).read_text())
    assert about["status"] == "interrupted"
    for member in skmpm.sweep(ensembles.squeezed, members, out=tmp_path, processes=2):
        assert text(member) == ensembles.by_hand(member.parameters["speed"])


def test_how_far_members_are(client, tmp_path, monkeypatch):
    """Shares of the end are shown while members run."""
    lines = []
    bar = skmpm.sweep.__globals__["_Bar"]
    show = bar.show
    monkeypatch.setattr(bar, "show", lambda self, event: (show(self, event), lines.append(self.line()))[0])
    skmpm.sweep(ensembles.squeezed, [{"speed": 1.0, "slow": True}], out=tmp_path, client=client)
    assert any("slow=True,speed=1.0 " in line and " %" in line for line in lines)
    assert lines[-1].startswith("1 of 1 members")
