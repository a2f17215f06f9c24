"""Every example is one file: it runs where nothing else of the folder is."""

import shutil
import subprocess
import sys
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples"
IMPORT = "import sys; from runpy import run_path; [run_path(path, run_name='example') for path in sys.argv[1:]]"


def run(command, cwd):
    return subprocess.run([sys.executable, *command], cwd=cwd, capture_output=True, text=True)


def alone(name, folder):
    """A copy of an example in a directory of its own."""
    (folder / name).mkdir()
    return shutil.copy(EXAMPLES / f"{name}.py", folder / name)


def test_examples_import_nothing_that_lies_beside_them(tmp_path):
    names = sorted(path.stem for path in EXAMPLES.glob("*.py") if path.stem != "__init__")
    assert len(names) > 20
    done = run(["-c", IMPORT, *(alone(name, tmp_path) for name in names)], tmp_path)
    assert done.returncode == 0, done.stderr


def test_a_copied_example_writes_its_picture(tmp_path):
    done = run([alone("fall", tmp_path)], tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "fall" / "fall.png").stat().st_size > 1000
