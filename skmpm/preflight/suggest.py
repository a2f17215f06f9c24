"""Cell, spacing and time step for a wanted error, from laws fitted to the runs of docs/studies/work_precision.md."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.material import poisson_ratio
from skmpm.outline import slit_width, thickness
from skmpm.preflight.limit import rounded_up
from skmpm.preflight.limits import APPROACH, CONFINED, COURANT, LID, RESOLUTION, SLIT, SMALLEST, THIN
from skmpm.scene import Scene, check_scene
from skmpm.simulate.initial_state import can_touch
from skmpm.simulate.loading import SEVERAL, Loading, loading_of, smallest_radii

Array = NDArray[np.float64]

LARGEST = 0.25  # error; coarser resolutions were not measured
RESOLUTIONS = np.geomspace(3.2, 100.0, 100)  # R/h to choose from
# Cells across a thin part, and the error of its deflection then at 45 degrees to the grid, 2.3 % at nu = 0.3 and 4.6
# at 0.499, which falls by 3 from 4 to 8; along the grid it is a third of that (`THIN`).
THIN_CELLS, THIN_ERROR, THIN_POWER = 8.0, 0.032, 1.57
WORK = 2.5  # a step costs (R/h)^2.5: unknowns times bandwidth, and contacts


@dataclass(frozen=True)
class Law:
    """error = c n^-p + d s: n = R/h, R the radius of the smallest body, s the length of a step.

    s is dt c / R in impacts and free motion, c the speed of pressure waves; otherwise the displacement of the driven
    object over R.
    For `Scheme.balanced()`, whose backward Euler is of first order.
    """

    spacing: float  # of material points [cells]
    scale: float  # c
    power: float  # p
    time: float  # d

    def __call__(self, n: Array | float, s: Array | float) -> Array:
        """The error."""
        return np.asarray(self.scale * np.asarray(n) ** -self.power + self.time * np.asarray(s))


LAWS = {
    "bending": (Law(0.5, 0.45, 0.95, 0.37),),
    "pressing": (Law(0.74, 2.6, 1.63, 0.37),),
    "impact": (Law(0.74, 0.27, 1.32, 0.37), Law(0.5, 0.57, 1.8, 0.37)),
    "packing": (Law(0.74, 0.245, 2.0, 0.79),),
}


@dataclass(frozen=True)
class Suggestion:
    """Cell, spacing of points and time step for a wanted error, and the kind of the scene; printed as a sentence.

    Attributes
    ----------
    cell : side of the grid cells, for `Scene.cell` [m]
    spacing : of material points, for `disc` and `box` [m]
    dt : time step [s]
    kind : "bending", "pressing", "impact", "packing" or "pour"
    why : the reason for the kind and the time step
    """

    cell: float
    spacing: float
    dt: float
    kind: str
    why: str

    def __str__(self) -> str:
        """The suggestion as a sentence."""
        return (
            f"{self.kind}: {self.why}; use cell = {self.cell:.3g} m, spacing = {self.spacing:.3g} m,"
            f" dt = {self.dt:.3g} s"
        )


def suggest(scene: Scene, *, error: float) -> Suggestion:
    """The cheapest cell, spacing of points and time step for an error, with `Scheme.balanced()`.

    The error is relative: the largest of those that the study work_precision measures on its scene of that kind.
    *Bending*, without contact: deflection and stress. *Pressing*, few bodies that touch: force and width of contacts.
    *Impact*, bodies with initial velocities: velocities afterwards. *Packing*, six or more bodies that are driven:
    pressure, work and aspect ratio. *Pour*, bodies that fall: as packing, or pressing if few. Only materials,
    sizes, gravity and motion at t = 0 are used, not the scene's own cell and points. In impacts, and if nothing is
    driven, dt resolves waves; otherwise it follows from the displacement per step. Where `preflight` would warn, the
    cell or the step is smaller than needed for the error. For four scenes that are not in the study the error is less
    than twice the wanted one (`examples/studies/work_precision/promises.py`). The walls of hollow bodies have cells
    enough for the error of their bending. Points are at most half a cell apart
    for Poisson's ratios above 0.49.

    Raises
    ------
    ValueError
        if the error is larger than those measured, or so small that a body would be 200 cells across
    """
    check_scene("suggest", scene)
    loading, size = loading_of(scene), float(smallest_radii(scene).min())
    laws = LAWS[_measured_as(scene, loading.kind)]
    found = [best for law in laws if (best := _cheapest(law, error)) is not None]
    if not found:
        least = min(float(law(RESOLUTIONS[-1], 0.0)) for law in laws)
        raise ValueError(f"suggest: error = {error!r}; use one between {rounded_up(1.01 * least)} and {LARGEST}")
    _, n, spacing, stride = min(found)
    cell = min(size / n, _coarsest(scene, error))
    spacing = min(spacing, 0.5) if max(map(poisson_ratio, scene.materials)) > CONFINED.value else spacing
    dt = min(stride * size / loading.speed, _longest(scene, loading, cell))
    paced = "dt resolves waves" if loading.waves else "dt follows from the displacement per step"
    return Suggestion(cell, spacing * cell, dt, loading.kind, f"{loading.why}, so {paced}")


def _measured_as(scene: Scene, kind: str) -> str:
    """The key of `LAWS` for a kind."""
    if kind == "pour":
        return "packing" if scene.deformable.sum() >= SEVERAL else "pressing"
    return kind


def _coarsest(scene: Scene, error: float) -> float:
    """The largest cell without warnings of `preflight`, and in which thin parts bend with at most this error [m].

    Thin parts are those of bodies that are wider, as rings; of beams the law of the kind takes care.
    """
    boundary, own, count = scene.outlines, scene.deformable, len(scene.bodies)
    radius = np.sqrt(np.bincount(scene.owner, scene.initial_volumes, count) / np.pi)[own].min()
    across, slit = (
        f(boundary, scene.initial_positions[:, boundary.point], count)[own] for f in (thickness, slit_width)
    )
    limit = (RESOLUTION if can_touch(scene) else SMALLEST).value
    thin = across < smallest_radii(scene)
    cells = np.where(
        thin, np.maximum(THIN.value, THIN_CELLS * (THIN_ERROR / error) ** (1.0 / THIN_POWER)), THIN.value
    )
    thinnest = np.min((across / cells)[~np.isnan(across)], initial=np.inf)
    return float(min(radius / limit, thinnest, slit.min() / SLIT.value))


def _longest(scene: Scene, loading: Loading, cell: float) -> float:
    """The longest step without warnings of `preflight` [s]."""
    limits = [(COURANT.value, scene.fastest_wave if loading.waves else 0.0)]
    if can_touch(scene):
        limits += [(LID.value, loading.driven), (APPROACH.value, loading.approach)]
    return min((value * cell / speed for value, speed in limits if speed > 0.0), default=float("inf"))


def _cheapest(law: Law, error: float) -> tuple[float, float, float, float] | None:
    """Cost, R/h, spacing [cells] and length of a step that reach an error at least cost; None if none does."""
    room = error - law(RESOLUTIONS, 0.0)
    enough = room > 0.0
    if not (enough.any() and error <= LARGEST):
        return None
    n, step = RESOLUTIONS[enough], room[enough] / law.time
    cost = n**WORK * (1.0 + 0.5 / law.spacing**2) / step
    k = int(np.argmin(cost))
    return float(cost[k]), float(n[k]), law.spacing, float(step[k])
