"""The scripts on the first pages run as they stand."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("page", ["README.md", "docs/index.md", "docs/getting_started.md"])
def test_the_script_of_a_page_runs(page, tmp_path):
    """In a process of its own: what it needs it imports."""
    (code,) = re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(), re.DOTALL | re.MULTILINE)
    options = {"cwd": tmp_path, "env": os.environ | {"MPLBACKEND": "Agg"}, "capture_output": True}
    done = subprocess.run([sys.executable, "-c", code], check=False, **options)
    assert done.returncode == 0, done.stderr.decode()
    force = float(re.findall(r"[-+.\de]+", done.stdout.decode())[-1])
    assert force > 50.0  # the last line ends with the force on the lid [N/m]
    if "savefig" in code:
        assert next(tmp_path.glob("*.png")).stat().st_size > 10_000
