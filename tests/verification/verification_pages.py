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
    """Heads of columns, and lines (label, numbers) of a row whose error is a number by grid or label; else None."""
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
        return row["reference"], row["goal"], row["rate"], row["test"], found and found[0]

    for (reference, goal, rate, test, heads), group in groupby(rows, kind):
        own = list(group)
        if heads:
            yield from ["", *table(heads, own), ""]
        else:
            for row in own:
                yield from ["", f"**{row['problem']}** ({row['h']}): {row['error']}", ""]
        facts = [f"Reference: {reference}.", f"Order: {rate}." if rate != "-" else ""]
        facts += [f"Goal: {goal}." if goal != "-" else "", f"Test: `{test}`."]
        yield " ".join(filter(None, facts))


def verdict(rows):
    """How many comparisons there are, how many goals are met and missed."""
    missed = sum("missed" in row["goal"] for row in rows)
    return len(rows), sum("met" in row["goal"] and "missed" not in row["goal"] for row in rows), missed


def page(name, title, rows, captions):
    """The page of a module."""
    text = (HERE / f"test_{name}.py").read_text()
    count, met, missed = verdict(rows)
    lines = [f"# {title}", "", f"{count} comparisons: {met} goals met, {missed} missed.", ""]
    if missed:
        lines += ["Missed:", ""]
        lines += [f"- {row['problem']}: {row['goal']}" for row in rows if "missed" in row["goal"]] + [""]
    lines += [ast.get_docstring(ast.parse(text)), ""]
    for file, caption in captions.items():
        lines += [f"![{caption.split('. ')[0]}]({file})", "", f"*{caption}*", ""]
    lines += ["## Comparisons", *comparisons(rows), "", f"`python tests/verification/draw.py {name}` repeats them."]
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
            index.append(f"| [{title}]({name}.md) | " + " | ".join(map(str, verdict(rows))) + " |")
            tree.append(name)
        index += [*tree, "```", ""]
    (KEPT / "index.md").write_text("\n".join(index))


if __name__ == "__main__":
    write()
