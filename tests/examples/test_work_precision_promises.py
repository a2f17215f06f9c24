"""Errors predicted by `suggest` on the two scenes with cheap references; the others are on the page."""

import csv
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
    assert 0.1 < float(row[promises.HEAD.index("largest / asked")]) < 2.0


def test_the_page_has_all_promises():
    """A line for every scene and error of the script, and the verdict."""
    docs = ROOT / "docs" / "studies"
    with (docs / "work_precision" / "promises.csv").open(encoding="utf-8") as file:
        head, *lines = (tuple(line) for line in csv.reader(file))
    assert head == promises.HEAD
    expected = [
        (each.name, each.against, f"{100 * error:g}") for each in promises.promises() for error in each.errors
    ]
    assert [line[:3] for line in lines] == expected
    page = (docs / "work_precision.md").read_text().split("<!-- promises -->")[1]
    assert promises.short(lines) in page
    kept = sum(float(line[6]) <= promises.PROMISE for line in lines)
    assert f"Within a factor of 2: {kept} of {len(lines)}, met." in page and kept == len(lines)
