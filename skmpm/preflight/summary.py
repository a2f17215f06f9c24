"""The preflight check: a summary of a run before it starts, and warnings outside the verified range."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skmpm.contact import acts_at_grid_nodes
from skmpm.contact.self_contact import can_touch
from skmpm.material import is_linear
from skmpm.preflight.checks import warnings_of
from skmpm.preflight.cost import chosen_steps, first_step, seconds_of_step
from skmpm.preflight.limits import PreflightWarning
from skmpm.preflight.metrics import SceneMetrics, examine
from skmpm.representation import quantity, table
from skmpm.scene import Scene, check_scene
from skmpm.scheme import Scheme
from skmpm.step.algorithm import SHORTEST, check_time
from skmpm.step.step_length import MAX_APPROACH, STROKE, pace_of

PAGE = "docs/how_to/warnings.md"


@dataclass(frozen=True, repr=False)
class Preflight:
    """The preflight check of a scene, printed as text; in a notebook a table.

    Attributes
    ----------
    lines : the summary, text by subject
    warnings : of what lies outside of the verified range, at most one of a kind, `PreflightWarning`
    """

    lines: dict[str, str]
    warnings: tuple[PreflightWarning, ...]

    def __str__(self) -> str:
        """The lines, then a line that begins with ``!`` for each warning."""
        said = [f"! {warning}" for warning in self.warnings]
        said += [f"about [...]: sections of {PAGE}"] if said else ["no warnings"]
        return "\n".join([*(f"{name:8s}  {text}" for name, text in self.lines.items()), *said])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        said = {f"! {warning.kind}": str(warning) for warning in self.warnings}
        return table("Preflight", self.lines | (said or {"": "no warnings"}))


def preflight(
    scene: Scene,
    dt: float | None = None,
    *,
    scheme: Scheme = Scheme(),  # noqa: B008
    until: float | None = None,
) -> Preflight:
    """Summary of a run before it starts: sizes, resolution, motion per step, solver, memory; and warnings.

    Without dt [s], motions per step are those of the first step that `simulate` chooses by what acts at t = 0.
    With `until` [s], the number of steps and the time that a run takes are estimated, to an order of magnitude.

    Body grids are built, nothing is solved. Motions are those at t = 0, including what bodies gain by falling; with
    `until` walls and supports that are functions of time count by their largest speeds. In the
    printed text a line that begins with ``!`` is a warning: object, value, what was verified, the remedy and, in
    brackets, the section of docs/how_to/warnings.md that explains it. `simulate` logs the same warnings.

    Raises
    ------
    ValueError
        if dt is not positive
    SceneError
        if a velocity is not finite, steps cannot be chosen, or `initial` refuses the scene, as where bodies that may
        touch have no outline
    """
    check_scene("preflight", scene)
    step = first_step(scene, scheme) if dt is None else dt
    if until is not None:
        check_time("preflight: until", until, SHORTEST, "the time to stop at")
    metrics = examine(scene, step, scheme, until)
    if dt is None:  # chosen steps resolve waves where they matter, and are shorter once bodies have fallen
        lid, approach = min(metrics.lid, STROKE), min(metrics.approach, MAX_APPROACH)
        metrics = replace(metrics, waves=False, lid=lid, approach=approach, fall=0.0)
    chosen = {"step": _chosen(scene, step, scheme, until)} if dt is None else {}
    if until is not None:
        steps = chosen_steps(scene, scheme, until) if dt is None else ceil(until / dt - 1e-9)
        metrics = replace(metrics, steps=steps)
    cost = {"cost": _cost(metrics)}
    return Preflight(_lines(scene, metrics, scheme) | cost | chosen, warnings_of(scene, metrics, scheme))


def _chosen(scene: Scene, step: float, scheme: Scheme, until: float | None) -> str:
    """The step, and whether chosen ones pass over impacts."""
    text, pace = f"chosen, {step:.3g} s at first", pace_of(scene, scheme, 0.0, until or 0.0)
    passes = scheme.inertia and can_touch(scene) and not pace.losses
    return f"{text}; impacts of so many bodies are not resolved, unless waves=True" if passes else text


def _lines(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> dict[str, str]:
    """The lines of the summary, by subject."""
    each, fewest = _span(metrics.points, "d"), metrics.points_per_cell.min()
    law = "linear, one solve" if all(map(is_linear, scene.materials)) else "nonlinear, Newton"
    balance = f"theta = {scheme.theta:g}" if scheme.inertia else "quasi-static"
    return {
        "bodies": f"{_bodies(scene)}; {_around(scene)}",
        "sizes": f"{_sizes(metrics)} across; cells of {quantity(metrics.cell, 'm')}",
        "points": f"{metrics.points.sum()}, {each} a body, {fewest:.3g} or more per filled cell",
        "grid": f"{metrics.cells} cells, {metrics.unknowns} unknowns",
        "R/h": f"{metrics.resolution.min():.3g} smallest, {metrics.resolution.mean():.3g} mean; {_across(metrics)}",
        "dt c/h": f"{metrics.courant:.3g}, c = {metrics.wave:.4g} m/s" if metrics.inertia else "none without inertia",
        "driven": f"{metrics.lid_name}, {metrics.lid:.3g} h a step" if metrics.lid else metrics.lid_name or "nothing",
        "motion": _motion(metrics),
        "bulk": f"{_materials(metrics)}; {law}; {balance}",
        "contact": _contact(scene, metrics, scheme),
        "solver": f"{metrics.solver}, half bandwidth {metrics.half_bandwidth}",
        "memory": f"about {_bytes(metrics.memory)} besides the program",
    }


def _materials(metrics: SceneMetrics) -> str:
    """Small-strain moduli, whose units are a common mistake."""
    return f"E = {_span(metrics.young, '.4g')} Pa, nu = {_span(metrics.poisson, '.5g')}"


def _span(values: NDArray[Any], digits: str) -> str:
    low, high = values.min(), values.max()
    return f"{low:{digits}}" if low == high else f"{low:{digits}} to {high:{digits}}"


def _sizes(metrics: SceneMetrics) -> str:
    """Diameters of discs of the areas of deformable bodies, with units."""
    diameter = 2.0 * metrics.resolution * metrics.cell
    low, high = (quantity(float(each), "m") for each in (diameter.min(), diameter.max()))
    return low if low == high else f"{low} to {high}"


def _cost(metrics: SceneMetrics) -> str:
    """How long a step takes, and all of a run whose end is known."""
    size = (int(metrics.points.sum()), metrics.unknowns, metrics.half_bandwidth, metrics.solver)
    each = seconds_of_step(*size, touches=metrics.touches, inertia=metrics.inertia)
    if not np.isfinite(metrics.steps):
        return f"about {each:.1g} s a step"
    seconds = metrics.steps * each
    unit, name = next((u, name) for u, name in ((3600.0, "h"), (60.0, "min"), (0.0, "s")) if seconds >= u)
    return f"about {metrics.steps} steps of {each:.1g} s or more: {seconds / (unit or 1.0):.1g} {name}"


def _bodies(scene: Scene) -> str:
    free = f" ({scene.free_rigid.size} free)" if scene.free_rigid.size else ""
    return f"{len(scene.bodies)}, rigid {(~scene.deformable).sum()}{free}"


def _around(scene: Scene) -> str:
    """What acts on bodies: numbers of walls or the periodic box, numbers of supports, loads and springs."""
    box, springs = scene.periodic, f", springs {len(scene.springs)}" if scene.springs else ""
    walls = f"walls {len(scene.walls)}" if box is None else f"periodic box {box.width:.4g} x {box.height:.4g} m"
    return f"{walls}, supports {len(scene.supports)}, loads {len(scene.loads)}{springs}"


def _motion(metrics: SceneMetrics) -> str:
    if not metrics.touches:
        return "nothing else can touch it"
    if not metrics.inertia:
        return "from equilibrium to equilibrium, nothing falls without inertia"
    after = f", after falling by {metrics.fall:.3g} m" if metrics.fall else ""
    return f"{metrics.approach:.3g} h a step past each other{after}"


def _across(metrics: SceneMetrics) -> str:
    known = metrics.across[~np.isnan(metrics.across)]
    slit = f", {metrics.slit.min():.3g} the narrowest slit" if np.isfinite(metrics.slit).any() else ""
    return f"{known.min():.3g} cells across the thinnest part{slit}" if known.size else "no outlines"


def _contact(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> str:
    if not metrics.touches:
        return "of bodies with themselves only"
    cohesion = f", cohesion up to {metrics.cohesion:g} Pa" if metrics.cohesion else ""
    law = getattr(scheme.contact, "__name__", type(scheme.contact).__name__).replace("_", " ")
    return f"{'shared grid' if acts_at_grid_nodes(scheme.contact) else law}, {scene.frictions}{cohesion}"


def _bytes(number: float) -> str:
    return f"{number / 1e9:.2g} GB" if number >= 1e9 else f"{number / 1e6:.0f} MB"
