"""The health report before time is spent: what a scene asks for, and where it leaves what was verified."""

from __future__ import annotations

import numpy as np

from skmpm.scene import Scene
from skmpm.scheme import Scheme
from skmpm.simulate.health.numbers import Health, examine, memory_of
from skmpm.simulate.health.verified import warnings_of

__all__ = ["Health", "examine", "memory_of", "report", "warnings_of"]


def report(scene: Scene, dt: float, *, scheme: Scheme = Scheme()) -> str:  # noqa: B008
    """What `simulate` would be asked for, as text: sizes, resolution, motion per step, solver, memory, warnings.

    Sheets are laid, nothing is solved. Motions are those at t = 0 and what bodies gain by falling. A line that begins
    with `!` names an object, its value, what was verified and the remedy.

    Raises
    ------
    ValueError
        when dt [s] is not a time step; SceneError when a velocity is not finite
    """
    health = examine(scene, dt, scheme)
    lines = [f"{name:8s}  {text}" for name, text in _lines(health).items()]
    warnings = [f"! {text}" for text in warnings_of(scene, health, scheme)]
    return "\n".join([*lines, *(warnings or ["nothing to warn of"])])


def _lines(health: Health) -> dict[str, str]:
    """What the report says, by subject."""
    least, most = health.points.min(), health.points.max()
    each = f"{least}" if least == most else f"{least} to {most}"
    around = ", ".join(f"{name} {number}" for name, number in health.around.items())
    law = "linear, one solve" if health.linear else "nonlinear, Newton"
    return {
        "bodies": f"{health.points.size}, rigid {health.rigid}; {around}",
        "points": f"{health.points.sum()}, {each} a body, {health.points_per_cell.min():.3g} or more per filled cell",
        "grid": f"{health.cells} cells of {health.cell:.6g} m, {health.unknowns} unknowns",
        "R/h": f"{health.resolution.min():.3g} smallest, {health.resolution.mean():.3g} mean; {_across(health)}",
        "dt c/h": f"{health.courant:.3g}, c = {health.wave:.4g} m/s" if health.inertia else "none without inertia",
        "driven": f"{health.lid_name}, {health.lid:.3g} h a step" if health.lid else "nothing",
        "motion": _motion(health),
        "bulk": f"{law}; {f'theta = {health.theta:g}' if health.inertia else 'quasi-static'}",
        "contact": _contact(health),
        "solver": f"{health.solver}, half bandwidth {health.half_bandwidth}",
        "memory": f"about {_bytes(health.memory)} besides the program",
    }


def _motion(health: Health) -> str:
    if not health.touches:
        return "nothing can touch"
    after = f", after falling by {health.fall:.3g} m" if health.fall else ""
    return f"{health.approach:.3g} h a step past each other{after}"


def _across(health: Health) -> str:
    known = health.across[~np.isnan(health.across)]
    return f"{known.min():.3g} cells across the thinnest part" if known.size else "no outlines"


def _contact(health: Health) -> str:
    if not health.touches:
        return "off"
    return f"{health.contact}, {f'friction up to {health.friction:g}' if health.friction else 'frictionless'}"


def _bytes(number: float) -> str:
    return f"{number / 1e9:.2g} GB" if number >= 1e9 else f"{number / 1e6:.0f} MB"
