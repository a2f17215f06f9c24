"""The maps of docs/studies/stability.md, one per parameter, the page's table, and a file of failures."""

from __future__ import annotations

import csv
from collections import Counter
from pathlib import Path

import numpy as np
from settings import KEPT, PAGE, SWEEPS, TITLES, columns, read

COLOURS = {
    "right": "#a3d5a3",
    "StepFailed": "#f2b866",
    "SceneError": "#8fb4dd",
    "wrong": "#e0605e",
    "too long": "#bbbbbb",
}
LINK = "{{download}}`{0}.csv <stability/{0}.csv>`"
LINES = {"fall": "o-", "collision": "s-", "squeeze": "^-"}
BEGIN, END = "<!-- drawn by tests/extremes/sweeps.py: begin -->", "<!-- end -->"


def draw(parameter: str, rows: list[dict[str, str]], folder: Path) -> Path:
    """How every scene ended at every setting of a parameter, with retries; below, the error of what ended right."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    labels = list(dict.fromkeys(row["setting"] for row in rows))
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    compared = [name for name in scenes if any(row["scene"] == name and row["error"] != "nan" for row in rows)]
    height = 1.3 + 0.38 * len(scenes) + (2.3 if compared else 0.0)
    figure, axes = plt.subplots(
        2 if compared else 1,
        1,
        figsize=(7.2, height),
        sharex=True,
        squeeze=False,
        height_ratios=[0.38 * len(scenes), 2.1] if compared else [1.0],
        layout="constrained",
    )
    _map(axes[0, 0], labels, scenes, rows)
    for name in compared:
        error = {r["setting"]: float(r["error"]) for r in rows if r["scene"] == name}
        values = [error.get(label) or np.nan for label in labels]  # no error at all: nothing has moved yet
        axes[1, 0].semilogy(values, LINES[name], ms=4, lw=1, label=name)
    bottom = axes[-1, 0]
    if compared:
        bottom.set_ylabel("error against reference")
        bottom.grid(alpha=0.3)
        bottom.legend(fontsize=7)
    steep = max(len(label) for label in labels) > 7
    bottom.set_xticks(
        range(len(labels)), labels, fontsize=8, rotation=30 if steep else 0, ha="right" if steep else "center"
    )
    bottom.set_xlabel(TITLES[parameter])
    path = folder / f"{parameter}.png"
    figure.savefig(path, dpi=120)
    plt.close(figure)
    return path


def _map(axes, labels: list[str], scenes: list[str], rows: list[dict[str, str]]) -> None:
    """One coloured field for each run; r3: three retries."""
    for row in rows:
        i, j = labels.index(row["setting"]), scenes.index(row["scene"])
        axes.add_patch(_field(i, j, COLOURS[row["kind"]]))
        text = f"r{row['retries']}" if row["retries"] not in ("", "0") else ""
        axes.text(i, j, text, ha="center", va="center", fontsize=7)
    axes.set_xlim(-0.5, len(labels) - 0.5)
    axes.set_ylim(len(scenes) - 0.5, -0.5)
    axes.set_yticks(range(len(scenes)), scenes, fontsize=8)
    axes.tick_params(length=0)
    kinds = [kind for kind in COLOURS if any(row["kind"] == kind for row in rows)]
    handles = [_field(0, 0, COLOURS[kind]) for kind in kinds]
    axes.legend(handles, kinds, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=5, fontsize=7, frameon=False)


def _field(i: int, j: int, colour: str):
    """One field of a map."""
    from matplotlib.patches import Rectangle

    return Rectangle((i - 0.5, j - 0.5), 1.0, 1.0, facecolor=colour, edgecolor="white")


def summary(found: dict[str, list[dict[str, str]]]) -> list[tuple[str, ...]]:
    """A line for every parameter, a header first: how runs ended, and the worst of what was checked in right ones."""
    worst = ("momentum", "residual", "energy gained", "overlap")
    lines = [("parameter", "from", "to", *COLOURS, "most retries", *worst)]
    for parameter, rows in found.items():
        labels = list(dict.fromkeys(row["setting"] for row in rows))
        counts = [str(sum(row["kind"] == kind for row in rows)) for kind in COLOURS]
        right = [row for row in rows if row["kind"] == "right"]
        retries = str(max((int(row["retries"]) for row in rows), default=0))
        largest = (_largest(right, key) for key in worst)
        lines.append((TITLES[parameter], labels[0], labels[-1], *counts, retries, *largest))
    return lines


def table(lines: list[tuple[str, ...]]) -> list[str]:
    """The lines on the page, without what was checked."""
    short = [line[:-4] for line in lines]
    return ["| " + " | ".join(line) + " |" for line in (short[0], ("---",) * len(short[0]), *short[1:])]


def keep(name: str, lines: list[tuple[str, ...]]) -> None:
    """A file beside the maps."""
    with (KEPT / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(lines)


def _largest(rows: list[dict[str, str]], key: str) -> str:
    """The largest of a column, in words where it never got above zero."""
    values = [float(row[key]) for row in rows if row[key] not in ("", "nan")]
    if not values:
        return "-"
    return f"{max(values):.1g}" if max(values) > 0.0 else "none"


def failures(found: dict[str, list[dict[str, str]]]) -> list[tuple[str, ...]]:
    """A line for every run that did not end right, a header first: where, how far it came, and what it said."""
    lines = [("parameter", "setting", "scene", "outcome", "steps", "part of the time", "message")]
    for parameter, rows in found.items():
        lines += [
            (TITLES[parameter], *(row[name] for name in ("setting", "scene", "kind", "steps", "reached")),
             row["violations"] or row["message"])
            for row in rows if row["kind"] != "right"
        ]  # fmt: skip
    return lines


def made(found: dict[str, list[dict[str, str]]]) -> str:
    """The command, the version of the library or a warning, and the time."""
    rows = [row for each in found.values() for row in each]
    hours = sum(float(row["seconds"]) for row in rows) / 3600.0
    versions = Counter(row["library"] or "unknown" for row in rows)
    said = f"All with {next(iter(versions))}."
    if len(versions) > 1:
        said = f"**Warning: several versions**: {', '.join(f'{name} ({n})' for name, n in versions.items())}."
    return (
        f"Made by `python tests/extremes/sweeps.py --fresh`: {len(rows)} runs, {hours:.1f} h of processor time,"
        f" without that of the finer runs that errors refer to. {said}"
    )


def page() -> None:
    """Draw the maps and write what is between the marks of docs/studies/stability.md."""
    found = {parameter: rows for parameter in SWEEPS if (rows := read(parameter))}
    missing = [f"{parameter} {s.label} {name}" for parameter in found for s, name in columns(parameter)
               if not any(r["setting"] == s.label and r["scene"] == name for r in found[parameter])]  # fmt: skip
    pictures = []
    for parameter, rows in found.items():
        draw(parameter, rows, KEPT)
        pictures += [f"![{TITLES[parameter]}](stability/{parameter}.png)", ""]
    lines, failed = summary(found), failures(found)
    keep("summary", lines)
    keep("failures", failed)
    written = [
        BEGIN,
        "",
        made(found),
        "",
        *table(lines),
        "",
        f"{LINK.format('failures')} names the {len(failed) - 1} runs that did not end right, with their messages."
        f" {LINK.format('summary')} has the worst values of what was checked.",
        "",
        ":::{dropdown} Maps of all settings, with errors",
        *pictures,
        ":::",
    ]
    written += ["", f"Not run: {', '.join(missing)}."] if missing else []
    before, rest = PAGE.read_text().split(BEGIN)
    PAGE.write_text(before + "\n".join([*written, "", END]) + rest.split(END, 1)[1])
