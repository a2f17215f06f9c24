"""Jamming and the laws of compaction: what quasi-static packings should show, fixed before any result was seen.

All fractions are those of deformed outlines. Jamming is that of the interior, two mean diameters from every wall;
periodic packings are interior everywhere. Each packing gives a value, "±" is the standard error of their mean.
"""

from __future__ import annotations

import numpy as np

from .claims import NOT_RUN, Row, decide, figure
from .curves import NEAR_JAMMING, PHI, Array, Member, Study, mean
from .fits import Compaction, Power, compaction_factor, compaction_law, last_passage, line_to_zero, power_law
from .scenes import YOUNG

KINDS = {"quasistatic": "uniaxial", "periodic": "isotropic"}
JAMMING = {0.0: (0.83, 0.86), 0.5: (0.79, 0.82)}  # where the line is zero
ISOSTATIC, AGREE = 4.0, 0.005  # Z without friction, and how far two definitions may be apart
Z_J = {0.0: 4.0, 0.1: 3.6, 0.5: 3.2}  # that the power law starts from
ROOT, WINDOW = (3.1, 4.1), np.linspace(0.005, 0.03, 11)  # (Z - 4) / sqrt(x), and x
Z_BARE = "coordination_without_rattlers"
EXPONENT, FAR, Z_FAR = (0.4, 0.6), 0.10, (5.1, 5.6)
DENSE, P_DENSE = 0.926, (0.05, 0.065)  # P / E there
FACTOR = (0.06, 0.08)  # b with Phi_0 = Phi_J and Phi_max = 1
FRICTIONS = (0.0, 0.1, 0.5)
Limits = tuple[float, float]


def rows(found: Study, kind: str) -> list[Row]:
    """All targets, of the packings of a kind."""
    return [
        *(jammed(found, kind, friction) for friction in FRICTIONS),
        agreement(found, kind),
        *(coordination_at_onset(found, kind, friction) for friction in FRICTIONS),
        root(found, kind),
        exponent(found, kind),
        distant(found, kind),
        *(dense(found, kind, friction) for friction in FRICTIONS),
        *(factor(found, kind, friction) for friction in FRICTIONS),
        *(law(found, kind, friction) for friction in FRICTIONS),
        *(power(found, kind, friction) for friction in FRICTIONS),
        largest(found, kind),
    ]


def within(claim: str, values: list[float], limits: Limits | None, note: str = "", rule: str = "-") -> Row:
    """Whether the mean of the packings' values is between limits; shown only, without limits."""
    rule = f"in {limits[0]}-{limits[1]}" if limits else rule
    value, error = (float(v) for v in mean(np.asarray(values, dtype=float)))
    if not np.isfinite(value):
        return Row(claim, rule, "-", NOT_RUN)
    verdict = "shown" if limits is None else decide(limits[0] <= value <= limits[1])
    return Row(claim, rule, figure(value, error, 4 if abs(value) < 1.0 else 2) + note, verdict, value)


def average(values: Array | list[float]) -> float:
    """Mean of the packings' values, nan of none."""
    return float(mean(np.array(values))[0])


def phi_jammed(member: Member, *, box: bool = False) -> float:
    """Phi_J by the line through P = 3e-4..4e-3 E*, of the interior or of the whole box."""
    names = ("solid_fraction", "pressure") if box else ("interior_fraction", "interior_pressure")
    p = member.over(names[1], NEAR_JAMMING, along=names[0]) / member.plane
    return line_to_zero(NEAR_JAMMING, p)


def inside(member: Member, name: str, grid: Array) -> Array:
    """A measure of the interior at solid fractions of the interior."""
    return member.over(name, grid, along="interior_fraction")


def z_inside(member: Member, grid: Array) -> Array:
    """Z of the interior without rattlers, at solid fractions of the interior."""
    return inside(member, "interior_coordination_without_rattlers", grid)


def isostatic(member: Member) -> float:
    """Solid fraction of the interior above which Z without rattlers stays above 4."""
    return last_passage(NEAR_JAMMING, z_inside(member, NEAR_JAMMING), ISOSTATIC)


def jammed(found: Study, kind: str, friction: float) -> Row:
    """Phi_J by the line."""
    members = found.seeds(kind, friction)
    note = f" (box {figure(average([phi_jammed(m, box=True) for m in members]))})"
    claim = f"Phi_J, P extrapolated to zero, friction {friction:g}"
    return within(claim, [phi_jammed(m) for m in members], JAMMING.get(friction), note)


def agreement(found: Study, kind: str) -> Row:
    """Both definitions of Phi_J without friction; with friction Z = 4 is beyond jamming."""
    members = found.seeds(kind, 0.0)
    line, four = (np.array([f(m) for m in members]) for f in (phi_jammed, isostatic))
    claim = "Phi_J where Z without rattlers passes 4, friction 0"
    rule = f"differs from that of P by {AGREE} at most, mean over the packings"
    apart = average(np.abs(four - line))
    if not np.isfinite(apart):
        return Row(claim, rule, "-", NOT_RUN)
    text = f"{figure(*map(float, mean(four)))}, differs by {apart:.4f}"
    return Row(claim, rule, text, decide(apart <= AGREE), apart)


def coordination_at_onset(found: Study, kind: str, friction: float) -> Row:
    """Z where P passes 3e-4 E* for good, with and without rattlers."""
    both = []
    for name in ("interior_coordination_without_rattlers", "interior_coordination"):
        values = []
        for m in found.seeds(kind, friction):
            at = last_passage(NEAR_JAMMING, inside(m, "interior_pressure", NEAR_JAMMING) / m.plane, 3e-4)
            values.append(float(inside(m, name, np.array([at]))[0]) if np.isfinite(at) else np.nan)
        both.append(values)
    literature = {0.0: "literature: 4", 0.5: "literature: 3.1-3.4"}.get(friction, "-")
    note = f" (with rattlers {figure(average(both[1]), digits=2)})"
    claim = f"Z without rattlers where P passes 3e-4 E*, friction {friction:g}"
    return within(claim, both[0], None, note, literature)


def root(found: Study, kind: str) -> Row:
    """(Z - 4) over the root of the distance from jamming, without friction."""
    values, single = [], []
    for m in found.seeds(kind, 0.0):
        ratio = (z_inside(m, phi_jammed(m) + WINDOW) - ISOSTATIC) / np.sqrt(WINDOW)
        values.append(ratio.mean())
        single.append(ratio[[0, 2, 6, 10]])
    note = ""
    if single:
        note = "; " + ", ".join(figure(float(v), digits=2) for v in mean(np.array(single))[0])
    return within("(Z - 4) / sqrt(Phi - Phi_J) without rattlers, friction 0, mean over Phi - Phi_J of 0.005-0.03;"
                  " at 0.005, 0.01, 0.02, 0.03", values, ROOT, note)  # fmt: skip


def exponent(found: Study, kind: str) -> Row:
    """Exponent of Z - 4 over the same range."""
    values = []
    for m in found.seeds(kind, 0.0):
        near = phi_jammed(m)
        fit = power_law(NEAR_JAMMING, z_inside(m, NEAR_JAMMING), ISOSTATIC, (0.005, 0.03), near)
        values.append(fit.beta if fit else np.nan)
    return within("exponent of Z - 4 over the same range", values, EXPONENT)


def distant(found: Study, kind: str) -> Row:
    """Z well above jamming, without friction."""
    values = [float(z_inside(m, np.array([phi_jammed(m) + FAR]))[0]) for m in found.seeds(kind, 0.0)]
    return within(f"Z without rattlers at Phi - Phi_J = {FAR}, friction 0", values, Z_FAR)


def dense(found: Study, kind: str, friction: float) -> Row:
    """P / E in a dense packing; P / E* and the nominal fraction there beside it."""
    at, members = np.array([DENSE]), found.seeds(kind, friction)
    by_plane = average([float(m.pressure(at)[0]) for m in members])
    nominal = average([float(m.over("solid_fraction_nominal", at)[0]) for m in members])
    note = f" (P/E* {figure(by_plane, digits=4)}, nominal {figure(nominal)})"
    values = [float(m.pressure(at, over=YOUNG)[0]) for m in members]
    return within(f"P/E at Phi = {DENSE}, friction {friction:g}", values, P_DENSE if friction == 0.0 else None, note)


def factor(found: Study, kind: str, friction: float) -> Row:
    """The factor b of the law of compaction with Phi_0 = Phi_J of the box and Phi_max = 1."""
    members = found.seeds(kind, friction)
    note = f" (Z without rattlers: {figure(average([fixed(m, Z_BARE) for m in members]))})"
    values = [fixed(m, "coordination") for m in members]
    claim = f"b with Phi_0 = Phi_J, Phi_max = 1, friction {friction:g}"
    return within(claim, values, FACTOR if friction == 0.0 else None, note)


def fixed(member: Member, name: str) -> float:
    """The factor with the other two constants fixed; `name` is the coordination that is used."""
    return compaction_factor(PHI, member.over(name), member.pressure(over=YOUNG), phi_jammed(member, box=True))


def compaction_fits(found: Study, kind: str, friction: float) -> list[tuple[Member, Compaction]]:
    """The law with three free constants of each packing that has one."""
    fits = [
        (m, compaction_law(PHI, m.over("coordination"), m.pressure(over=YOUNG))) for m in found.seeds(kind, friction)
    ]
    return [(member, fit) for member, fit in fits if fit is not None]


def power_fits(found: Study, kind: str, friction: float) -> list[Power]:
    """Coordination above jamming of each packing, all discs of the box."""
    fits = [power_law(PHI, m.over("coordination", averaged=True), Z_J[friction]) for m in found.seeds(kind, friction)]
    return [fit for fit in fits if fit is not None]


def law(found: Study, kind: str, friction: float) -> Row:
    """The three constants of the law, all fitted."""
    fits = [fit for _, fit in compaction_fits(found, kind, friction)]
    claim = f"P/E = -(b/4) Phi Z ln[(Phi_max - Phi)/(Phi_max - Phi_0)], all fitted, friction {friction:g}"
    return constants(claim, "literature: b 0.1-0.2", ("b", "Phi_max", "Phi_0"), fits)


def power(found: Study, kind: str, friction: float) -> Row:
    """The power law of all discs of the box, rattlers included, as this page had it before."""
    fits = power_fits(found, kind, friction)
    claim = f"Z - {Z_J[friction]:g} = a (Phi - Phi_J)^beta, all discs, friction {friction:g}"
    return constants(claim, "literature: beta 0.5", ("Phi_J", "a", "beta"), fits)


def constants(claim: str, rule: str, names: tuple[str, ...], fits: list[Compaction] | list[Power]) -> Row:
    """Means of the constants of fits."""
    values = [mean(np.array([getattr(fit, name.replace("Phi", "phi")) for fit in fits])) for name in names]
    text = ", ".join(f"{n} {figure(float(v), float(e))}" for n, (v, e) in zip(names, values, strict=True))
    return Row(claim, rule, text if fits else "-", "shown" if fits else NOT_RUN)


def largest(found: Study, kind: str) -> Row:
    """Phi_max of the free fits by friction."""
    both = [[fit.phi_max for _, fit in compaction_fits(found, kind, friction)] for friction in (0.0, 0.5)]
    claim, rule = "Phi_max of the free fits falls with friction", "smaller with 0.5 than without, means"
    if not all(both):
        return Row(claim, rule, "-", NOT_RUN)
    without, with_friction = (float(np.mean(values)) for values in both)
    text = f"{without:.3f} without, {with_friction:.3f} with"
    return Row(claim, rule, text, decide(with_friction < without), with_friction - without)
