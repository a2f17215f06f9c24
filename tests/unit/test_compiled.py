"""Compiled loops: their results do not depend on what has been compiled before."""

import os
import subprocess
import sys

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
