"""The API reference names everything public, once, and the citation this version."""

import inspect
import re
from pathlib import Path

import skmpm

PAGES = (Path(__file__).parents[2] / "docs" / "api").glob("[!i]*.rst")  # the index names sections only
MODULES = ("contact", "coulomb", "linear", "outline")


def named():
    """Names in the tables of the reference, by module."""
    found, module = [], "skmpm"
    for line in "\n".join(page.read_text() for page in PAGES).splitlines():
        if match := re.match(r"\.\. (?:current|auto)module:: (.+)", line):
            module = match[1]
        elif match := re.fullmatch(r"   ([\w.]+)", line):
            found.append(f"{module}.{match[1]}")
    return found


def test_the_api_reference_has_every_public_name():
    modules = {"skmpm": skmpm} | {f"skmpm.{name}": getattr(skmpm, name) for name in MODULES}
    public = {f"{name}.{each}": getattr(module, each) for name, module in modules.items() for each in module.__all__}
    types_and_constants = {  # of signatures, and in the text of other pages
        "skmpm.contact.ContactFormulation",
        "skmpm.contact.Linearise",
        "skmpm.coulomb.MAX_DENSE_ROWS",
        "skmpm.linear.Linear",
    }
    names = named()
    assert len(names) == len(set(names))
    asked = {name for name, thing in public.items() if not inspect.ismodule(thing)} - types_and_constants
    assert asked <= set(names)
    results = {name for name in set(names) - asked if name.split(".")[1] not in (*MODULES, "transfer")}
    assert all(re.fullmatch(r"skmpm\.\w+\.[A-Z]\w+", name) for name in results)  # classes that others return


def test_the_citation_is_that_of_this_version():
    citation = (Path(__file__).parents[2] / "CITATION.cff").read_text()
    assert f"\nversion: {skmpm.__version__}\n" in citation
