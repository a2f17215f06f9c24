"""The pages of docs/verification, one for each phenomenon, from what `draw.py` keeps of every module.

python tests/verification/verification_pages.py
"""

import ast
import csv
import json
import re
from itertools import groupby
from pathlib import Path

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

`python tests/verification/draw.py` repeats the measurements, `python tests/verification/verification_pages.py` writes
these pages from what it keeps. Only the packings of 100 and 300 discs are read from tables in
docs/verification/packings, which `tests/verification/packings.py` makes in hours.
"""
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


def table(heads, rows):
    """Lines of a table of the rows, with one number in a cell."""
    body = [[row["problem"], label, *numbers] for row in rows for label, numbers in columns(row)[1]]
    yield "| problem | | " + " | ".join(heads) + " |"
    yield "|---|---|" + "---:|" * len(heads)
    for k, line in enumerate(body):
        problem = "" if k and body[k - 1][0] == line[0] else line[0]
        yield "| " + " | ".join(cell.replace("|", "\\|") for cell in [problem, *line[1:]]) + " |"


def comparisons(rows):
    """Lines of all comparisons: tables where they have the same columns, else item by item."""

    def kind(row):
        found = columns(row)
        return row["reference"], wanted(row), row["rate"], row["test"], found and found[0], sizes(row)

    for (reference, goal, rate, test, heads, runs), group in groupby(rows, kind):
        own = list(group)
        if heads:
            yield from ["", *table(heads, own), ""]
        else:
            for row in own:
                yield from ["", f"**{row['problem']}** ({row['h']}): {row['error']}", ""]
        facts = [f"Runs: {runs}." if runs else "", f"Reference: {reference}." if reference != "-" else ""]
        facts += [f"Order: {rate}." if rate != "-" else "", f"Goal: {goal}." if goal != "-" else ""]
        yield " ".join(filter(None, [*facts, f"Test: `{test}`."]))


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
    kinds = (met, "met"), (missed, "missed"), (other, "asserted by the tests")
    goals = ", ".join(f"{number} {what}" for number, what in kinds if number)
    return f"{count} comparison{'s' * (count > 1)}" + (f"; goals: {goals}." if goals else ", without goals.")


def page(name, title, rows, captions):
    """The page of a module: what was found, tables of it, pictures, and how it was measured."""
    text = (HERE / f"test_{name}.py").read_text()
    answer, _, details = ast.get_docstring(ast.parse(text)).partition("\n\n")
    lines = [f"# {title}", "", answer, "", told(rows), ""]
    if missed := reasons(rows):
        lines += ["Missed:", "", *missed, ""]
    lines += ["## Comparisons", *comparisons(rows), ""]
    for file, caption in captions.items():
        lines += [f"![{caption.split('. ')[0]}]({file})", "", f"*{caption}*", ""]
    lines += ["## How it is measured", "", *([details, ""] if details else [])]
    lines += [f"`python tests/verification/draw.py {name}` repeats the measurements."]
    return "\n".join(lines) + "\n"


def write():
    """Write all pages and their index."""
    index = [HEAD]
    for group, modules in GROUPS.items():
        index += [f"## {group}", "", "| phenomenon | comparisons | goals met | missed |", "|---|---:|---:|---:|"]
        tree = ["", "```{toctree}", ":hidden:", ""]
        for name, title in modules.items():
            with (KEPT / f"{name}.csv").open(newline="") as file:
                rows = list(csv.DictReader(file))
            captions = json.loads((KEPT / f"{name}.json").read_text())
            (KEPT / f"{name}.md").write_text(page(name, title, rows, captions))
            count, *goals = verdict(rows)
            shown = [count, *(goals if any(goals) else "--")]
            index.append(f"| [{title}]({name}.md) | " + " | ".join(map(str, shown)) + " |")
            tree.append(name)
        index += [*tree, "```", ""]
    (KEPT / "index.md").write_text("\n".join(index))


if __name__ == "__main__":
    write()
