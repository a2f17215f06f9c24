"""Errors predicted by `suggest` on the two scenes with cheap references; the others are on the page."""

from pathlib import Path

import pytest

from examples.studies.work_precision import promises

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("k", [0, 1], ids=["finite elements", "Hertz"])
@pytest.mark.parametrize("error", [0.1, 0.05])
def test_a_block_and_a_rubber_disc_err_by_no_more_than_twice_what_was_asked(k, error):
    """Nor by less than a tenth of it: the promise costs something."""
    promise = promises.promises()[k]
    row, kept = promises.line(promise, error)
    assert kept
    assert 0.1 < float(row[7]) < 2.0


def test_the_page_has_all_promises():
    """A line for every scene and error of the script, and the verdict."""
    page = (ROOT / "docs" / "studies" / "work_precision.md").read_text().split("<!-- promises -->")[1]
    for promise in promises.promises():
        for error in promise.errors:
            assert f"| {promise.name} | {promise.against} | {100 * error:g} |" in page
    assert "Within a factor of 2: " in page
