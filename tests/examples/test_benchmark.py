"""The benchmark at small size: it runs, resumes and writes its page; mirror images move as their originals."""

import csv
import json
import re
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import skmpm
from examples.studies.benchmark import crossover, large, measure, scenes, study
from examples.studies.pages import DOCS
from skmpm.contact.shifts import Shifts
from skmpm.parallel import available


def test_images_move_as_the_tile(monkeypatch, tmp_path):
    """A frictional packing at 0.90, and it with five images and no walls between: every disc makes the same steps.

    Reference: the packing itself, reflected. Steps are solved to 1e-8 of the forces; tolerance 1e-5 of the motion and
    of the stress, for normals at the edges of facets are not quite those of a wall. How much they differ depends on
    where contacts lie: 1e-6 with friction 0.3, 8e-6 with 0.5, 6e-4 with 0.4 and 0.45. Wrong signs or places of an
    image show as 1e-3 and more.
    """
    # Closest points are known to 1e-3 of a segment, and by so much the normals there differ from that of a wall.
    monkeypatch.setattr("skmpm.contact.boundary.closest_points", lambda *_, slide: Shifts.none())
    scene, state = scenes.squeezed(10, 3.0, 0.3, tmp_path)
    assert scenes.fraction(scene, state) == pytest.approx(scenes.SQUEEZED, rel=1e-9)
    after, (whole, images) = state, scenes.tiled(scene, state, 3, 2)
    scheme = skmpm.Scheme(newton_tol=1e-8, contact_tol=1e-8, gap_tol=1e-8)
    for _ in range(2):
        after = skmpm.step(scene, after, scenes.DT, scheme=scheme)
        images = skmpm.step(whole, images, scenes.DT, scheme=scheme)
        assert abs(images.report.newton - after.report.newton) <= 1
    size, speed = np.array([after.walls[3, 0], after.walls[1, 1]]), np.array(scene.walls[1].velocity)
    fields = (("x", size, np.abs(after.x - state.x).max()), ("v", speed, np.abs(after.v).max()))
    for k, place in enumerate(np.array([i, j]) for j in (0, 1) for i in (0, 1, 2)):
        own, turned = slice(k * state.body.size, (k + 1) * state.body.size), scenes.Image(place)
        for name, far, scale in fields:
            expected = turned(getattr(after, name), far)
            np.testing.assert_allclose(getattr(images, name)[:, own], expected, rtol=0.0, atol=1e-5 * scale)
        for name in ("F", "stress"):
            expected = turned.tensor(getattr(after, name))
            atol = 1e-5 * np.abs(expected).max()
            np.testing.assert_allclose(getattr(images, name)[..., own], expected, rtol=0.0, atol=atol)


def test_sizes_are_tiles():
    """Larger packings are whole numbers of tiles, as square as they can be."""
    layout = scenes.layout
    assert [layout(n, 100) for n in (30, 100, 300, 1000, 3000)] == [
        (30, 1, 1), (100, 1, 1), (100, 3, 1), (100, 5, 2), (100, 6, 5)
    ]  # fmt: skip
    with pytest.raises(ValueError, match="multiple"):
        layout(250, 100)


def first_alone(command, real=subprocess.run, **options):
    """Run the first workload in a process of its own, the others here, which saves their imports."""
    setup, path, cache = command[-3:]
    if json.loads(setup).get("law") == "LinearElastic":
        return real(command, **options)
    Path(path).write_text(json.dumps(measure.main(json.loads(setup), Path(cache))))
    return subprocess.CompletedProcess(command, 0)


@pytest.mark.slow
def test_benchmark(monkeypatch, tmp_path):
    """Everything at small size; a second run repeats no measurement."""
    monkeypatch.setattr(study, "subprocess", SimpleNamespace(run=first_alone))  # for the study alone
    monkeypatch.setitem(study.QUICK, "memory_steps", 80)
    (tmp_path / "docs").mkdir()
    for name in ("performance", "how_large"):
        shutil.copy(DOCS / f"{name}.md", tmp_path / "docs")
    options = ["--quick", "--out", str(tmp_path / "out"), "--docs", str(tmp_path / "docs")]
    study.main(study.parser().parse_args(options))
    results = sorted((tmp_path / "out").glob("*.json"))
    assert len(results) == 10 + len({1, available()})
    dense = json.loads((tmp_path / "out" / "dense_20_3_0.5.json").read_text())
    assert dense["fraction"] == pytest.approx(0.90, abs=2e-3)
    assert 0.0 < dense["contact_phases"] < dense["step"]
    page = (tmp_path / "docs" / "performance.md").read_text()
    goals = page[page.index("## Goals") : page.index("## Where")]
    assert goals.count("| met |") + goals.count("| **missed** |") == 8 + (
        available() > 1
    )  # but for pyamg's: no body is large enough
    assert goals.count("| shown |") == 1
    large = (tmp_path / "docs" / "how_large.md").read_text()
    assert re.search(r"\| 20 \| \d+ \| \d+ \|", large) and "| 1 | 2 |" in large
    with (tmp_path / "docs" / "performance" / "results.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(results)
    phases = (tmp_path / "docs" / "performance" / "phases.csv").read_text().splitlines()
    assert "detection %" in phases[0] and len(phases) > 5
    times = [path.stat().st_mtime_ns for path in results]
    study.main(study.parser().parse_args(options))
    assert [path.stat().st_mtime_ns for path in results] == times
    found = {path.stem: json.loads(path.read_text()) for path in results if not path.stem.startswith("single")}
    options = study.parser().parse_args([*options, "--single"])
    study.page.write(found, options, tmp_path / "docs")  # nothing to draw on the right


def test_a_page_without_single_bodies_or_packings(tmp_path):
    """Logarithmic axes are drawn where there is something to scale."""
    (tmp_path / "docs").mkdir()
    for name in ("performance", "how_large"):
        shutil.copy(DOCS / f"{name}.md", tmp_path / "docs")
    options = study.parser().parse_args(["--single"])
    study.page.write({}, options, tmp_path / "docs")
    assert (tmp_path / "docs" / "performance" / "phases.png").stat().st_size > 1_000


def test_large():
    """A small one of the large bodies: few iterations, and the support carries weight and inertia.

    It sinks as far as one of 90,000 points h/2 apart, 2.046 mm, to 1 %: the arc held varies by boundary segments.
    """
    for found in large.main(large.parser().parse_args(["--points", "6000"])).values():
        assert 0 < found["iterations"] <= 20
        assert found["balance"] <= 1e-6
    found = large.advance(large.hanging(6000, 0.3, 1), inertia=False)
    assert found["sag"] == pytest.approx(2.046e-3, rel=0.01)


def test_crossover():
    """A disc of ten cells is solved faster by the band than by multigrid, of which set-up alone takes longer."""
    ((cells, band, *ratios),) = crossover.main(crossover.parser().parse_args(["--across", "10"]))
    assert cells == 10
    assert 20 < band < 100
    assert max(ratios) < 1.0
