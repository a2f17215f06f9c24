"""Every study runs as a module and by path, from a clone and from any directory."""

import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
STUDIES = {
    "packing_ensemble": ("", "figures", "main_job"),
    "work_precision": ("", "page", "promises"),
    "feature_cost": ("",),
    "periodic_shear": ("", "figures"),
    "benchmark": ("", "crossover", "large"),
}


def run(where, *arguments, cwd):
    """What a command prints."""
    environment = {**os.environ, "PYTHONPATH": "", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, *where, *filter(None, arguments)]
    return subprocess.run(command, env=environment, cwd=cwd, check=True, capture_output=True, text=True).stdout


@pytest.mark.parametrize("study", STUDIES)
def test_by_path_and_as_a_module(study, tmp_path, monkeypatch, capsys):
    """Both know the same options, and every command its own.

    A process of its own shows that each way finds the packages; what follows, which commands there are, is looked at
    here, which saves their imports.
    """
    path = ROOT / "examples" / "studies" / study
    by_path = {"": run([path], "--help", cwd=tmp_path)}
    monkeypatch.setattr(sys, "path", list(sys.path))
    for name in filter(None, STUDIES[study]):
        monkeypatch.setattr(sys, "argv", [str(path), name, "--help"])
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(str(path), run_name="__main__")
        assert ended.value.code == 0
        by_path[name] = capsys.readouterr().out
    assert all("--" in text for text in by_path.values())
    assert len(set(by_path.values())) == len(by_path)
    as_module = run(["-m", f"examples.studies.{study}"], "--help", cwd=ROOT)
    assert by_path[""].partition("options:")[2] == as_module.partition("options:")[2]


def test_processes_that_a_study_starts_find_it_too(tmp_path):
    """By path from elsewhere: one setting of a scene in a process that is spawned."""
    path = ROOT / "examples" / "studies" / "work_precision"
    page = ROOT / "docs" / "studies" / "work_precision.md"
    (tmp_path / page.name).write_text(page.read_text())
    options = ["--scenes", "cantilever", "--only", "sample", "--runs", "1", "--processes", "1"]
    assert "cantilever sample" in run([path], *options, "--out", "out", "--docs", ".", cwd=tmp_path)
    assert len(list((tmp_path / "out").glob("cantilever_*/table.csv"))) == 1
