"""The tables of what the step, cells and points of the main job cost."""

import csv

import numpy as np
import pytest

from examples import compaction
from examples.studies.packing_ensemble import choices


def written(place, factor):
    """A run whose pressure is so many times the square of the nominal solid fraction."""
    place.mkdir(parents=True)
    (place / "stages.png").touch()
    with (place / "observables.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, compaction.COLUMNS)
        table.writeheader()
        for phi in np.linspace(0.7, 0.95, 251):
            values = dict.fromkeys(compaction.COLUMNS, 2.0)
            table.writerow(values | {"solid_fraction_nominal": phi, "pressure": factor * phi**2})


def test_deviations_and_scatter_are_those_of_the_runs(tmp_path, capsys):
    """Two packings that differ by a fifth, and steps of 8 us that press a tenth more in both."""
    for seed, packing in enumerate((0.9, 1.1)):
        for chosen, factor in zip(choices.steps().values(), (1.0, 1.1, 1.0), strict=True):
            written(choices.place_of(tmp_path, chosen, seed), packing * factor)
    choices.main(choices.parser().parse_args(["steps", "--out", str(tmp_path), "--packings", "2"]))
    rows = [line.split(" | ") for line in capsys.readouterr().out.splitlines()[2:]]
    assert [row[2] for row in rows[:3]] == ["+10.0 / 10.0 %", "+0.0 / 0.0 %", "14.1 %"]
    assert all(row[3] == "+0.0 / 0.0 %" for row in rows if "steps" in row[1])


def test_a_choice_is_run_by_the_main_example_once(tmp_path, monkeypatch):
    chosen = [*choices.resolution()["R/h = 5, points 0.74 h apart"], "--discs", "5", "--until", "0.705"]
    place = choices.run(tmp_path, chosen, 3)
    assert choices.curves(place)["solid_fraction_nominal"][-1] == pytest.approx(0.705, abs=1e-3)
    monkeypatch.setattr(compaction, "run", None)
    assert choices.run(tmp_path, chosen, 3) == place


def test_options_of_the_main_example_come_last():
    """As the text of the module says."""
    (line,) = (line for line in choices.__doc__.splitlines() if " -- " in line)
    words = line.partition("#")[0].split()
    options = choices.parser().parse_args(words[words.index("choices") + 1 :])
    assert (options.what, options.compaction) == ("resolution", ["--discs", "100"])
