#!/usr/bin/env python3
"""Run some 400 fast tests with the lowest versions that pyproject.toml allows of all that the tests need.

Every `>=` is read as `==`, and must be there as a wheel for the Python that runs this script: 3.11, the lowest, too.
The tests are those of the modules that own a library.
"""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
TESTS = [
    *("unit/test_grid.py", "unit/test_forms.py", "unit/test_points.py"),  # scikit-fem, meshio
    *("unit/test_assembly.py", "unit/test_material.py", "unit/test_transfer.py"),  # numba, hypothesis
    *("unit/test_linear.py", "unit/test_krylov.py"),  # scipy, pyamg, threadpoolctl
    *("unit/test_io.py", "unit/test_plot.py", "unit/test_network.py"),  # h5py, matplotlib, vtk, pyvista
    "unit/test_sweep.py::test_a_sweep_in_two_processes_is_what_loops_by_hand_give",  # distributed
    "unit/test_sweep.py::test_a_member_that_fails_is_named_and_does_not_stop_the_others",
    "unit/test_sweep.py::test_a_script_needs_no_guard_and_hears_nothing_of_dask",
    "unit/test_sweep.py::test_one_directory_one_run",  # locket
    "unit/test_sweep.py::test_what_cannot_be_sent_is_named",  # cloudpickle
]


def lowest(requirements: list[str]) -> list[str]:
    """The requirements with `==` for `>=`, those of extras of the project itself included."""
    found = []
    for requirement in requirements:
        if extras := re.fullmatch(r"skmpm\[(.*)\]", requirement):
            for extra in extras[1].split(","):
                found += lowest(PROJECT["optional-dependencies"][extra])
        else:
            found.append(requirement.replace(">=", "=="))
    return found


def main() -> int:
    """Install and test in a directory that is removed again; return the exit code of the tests."""
    needed = lowest([*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["test"]])
    with TemporaryDirectory() as folder:
        python = Path(folder, "bin", "python")
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        install = [python, "-m", "pip", "install", "--quiet", "--no-compile", "--only-binary", ":all:"]
        subprocess.run([*install, *needed], check=True)
        variables = {
            "PYTHONPATH": str(ROOT),
            "NUMBA_CACHE_DIR": folder,
            "OPENBLAS_NUM_THREADS": "1",
            "MPLBACKEND": "Agg",
        }
        options = ["-m", "not slow", "-p", "no:cacheprovider", "--basetemp", f"{folder}/tests"]
        options += ["-W", "default::DeprecationWarning"]  # what old libraries use of newer ones
        command = [python, "-m", "pytest", "-q", *options, *(f"tests/{name}" for name in TESTS)]
        return subprocess.run(command, cwd=ROOT, env=os.environ | variables).returncode


if __name__ == "__main__":
    sys.exit(main())
