"""Every study runs as a module and by path, from a clone and from any directory."""

import os
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
def test_by_path_and_as_a_module(study, tmp_path):
    """Both know the same options, and every command its own."""
    by_path = {
        name: run([ROOT / "examples" / "studies" / study], name, "--help", cwd=tmp_path) for name in STUDIES[study]
    }
    assert all("--" in text for text in by_path.values())
    assert len(set(by_path.values())) == len(by_path)
    as_module = run(["-m", f"examples.studies.{study}"], "--help", cwd=ROOT)
    assert by_path[""].partition("options:")[2] == as_module.partition("options:")[2]


def test_processes_that_a_study_starts_find_it_too(tmp_path):
    """By path from elsewhere: two presets of a scene in a process that is spawned."""
    path = ROOT / "examples" / "studies" / "work_precision"
    page = ROOT / "docs" / "studies" / "work_precision.md"
    (tmp_path / page.name).write_text(page.read_text())
    options = ["--scenes", "cantilever", "--only", "preset", "--processes", "1", "--out", "out", "--docs", "."]
    assert "cantilever preset" in run([path], *options, cwd=tmp_path)
    assert len(list((tmp_path / "out").glob("cantilever_*/table.csv"))) == 3
