"""The pages of docs/verification are those of what was measured, each of a test that is there."""

import csv
import json
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "verification"))
from ledger import tabulated
from verification_pages import GROUPS, KEPT, cells, columns, comparisons, long_tables, page, reasons, told

PAGES = [(name, title) for modules in GROUPS.values() for name, title in modules.items()]


@pytest.mark.parametrize(("name", "title"), PAGES)
def test_a_page_is_made_of_its_measurements_by_its_module(name, title):
    with (KEPT / f"{name}.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    captions = json.loads((KEPT / f"{name}.json").read_text())
    assert (KEPT / f"{name}.md").read_text() == page(name, title, rows, captions)
    assert all((KEPT / file).read_text() == text for file, text in long_tables(name, rows).items())
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
    assert told(rows) == "6 comparisons; goals: 1 met, 1 asserted by the tests, 2 missed:"
    assert reasons(rows) == ["- d (by 2 %)", "- f (goal: 3)"]


def row(problem, lines, goal="1 %: met", test="test_a"):
    """A comparison of numbers at R/h = 5."""
    return {"problem": problem, "reference": "exact", "h": "R/h = 5", "error": tabulated(["mean", "worst"], lines),
            "rate": "-", "goal": goal, "test": test}  # fmt: skip


def test_tables_with_the_same_columns_are_one_and_its_legend_says_once_what_is_common():
    goals = {"a": "1 %: met", "b": "1 %: missed", "c": "-"}
    rows = [row(name, {"force": ["1", "2"]}, goal) for name, goal in goals.items()]
    assert list(comparisons("page", rows)) == [
        "", "| problem | | mean | worst |", "|---|---|---:|---:|", "| a | force | 1 | 2 |", "| b | force | 1 | 2 |",
        "| c | force | 1 | 2 |", "", "Runs: R/h = 5. Reference: exact. Test: `test_a`.", "",
        "- *a*: Goal: 1 %. Met.", "- *b*: Goal: 1 %. Missed.",
    ]  # fmt: skip
    same = [row(name, {"force": ["1", "2"]}) for name in "ab"]
    assert list(comparisons("page", same))[-1] == "Runs: R/h = 5. Reference: exact. Goal: 1 %. Met. Test: `test_a`."


def test_a_problem_with_other_facts_starts_another_table():
    rows = [row("a", {"force": ["1", "2"]}), row("a", {"force": ["3", "4"]}, goal="-")]
    assert sum(line.startswith("| problem") for line in comparisons("page", rows)) == 2


def test_a_long_table_is_a_file_and_its_page_has_the_least_and_the_most():
    rows = [row("disc", {f"case {k}": [f"{k - 10:+d}*", "-"] for k in range(17)})]
    text = "\n".join(comparisons("page", rows))
    assert "| disc | least | -10* | - |\n|  | most | +6* | - |" in text
    assert long_tables("page", rows).keys() == {"tables/page_a.csv"}
    assert "tables/page_a.csv" in text
    kept = list(csv.reader(long_tables("page", rows)["tables/page_a.csv"].splitlines()))
    assert len(kept) == 18
    assert kept[1] == ["disc", "case 0", "-10*", "-"]


def test_cells_of_long_problems_are_split():
    assert cells("short: force", "R/h = 5") == ("short: force", "R/h = 5")
    long = "disc rolls on 0.5 degrees, E = 1e+06 Pa: acceleration"
    assert cells(long, "R/h = 5") == ("disc rolls on 0.5 degrees, E = 1e+06 Pa", "acceleration, R/h = 5")
    assert cells("x" * 50, "") == ("x" * 50, "")
    cut = "manufactured square, cut at (0.3, 0.45) h"
    assert cells(cut, "velocity") == ("manufactured square", "cut at (0.3, 0.45) h, velocity")
