"""The pages of docs/verification, one for each phenomenon, from what `draw.py` keeps of every module.

python tests/verification/verification_pages.py
"""

import ast
import csv
import io
import json
import re
from itertools import groupby
from pathlib import Path

from ledger import tabulated

HERE = Path(__file__).resolve().parent
KEPT = HERE.parents[1] / "docs" / "verification"
GROUPS = {
    "Bulk": {
        "materials": "Constitutive laws",
        "patch": "Patch tests",
        "fem_elasticity": "Elasticity against finite elements",
        "manufactured": "Manufactured solutions",
        "locking": "Volumetric locking",
        "mean_dilatation": "When mean dilatation pays",
        "thin_parts": "Thin parts",
        "slits": "Slits",
        "large_deflection": "Large deflections and strains",
        "plastic_flow": "Plasticity",
    },
    "Dynamics": {
        "dynamics": "An elastic bar and a spinning disc",
        "viscosity": "Viscous damping",
        "galilean": "Galilean invariance",
        "long_steps": "Long steps",
    },
    "Contact": {
        "onset": "Onset of contact",
        "interpenetration": "Interpenetration",
        "hertz": "Hertz's contact",
        "contact_pressure": "Contact pressure",
        "fringes": "Isochromatics",
        "contact_patch": "Contact patch test",
        "ironing": "Sliding over many cells",
        "corners": "Corners",
        "self_contact": "Self-contact",
        "adhesion": "Cohesion",
        "contact_solver": "The contact solver",
    },
    "Friction and motion": {
        "friction": "Sticking and sliding on a slope",
        "rolling": "Rolling",
        "collision": "Collisions",
        "arch": "An arch of blocks",
        "pile": "Piles at rest",
    },
    "Packings": {
        "four_walls": "A disc between four walls",
        "jamming": "Jamming",
    },
}
HEAD = """# Verification

Every claim about bulk and contact is compared with a closed form, a rate or another code. The comparisons are those
of the tests, with larger sizes where a test runs a short version. A missed goal is marked as such, with its measured
figure and the reason.

On every page, *Runs* are the grids or cases where the table does not name them, *Order* is the measured order of
convergence, and *Test* asserts the numbers. R/h is the radius over the side of a cell.

`python tests/verification/draw.py` repeats all measurements and writes these pages, `draw.py hertz` those of a page;
`python tests/verification/verification_pages.py` writes the pages from what is kept. Only the packings of 100 and 300
discs are read from tables in docs/verification/packings, which `tests/verification/packings.py` makes in hours.
"""
LONG = 16  # lines of a table; of a longer one its page has the least and the most
WIDTH = 40  # characters of a cell that are read at a glance
NUMBER = r"[+-]?\d+\.?\d*(?:e[+-]?\d+)?"
SCALAR = re.compile(rf"(?P<label>[^\d,;]+) (?P<numbers>{NUMBER})(?P<unit>)")


def grids(h):
    """The grids that a text names, one by one: "R/h = 5, 10" is R/h = 5 and 10; [] if it is not such a list."""
    match = re.fullmatch(r"((?:[A-Za-z/]+ = )?)([\dl][^ ,]*(?:, [\dl][^ ,]*)+)((?: of [a-z ]+)?)", h)
    return [f"{match[1]}{value}{match[3]}" for value in match[2].split(", ")] if match else []


def columns(row):
    """Heads of columns, and lines (label, numbers) of a row whose error is a table or numbers by grid; else None."""
    given, _, lines = row["error"].partition(" || ")
    if lines:
        split = [line.rpartition(": ") for line in lines.split("; ")]
        return tuple(given.split(" | ")), [(label or row["h"], numbers.split(" | ")) for label, _, numbers in split]
    heads = grids(row["h"])
    numbers = f"{NUMBER}(?:, {NUMBER}){{{len(heads) - 1}}}" if heads else NUMBER
    series = [re.fullmatch(rf"(?P<label>.*?)\s*(?P<numbers>{numbers})(?P<unit>[^\d]*)", part.strip())
              for part in row["error"].split(";")]  # fmt: skip
    if heads and all(series):
        named = [(" ".join([part["label"].strip(), part["unit"].strip()]).strip(" ,"), part) for part in series]
        return tuple(heads), [(label, part["numbers"].split(", ")) for label, part in named]
    scalars = [SCALAR.fullmatch(part.strip()) for part in re.split("[,;]", row["error"])]
    if all(scalars):
        return tuple(part["label"] for part in scalars), [(row["h"], [part["numbers"] for part in scalars])]
    return None


def sizes(row):
    """The grids of a row, if its table does not name them."""
    lines = row["error"].partition(" || ")[2]
    return row["h"] if lines and not lines.startswith(": ") else ""


def cells(problem, label):
    """The first two cells of a line; a part of a long problem is moved to the label."""
    parts = re.split("([:,] )", problem)
    for k in range(len(parts) - 2, 0, -2):
        kept, moved = "".join(parts[:k]), "".join(parts[k + 1 :]) + f", {label}" * bool(label)
        whole = kept.count("(") == kept.count(")") and kept.count("$") % 2 == 0
        if whole and len(problem) > WIDTH >= max(len(kept), len(moved)):
            return kept, moved
    return problem, label


def table(heads, rows):
    """Lines of a table of the rows, with one number in a cell."""
    yield "| problem | | " + " | ".join(heads) + " |"
    yield "|---|---|" + "---:|" * len(heads)
    before = ""
    for row in rows:
        for label, numbers in columns(row)[1]:
            first = cells(row["problem"], label) if row["problem"] != before else ("", label)
            yield "| " + " | ".join(cell.replace("|", "\\|") for cell in [*first, *numbers]) + " |"
            before = row["problem"]


def facts(row):
    """What is said of a row below its table: sentences by kind, without those that say nothing."""
    goal, _, verdict = re.fullmatch(r"(.*?)([:;] (met|missed))?", wanted(row)).groups()
    said = {"Runs": sizes(row), "Reference": row["reference"], "Order": row["rate"], "Goal": goal}
    sentences = {kind: f"{kind}: {text}." for kind, text in said.items() if text not in ("", "-")}
    sentences |= {"verdict": f"{verdict.capitalize()}."} if verdict else {}
    return sentences | {"Test": f"Test: `{row['test']}`."}


def legend(rows):
    """Lines below a table: facts of all its rows, then what differs, an item for each of them."""
    each = [facts(row) for row in rows]
    common = {kind: text for kind, text in each[0].items() if all(other.get(kind) == text for other in each)}
    if "Goal" not in common:
        common.pop("verdict", None)
    if common:
        yield " ".join(common.values())
    if any(own.keys() - common.keys() for own in each):
        yield from [""] * bool(common)
        problems = {}
        for own, row in zip(each, rows, strict=True):
            text = " ".join(text for kind, text in own.items() if kind not in common)
            problems.setdefault(text, []).append(row["problem"])
        largest = max(problems, key=lambda text: len(problems[text]))
        if len(problems[largest]) > 1:
            problems[largest] = ["others"]
            problems[largest] = problems.pop(largest)
        yield from (f"- *{'; '.join(names)}*: {text}" for text, names in problems.items() if text)


def extremes(row):
    """A row of the least and the greatest number in each column of its table."""
    heads, lines = columns(row)
    found = {}
    for what, choice in (("least", min), ("most", max)):
        by_column = zip(*(numbers for _, numbers in lines), strict=True)
        known = ([cell for cell in column if re.match(NUMBER, cell)] for column in by_column)
        found[what] = [choice(c, key=lambda cell: float(re.match(NUMBER, cell)[0]), default="-") for c in known]
    return row | {"error": tabulated(heads, found)}


def tables(rows):
    """Rows that follow each other with the same columns, those of a long table or of a text by themselves."""

    def kind(k):
        row = rows[k]
        if columns(row) is None:
            return tuple(facts(row).values())
        heads = columns(row)[0]
        same = [other for other in rows if facts(other) == facts(row)]
        alone = is_long([other for other in same if (columns(other) or [None])[0] == heads])
        others = {str(facts(other)) for other in rows[:k] if other["problem"] == row["problem"]} - {str(facts(row))}
        return heads, row["test"] if alone else "", len(others)

    return [[rows[k] for k in group] for _, group in groupby(range(len(rows)), kind)]


def is_long(rows):
    """Whether a table of these rows, each of several lines and with the same legend, has too many for a page."""
    counts = [len(columns(row)[1]) if columns(row) else 0 for row in rows]
    return min(counts) > 2 and sum(counts) > LONG and all(facts(row) == facts(rows[0]) for row in rows)


def comparisons(name, rows):
    """Lines of all comparisons: tables where they have the same columns, else item by item."""
    for own in tables(rows):
        if columns(own[0]):
            heads = columns(own[0])[0]
            yield from ["", *table(heads, [extremes(row) for row in own] if is_long(own) else own), ""]
            if is_long(own):
                yield f"Least and most of each; all cases are in {{download}}`{long_file(name, own)}`."
        else:
            for row in own:
                yield from ["", f"**{row['problem']}** ({row['h']}): {row['error']}", ""]
        yield from legend(own)


def long_file(name, rows):
    """The file of a long table, in the folder of the pages."""
    return f"tables/{name}_{rows[0]['test'].removeprefix('test_')}.csv"


def long_tables(name, rows):
    """The texts of the files of long tables, by file."""
    found = {}
    for own in filter(is_long, tables(rows)):
        lines = [[row["problem"], label, *numbers] for row in own for label, numbers in columns(row)[1]]
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([["problem", "case", *columns(own[0])[0]], *lines])
        found[long_file(name, own)] = text.getvalue()
    return found


def wanted(row):
    """The goal of a row, and whether it was met; why it was missed stands at the head of the page."""
    return row["goal"].partition(": missed")[0] + (": missed" if ": missed" in row["goal"] else "")


def reasons(rows):
    """Missed goals: what they are about, and why they were missed where that is known; a line for each reason."""
    found = {}
    for row in rows:
        if "missed" in row["goal"]:
            goal, _, why = row["goal"].partition("missed")
            why = re.sub(r"^\((.*)\)$", r"\1", why.strip(" :,"))
            found.setdefault(why or f"goal: {goal.strip(' :,')}", []).append(row["problem"])
    return [f"- {'; '.join(problems)} ({why})" for why, problems in found.items()]


def verdict(rows):
    """How many comparisons there are, how many goals are met and missed."""
    missed = sum("missed" in row["goal"] for row in rows)
    return len(rows), sum("met" in row["goal"] and "missed" not in row["goal"] for row in rows), missed


def told(rows):
    """The verdict as a sentence; goals are counted where there are some."""
    count, met, missed = verdict(rows)
    other = sum(re.match("-|shown|none|measured|plotted|about|.*(met|missed)", row["goal"]) is None for row in rows)
    kinds = (met, "met"), (other, "asserted by the tests"), (missed, "missed")
    goals = ", ".join(f"{number} {what}" for number, what in kinds if number)
    end = ":" if missed else "."
    return f"{count} comparison{'s' * (count > 1)}" + (f"; goals: {goals}{end}" if goals else ", without goals.")


def page(name, title, rows, captions):
    """The page of a module: what was found, tables of it, pictures, and how it was measured."""
    text = (HERE / f"test_{name}.py").read_text()
    answer, _, details = ast.get_docstring(ast.parse(text)).partition("\n\n")
    rows = [row | {"problem": row["problem"].removeprefix(f"{title}, ")} for row in rows]
    lines = [f"# {title}", "", answer, "", told(rows), ""]
    lines += [*missed, ""] if (missed := reasons(rows)) else []
    lines += ["## Comparisons", *comparisons(name, rows), ""]
    for file, caption in captions.items():
        lines += [f"![{re.split('[.:;] | [(]', caption)[0].rstrip('.')}]({file})", "", f"*{caption}*", ""]
    lines += ["## How it is measured", "", details, ""] if details else []
    return "\n".join(lines).rstrip("\n") + "\n"


def write():
    """Write all pages and their index."""
    (KEPT / "tables").mkdir(exist_ok=True)
    index = [HEAD]
    for group, modules in GROUPS.items():
        index += [f"## {group}", "", "| phenomenon | comparisons | goals met | missed |", "|---|---:|---:|---:|"]
        tree = ["", "```{toctree}", ":hidden:", ""]
        for name, title in modules.items():
            with (KEPT / f"{name}.csv").open(newline="") as file:
                rows = list(csv.DictReader(file))
            captions = json.loads((KEPT / f"{name}.json").read_text())
            for file, text in {f"{name}.md": page(name, title, rows, captions), **long_tables(name, rows)}.items():
                (KEPT / file).write_text(text)
            count, *goals = verdict(rows)
            shown = [count, *(goals if any(goals) else "--")]
            index.append(f"| [{title}]({name}.md) | " + " | ".join(map(str, shown)) + " |")
            tree.append(name)
        index += [*tree, "```", ""]
    (KEPT / "index.md").write_text("\n".join(index))


if __name__ == "__main__":
    write()
