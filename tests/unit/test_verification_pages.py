"""The pages of docs/verification are those of what was measured, each of a test that is there."""

import csv
import json
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "verification"))
from verification_pages import GROUPS, KEPT, page

PAGES = [(name, title) for modules in GROUPS.values() for name, title in modules.items()]


@pytest.mark.parametrize(("name", "title"), PAGES)
def test_a_page_is_made_of_its_measurements_by_its_module(name, title):
    with (KEPT / f"{name}.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    captions = json.loads((KEPT / f"{name}.json").read_text())
    assert (KEPT / f"{name}.md").read_text() == page(name, title, rows, captions)
    tests = (Path(__file__).parents[1] / "verification" / f"test_{name}.py").read_text()
    assert all(test.strip().rstrip(".") in tests for row in rows for test in row["test"].split("[")[0].split(","))
    assert all((KEPT / file).exists() for file in captions)


def test_every_page_is_in_a_group():
    assert sorted(path.stem for path in KEPT.glob("*.csv")) == sorted(name for name, _ in PAGES)
