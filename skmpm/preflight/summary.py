"""The preflight check: a summary of a run before it starts, and warnings outside the verified range."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skmpm.preflight.limits import warnings_of
from skmpm.preflight.metrics import SceneMetrics, examine, first_step
from skmpm.scene import Scene, check_scene, prescribed_motions
from skmpm.scheme import Scheme
from skmpm.simulate.loading import loading_of
from skmpm.simulate.step_length import MAX_APPROACH

PAGE = "docs/how_to/warnings.md"


def preflight(scene: Scene, dt: float | None = None, *, scheme: Scheme = Scheme()) -> str:  # noqa: B008
    """Summary of a run as text: sizes, resolution, motion per step, solver, memory, warnings.

    Without dt [s], motions per step are those of the first step that `simulate` chooses by what acts at t = 0.

    Body grids are built, nothing is solved. Motions are those at t = 0, including what bodies gain by falling. A line
    that begins with ``!`` is a warning: object, value, what was verified, the remedy and, in brackets, the section
    docs/how_to/warnings.md that explains it.

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
    metrics = examine(scene, step, scheme)
    if dt is None:  # chosen steps resolve waves where they matter, and are shorter once bodies have fallen
        metrics = replace(metrics, waves=False, approach=min(metrics.approach, MAX_APPROACH), fall=0.0)
    chosen = {"step": _chosen(scene, step, scheme)} if dt is None else {}
    lines = [f"{name:8s}  {text}" for name, text in {**_lines(metrics), **chosen}.items()]
    warnings = [f"! {text} [{topic}]" for topic, text in warnings_of(scene, metrics, scheme)]
    if warnings:
        warnings.append(f"about [...]: sections of {PAGE}")
    return "\n".join([*lines, *(warnings or ["no warnings"])])


def _chosen(scene: Scene, step: float, scheme: Scheme) -> str:
    """The step, and whether all resolve waves; what moves by functions of time may do so later only."""
    loading, text = loading_of(scene), f"chosen, {step:.3g} s at first"
    driving = (each for wall in scene.walls for each in (wall.force, wall.pressure))
    stress = None if scene.periodic is None else scene.periodic.stress
    moving = (scene.gravity, stress, *driving, *prescribed_motions(scene))
    resolved = scheme.inertia and loading.every_step and not any(callable(each) for each in moving)
    return f"{text}; all resolve waves: {loading.why}" if resolved else text


def _lines(metrics: SceneMetrics) -> dict[str, str]:
    """The lines of the summary, by subject."""
    each, fewest = _span(metrics.points, "d"), metrics.points_per_cell.min()
    around = ", ".join(f"{name} {number}" for name, number in metrics.around.items())
    law = "linear, one solve" if metrics.linear else "nonlinear, Newton"
    balance = f"theta = {metrics.theta:g}" if metrics.inertia else "quasi-static"
    return {
        "bodies": f"{metrics.points.size}, rigid {metrics.rigid}{_free(metrics)}; {around}",
        "points": f"{metrics.points.sum()}, {each} a body, {fewest:.3g} or more per filled cell",
        "grid": f"{metrics.cells} cells of {metrics.cell:.6g} m, {metrics.unknowns} unknowns",
        "R/h": f"{metrics.resolution.min():.3g} smallest, {metrics.resolution.mean():.3g} mean; {_across(metrics)}",
        "dt c/h": f"{metrics.courant:.3g}, c = {metrics.wave:.4g} m/s" if metrics.inertia else "none without inertia",
        "driven": f"{metrics.lid_name}, {metrics.lid:.3g} h a step" if metrics.lid else metrics.lid_name or "nothing",
        "motion": _motion(metrics),
        "bulk": f"{_materials(metrics)}; {law}; {balance}",
        "contact": _contact(metrics),
        "solver": f"{metrics.solver}, half bandwidth {metrics.half_bandwidth}",
        "memory": f"about {_bytes(metrics.memory)} besides the program",
    }


def _materials(metrics: SceneMetrics) -> str:
    """Small-strain moduli, whose units are a common mistake."""
    return f"E = {_span(metrics.young, '.4g')} Pa, nu = {_span(metrics.poisson, '.5g')}"


def _span(values: NDArray[Any], digits: str) -> str:
    low, high = values.min(), values.max()
    return f"{low:{digits}}" if low == high else f"{low:{digits}} to {high:{digits}}"


def _free(metrics: SceneMetrics) -> str:
    return f" ({metrics.free_rigid} free)" if metrics.free_rigid else ""


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


def _contact(metrics: SceneMetrics) -> str:
    if not metrics.touches:
        return "of bodies with themselves only"
    cohesion = f", cohesion up to {metrics.cohesion:g} Pa" if metrics.cohesion else ""
    return f"{metrics.contact}, {metrics.frictions}{cohesion}"


def _bytes(number: float) -> str:
    return f"{number / 1e9:.2g} GB" if number >= 1e9 else f"{number / 1e6:.0f} MB"
