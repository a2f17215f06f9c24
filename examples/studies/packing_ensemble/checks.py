"""The checks of the study: three pressures, an identity, what is quasi-static, rates, grids, materials and walls.

Like the claims, they were fixed before any result was seen. "Worst" is over all members and solid fractions meant.
"""

from __future__ import annotations

import numpy as np

from . import stages
from .claims import NOT_RUN, Row, decide, figure
from .curves import PHI, Array, Member, Study, mean
from .members import LIDS, RATIOS
from .scenes import YOUNG
from .still import still
from .targets import FRICTIONS, KINDS, phi_jammed

DENSE, GRIDS = 0.88, 0.85  # solid fractions above which pressures and grids are compared
COLLAPSE = (DENSE, 0.93)  # between which Poisson's ratios are
ABOVE_JAMMING = 0.01  # of the solid fraction, from where rates must not matter
AT = np.array([0.86, 0.90, 0.926, 0.95])  # where kinds are compared
CURVES = {"pressure": "P", "contact_surface": "S", "anisotropy": "A_m", "aspect_ratio": "alpha", "coordination": "Z"}
THREE = {
    "contacts and points": ("pressure", "pressure_points"),
    "contacts and walls": ("pressure", "walls"),
    "points and walls": ("pressure_points", "walls"),
}
SWING = {
    f"{what}, the discs' swing taken off,": (f"{a} - swing", b) for what, (a, b) in THREE.items() if b == "walls"
}  # by the virial theorem


def rows(found: Study) -> list[Row]:
    """All checks."""
    return [
        *still(found),
        *pressures(found),
        *identities(found),
        *(
            rate(found, name, friction)
            for name in ("pressure", "coordination_without_rattlers")
            for friction in FRICTIONS
        ),
        *(collapse(found, nu) for nu in RATIOS),
        *(grid(found, name, friction) for name in CURVES for friction in FRICTIONS),
        *(compared(found, "periodic", "isotropic over uniaxial", friction) for friction in FRICTIONS),
        *(compared(found, "fast", "lid at 2 m/s over quasi-static", friction) for friction in FRICTIONS),
        forgetting(found),
    ]


def apart(a: Array, b: Array) -> tuple[float, float]:
    """Mean and worst of |b / a - 1| where both are known; nan if nowhere."""
    there = np.isfinite(a) & np.isfinite(b) & (a != 0.0)
    if not there.any():
        return np.nan, np.nan
    relative = np.abs(b[there] / a[there] - 1.0)
    return float(relative.mean()), float(relative.max())


def verdict(worst: float, limit: float) -> str:
    """Not run if there is no figure."""
    return decide(worst < limit) if np.isfinite(worst) else NOT_RUN


def percent(both: tuple[float, float]) -> str:
    """A mean and a worst deviation."""
    return f"mean {hundredths(both[0])} %, worst {hundredths(both[1])} %" if np.isfinite(both[1]) else "-"


def hundredths(share: float) -> str:
    """A share in percent, with as many digits as it takes to see it."""
    return f"{100 * share:.2f}" if share > 2e-4 or share == 0.0 else f"{100 * share:.1g}"


def pressures(found: Study) -> list[Row]:
    """Contacts, points and walls, two by two: quasi-static ones step by step, others as means over a transit.

    At 2 m/s all motion is added to what walls do not feel, or that of the discs taken off by the virial theorem.
    """
    moving = {what: (a if b != "walls" else f"{a} + motion", b) for what, (a, b) in THREE.items()}
    result = []
    for kind, words in (KINDS | {"fast": "2 m/s"}).items():
        members = [m for friction in FRICTIONS for m in found.seeds(kind, friction)]
        for what, pair in ((moving if kind == "fast" else THREE) | SWING).items():
            if kind == "periodic" and "walls" in pair:
                continue
            both = over_transits(members, *pair, 1.0)
            rule, text = f"worst < 3 % above Phi = {DENSE}, at every step", percent(both)
            if kind == "fast":
                rule += ", of means over one transit time"
                longer = (hundredths(over_transits(members, *pair, transits)[1]) for transits in (2.0, 4.0))
                text += f"; over 2 and 4 transit times worst {', '.join(longer)} %" if np.isfinite(both[1]) else ""
            claim = f"{words}: P from {what} agree"
            result.append(Row(claim, rule, text, verdict(both[1], 0.03), 100 * both[1]))
    return result


def over_transits(members: list[Member], a: str, b: str, transits: float) -> tuple[float, float]:
    """Mean and worst difference of two pressures above `DENSE`, as means over so many transit times."""
    samples = []
    for member in members:
        above = member.table["solid_fraction"] > DENSE
        samples.append(apart(member.steady(a, transits)[above], member.steady(b, transits)[above]))
    means, worst = np.array([both for both in samples if np.isfinite(both[1])]).reshape(-1, 2).T
    return (float(means.mean()), float(worst.max())) if means.size else (np.nan, np.nan)


def identities(found: Study) -> list[Row]:
    """P = (Phi Z / 4) sigma_l at the stages, in boxes of walls."""
    result = []
    for kind, words in (("quasistatic", "quasi-static"), ("fast", "2 m/s")):
        values = [
            values["identity"]
            for friction in FRICTIONS
            for member in found.seeds(kind, friction)
            for values in stages.measured(member).values()
            if np.isfinite(values["identity"])
        ]
        both = apart(np.ones(len(values)), np.array(values))
        claim = f"{words}: P = (Phi Z/4) sigma_l, sigma_l = mean(f.l) / mean(V_p) by own code"
        rule = "worst < 1 %, at all stages"
        result.append(Row(claim, rule, percent(both), verdict(both[1], 0.01), 100 * both[1]))
    return result


def rate(found: Study, name: str, friction: float) -> Row:
    """The first packing under two other lids, against what the packings differ by."""
    symbol = {"pressure": "P"}.get(name, "Z without rattlers")
    claim = f"{symbol}(Phi), lids of {LIDS[0]:g} and {LIDS[1]:g} m/s, friction {friction:g}"
    rule = "rms difference at most the packings' rms deviation from their mean, from 0.01 above Phi_J on"
    usual = found.seeds("quasistatic", friction)
    lids = [found.packing(f"lid{speed:g}", friction) for speed in LIDS]
    if None in lids or len(usual) < 2:
        return Row(claim, rule, "-", NOT_RUN)
    jammed = [phi for m in usual if np.isfinite(phi := phi_jammed(m, box=True))]
    above = PHI[max(jammed, default=np.inf) + ABOVE_JAMMING < PHI]
    samples = np.array([m.over(name, above) for m in usual])
    first, second = (m.over(name, above) for m in lids if m is not None)
    there = np.isfinite(first + second) & np.isfinite(samples).all(axis=0)
    if not there.any():
        return Row(claim, rule, "-", NOT_RUN)
    middle = samples[:, there].mean(axis=0)
    scatter = float(np.sqrt((samples[:, there].std(axis=0, ddof=1) ** 2 / middle**2).mean()))
    apart_by = float(np.sqrt((((second - first)[there] / middle) ** 2).mean()))
    text = f"rms {hundredths(apart_by)} %, packings {hundredths(scatter)} %"
    packing = found.packing("quasistatic", friction)
    if packing is not None:
        text += f"; either against {packing.options.speed:g} m/s: " + ", ".join(
            f"mean {hundredths(apart(packing.over(name, above), m.over(name, above))[0])} %" for m in lids if m
        )
    return Row(claim, rule, text, decide(apart_by <= scatter), apart_by / scatter)


def collapse(found: Study, nu: float) -> Row:
    """P / E* of another Poisson's ratio over that of 0.45, by current Phi; the mean of the packings run with both."""
    pairs, (low, high) = found.pairs("quasistatic", f"nu{nu:g}", 0.0), COLLAPSE
    claim = f"P/E* by current Phi, Poisson's ratio {nu:g} over 0.45, friction 0"
    rule = f"worst < 5 % for Phi in {low}-{high}, mean over the packings run with both"
    grid = PHI[(low <= PHI) & (high + 1e-9 >= PHI)]
    if not pairs:
        return Row(claim, rule, "-", NOT_RUN)
    by_plane, by_young = (
        apart(*np.array([[m.pressure(grid, over=over) for m in pair] for pair in pairs]).mean(axis=0))
        for over in (None, YOUNG)
    )
    text = f"{percent(by_plane)} of {len(pairs)} packings (of P/E: {percent(by_young)})"
    return Row(
        claim, rule, text + scatter(found, 0.0, "pressure", grid), verdict(by_plane[1], 0.05), 100 * by_plane[1]
    )


def grid(found: Study, name: str, friction: float) -> Row:
    """A curve at R/h = 5 and 8; the mean of the packings run on both grids."""
    pairs = found.pairs("quasistatic", "fine", friction)
    above = PHI[GRIDS < PHI]
    claim = f"{CURVES[name]}(Phi) at R/h = 5 and 8, friction {friction:g}"
    rule = f"worst < 5 % above Phi = {GRIDS}, mean over the packings run on both"
    if not pairs:
        return Row(claim, rule, "-", NOT_RUN)
    coarse, fine = (np.array([m.over(name, above) for m in side]) for side in zip(*pairs, strict=True))
    both = apart(coarse.mean(axis=0), fine.mean(axis=0))
    singles, _ = mean(np.array([apart(a, b)[0] for a, b in zip(coarse, fine, strict=True)]))
    text = f"{percent(both)} of {len(pairs)} packings, each: mean {hundredths(float(singles))} %"
    return Row(claim, rule, text + scatter(found, friction, name, above), verdict(both[1], 0.05), 100 * both[1])


def scatter(found: Study, friction: float, name: str, grid: Array) -> str:
    """Standard deviation of the packings over their mean, averaged over the solid fractions that all reached."""
    samples = np.array([m.over(name, grid) for m in found.seeds("quasistatic", friction)])
    if len(samples) < 2 or not (there := np.isfinite(samples).all(axis=0)).any():
        return ""
    relative = samples[:, there].std(axis=0, ddof=1) / np.abs(samples[:, there].mean(axis=0))
    return f" (packings scatter by {100 * relative.mean():.1f} %)"


def compared(found: Study, kind: str, words: str, friction: float) -> Row:
    """P of another kind over that of the quasi-static uniaxial packings, and Z less theirs; means of the packings."""
    claim = f"{words}: P ratio, difference of Z without rattlers, friction {friction:g}"
    one, other = found.seeds("quasistatic", friction), found.seeds(kind, friction)
    if not one or not other:
        return Row(claim, "-", "-", NOT_RUN)
    p, z = (
        [mean(np.array([m.over(name, AT) for m in side]))[0] for side in (one, other)]
        for name in ("pressure", "coordination_without_rattlers")
    )
    values = zip(AT, p[1] / p[0], z[1] - z[0], strict=True)
    text = "; ".join(f"at {phi:g}: {figure(ratio)}, {figure(more, digits=2)}" for phi, ratio, more in values)
    return Row(claim, "-", text, "shown")


def forgetting(found: Study) -> Row:
    """What body grids rebuilt at every step do to the pressure."""
    usual, other = found.packing("fast", 0.5), found.packing("regridded", 0.5)
    claim, at = "body grids rebuilt at every step: P over that of the same packing", np.array([0.85, 0.90, 0.95])
    if usual is None or other is None:
        return Row(claim, "-", "-", NOT_RUN)
    ratio = other.over("pressure", at) / usual.over("pressure", at)
    text = "; ".join(f"at {phi:.2f}: {figure(r, digits=2)}" for phi, r in zip(at, ratio, strict=True))
    return Row(claim, "-", text, "shown")
