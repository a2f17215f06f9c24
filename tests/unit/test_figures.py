"""Figures of the docs: scripts draw those that are kept, small and in both modes, and pages show them."""

import importlib
import re
import runpy
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
KEPT = {path.name for path in (DOCS / "static").iterdir()}


@pytest.mark.parametrize(
    ("script", "names"),
    [
        ("method", ["method_body", "method_contact"]),
        ("loading", ["loading_bodies", "loading_scenes"]),
        ("step", ["step"]),
    ],
)
def test_a_script_draws_the_figures_that_are_kept(script, names, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(DOCS / "figures")
    monkeypatch.setattr(importlib.import_module("drawing"), "STATIC", tmp_path)
    runpy.run_path(str(DOCS / "figures" / f"{script}.py"), run_name="__main__")
    drawn = {path.name for path in tmp_path.iterdir()}
    assert drawn == {f"{name}{mode}.svg" for name in names for mode in ("", "_dark")} and drawn <= KEPT


def test_modules_of_the_figure_of_a_step_exist(monkeypatch):
    monkeypatch.syspath_prepend(DOCS / "figures")
    for _, module in importlib.import_module("step").STEPS:
        importlib.import_module(f"skmpm.{module}")


def test_pictures_are_small_and_shown():
    pages = [*DOCS.glob("*.md"), *DOCS.glob("*/*.md")]
    shown = {name for page in pages for name in re.findall(r"static/([\w.]+)\)", page.read_text())}
    pictures = {name for name in KEPT if not name.endswith(".css")}
    assert pictures == shown | {name.replace(".", "_dark.") for name in shown} & KEPT
    assert max((DOCS / "static" / name).stat().st_size for name in pictures) < 300_000
