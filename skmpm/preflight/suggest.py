"""Cell, spacing and time step for a wanted error, from laws fitted to the runs of docs/studies/work_precision.md."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from skmpm.arrays import ROUND_OFF, Array, Bools
from skmpm.material import poisson_ratio, youngs_modulus
from skmpm.observe.bodies import diameters
from skmpm.outline.curve import CORNER_COSINE
from skmpm.outline.measures import turning_angles
from skmpm.outline.widths import inclined_thickness, slit_width
from skmpm.points import Points
from skmpm.preflight.limits import LIMITS
from skmpm.preflight.quantities import ceiled, shares_cells
from skmpm.representation import line, quantity
from skmpm.scene import Body, Scene, check_scene, varies_in_time
from skmpm.scheme import Scheme
from skmpm.step.algorithm import SHORTEST, check_time
from skmpm.step.initial_state import check_scheme
from skmpm.stepping.functions_of_time import TIMES
from skmpm.stepping.loading import Loading, loading_of, several, smallest_radii
from skmpm.stepping.step_length import MAX_APPROACH, STROKE

LARGEST = 0.25  # error; coarser resolutions were not measured
RESOLUTIONS = np.geomspace(3.2, 100.0, 100)  # R/h to choose from
# Cells across a thin part, and the error of its deflection then at 45 degrees to the grid and nu = 0.499, of finite
# elements 2.8 %, which falls by 3 from 4 to 8; at nu = 0.3 it is two thirds, along the grid a third of that.
THIN_CELLS, THIN_ERROR, THIN_POWER = 8.0, 0.032, 1.57
SHARPEST = 0.25  # radius of an arc over that of a disc: for an error of 2 % it needs R/h = 107, a sharper one more
WORK = 2.5  # a step costs (R/h)^2.5: unknowns times bandwidth, and contacts


@dataclass(frozen=True)
class Law:
    """error = c n^-p + d s: n = R/h, R the radius of the smallest body, s the length of a step.

    R is that of a disc of the same area or of a sharper arc, in bending twice the least radius of gyration, which is
    that of a disc, too.
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
    "packing": (Law(0.74, 1.35, 2.0, 0.79),),
}


@dataclass(frozen=True, repr=False)
class Suggestion:
    """Cell, spacing of points and time step for a wanted error, and the kind of the scene; printed as a sentence.

    Attributes
    ----------
    cell : side of the grid cells, for `Scene.cell` [m]
    spacing : distance between material points, for `disc` and `box` [m]
    dt : time step [s]; None where nothing limits it, as of equilibrium under constant loads
    kind : "bending", "pressing", "impact", "packing" or "pour"
    why : the reason for the kind and the time step

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> floor = skmpm.Wall((0, -1e-3), (0, 1))
    >>> scene = skmpm.Scene([body], cell=4e-4, walls=[floor], gravity=(0, -9.81))
    >>> choice = skmpm.suggest(scene, error=0.05)
    >>> choice.kind
    'pour'
    >>> choice.spacing < choice.cell
    True
    >>> str(choice)[:30]
    'pour: gravity lets bodies fall'
    """

    cell: float
    spacing: float
    dt: float | None
    kind: str
    why: str

    def __repr__(self) -> str:
        facts = {"": self.kind, "cell": quantity(self.cell, "m"), "spacing": quantity(self.spacing, "m")}
        return line("Suggestion", facts | {"dt": "any" if self.dt is None else quantity(self.dt, "s")})

    def __str__(self) -> str:
        """The suggestion as a sentence."""
        return f"{self.kind}: {self.why}; use cell = {self.cell:.3g} m, spacing = {self.spacing:.3g} m," + (
            " any dt" if self.dt is None else f" dt = {self.dt:.3g} s"
        )


def suggest(
    scene: Scene,
    *,
    error: float,
    scheme: Scheme = Scheme(),  # noqa: B008
    until: float | None = None,
) -> Suggestion:
    """The cheapest cell, spacing of points and time step for an error, with `Scheme.balanced()`.

    Parameters
    ----------
    scene : the scene
    error : wanted relative error, above zero
    scheme : how steps are solved; without inertia nothing vibrates or falls
    until : end of the run [s], for scenes with functions of time, whose largest values count

    Returns
    -------
    cell, spacing and time step

    Raises
    ------
    ValueError
        if the error is larger than those measured, or so small that a body would be 200 cells across, or if the scene
        has functions of time and `until` is not given

    Notes
    -----
    The error is relative: the largest of those that the study work_precision measures on its scene of that kind.
    *Bending*, without contact: deflection and stress. *Pressing*, few bodies that touch: force and width of contacts.
    *Impact*, bodies with initial velocities: velocities afterwards. *Packing*, six or more bodies that are driven:
    pressure, work and aspect ratio. *Pour*, bodies that fall: as packing, or pressing if few. Only materials,
    sizes, gravity and motion are used, not the scene's own cell and points. In impacts, and if nothing is
    driven, dt resolves waves; otherwise it follows from the displacement per step. Where `preflight` would warn, the
    cell or the step is smaller than needed for the error. For four scenes that are not in the study the error is less
    than twice the wanted one (`examples/studies/work_precision/promises.py`). In contact, bodies with parts thinner
    than the radius of a disc of their area, as lips and rings, have cells enough for the error of their deflection.
    Interfaces of materials cost at most the error where they lie inside cells; where they lie on grid lines of the
    scene's own cell, the cell is a fraction of it. Points are at most half a cell apart for Poisson's ratios above
    0.48. In pressing, convex arcs of outlines, as the tips of ellipses and lips, have cells enough for discs of their
    radii, whether others touch them or not. Arcs of less than a quarter of R count as corners, where cells do not
    resolve the contact. Arcs are found where the given outline turns at three successive points or more.

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> floor = skmpm.Wall((0, -1e-3), (0, 1))
    >>> scene = skmpm.Scene([body], cell=4e-4, walls=[floor], gravity=(0, -9.81))
    >>> choice = skmpm.suggest(scene, error=0.05)
    >>> choice.kind
    'pour'
    """
    check_scene("suggest", scene)
    check_scheme("suggest", scheme)
    loading = loading_of(scene, _times(scene, until), inertia=scheme.inertia)
    disc = 0.5 * diameters(scene)[scene.deformable]
    slender = scene.thickness[scene.deformable] < disc  # with a part that bends: strips, lips, rings
    radius, measured = disc, ~slender
    if loading.kind == "bending":
        radius, measured = smallest_radii(scene), np.ones_like(measured)
    paced = scheme.inertia or not loading.waves
    kind = loading.kind
    if kind == "pour":
        kind = "packing" if several(scene) else "pressing"
    laws = LAWS[kind]
    found = [best for law in laws if (best := _cheapest(law, error, paced)) is not None]
    if not found:
        least = min(float(law(RESOLUTIONS[-1], 0.0)) for law in laws)
        raise ValueError(f"suggest: error = {error!r}; use one between {ceiled(1.01 * least)} and {LARGEST}")
    _, n, spacing, stride = min(found)
    rounded = _arc_radii(scene)[scene.deformable] if kind == "pressing" else radius
    sharper = (SHARPEST * radius < rounded) & (rounded < radius * (1.0 - ROUND_OFF))
    radius, measured = np.where(sharper, rounded, radius), measured | sharper
    size = float(radius.min())
    cell = float(min(radius[measured].min(initial=np.inf) / n, _coarsest(scene, error, disc, slender)))
    cell = _with_interfaces(scene, cell, error)
    if max(map(poisson_ratio, scene.materials)) > LIMITS["nu with few points"].value:
        spacing = min(spacing, 0.5)
    longest = [stride * size / loading.speed] if paced else []
    dt = min([*longest, *_longest(scene, loading, cell, scheme), *([] if until is None else [until])], default=None)
    paces = "dt resolves waves" if loading.waves else "dt follows from the displacement per step"
    arcs = f", and cells resolve arcs of radius {size:.3g} m" if sharper[np.argmin(radius)] else ""
    why = f"{loading.why}, so {paces if paced else 'nothing limits dt'}{arcs}"
    return Suggestion(cell, spacing * cell, dt, loading.kind, why)


def _times(scene: Scene, until: float | None) -> Array:
    """Times of a run at which functions of time are evaluated [s]."""
    if until is None:
        if varies_in_time(scene):
            raise ValueError("suggest: the scene has functions of time; give until, the end of the run in seconds")
        return np.zeros(1)
    check_time("suggest: until", until, SHORTEST, "the end of the run")
    return np.linspace(0.0, until, TIMES)


def _coarsest(scene: Scene, error: float, radius: Array, slender: Bools) -> float:
    """The largest cell without warnings of `preflight`, and in which slender bodies bend with at most this error [m].

    `radius` (deformable,) [m] are those of discs of the areas of the bodies.
    """
    boundary, own, count = scene.outlines, scene.deformable, len(scene.bodies)
    x, thin_bodies = scene.initial_positions[:, boundary.point], np.zeros(count, dtype=bool)
    thin_bodies[own] = slender
    slit, inclined = slit_width(boundary, x, count)[own], inclined_thickness(boundary, x, thin_bodies)
    limit = LIMITS["R/h" if scene.can_touch else "R/h alone"].value
    thin = LIMITS["thin part"].value
    enough = max(thin, THIN_CELLS * (THIN_ERROR / error) ** (1.0 / THIN_POWER))
    thinnest = np.nanmin(scene.thickness[own] / np.where(slender, enough, thin), initial=np.inf)
    inclined_enough = LIMITS["inclined thin part"].value
    return float(
        min(radius.min() / limit, thinnest, slit.min() / LIMITS["slit"].value, inclined.min() / inclined_enough)
    )


def _arc_radii(scene: Scene) -> Array:
    """Smallest radii of arcs of outlines that are convex and smooth, (bodies,) [m]; inf without one.

    On an arc the boundary turns at three successive points or more, at each by less than at a corner.
    """
    boundary, least = scene.outlines, np.full(len(scene.bodies), np.inf)
    x = scene.initial_positions[:, boundary.point]
    length, turn = np.hypot(*(x[:, boundary.next] - x)), turning_angles(boundary, x)
    smooth = (turn > 0.0) & (np.cos(turn) >= CORNER_COSINE)
    bend = 4.0 * np.sin(0.5 * turn) / (length + length[boundary.previous])
    radius = np.divide(1.0, bend, out=np.full(turn.size, np.inf), where=smooth)
    arc = np.maximum(radius, np.maximum(radius[boundary.previous], radius[boundary.next]))
    np.minimum.at(least, boundary.body, arc)
    return least


def _with_interfaces(scene: Scene, cell: float, error: float) -> float:
    """The largest cell up to one at which interfaces of materials cost at most this error [m].

    If interfaces lie on grid lines of the scene's own cell, it is a fraction of that.
    """
    parts = [(body.points, E) for body in scene.bodies if np.ptp(E := _moduli(body)) > 0.0]
    if not parts:
        return cell
    if not any(shares_cells(points.x / scene.cell, e == E) for points, E in parts for e in np.unique(E)):
        return scene.cell / float(np.ceil(scene.cell / cell * (1.0 - ROUND_OFF)))
    return min(cell, *(error / lost for points, E in parts if (lost := _smeared(points, E)) > 0.0))


def _moduli(body: Body) -> Array:
    """Young's moduli of points, (n,) [Pa]; zero in rigid bodies."""
    E = np.zeros(body.points.size)
    for material, own in body.parts:
        E[own] = youngs_modulus(material)
    return E


def _smeared(points: Points, E: Array) -> float:
    """Share of the compliance of a body that it loses by interfaces inside cells, over the side of these [1/m].

    A cell that an interface divides into a soft and a stiff part, strained alike instead of in series, is short of at
    most (1 - sqrt(E / E'))^2 of the soft part's compliance, wherever the interface lies.
    """
    compliance, spacing, lost = points.volume / E, float(np.sqrt(points.volume.mean())), 0.0
    for modulus in np.unique(E)[:-1]:
        soft, stiff = modulus == E, modulus < E
        distance, nearest = KDTree(points.x[:, stiff].T).query(points.x[:, soft].T)
        loss = (1.0 - np.sqrt(modulus / E[stiff][nearest])) ** 2
        lost += float((distance < 2.5 * spacing) @ (loss * compliance[soft]))  # of two layers of points
    return lost / float(compliance.sum()) / (2.0 * spacing)


def _longest(scene: Scene, loading: Loading, cell: float, scheme: Scheme) -> list[float]:
    """The longest steps without warnings of `preflight` [s]."""
    limits = [(LIMITS["dt c/h"].value, scene.fastest_wave)] if scheme.inertia and loading.waves else []
    if scene.can_touch:
        limits += [(STROKE, loading.driven), (MAX_APPROACH, loading.approach if scheme.inertia else 0.0)]
    return [value * cell / speed for value, speed in limits if speed > 0.0]


def _cheapest(law: Law, error: float, paced: bool) -> tuple[float, float, float, float] | None:
    """Cost, R/h, spacing [cells] and length of a step that reach an error at least cost; None if none does.

    If the scene is not paced, the length of steps does not matter.
    """
    room = error - law(RESOLUTIONS, 0.0)
    enough = room > 0.0
    if not (enough.any() and error <= LARGEST):
        return None
    n, step = RESOLUTIONS[enough], room[enough] / law.time
    cost = n**WORK * (1.0 + 0.5 / law.spacing**2) / (step if paced else 1.0)
    k = int(np.argmin(cost))
    return float(cost[k]), float(n[k]), law.spacing, float(step[k])
