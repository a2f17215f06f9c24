"""The claims of Nezamabadi et al. (2017), each with its decision rule, fixed before any result was seen.

They are judged by packings under the published lid at 2 m/s and by quasi-static ones. A claim about the ensemble
needs at least two packings. Differences between frictions are those of the same packing without and with friction;
"over 2 errors" means larger than two standard errors of their mean.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from . import stages, study
from .curves import PHI, Array, Member, Study, mean
from .fits import Broken, broken, last_passage
from .members import CELLS

AT = np.array([0.80, 0.85, 0.90, 0.95])  # solid fractions at which frictions are compared
SHOWN_AT = 0.90  # of these in the table of the page
REGIMES = np.array([0.72, 0.90])  # where the change of Nezamabadi et al. (2017)
NEAR = 0.02  # how near a measured solid fraction must be to the or of Nezamabadi et al. (2017) the gap's
JAMMED, JAMMING = 0.842, (0.83, 0.86)  # frictionless, mean and by protocol
SHARED = {
    f"mode of Nezamabadi et al. (2017), R/h = {cells}": f"shared_grid_mu0_r{cells}" for cells in CELLS
}  # these by what they are
POLYGON = 0.05  # excess of shape half way between an ellipse and a hexagon
NOT_RUN = "not run"


@dataclass(frozen=True)
class Row:
    """One line of the tables beside docs/studies/packing_ensemble.md."""

    claim: str
    rule: str
    measured: str
    verdict: str  # holds, does not hold, not run or shown
    value: float = field(default=np.nan, compare=False)  # what the page shows of it


def decide(rule: bool | np.bool_) -> str:
    """The word for a rule that could be applied."""
    return "holds" if rule else "does not hold"


def figure(value: float, error: float = np.nan, digits: int = 3) -> str:
    """A value with its standard error, or "-"."""
    if not np.isfinite(value):
        return "-"
    return f"{value:.{digits}f}" + (f" ± {error:.{digits}f}" if np.isfinite(error) else "")


def compared(claim: str, difference: tuple[Array, Array], rule: str) -> Row:
    """A claim about differences (k,) at `AT`, mu 0.5 less mu 0: "same" or "larger" at every one."""
    value, error = difference
    text = "at " + "; ".join(f"{phi:.2f}: {figure(*pair, 4)}" for phi, *pair in zip(AT, value, error, strict=True))
    words = {"same": "difference within 2 errors at every Phi", "larger": "difference over 2 errors at every Phi"}
    there = np.isfinite(value) & np.isfinite(error)
    met = np.abs(value) <= 2.0 * error if rule == "same" else value > 2.0 * error
    dense = float(value[AT == SHOWN_AT][0])
    if (there & ~met).any():  # one is enough, whatever is missing
        return Row(claim, words[rule], text, decide(False), dense)
    return Row(claim, words[rule], text, decide(True) if there.all() else NOT_RUN, dense)


def difference(found: Study, kind: str, name: str) -> tuple[Array, Array]:
    """Mean and standard error of a measure with friction less without, the same packing, at `AT`."""
    samples = [b.over(name, AT) - a.over(name, AT) for a, b in both(found, kind)]
    return mean(np.array(samples).reshape(-1, AT.size))


def both(found: Study, kind: str) -> list[tuple[Member, Member]]:
    """The same packing without friction and with 0.5."""
    return found.pairs(kind, kind, 0.0, 0.5)


def rows(found: Study, kind: str) -> list[Row]:
    """The claims about packings of a kind."""
    return [
        compared("S(Phi) is the same for both frictions", difference(found, kind, "contact_surface"), "same"),
        compared("alpha is larger with friction", difference(found, kind, "aspect_ratio"), "larger"),
        compared("A_m is larger with friction", difference(found, kind, "anisotropy"), "larger"),
        *regimes(found, kind),
        slower(found, kind, "anisotropy", "A_m grows more slowly with friction between the breaks", -1.0),
        slower(found, kind, "aspect_ratio", "alpha grows faster with friction between the breaks", 1.0),
        polygons(found, kind),
    ]


def bends(members: list[Member], name: str, grid: Array = PHI) -> list[Broken]:
    """The three straight pieces of a measure over solid fractions, of each member that has them."""
    return [fit for member in members if (fit := broken(grid, member.over(name, grid))) is not None]


def regimes(found: Study, kind: str) -> list[Row]:
    """Three regimes: whether slopes rise and fall again, and where."""
    result = []
    for name, symbol in (("aspect_ratio", "alpha"), ("contact_surface", "S")):
        for friction in (0.0, 0.5):
            fits = bends(found.seeds(kind, friction), name)
            result += three_regimes(f"{symbol}, friction {friction:g}", fits)
    return result


def three_regimes(what: str, fits: list[Broken]) -> list[Row]:
    """The two claims about one measure, from the fits of its packings."""
    steps = "the middle slope is larger than the first and than the last, over 2 errors"
    places = f"each break within {NEAR} or 2 errors of Nezamabadi et al.'s (2017)"
    claims = (
        f"{what}: three regimes, slow, fast and slower",
        f"{what}: they change at {REGIMES[0]} and {REGIMES[1]}",
    )
    if len(fits) < 2:
        return [Row(claim, rule, "-", NOT_RUN) for claim, rule in zip(claims, (steps, places), strict=True)]
    slopes, breaks = np.array([f.slopes for f in fits]), np.array([f.breaks for f in fits])
    rises, errors = mean(slopes[:, 1:2] - slopes[:, ::2])
    place, place_error = mean(breaks)
    text = ", ".join(figure(*pair) for pair in zip(*mean(slopes), strict=True))
    where = ", ".join(figure(*pair) for pair in zip(place, place_error, strict=True))
    _, middle, last = mean(slopes)[0]
    near = np.abs(place - REGIMES) <= np.maximum(NEAR, 2.0 * place_error)
    return [
        Row(claims[0], steps, f"slopes {text}", decide((rises > 2.0 * errors).all()), float(last / middle)),
        Row(claims[1], places, f"breaks at {where}", decide(near.all()), float(place[0])),
    ]


def slower(found: Study, kind: str, name: str, claim: str, sign: float) -> Row:
    """A claim about slopes between the breaks of alpha: friction makes them larger (sign 1) or smaller (-1)."""
    rule = "slope of a line through it between the two breaks of alpha of the same run: difference over 2 errors"
    pairs = [[middle_slope(member, name) for member in pair] for pair in both(found, kind)]
    slopes = np.array(pairs).reshape(-1, 2)
    value, error = mean(slopes[:, 1] - slopes[:, 0])
    if not np.isfinite(error):
        return Row(claim, rule, "-", NOT_RUN)
    text = f"{figure(*mean(slopes[:, 1]))} with, {figure(*mean(slopes[:, 0]))} without, difference"
    return Row(claim, rule, f"{text} {figure(value, error)}", decide(sign * value > 2.0 * error), float(value))


def middle_slope(member: Member, name: str) -> float:
    """Slope of a measure between the breaks of the member's alpha; nan if there are none."""
    fit = broken(PHI, member.over("aspect_ratio"))
    if fit is None:
        return np.nan
    values = member.over(name)
    low, high = fit.breaks
    between = (low <= PHI) & (high >= PHI) & np.isfinite(values)
    return float(np.polyfit(PHI[between], values[between], 1)[0]) if between.sum() > 1 else np.nan


def polygons(found: Study, kind: str) -> Row:
    """Circles become polygons: by the last of the kept states."""
    claim = "circles become nearly polygons"
    rule = (
        f"at a nominal {study.STAGES[-1]:.2f} the mean of perimeter^2 / (4 pi area) exceeds that of ellipses "
        f"as long and wide by more than {POLYGON} (hexagon: 0.10), over 2 errors, for both frictions"
    )
    texts, met, excess = [], [], []
    for friction in (0.0, 0.5):
        last = [stages.measured(member).get(study.STAGES[-1]) for member in found.seeds(kind, friction)]
        samples = [values["polygons"] for values in last if values is not None]
        value, error = mean(np.array(samples))
        texts.append(f"friction {friction:g}: {figure(float(value), float(error))}")
        excess.append(float(value))
        met.append(value - POLYGON > 2.0 * error if np.isfinite(error) else None)
    verdict = NOT_RUN if None in met else decide(all(met))
    return Row(claim, rule, "; ".join(texts), verdict, min(excess))


def apparent(cells: float, jammed: float = JAMMED) -> float:
    """Jamming fraction with a gap of one cell between bodies."""
    return jammed / (1.0 + 0.5 / cells) ** 2


def resisting(found: Study, kind: str, friction: float) -> tuple[float, float]:
    """First change of the packings of a kind, without a gap: mean and standard error."""
    value, error = mean(np.array([change(m) for m in found.seeds(kind, friction)]))
    return float(value), float(error)


def change(member: Member | None) -> float:
    """Interior solid fraction of the first change: where the interior pressure exceeds 1e-3 E* for good.

    Both are means over one transit time where the lid is fast; nan for no member, or one whose box has no interior.
    """
    if member is None:
        return np.nan
    return last_passage(member.steady("interior_fraction"), member.steady("interior_pressure") / member.plane, 1e-3)


def jamming(found: Study) -> list[Row]:
    """Where the first change comes, in the mode of Nezamabadi et al. (2017) and with the gap corrected."""
    shared = np.array([change(found.get(f"shared_grid_mu0_r{cells}")) for cells in CELLS])
    formula = np.array([apparent(cells) for cells in CELLS])
    there = np.isfinite(shared).all()
    lids = {"quasi-static": "quasistatic", "2 m/s": "fast"}
    found_at = {mu: {what: resisting(found, kind, mu) for what, kind in lids.items()} for mu in (0.0, 0.5)}
    own = [figure(apparent(cells, found_at[0.0]["2 m/s"][0])) for cells in CELLS]
    text = "; ".join(
        f"R/h = {c}: {figure(s)} ({f:.3f}, {o})" for c, s, f, o in zip(CELLS, shared, formula, own, strict=True)
    )
    moved = decide((np.abs(shared - formula) <= NEAR).all() and (np.diff(shared) > 0).all()) if there else NOT_RUN
    slow = np.array([found_at[mu]["quasi-static"][0] for mu in found_at])
    low, high = JAMMING
    first, second = np.isfinite(slow[0]), np.isfinite(slow).all()
    values = [", ".join(f"{what} {figure(*v)}" for what, v in each.items()) for each in found_at.values()]
    with_friction = figure(change(found.get("shared_grid_mu0.5_r6")))
    return [
        Row("in the mode of Nezamabadi et al. (2017) the first change moves with R/h as 0.842/(1 + h/2R)^2 says",
            f"each within {NEAR} of the formula (in brackets; then with the packings' own fraction at 2 m/s instead "
            f"of {JAMMED}), larger with R/h",
            f"{text}; friction 0.5, R/h = 6: {with_friction}", moved),
        Row("the published first change at 0.72 is that of a gap of one cell at R/h = 6", f"within {NEAR} of 0.72",
            figure(shared[0]), decide(abs(shared[0] - REGIMES[0]) <= NEAR) if np.isfinite(shared[0]) else NOT_RUN),
        Row("with the gap corrected it comes at jamming, without friction", f"quasi-static: in {low}-{high}",
            values[0], decide(low <= slow[0] <= high) if first else NOT_RUN),
        Row("with friction it comes earlier", "quasi-static: smaller than without", values[1],
            decide(slow[1] < slow[0]) if second else NOT_RUN),
    ]  # fmt: skip
