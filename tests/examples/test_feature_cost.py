"""The table of feature costs at small size: every line counts what it names, and every test in it exists."""

import csv
from pathlib import Path

import pytest

from examples.studies.feature_cost import study as features

ROOT = Path(__file__).parents[2]
SMALL = ["--discs", "8", "--cells", "3", "--large", "6", "--repeats", "1"]


@pytest.fixture
def page(tmp_path, monkeypatch):
    """The small table of a packing that has just begun to touch, on a page that has text around the marks."""
    monkeypatch.setattr(features.scenes, "FRACTION", 0.72)
    path = tmp_path / "work_precision.md"
    path.write_text("before\n\n<!-- features -->\nold\n<!-- /features -->\n\nafter\n")
    features.main(features.parser().parse_args([*SMALL, "--docs", str(tmp_path)]))
    with (tmp_path / "work_precision" / "features.csv").open(encoding="utf-8") as file:
        return path.read_text(), list(csv.reader(file))


@pytest.mark.slow
def test_every_line_is_measured_and_the_rest_of_the_page_stays(page):
    """What is off is counted as nothing, what is on as something; all tests that are named exist."""
    page, (head, *lines) = page
    assert page.startswith("before\n\n<!-- features -->\n\n`python -m examples.studies.feature_cost`")
    assert page.endswith("<!-- /features -->\n\nafter\n")
    assert "old" not in page.splitlines()
    wanted = features.scenes.features(8, 3.0, 6.0)
    assert [line[0] for line in lines] == [feature.name for feature in wanted]
    assert all(len(line) == len(head) == 8 for line in lines)
    shown = [tuple(line.strip("| ").split(" | ")) for line in page.splitlines() if line.startswith("| ")][2:]
    assert shown == [(*line[:2], line[4]) for line in lines if not 1 / 1.2 < float(line[4]) < 1.2]
    found = {(line[0], line[1]): counts(line[3]) for line in lines}
    never = {
        "calls in `contact` and `coulomb`", "gravity evaluated", "loads evaluated", "eliminations", "line searches",
        "means of dilatation", "kinetic energies", "body grids built", "patterns made",
    }  # fmt: skip
    for each in found.values():
        for name in never & each.keys():
            on, off = each[name]
            assert on > 0.0 == off, name
    friction = found["friction 0.5 / 0", "packing"]
    assert friction["rows of W"][1] <= friction["contacts"][1] * 1.5 < friction["rows of W"][0]
    walls = found["walls of rigid points / planes", "packing, rough walls"]["unknowns"]
    assert walls[0] == walls[1] > 0
    bodies = found["a deformable / a rigid body", "two discs meet"]
    assert bodies["unknowns"][0] == 2 * bodies["unknowns"][1]
    sources = "".join(path.read_text() for path in (ROOT / "tests").rglob("test_*.py"))
    named = {test for feature in wanted for test in feature.tests}
    assert not {test for test in named if f"def {test}(" not in sources}


def counts(cell):
    """Numbers on and off by name."""
    parts = (part.rsplit(" ", 3) for part in cell.split("; "))
    return {name: (float(on), float(off)) for name, on, slash, off in parts}
