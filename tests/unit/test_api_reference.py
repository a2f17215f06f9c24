"""The API reference names everything public, once, and the citation this version."""

import re
from pathlib import Path

import skmpm

PAGES = (Path(__file__).parents[2] / "docs" / "api").glob("*.rst")


def test_the_api_reference_has_every_public_name():
    text = "\n".join(page.read_text() for page in PAGES)
    named = re.findall(
        r"^\.\. auto(?:class|function|exception|module):: (?:skmpm\.)?(\w+)(?:\(\))?$", text, re.MULTILINE
    )
    assert sorted(set(named)) == sorted(skmpm.__all__)
    assert len(named) == len(set(named))


def test_the_citation_is_that_of_this_version():
    citation = (Path(__file__).parents[2] / "CITATION.cff").read_text()
    assert f"\nversion: {skmpm.__version__}\n" in citation
