"""The main job at small size; its checks at every step are in `test_packing_ensemble`."""

import csv

import numpy as np
import pytest

import skmpm
from examples import compaction

SMALL = ["--discs", "12", "--start", "0.66", "--until", "0.75"]


def table(folder):
    with (folder / "observables.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The directory of a run that was not interrupted."""
    out = tmp_path_factory.mktemp("compaction")
    compaction.main([*SMALL, "--out", str(out)])
    return out


def test_compaction(finished):
    """The table is complete, and what must hold of it holds."""
    lines = table(finished)
    assert tuple(lines[0]) == compaction.COLUMNS
    assert all(np.isfinite(float(value)) for line in lines for value in line.values())
    assert float(lines[-1]["solid_fraction_nominal"]) == pytest.approx(0.75, abs=1e-6)
    assert max(float(line["residual"]) for line in lines) <= 1e-4
    assert max(float(line["overlap"]) for line in lines) <= 2e-3
    for name in ("packing.vtkhdf", "stages.png", "last.checkpoint"):
        assert (finished / name).stat().st_size > 1000


def test_a_run_is_not_overwritten(finished, tmp_path):
    before = (finished / "observables.csv").read_bytes()
    with pytest.raises(SystemExit, match=r"has a run: go on with `python .* --resume --out .*`, or give another"):
        compaction.main([*SMALL, "--out", str(finished)])
    assert (finished / "observables.csv").read_bytes() == before
    with pytest.raises(SystemExit, match="has no run to resume"):
        compaction.main(["--resume", "--out", str(tmp_path)])


def test_an_interrupted_run_ends_as_one_that_was_not(finished, tmp_path, monkeypatch):
    """Ctrl-C ends with a line that says how to go on; table, frames and last state are then the same."""
    original, calls = compaction.row, []

    def interrupted(*arguments):
        calls.append(1)
        if len(calls) == 15:
            raise KeyboardInterrupt
        return original(*arguments)

    with monkeypatch.context() as patched:
        patched.setattr(compaction, "row", interrupted)
        with pytest.raises(SystemExit, match=f"^stopped; go on with `python .* --resume --out {tmp_path}`$"):
            compaction.main([*SMALL, "--out", str(tmp_path)])
    assert len(table(tmp_path)) == 14
    compaction.main(["--resume", "--out", str(tmp_path)])
    ended, whole = table(tmp_path), table(finished)
    for line in ended + whole:
        del line["seconds"]
    assert ended == whole
    states = [skmpm.load(folder / "last.checkpoint") for folder in (tmp_path, finished)]
    np.testing.assert_array_equal(*(state.x for state in states))
    np.testing.assert_array_equal(*(skmpm.read(folder / "packing.vtkhdf").t for folder in (tmp_path, finished)))
    assert (tmp_path / "stages.png").stat().st_size > 1000
