"""The pages of docs/verification are those of what was measured, each of a test that is there."""

import csv
import json
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "verification"))
from ledger import tabulated
from verification_pages import GROUPS, KEPT, columns, page, reasons, told

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


def test_a_table_of_a_row_is_read_as_it_was_written():
    error = tabulated(["force [%]", "P / E*"], {"disc: mean": ["+1", "0.2"], "worst": ["-3", "-"]})
    row = {"h": "R/h = 5", "error": error}
    assert columns(row) == (("force [%]", "P / E*"), [("disc: mean", ["+1", "0.2"]), ("worst", ["-3", "-"])])
    row["error"] = tabulated(["force [%]"], {"": ["+1"]})
    assert columns(row) == (("force [%]",), [("R/h = 5", ["+1"])])


def test_goals_are_counted_where_there_are_some():
    goals = "-", "shown", "1 %: met", "1 %: missed: by 2 %", "rate >= 1.8", "3: missed"
    rows = [{"problem": name, "goal": goal} for name, goal in zip("abcdef", goals, strict=True)]
    assert told(rows[:2]) == "2 comparisons, without goals."
    assert told(rows) == "6 comparisons; goals: 1 met, 2 missed, 1 asserted by the tests."
    assert reasons(rows) == ["- d (by 2 %)", "- f (goal: 3)"]
