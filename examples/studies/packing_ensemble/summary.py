"""The short tables of the page: a number per cell, in bold what does not meet its rule. All rows are in CSV files."""

from __future__ import annotations

import numpy as np

from . import checks, stages, study
from .claims import JAMMED, NOT_RUN, SHARED, SHOWN_AT, Row, apparent, bends, change, figure, resisting
from .curves import EARLY, Study
from .members import CELLS

Line = tuple[str, ...]
TARGETS = {
    "Phi_J, P extrapolated to zero, friction 0": ("Phi_J by pressure, friction 0", "0.83-0.86"),
    "Phi_J, P extrapolated to zero, friction 0.5": ("Phi_J by pressure, friction 0.5", "0.79-0.82"),
    "Phi_J where Z without rattlers passes 4, friction 0": ("Phi_J where Z passes 4, difference", "0.005"),
    "(Z - 4) / sqrt(Phi - Phi_J)": ("(Z - 4) / sqrt(Phi - Phi_J)", "3.1-4.1"),
    "exponent of Z - 4 over the same range": ("exponent of Z - 4", "0.4-0.6"),
    "Z without rattlers at Phi - Phi_J = 0.1, friction 0": ("Z at Phi - Phi_J = 0.1", "5.1-5.6"),
    "P/E at Phi = 0.926, friction 0": ("P/E at Phi = 0.926", "0.05-0.065"),
    "b with Phi_0 = Phi_J, Phi_max = 1, friction 0": ("b of the compaction law", "0.06-0.08"),
    "Phi_max of the free fits falls with friction": ("Phi_max, friction 0.5 less 0", "< 0"),
}  # how a claim begins, its name and its rule in the table
CLAIMS = {
    "S(Phi) is the same": (f"S at {SHOWN_AT:.2f}, friction 0.5 less 0", "0"),
    "alpha is larger": (f"alpha at {SHOWN_AT:.2f}, friction 0.5 less 0", "> 0"),
    "A_m is larger": (f"A_m at {SHOWN_AT:.2f}, friction 0.5 less 0", "> 0"),
    "alpha, friction 0: three": ("alpha, friction 0, last over middle slope", "< 1"),
    "alpha, friction 0.5: three": ("alpha, friction 0.5, last over middle slope", "< 1"),
    "alpha, friction 0: they": ("first break of alpha, friction 0", "0.72"),
    "alpha, friction 0.5: they": ("first break of alpha, friction 0.5", "0.72"),
    "A_m grows more slowly": ("slope of A_m, friction 0.5 less 0", "< 0"),
    "alpha grows faster": ("slope of alpha, friction 0.5 less 0", "> 0"),
    "circles become nearly polygons": ("excess of perimeter, smaller one", "0.05"),
}
KINDS = {"uniaxial": 0, "quasi-static": 0, "isotropic": 1, "2 m/s": 2}  # column by the begin of a check
STATES = {
    "inertial number": ("inertial number", "1e-4"),
    "unbalanced force ratio": ("unbalanced force ratio", "1e-3"),
    "kinetic over elastic energy": ("kinetic over elastic energy", "1e-3"),
    "step of Phi": ("step of Phi near jamming", "1e-3"),
    "P from contacts and points agree": ("P, contacts and points [%]", "3"),
    "P from contacts and walls agree": ("P, contacts and walls [%]", "3"),
    "P from points and walls agree": ("P, points and walls [%]", "3"),
    "P from contacts and walls, the": ("P, contacts and walls, no swing [%]", "3"),
    "P from points and walls, the": ("P, points and walls, no swing [%]", "3"),
    "P = (Phi Z/4) sigma_l": ("P by mean forces and branches [%]", "1"),
}
FRICTIONS = ("friction 0", "friction 0.1", "friction 0.5")
CURVES = {
    "P(Phi), lids": ("P, rms of lids over that of packings", "1"),
    "Z without rattlers(Phi), lids": ("Z, rms of lids over that of packings", "1"),
    **{f"{symbol}(Phi) at R/h": (f"{symbol}, R/h = 8 against 5 [%]", "5") for symbol in checks.CURVES.values()},
    "P/E* by current Phi, Poisson's ratio 0.3 ": ("P/E*, Poisson's ratio 0.3 over 0.45 [%]", "5"),
    "P/E* by current Phi, Poisson's ratio 0.495": ("P/E*, Poisson's ratio 0.495 over 0.45 [%]", "5"),
}


def cell(row: Row | None) -> str:
    """The number of a row, in bold where its rule is not met."""
    if row is None or row.verdict == NOT_RUN or not np.isfinite(row.value):
        return "-"
    text = f"{row.value:#.3g}" if abs(row.value) >= 1e-3 else f"{row.value:.1e}"
    return f"**{text}**" if row.verdict == "does not hold" else text


def beside(
    chosen: dict[str, tuple[str, str]], first: list[Row], second: list[Row], heads: tuple[str, str]
) -> list[Line]:
    """A table of some claims about two kinds of packings, its header first."""
    lines: list[Line] = [("quantity", "required", *heads)]
    for begin, names in chosen.items():
        lines.append((*names, *(cell(starting(rows, begin)) for rows in (first, second))))
    return lines


def starting(rows: list[Row], begin: str) -> Row | None:
    """The one row whose claim begins so."""
    return next((row for row in rows if row.claim.startswith(begin)), None)


def states(rows: list[Row]) -> list[Line]:
    """Checks of each kind of packings, the largest value of any member."""
    lines: list[Line] = [("check", "at most", "uniaxial", "isotropic", "2 m/s")]
    for begin, names in STATES.items():
        cells = ["-"] * 3
        for kind, column in KINDS.items():
            if (row := starting(rows, f"{kind}: {begin}")) is not None:
                cells[column] = cell(row)
        lines.append((*names, *cells))
    return lines


def curves(rows: list[Row]) -> list[Line]:
    """Checks of curves by friction: the largest difference, or for lids its rms over that of the packings."""
    lines: list[Line] = [("check", "at most", *FRICTIONS)]
    for begin, names in CURVES.items():
        found = {row.claim.rsplit(", ", 1)[1]: row for row in rows if row.claim.startswith(begin)}
        lines.append((*names, *(cell(found.get(friction)) for friction in FRICTIONS)))
    return lines


def shared_grid(found: Study) -> list[Line]:
    """First changes with contact at shared grid nodes, and what the gap predicts; then with the gap corrected."""
    head = (
        "packings",
        "friction",
        "first change",
        f"by {JAMMED}",
        "by 2 m/s",
        "first break of alpha",
        "distance [h]",
    )
    lines: list[Line] = [head]
    own = resisting(found, "fast", 0.0)[0]
    names = [(cells, "0", name) for cells, name in zip(CELLS, SHARED.values(), strict=True)]
    for cells, friction, name in [*names, (6, "0.5", "shared_grid_mu0.5_r6")]:
        predicted = [apparent(cells), apparent(cells, own)] if friction == "0" else [np.nan, np.nan]
        values = [change(found.get(name)), *predicted, break_of(found, name)]
        lines.append((f"shared grid, R/h = {cells}", friction, *map(figure, values), distance(found, name)))
    for kind, what in (("quasistatic", "contact at outlines, quasi-static"), ("fast", "contact at outlines, 2 m/s")):
        for mu in (0.0, 0.5):
            name = f"{kind}_mu{mu:g}_seed0"
            first = figure(resisting(found, kind, mu)[0])
            lines.append((what, f"{mu:g}", first, "-", "-", figure(break_of(found, name)), distance(found, name)))
    return lines


def break_of(found: Study, name: str) -> float:
    """The first break of alpha of a member, box instead of interior; nan if there is none."""
    member = found.get(name)
    fits = bends([member], "aspect_ratio", EARLY) if member else []
    return float(fits[0].breaks[0]) if fits else np.nan


def distance(found: Study, name: str) -> str:
    """Mean distance of discs that push each other, in cells, at the first stage."""
    member = found.get(name)
    values = stages.measured(member).get(study.STAGES[0]) if member else None
    return figure(values["apart"], digits=2) if values is not None else "-"


def judged(rows: list[Row]) -> list[Line]:
    """All claims or checks, the header first."""
    return [("claim", "rule", "measured", "verdict"), *((r.claim, r.rule, r.measured, r.verdict) for r in rows)]


def judged_twice(first: list[Row], second: list[Row], heads: tuple[str, str]) -> list[Line]:
    """The same claims about two kinds of packings."""
    head = ("claim", "rule", *(f"{what} {kind}" for kind in heads for what in ("measured", "verdict")))
    both = zip(first, second, strict=True)
    return [head, *((a.claim, a.rule, a.measured, a.verdict, b.measured, b.verdict) for a, b in both)]
