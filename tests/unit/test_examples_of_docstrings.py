"""The examples in the docstrings of public names: each has some, and they run as they are printed."""

import doctest
import inspect

import pytest

import skmpm

MODULES = ("contact", "coulomb", "linear", "outline", "transfer")
PUBLIC = {name: getattr(skmpm, name) for name in skmpm.__all__ if name not in MODULES}
DOCUMENTED = {
    f"{module}.{name}": thing
    for module in MODULES
    for name in (["to_points"] if module == "transfer" else getattr(skmpm, module).__all__)
    if inspect.isclass(thing := getattr(getattr(skmpm, module), name)) or inspect.isfunction(thing)
}
# Parts of the method without an example; none may be added.
MISSING = {
    "contact.Constraints",
    "coulomb.Bilateral",
    "linear.Amg",
    "linear.Banded",
    "linear.Delassus",
    "linear.Direct",
    "linear.NotPositiveDefinite",
    "linear.Solver",
    "outline.Cubics",
    "outline.Curve",
    "outline.Polylines",
    "outline.crossings",
    "outline.curve",
    "outline.depth",
    "outline.inside",
    "outline.normals",
    "outline.overlap",
    "outline.polylines",
    "outline.second_moments",
    "transfer.to_points",
}


def examples(name):
    """The examples of a name, whose only globals are those that they import."""
    finder = doctest.DocTestFinder(recurse=False, exclude_empty=False)
    (found,) = finder.find((PUBLIC | DOCUMENTED)[name], name, module=False, globs={})
    return found


@pytest.mark.parametrize("name", sorted((PUBLIC | DOCUMENTED).keys() - MISSING))
def test_the_examples_of_a_name_run_as_printed(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found, printed = examples(name), []
    assert found.docstring.count("Examples\n") == 1 and found.examples
    runner = doctest.DocTestRunner(verbose=False)
    assert runner.run(found, out=printed.append).failed == 0, "".join(printed)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", sorted(MISSING))
def test_what_has_examples_is_not_called_missing(name):
    assert not examples(name).examples
