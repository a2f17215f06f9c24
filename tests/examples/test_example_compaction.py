"""The main job at small size; its checks at every step are in `test_packing_ensemble`."""

import csv

import numpy as np
import pytest

from examples import compaction


def test_compaction(tmp_path):
    """The table is complete, and what must hold of it holds."""
    options = ["--discs", "12", "--start", "0.6", "--until", "0.75", "--out", str(tmp_path)]
    compaction.run(compaction.parser().parse_args(options))
    with (tmp_path / "observables.csv").open() as file:
        table = list(csv.DictReader(file))
    assert tuple(table[0]) == compaction.COLUMNS
    assert all(np.isfinite(float(value)) for line in table for value in line.values())
    assert float(table[-1]["solid_fraction_nominal"]) == pytest.approx(0.75, abs=1e-6)
    assert max(float(line["residual"]) for line in table) <= 1e-4
    assert max(float(line["overlap"]) for line in table) <= 2e-3
    for name in ("packing.vtkhdf", "stages.png", "last.checkpoint"):
        assert (tmp_path / name).stat().st_size > 1000
