"""Pages can be read once: their sentences have at most 25 words on average, and none has more than 45.

`python tests/unit/test_prose.py` prints words, mean and longest sentence of every page, the longest means first.
"""

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MEAN, LONGEST = 25.0, 45

ABBREVIATIONS = "al|J|Int|Mech|Phys|Solids|Appl|Numer|Anal|Comput|Control|Optim|Struct|Sci|Adhes|Rev"
REMOVED = [
    (r"(?s)\A---\n.*?\n---\n", ""),  # options of a page
    (r"(?s)<!--[^>]*begin -->.*?<!-- end -->|<!--.*?-->", "\n\n"),  # lists by scripts, marks of scripts
    (r"(?ms)^( *)(`{3,}).*?^\1\2 *$", "\n\n"),  # code
    (r"`[^`]+`", "x"),
    (r"(?s)\$\$.*?\$\$", "x"),
    (r"\$[^$]+\$", "x"),
    (r"(?m)^(\|.*|#.*|!\[.*\]\(.*\))$", "\n"),  # tables, headings, pictures
    (r"(?m)^(\(.*\)=|:.*)$", "\n"),  # targets of links, options of directives
    (r"(?m)(^|\n)\n((?: {4}.*\n|\n)+)", r"\1\n"),  # code by indentation
    (r"\[([^\]]*)\]\([^)]*\)", r"\1"),  # where links lead
]


def pages():
    """All pages that are written by hand or by a script of the repository, relative to its root."""
    docs = [p.relative_to(ROOT) for p in (ROOT / "docs").rglob("*.md")]
    site = [p for p in docs if not {"_build", "generated"} & set(p.parts)]
    return sorted(path.as_posix() for path in [*site, *map(Path, ("README.md", "CHANGELOG.md", "CONTRIBUTING.md"))])


def sentences(text):
    """Sentences of the prose of a page, each a list of words: `code`, $formulas$ and numbers are one word each.

    Without code blocks, tables, headings, targets, comments, lists that scripts write between "begin" and "end", the
    places where links lead, and the first words of a paragraph in bold or italics that end with a full stop or colon.
    """
    for pattern, by in REMOVED:
        text = re.sub(pattern, by, text)
    found = []
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.) )", text):
        line = re.sub(r"^\s*(?:[-*]|\d+\.) ", "", block).strip()
        line = re.sub(r"^(\*+)[^*]*[.:]\1 |^(\*+)[^*]*\2[.:] ", "", line)
        line = re.sub(rf"\b({ABBREVIATIONS})\.(?= )", r"\1", line)
        for sentence in re.split(r"(?<=[.!?])[)*\"]*\s+(?=\S)", line):
            words = [word for word in sentence.split() if re.search(r"\w", word)]
            if words:
                found.append(words)
    return found


def measured(page):
    """Mean number of words of its sentences, and the longest one."""
    all_of_it = sentences((ROOT / page).read_text())
    longest = max(all_of_it, key=len, default=[])
    return sum(map(len, all_of_it)) / max(len(all_of_it), 1), longest


def test_words_are_counted_as_a_reader_does():
    page = "(name)=\n# A title\n\nOne two three four $a + b$. Six is\n`code = 1`, [a link](target.md#x) of 0.5.\n\n"
    page += "| no | no |\n|---|---|\n\n    code = 1\n\n- **Title.** Seven by Hill et al. (1950).\n- Eight\n  nine.\n"
    page += "\n```python\nno = 1\n```\n"
    assert [len(sentence) for sentence in sentences(page)] == [5, 7, 6, 2]


@pytest.mark.parametrize("page", pages())
def test_a_page_can_be_read_once(page):
    mean, longest = measured(page)
    met = mean <= MEAN and len(longest) <= LONGEST
    assert met, f"{mean:.1f} words a sentence; the longest has {len(longest)}: {' '.join(longest)}"


def test_sections_that_others_link_to_have_names_that_stay():
    """Names of warnings are titles. Each section of limits has a name of its own, so that its title may change."""
    warnings = re.findall(r"(?m)^## (.+)$", (ROOT / "docs/how_to/warnings.md").read_text())
    assert warnings and all(re.fullmatch(r"[a-z]+(-[a-z]+)*", title) for title in warnings)
    limits = (ROOT / "docs/limits.md").read_text()
    assert len(re.findall(r"(?m)^\([a-z-]+\)=\n##+ ", limits)) == len(re.findall(r"(?m)^##+ ", limits)) > 5


def table():
    """Words, mean and longest sentence of each page, as text."""
    lines = []
    for page in pages():
        (mean, longest), words = measured(page), len((ROOT / page).read_text().split())
        lines.append(f"{mean:5.1f} {len(longest):4d} {words:6d}  {page}\n{'':19}{' '.join(longest)[:120]}")
    return "\n".join([" mean most  words  page, and the begin of its longest sentence", *sorted(lines)[::-1]])


if __name__ == "__main__":
    sys.stdout.write(table() + "\n")
