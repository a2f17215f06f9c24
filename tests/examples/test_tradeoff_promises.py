"""What `suggest` promises, on the two scenes whose references cost nothing; the others are on the page."""

import sys
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def promises():
    """The script; it leaves no modules behind."""
    before = set(sys.modules)
    sys.path.insert(0, str(ROOT / "examples"))
    yield import_module("tradeoff_promises")
    sys.path.remove(str(ROOT / "examples"))
    for name in set(sys.modules) - before:
        if name.startswith("tradeoff"):
            sys.modules.pop(name)


@pytest.mark.parametrize("k", [0, 1], ids=["finite elements", "Hertz"])
@pytest.mark.parametrize("error", [0.1, 0.05])
def test_a_block_and_a_rubber_disc_err_by_no_more_than_twice_what_was_asked(promises, k, error):
    """Nor by less than a tenth of it: the promise costs something."""
    promise = promises.promises()[k]
    row, kept = promises.line(promise, error)
    assert kept
    assert 0.1 < float(row[7]) < 2.0


def test_the_page_has_all_promises(promises):
    """A line for every scene and error of the script, and the verdict."""
    page = (ROOT / "docs" / "work_precision.md").read_text().split("<!-- promises -->")[1]
    for promise in promises.promises():
        for error in promise.errors:
            assert f"| {promise.name} | {promise.against} | {100 * error:g} |" in page
    assert "Within a factor of 2: " in page
