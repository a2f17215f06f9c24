"""Compiled loops: their results do not depend on what has been compiled before."""

import ctypes
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import skmpm

EXAMPLES = Path(__file__).parents[2] / "examples"

HANGING_BAR = """
import hashlib
import skmpm

bar = skmpm.Body(skmpm.box((0, 0), (4e-3, 1e-3), spacing=2.5e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1e3))
held = skmpm.Support(lambda x: x[0] < 6e-4)
scene = skmpm.Scene([bar], cell=5e-4, supports=[held], gravity=(0, -500))
*_, state = skmpm.simulate(scene, dt=1e-4, until=5e-4, warn=False)
print(hashlib.sha256(state.x.tobytes()).hexdigest())
"""


SOURCE = Path(skmpm.__file__).parent


def bound_by_permissions():
    """Root, too, may no longer write where permissions do not say so (prctl: PR_CAPBSET_DROP, CAP_DAC_OVERRIDE)."""
    ctypes.CDLL(None).prctl(24, 1, 0, 0, 0)


@pytest.fixture
def read_only(tmp_path):
    """Called, takes from a directory the permission to write; returns a function that runs Python so, homeless."""
    home = tmp_path / "home"
    home.mkdir(mode=0o555)
    options = {k: v for k, v in os.environ.items() if k not in ("XDG_CACHE_HOME", "NUMBA_CACHE_DIR")}
    limits = {"preexec_fn": bound_by_permissions} if os.geteuid() == 0 else {}
    changed = []

    def run(code, path):
        options.update(HOME=str(home), PYTHONPATH=os.pathsep.join(map(str, path)))
        return subprocess.run(
            [sys.executable, "-c", code], cwd=home, env=options, capture_output=True, text=True, **limits
        )

    def locked(folder):
        for place in [folder, *folder.rglob("*")]:
            changed.append((place, place.stat().st_mode))
            place.chmod(place.stat().st_mode & 0o555)
        if run(f"open({str(folder / 'new')!r}, 'w')", []).returncode == 0:
            pytest.skip("this system lets its user write in spite of permissions")
        return run

    yield locked
    for place, mode in changed:
        place.chmod(mode)


def test_the_first_run_after_an_installation_has_the_bits_of_all_others(tmp_path, read_only):
    """One process compiles all loops, others read them: also from a read-only copy whose times have changed."""
    installed = tmp_path / "installed"
    shutil.copytree(SOURCE, installed / "skmpm", ignore=shutil.ignore_patterns("__pycache__"))
    options = {**os.environ, "PYTHONPATH": str(installed)}
    options.pop("NUMBA_CACHE_DIR", None)
    command = [sys.executable, "-c", HANGING_BAR]
    first = subprocess.run(command, cwd=installed, env=options, capture_output=True, check=True, text=True)
    for source in installed.rglob("*.py"):
        os.utime(source, (0, 0))
    second = read_only(installed)(HANGING_BAR, [installed])
    assert "compiling" in first.stderr and second.stderr == ""
    assert first.stdout == second.stdout


def test_a_loop_is_compiled_where_it_cannot_be_kept(tmp_path, read_only):
    """With one sentence that says so, and what to do."""
    modules = tmp_path / "modules"
    modules.mkdir()
    loop = "@compiled\ndef {}(x):\n    return 2.0 * x\n"
    (modules / "loops.py").write_text(
        "from skmpm.compiled import compiled\n" + loop.format("one") + loop.format("two")
    )
    done = read_only(modules)("from loops import one, two; print(one(1.0), two(2.0))", [modules, SOURCE.parent])
    assert done.stdout == "2.0 4.0\n"
    assert [line[:9] for line in done.stderr.splitlines()] == ["compiling", "compiled "]
    assert done.stderr.endswith("set NUMBA_CACHE_DIR to a directory that can\n")


def test_a_loop_is_compiled_again_when_one_of_another_module_that_it_calls_changes(tmp_path):
    """Numba looks at the module of the loop alone, and kept what had been inlined there."""
    loop = "from skmpm.compiled import compiled\n@compiled\ndef"
    (tmp_path / "outer.py").write_text(f"from inner import inner\n{loop} outer(x):\n    return inner(x)\n")
    found = []
    for factor in ("2.0", "30.0"):
        (tmp_path / "inner.py").write_text(f"{loop} inner(x):\n    return {factor} * x\n")
        command = [sys.executable, "-c", "from outer import outer; print(outer(1.0))"]
        found.append(subprocess.run(command, cwd=tmp_path, capture_output=True, check=True, text=True).stdout)
    assert found == ["2.0\n", "30.0\n"]


AFTER_WARMUP = """
import gc, sys
from pathlib import Path
from numba.core.dispatcher import Dispatcher
from skmpm.warmup import warm_up

def variants():
    loops = [a for a in gc.get_objects() if isinstance(a, Dispatcher) and a.py_func.__module__.startswith("skmpm.")]
    return {f"{loop.py_func.__module__}.{loop.py_func.__name__} {s}" for loop in loops for s in loop.signatures}

warm_up()
warm = variants()
sys.path.insert(0, sys.argv[1])
import collision, compaction, powder, squeeze
powder.TURN = 5e-4  # [s], of 2.5e-3
for example in (collision, powder, squeeze):
    example.main(Path(sys.argv[2]))
compaction.run(compaction.parser().parse_args(["--discs", "10", "--until", "0.75", "--out", sys.argv[2]]))
print(sorted(variants() - warm))
"""


def test_common_scenes_compile_nothing_after_the_warm_up(tmp_path):
    """Examples with friction and cohesion, whose scenes are not the warm-up's."""
    command = [sys.executable, "-c", AFTER_WARMUP, str(EXAMPLES), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, check=True, text=True)
    assert done.stdout.splitlines()[-1] == "[]"
