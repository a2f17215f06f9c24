"""Compiled loops: their results do not depend on what has been compiled before."""

import os
import subprocess
import sys
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples"

HANGING_BAR = """
import hashlib
import skmpm

bar = skmpm.Body(skmpm.box((0, 0), (4e-3, 1e-3), spacing=2.5e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1e3))
held = skmpm.Support(lambda x: x[0] < 6e-4)
scene = skmpm.Scene([bar], cell=5e-4, supports=[held], gravity=(0, -500))
*_, state = skmpm.simulate(scene, dt=1e-4, until=5e-4)
print(hashlib.sha256(state.x.tobytes()).hexdigest())
"""


def test_the_first_run_after_an_installation_has_the_bits_of_all_others(tmp_path):
    """One process compiles all loops, the next one reads them from the cache."""
    options = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", HANGING_BAR]
    first, second = (subprocess.run(command, env=options, capture_output=True, check=True) for _ in range(2))
    assert b"compiling" in first.stderr and b"compiling" not in second.stderr
    assert first.stdout == second.stdout


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
for example in (collision, powder, squeeze):
    example.main(Path(sys.argv[2]))
compaction.run(compaction.parser().parse_args(["--discs", "15", "--until", "0.75", "--out", sys.argv[2]]))
print(sorted(variants() - warm))
"""


def test_common_scenes_compile_nothing_after_the_warm_up(tmp_path):
    """Examples of implicit and explicit steps, with friction and cohesion, whose scenes are not the warm-up's."""
    command = [sys.executable, "-c", AFTER_WARMUP, str(EXAMPLES), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, check=True, text=True)
    assert done.stdout.splitlines()[-1] == "[]"
