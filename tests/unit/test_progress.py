"""Progress is one line on a terminal, and nothing elsewhere."""

import re
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import pytest

from skmpm.material import LinearElastic, Rigid
from skmpm.points import disc
from skmpm.progress import Progress
from skmpm.scene import Body, Energy, Scene, Wall
from skmpm.simulation import simulate
from skmpm.step.initial_state import initial

SCENE = Scene([Body(disc((0, 0), 1.0, spacing=0.5), LinearElastic(1e6, 0.3, 1e3), velocity=(1, 0))], cell=0.5)


@pytest.fixture
def terminal(monkeypatch):
    """Make stderr a terminal, whatever stream pytest puts there, on which every step is drawn."""
    stderr = SimpleNamespace(isatty=lambda: True)
    monkeypatch.setattr("skmpm.progress.sys", SimpleNamespace(stderr=stderr, modules={}))
    monkeypatch.setattr("skmpm.progress.EVERY", 0.0)


def run(capsys, *, progress):
    states = list(simulate(SCENE, dt=1e-3, until=5e-3, progress=progress))
    printed = capsys.readouterr()
    assert printed.out == ""
    return states, printed.err


def test_progress_prints_on_a_terminal(capsys, terminal):
    _, text = run(capsys, progress=True)
    lines = text.split("\r")[1:]
    assert re.match(r" 20.0 % \|.*\| \d+:\d\d, \d+:\d\d left, step 1  t = 1 ms  dynamic", lines[0])
    assert lines[-1].startswith("100.0 %") and "step 5  t = 5 ms" in lines[-1]
    assert text.endswith("\n")


def test_progress_is_silent_elsewhere(capsys, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: False)
    assert run(capsys, progress=True)[1] == ""


def test_progress_is_silent_unless_wanted(capsys, terminal):
    assert run(capsys, progress=False)[1] == ""


def test_what_is_not_shown_imports_nothing():
    """The library of bars takes a tenth of a second to import."""
    code = "import sys, skmpm.progress; skmpm.progress.Bar(1.0, shown=True); print('tqdm' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_a_run_that_fails_leaves_the_line_and_the_error_alone(capsys, terminal):
    with pytest.raises(RuntimeError, match="broken"), Progress(SCENE, initial(SCENE), 1.0, shown=True) as bar:
        bar.show_state(next(iter(simulate(SCENE, dt=1e-3, until=5e-3))))
        raise RuntimeError("broken")
    assert capsys.readouterr().err.endswith("\n")


def test_nothing_is_printed_when_there_is_nothing_to_do(capsys, terminal):
    assert list(simulate(SCENE, dt=1e-3, until=0.0, progress=True)) == []
    assert capsys.readouterr().err == ""


def test_retries_are_counted(capsys, terminal):
    state = initial(SCENE)
    with Progress(SCENE, initial(SCENE), 1.0, shown=True) as bar:
        for k, retries in enumerate((0, 2, 1)):
            bar.show_state(replace(state, t=0.1 * (k + 1), report=replace(state.report, retries=retries)))
    lines = capsys.readouterr().err.split("\r")[1:]
    assert "retries" not in lines[0]
    assert [line.split("retries ")[1].split()[0] for line in lines[1:3]] == ["2", "3"]


def shown(capsys, scene, state):
    start = initial(scene)
    capsys.readouterr()
    with Progress(scene, start, 1.0, shown=True) as bar:
        bar.show_state(state)
    return capsys.readouterr().err


def boxed(*, lid):
    """A disc of area 3.14 in a box of 3 by 4, without lid an open one."""
    walls = [Wall((-1.5, -1.0), (0, 1)), Wall((-1.5, 0.0), (1, 0)), Wall((1.5, 0.0), (-1, 0))]
    top = [Wall((0.0, 3.0), (0, -1), velocity=(0.0, -1.0))] if lid else []
    return Scene([Body(disc((0, 0), 1.0, spacing=0.5), LinearElastic(1e6, 0.3, 1e3))], cell=0.5, walls=[*walls, *top])


def test_the_solid_fraction_or_the_stroke_is_shown(capsys, terminal):
    closed, open_ = boxed(lid=True), boxed(lid=False)
    state = initial(closed)
    lower = replace(state, t=0.5, walls=state.walls.copy())
    lower.walls[3, 1] -= 1.0
    assert "solid fraction 0.349" in shown(capsys, closed, lower)  # pi / 9
    outside = Body(disc((0, 6.0), 1.0, spacing=0.5), Rigid(1.0), motion=(0, 0, 0))
    held = replace(closed, bodies=[*closed.bodies, outside])
    assert "solid fraction 0.262" in shown(capsys, held, replace(initial(held), t=0.5))  # pi / 12, without the held
    moved = initial(open_)
    moved.walls[0, 1] += 0.25
    assert "stroke 250 mm" in shown(capsys, open_, replace(moved, t=0.5))


def test_the_motion_is_quasi_static_where_kinetic_energy_is_small(capsys, terminal):
    state = initial(SCENE)
    for kinetic, kind in ((0.09, "quasi-static"), (0.11, "dynamic")):
        report = replace(state.report, energy=Energy(kinetic=kinetic, elastic=100.0))
        assert f"  {kind}" in shown(capsys, SCENE, replace(state, report=report))


def test_notebooks_see_it_too(capsys, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: False)
    monkeypatch.setitem(sys.modules, "ipykernel", SimpleNamespace())
    monkeypatch.setattr("skmpm.progress.EVERY", 0.0)
    assert "step 1  " in run(capsys, progress=True)[1]
