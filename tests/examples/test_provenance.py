"""What made the members of a study, from manifests as `sweep` writes them."""

from types import SimpleNamespace

import pytest

from examples.studies import provenance

COMMAND = ["/usr/bin/python", "/home/me/skmpm/examples/studies/x/__main__.py", "--out", "/data/x", "--discs", "30"]


def member(source="a" * 64, began="2026-01-02T03:00:00+00:00", seconds=3600.0, arguments=()):
    """One that ran for an hour of the clock and half of it of the processor."""
    session = {
        "began": began,
        "command": [*COMMAND, *arguments],
        "seconds": seconds,
        "processor_seconds": seconds / 2,
    }
    manifest = {"versions": {"skmpm": "0.2.0", "source": source}, "sessions": [session]}
    return SimpleNamespace(manifest=manifest)


def test_command_version_and_time():
    """Two members one after the other, with a pause of an hour; directories are none of the command."""
    later = member(began="2026-01-02T05:00:00+00:00", arguments=("--docs=/data/docs",))
    text = provenance.made([member(), later], "x")
    assert text == (
        "Made by `python -m x --discs 30`. 2 members took 1.0 h of processor time (2.0 h of their processes). The"
        " first was begun on 02 January 2026, and the last ended 3.0 h later. All with one version of the library,"
        " skmpm 0.2.0, source aaaaaaaaaaaa."
    )


def test_a_study_run_in_parts_names_its_module_once():
    parts = [member(), member(arguments=("--only", "fine")), member(arguments=("--only", "fine"))]
    assert "Made by `python -m x`, in parts (`--discs 30`, `--discs 30 --only fine`). 3 members" in provenance.made(
        parts, "x"
    )


def test_several_versions_are_a_warning():
    text = provenance.made([member(), member(), member("b" * 64)], "x")
    assert "**Warning: 2 versions of the library made these members**" in text
    assert "source aaaaaaaaaaaa (2), skmpm 0.2.0, source bbbbbbbbbbbb (1)" in text


@pytest.mark.parametrize("members", [[], [SimpleNamespace(manifest={})]])
def test_nothing_run(members):
    assert provenance.made(members, "x") == "Nothing has been run yet."


def test_a_session_that_was_killed_has_no_times():
    one = member()
    del one.manifest["sessions"][0]["seconds"], one.manifest["sessions"][0]["processor_seconds"]
    assert "1 member took 0 min of processor time" in provenance.made([one], "x")
