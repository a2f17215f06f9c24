"""Pages keep the text outside their marks, and commands that write them say what failed."""

from types import SimpleNamespace

import pytest

from examples.studies import pages, sweeps

PAGE = "a\n<!-- x -->\nold\n<!-- /x -->\nb\n"


def test_only_what_is_between_the_marks_is_written_and_twice_is_once(tmp_path):
    path = tmp_path / "page.md"
    path.write_text(PAGE)
    for _ in range(2):
        pages.put(path, {"x": "\nnew \\1\n"})
        assert path.read_text() == "a\n<!-- x -->\n\nnew \\1\n\n<!-- /x -->\nb\n"


@pytest.mark.parametrize("text", ["no marks\n", PAGE + PAGE, PAGE.replace("/x", "/y")])
def test_a_page_without_marks_is_left_alone(tmp_path, text):
    path = tmp_path / "page.md"
    path.write_text(text)
    with pytest.raises(SystemExit, match="marks of 'x' should be there, once each"):
        pages.put(path, {"x": "new"})
    assert path.read_text() == text


def test_options_are_typed_in_full(capsys):
    """A page says by which command its members were made, without directories, which it knows by their options."""
    with pytest.raises(SystemExit):
        pages.parser("", "page.md").parse_args(["--doc", "somewhere"])
    assert "unrecognized arguments: --doc" in capsys.readouterr().err


def broken(seed):
    raise ValueError(f"no packing of {seed}")


def test_a_study_whose_members_fail_ends_so(tmp_path, capsys):
    module = {"__name__": "studies.broken.study", "__doc__": "", "add_options": lambda options: None}
    study = SimpleNamespace(**module, build=broken, members=lambda options: [{"seed": 3}])
    with pytest.raises(SystemExit, match="1 of 1 members stopped; a page is of the others"):
        sweeps.command(study, words=["--processes", "1", "--out", str(tmp_path / "out"), "--docs", str(tmp_path)])
    assert "no packing of 3" in capsys.readouterr().out
