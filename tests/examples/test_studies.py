"""Every study runs as a module and by path, from a clone and from any directory."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
STUDIES = {
    "packing_ensemble": ("", "choices", "figures", "main_job", "own_jamming"),
    "work_precision": ("", "page", "promises"),
    "feature_cost": ("",),
    "periodic_shear": ("", "figures"),
    "shear_cell": ("", "figures"),
    "lmgc90_box": ("", "figures"),
    "mixtures": ("", "figures"),
    "hopper": ("", "figures"),
    "benchmark": ("", "crossover", "large"),
}
HELP = """
import contextlib, io, json, runpy, sys
path, found = sys.path[:], []
for run, where, *arguments in json.loads(sys.argv[1]):
    sys.path[:] = path
    for name in [name for name in sys.modules if name.partition(".")[0] == "examples"]:
        del sys.modules[name]
    sys.argv = [where, *arguments]
    with contextlib.redirect_stdout(io.StringIO()) as text, contextlib.suppress(SystemExit):
        getattr(runpy, run)(where, run_name="__main__")
    found.append(text.getvalue())
print(json.dumps(found))
"""  # what commands print, each with the paths and without the modules of studies that the one before has found


def run(where, *arguments, cwd):
    """What a command prints."""
    environment = {**os.environ, "PYTHONPATH": "", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, *where, *filter(None, arguments)]
    return subprocess.run(command, env=environment, cwd=cwd, check=True, capture_output=True, text=True).stdout


def helps(commands, *, cwd):
    """What several commands print with --help, one after another in one process, which imports numpy once."""
    commands = [(*filter(None, command), "--help") for command in commands]
    return json.loads(run(["-c", HELP], json.dumps(commands), cwd=cwd))


@pytest.fixture(scope="module")
def texts(tmp_path_factory):
    """Of all commands by path, from elsewhere, and of all studies as modules, from the clone."""
    each = [(study, name) for study, names in STUDIES.items() for name in names]
    paths = [("run_path", str(ROOT / "examples" / "studies" / study), name) for study, name in each]
    by_path = helps(paths, cwd=tmp_path_factory.mktemp("elsewhere"))
    as_module = helps([("run_module", f"examples.studies.{study}") for study in STUDIES], cwd=ROOT)
    return dict(zip(each, by_path, strict=True)), dict(zip(STUDIES, as_module, strict=True))


@pytest.mark.parametrize("study", STUDIES)
def test_by_path_and_as_a_module(study, texts):
    """Both know the same options, and every command its own."""
    by_path, as_module = {name: texts[0][study, name] for name in STUDIES[study]}, texts[1][study]
    assert all("--" in text for text in by_path.values())
    assert len(set(by_path.values())) == len(by_path)
    assert by_path[""].partition("options:")[2] == as_module.partition("options:")[2]
