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
    """In a process of its own: what it needs it imports. It prints what the page says, numbers within 1 %."""
    text = (ROOT / page).read_text()
    (code,) = re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    options = {"cwd": tmp_path, "env": os.environ | {"MPLBACKEND": "Agg"}, "capture_output": True}
    done = subprocess.run([sys.executable, "-c", code], check=False, **options)
    assert done.returncode == 0, done.stderr.decode()
    force = float(re.findall(r"[-+.\de]+", done.stdout.decode())[-1])
    assert force > 50.0  # the last line ends with the force on the lid [N/m]
    if "savefig" in code:
        assert next(tmp_path.glob("*.png")).stat().st_size > 10_000
    for said in re.findall(r"^```text\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
        (words, numbers), (own_words, own_numbers) = parts(said), parts(done.stdout.decode())
        assert words in own_words
        first = own_words[: own_words.rindex(words)].count("#")
        assert numbers == pytest.approx(own_numbers[first : first + len(numbers)], rel=0.01)


def parts(text):
    """A text with a # for each number, and the numbers."""
    number = r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]\d+)?"
    return re.sub(number, "#", text), [float(each) for each in re.findall(number, text)]


def test_every_page_cites_the_paper_of_the_method_by_its_doi():
    """The number of a neighbour in the same volume stood in a tutorial."""
    folders = [ROOT / "skmpm", ROOT / "docs", ROOT / "examples", ROOT / "tests"]
    pages = [ROOT / "README.md", ROOT / "CITATION.cff", *(p for folder in folders for p in folder.rglob("*.*"))]
    pages = [page for page in pages if page.suffix in (".py", ".md", ".cff", ".rst") and "_build" not in page.parts]
    found = {number for page in pages for number in re.findall(r"10\.1016/j\.proeng[.\d]*\d", page.read_text())}
    assert found == {"10.1016/j.proeng.2017.01.044"}
