"""The checks of the study: three pressures, an identity, the grid, the lid and the laws of compaction.

Like the claims, they were fixed before any result was seen. "Worst" is over all members and solid fractions meant.
"""

from __future__ import annotations

import numpy as np

from . import stages
from .claims import NOT_RUN, Row, decide, figure
from .curves import PHI, YOUNG, Array, Member, Study, mean
from .fits import Compaction, Power, compaction_law, power_law

DENSE, GRIDS = 0.88, 0.85  # solid fractions above which pressures and grids are compared
Z_J = {0.0: 4.0, 0.5: 3.2}  # coordination at jamming
CURVES = {"pressure": "P", "contact_surface": "S", "anisotropy": "A_m", "aspect_ratio": "alpha", "coordination": "Z"}


def rows(found: Study) -> list[Row]:
    """All checks."""
    return [
        *pressures(found),
        identity(found),
        *grids(found),
        lid(found),
        *laws(found),
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
    """Contacts, points and walls, two by two, over the ensemble."""
    names = {
        "contacts and points": ("pressure", "pressure_points"),
        "contacts and walls": ("pressure + motion", "walls"),
        "points and walls": ("pressure_points + motion", "walls"),
        "contacts and walls, the discs' swing taken off,": ("pressure - swing", "walls"),
        "points and walls, the discs' swing taken off,": ("pressure_points - swing", "walls"),
    }
    result = []
    packings = [m for friction in (0.0, 0.5) for m in found.seeds(friction)]
    slow = [m for friction in (0.0, 0.5) if (m := found.get(f"slow_mu{friction:g}"))]
    for what, (a, b) in names.items():
        one, *longer = (over_transits(packings, a, b, transits) for transits in (1.0, 2.0, 4.0))
        lid = over_transits(slow, a, b, 1.0)
        rule = f"worst < 3 % above Phi = {DENSE}, at every step, of means over one transit time"
        text = percent(one)
        if np.isfinite(one[1]):
            text += f"; over 2 and 4 transit times worst {', '.join(hundredths(worst) for _, worst in longer)} %"
        if np.isfinite(lid[1]):
            text += f"; lid at 0.5 m/s: {percent(lid)}"
        result.append(Row(f"P from {what} agree", rule, text, verdict(one[1], 0.03)))
    return result


def over_transits(members: list[Member], a: str, b: str, transits: float) -> tuple[float, float]:
    """Mean and worst difference of two pressures above `DENSE`, as means over so many transit times."""
    samples = []
    for member in members:
        above = member.table["solid_fraction"] > DENSE
        samples.append(apart(member.steady(a, transits)[above], member.steady(b, transits)[above]))
    means, worst = np.array([both for both in samples if np.isfinite(both[1])]).reshape(-1, 2).T
    return (float(means.mean()), float(worst.max())) if means.size else (np.nan, np.nan)


def identity(found: Study) -> Row:
    """P = (Phi Z / 4) sigma_l at the stages."""
    values = [
        stages.identity(member, state)
        for friction in (0.0, 0.5)
        for member in found.seeds(friction)
        for state in stages.states(member).values()
        if np.hypot(*state.contacts.force).any()
    ]
    both = apart(np.ones(len(values)), np.array(values))
    return Row("P = (Phi Z/4) sigma_l, sigma_l = mean(f.l) / mean(V_p) by own code", "worst < 1 %, at all stages",
               percent(both), verdict(both[1], 0.01))  # fmt: skip


def grids(found: Study) -> list[Row]:
    """Each curve at R/h = 5 and 8, the same packing."""
    result = []
    for name, symbol in CURVES.items():
        both, frictions = worst_of(found, "fine", name, GRIDS)
        result.append(Row(f"{symbol}(Phi) at R/h = 5 and 8", f"worst < 5 % above Phi = {GRIDS}, same packing",
                          frictions, verdict(both, 0.05)))  # fmt: skip
    return result


def lid(found: Study) -> Row:
    """The same packing with a lid at 0.5 m/s."""
    worst, text = worst_of(found, "slow", "pressure", DENSE)
    return Row(
        "P(Phi) with a lid at 0.5 m/s", f"worst < 5 % above Phi = {DENSE}, same packing", text, verdict(worst, 0.05)
    )


def worst_of(found: Study, kind: str, name: str, above: float) -> tuple[float, str]:
    """Worst deviation of the `kind` members from the first packing, both frictions; nan unless both were run.

    Beside it by how much the packings deviate from each other.
    """
    both, texts = [], []
    for friction in (0.0, 0.5):
        usual, other = found.get(f"mu{friction:g}_seed0"), found.get(f"{kind}_mu{friction:g}")
        grid = PHI[above < PHI]
        known = usual is not None and other is not None
        far = apart(*(m.over(name, grid) for m in (usual, other))) if known else (np.nan, np.nan)
        both.append(far[1])
        texts.append(f"friction {friction:g}: {percent(far)}{scatter(found, friction, name, grid)}")
    return float(np.max(both)), "; ".join(texts)


def scatter(found: Study, friction: float, name: str, grid: Array) -> str:
    """Standard deviation of the packings over their mean, averaged over the solid fractions that all reached."""
    samples = np.array([m.over(name, grid) for m in found.seeds(friction)])
    if len(samples) < 2 or not (there := np.isfinite(samples).all(axis=0)).any():
        return ""
    relative = samples[:, there].std(axis=0, ddof=1) / np.abs(samples[:, there].mean(axis=0))
    return f" (packings scatter by {100 * relative.mean():.1f} %)"


def compaction_fits(found: Study, friction: float) -> list[tuple[Member, Compaction]]:
    """The law of each packing that has one."""
    fits = [
        (m, compaction_law(PHI, m.over("coordination"), m.over("pressure") / YOUNG)) for m in found.seeds(friction)
    ]
    return [(member, fit) for member, fit in fits if fit is not None]


def power_fits(found: Study, friction: float) -> list[Power]:
    """Coordination above jamming of each packing; means over a transit time."""
    fits = [power_law(PHI, m.over("coordination", averaged=True), Z_J[friction]) for m in found.seeds(friction)]
    return [fit for fit in fits if fit is not None]


def laws(found: Study) -> list[Row]:
    """Constants of both laws beside the literature's."""
    result = []
    for friction in (0.0, 0.5):
        law, power = [fit for _, fit in compaction_fits(found, friction)], power_fits(found, friction)
        for what, names, fits, literature in (
            ("P/E = -(b/4) Phi Z ln[(Phi_max - Phi)/(Phi_max - Phi_0)]", ("b", "Phi_max", "Phi_0"), law, "b 0.1-0.2"),
            (f"Z - {Z_J[friction]:g} = a (Phi - Phi_J)^beta", ("Phi_J", "a", "beta"), power,
             "Phi_J 0.83-0.86, a 3.6 ± 0.5, beta 0.5" if friction == 0.0 else "Phi_J 0.80-0.81, beta 0.5"),
        ):  # fmt: skip
            values = [mean(np.array([getattr(fit, name.replace("Phi", "phi")) for fit in fits])) for name in names]
            text = ", ".join(f"{n} {figure(float(v), float(e))}" for n, (v, e) in zip(names, values, strict=True))
            result.append(Row(f"{what}, friction {friction:g}", f"literature: {literature}",
                              text if fits else "-", "shown" if fits else NOT_RUN))  # fmt: skip
    return result


def forgetting(found: Study) -> Row:
    """What body grids rebuilt at every step do to the pressure."""
    usual, other = found.get("mu0.5_seed0"), found.get("regridded_mu0.5")
    claim, at = "body grids rebuilt at every step: P over that of the same packing", np.array([0.85, 0.90, 0.95])
    if usual is None or other is None:
        return Row(claim, "-", "-", NOT_RUN)
    ratio = other.over("pressure", at) / usual.over("pressure", at)
    text = "; ".join(f"at {phi:.2f}: {figure(r, digits=2)}" for phi, r in zip(at, ratio, strict=True))
    return Row(claim, "-", text, "shown")
