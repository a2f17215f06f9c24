"""Pages keep what is not between their marks."""

from importlib import import_module
from pathlib import Path

import pytest

PAGE = "a\n<!-- x -->\nold\n<!-- /x -->\nb\n"


@pytest.fixture
def pages(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "examples"))
    return import_module("pages")


def test_only_what_is_between_the_marks_is_written_and_twice_is_once(pages, tmp_path):
    path = tmp_path / "page.md"
    path.write_text(PAGE)
    for _ in range(2):
        pages.put(path, {"x": "\nnew \\1\n"})
        assert path.read_text() == "a\n<!-- x -->\n\nnew \\1\n\n<!-- /x -->\nb\n"


@pytest.mark.parametrize("text", ["no marks\n", PAGE + PAGE, PAGE.replace("/x", "/y")])
def test_a_page_without_marks_is_left_alone(pages, tmp_path, text):
    path = tmp_path / "page.md"
    path.write_text(text)
    with pytest.raises(SystemExit, match="marks of 'x' should be there, once each"):
        pages.put(path, {"x": "new"})
    assert path.read_text() == text
