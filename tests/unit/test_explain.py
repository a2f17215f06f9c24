"""Sections that warnings name are printed, from the repository and from a wheel."""

import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import skmpm
from skmpm.preflight.explain import FOLDER, sections

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", sections())
def test_a_section_begins_with_what_is_wrong_and_names_pages_that_exist(name, capsys):
    skmpm.explain(name)
    title, _, first, *_ = capsys.readouterr().out.splitlines()
    assert title == name and (re.match(r"\*\*.+\*\*", first) or name == "failures")
    assert "](" not in sections()[name]
    for page in re.findall(r", (docs/[^)#]+)", sections()[name]):
        assert (ROOT / page).exists()


def test_without_a_name_all_are_listed(capsys):
    skmpm.explain()
    lines = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert lines.keys() == sections().keys()
    assert lines["resolution"] == "A body has too few cells" and max(map(len, lines.values())) < 110


@pytest.mark.parametrize("name", ["[thin-parts]", "Thin parts", " thin_parts "])
def test_a_name_may_be_written_as_in_the_warning_or_as_words(name, capsys):
    skmpm.explain(name)
    assert capsys.readouterr().out.startswith("thin-parts\n")


@pytest.mark.parametrize("told", [lambda w: w, str, lambda w: f"preflight: {w}\n", lambda w: w.kind])
def test_a_warning_is_explained_as_it_is_at_hand(told, capsys):
    """Itself, its text, a line of the log, its kind."""
    body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    floor = skmpm.Wall((0, -1e-3), (0, 1))
    (warning,) = skmpm.preflight(skmpm.Scene([body], cell=4e-4, walls=[floor], gravity=(0, -9.81))).warnings
    skmpm.explain(told(warning))
    assert capsys.readouterr().out.startswith("resolution\n") and warning.kind == "R/h"


@pytest.mark.parametrize(
    ("word", "section"),
    [
        ("thin-part", "thin-parts"),  # near a name
        ("units", "sizes"),  # of a text; near a name, too, "slits"
        ("millimeter", "sizes"),  # near a word of a text
        ("locking", "incompressibility"),
        ("step failed", "failures"),  # both words
    ],
)
def test_an_unknown_word_leads_to_the_section_that_speaks_of_it(word, section):
    every = ", ".join(sections())
    with pytest.raises(ValueError, match=rf"no section '{word}', perhaps {section}( or .*)?; use one of {every}$"):
        skmpm.explain(word)


@pytest.mark.parametrize("word", ["zzz", "temperature", "", 0.123])
def test_a_word_that_no_section_speaks_of_is_refused_with_all_names(word):
    with pytest.raises(
        ValueError, match=rf"explain: no section {word!r}; use one of what-acts, .*rigid-edges, failures"
    ):
        skmpm.explain(word)


def test_a_wheel_has_the_pages_and_prints_them(tmp_path):
    pytest.importorskip("hatchling")
    subprocess.run([sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path], cwd=ROOT, check=True)
    (wheel,) = tmp_path.glob("*.whl")
    zipfile.ZipFile(wheel).extractall(tmp_path / "installed")
    for name in ("failures", "warnings"):
        copy = tmp_path / "installed" / "skmpm" / "preflight" / f"{name}.md"
        assert copy.read_text() == (ROOT / FOLDER / f"{name}.md").read_text()
    copy.write_text("## waves\n\n**Of the wheel.**\n")
    code = "import skmpm; skmpm.explain('waves')"
    options = {"cwd": tmp_path / "installed", "capture_output": True, "text": True}
    assert subprocess.run([sys.executable, "-c", code], check=True, **options).stdout.endswith("**Of the wheel.**\n")
