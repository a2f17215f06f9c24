"""Whether the quasi-static members are: inertial number, unbalanced forces, kinetic energy, steps near jamming."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from .claims import NOT_RUN, Row, decide
from .curves import Member, Study
from .fits import last_passage
from .members import RADIUS
from .scenes import DENSITY
from .targets import FRICTIONS, KINDS, phi_jammed

INERTIAL, AT_PRESSURE = 1e-4, 1e-3  # largest inertial number, at so much of E*
SMALL = 1e-3  # largest median of unbalanced forces and of kinetic over elastic energy
STEP, NEAR = 1e-3, (-0.01, 0.02)  # longest step in solid fraction, median so near to jamming


def still(found: Study) -> list[Row]:
    """Four measures of the slow members, the largest over all of a kind."""
    result = []
    for kind, words in KINDS.items():
        members = [m for friction in FRICTIONS for m in found.seeds(kind, friction)]
        result += [
            most(f"{words}: inertial number at P = {AT_PRESSURE:g} E*", members, inertial, INERTIAL),
            most(
                f"{words}: unbalanced force ratio, median above that pressure",
                members,
                partial(median, name="unbalanced"),
                SMALL,
            ),
            most(
                f"{words}: kinetic over elastic energy, median above that pressure",
                members,
                partial(median, name="kinetic", over="elastic"),
                SMALL,
            ),
            most(f"{words}: step of Phi, median from 0.01 below jamming to 0.02 above", members, step, STEP),
        ]
    return result


def most(claim: str, members: list[Member], value: Callable[[Member], float], limit: float) -> Row:
    """A measure that must not exceed its limit in any member."""
    values = np.array([value(m) for m in members])
    values = values[np.isfinite(values)]
    rule = f"at most {limit:g} in every member"
    if not values.size:
        return Row(claim, rule, "-", NOT_RUN)
    text = f"largest {values.max():.1e}, median {np.median(values):.1e}"
    return Row(claim, rule, text, decide(values.max() <= limit), float(values.max()))


def inertial(member: Member) -> float:
    """I = rate d sqrt(rho / P) where P passes 1e-3 E* for good; the rate is that of the nominal fraction.

    Of a uniaxial squeeze it is the rate of the height; isotropic edges have half of that each.
    """
    t, p = member.table["t"], member.column("pressure") / member.plane
    at = last_passage(t, p, AT_PRESSURE)
    if not np.isfinite(at):
        return np.nan
    log = np.log(member.table["solid_fraction_nominal"])
    rate = float(np.interp(at, t[1:], np.diff(log) / np.diff(t))) / (2.0 if member.options.periodic else 1.0)
    return rate * 2.0 * RADIUS * float(np.sqrt(DENSITY / (AT_PRESSURE * member.plane)))


def median(member: Member, name: str, over: str | None = None) -> float:
    """Of a column, or of its ratio to another, above that pressure, weighted with the time of steps."""
    values = member.column(name) / (1.0 if over is None else member.column(over))
    chosen = (member.column("pressure") > AT_PRESSURE * member.plane) & np.isfinite(values)
    if not chosen.any():
        return np.nan
    weight, values = np.diff(member.table["t"], prepend=0.0)[chosen], values[chosen]
    order = np.argsort(values)
    share = np.cumsum(weight[order]) / weight.sum()
    return float(values[order][np.searchsorted(share, 0.5)])


def step(member: Member) -> float:
    """Median change of the solid fraction in the steps near jamming."""
    phi = member.column("solid_fraction")
    near = phi - phi_jammed(member, box=True)
    chosen = (near > NEAR[0]) & (near < NEAR[1])
    return float(np.median(np.diff(phi, prepend=phi[0])[chosen])) if chosen.any() else np.nan
