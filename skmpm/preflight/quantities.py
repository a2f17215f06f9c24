"""Quantities of a scene that `preflight` bounds, where one takes more than a line of the table of limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import ceil, floor, log10
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import KDTree

from skmpm import outline
from skmpm.arrays import ROUND_OFF, Array, Bools, Ints
from skmpm.contact import acts_at_grid_nodes
from skmpm.material import Material, NeoHookean, has_memory, is_linear, poisson_ratio, youngs_modulus
from skmpm.observe.bodies import diameters
from skmpm.outline.tips import tip_angles
from skmpm.outline.widths import inclined_thickness
from skmpm.points import Points
from skmpm.preflight.metrics import SceneMetrics
from skmpm.preflight.sampling import stress_errors
from skmpm.scene import TOUCHING, varies_in_time
from skmpm.step.driven import driven_by_force, prescribed_speeds
from skmpm.step.initial_state import initial_motion
from skmpm.step.regrid import torn_bodies
from skmpm.step.scene_forces import has_gravity
from skmpm.stepping.loading import gravity_of

CONFINED_POINTS = 3.5  # per cell; half a cell apart they are four, less a tenth at the boundary
MODERATE = 2.0  # stretch; rubber that softens at less has been fitted to smaller strains
STEPS = 1000  # over which the rotation of a spinning body is extrapolated


class Reading(NamedTuple):
    """Values of a quantity with their places: bodies by their numbers, anything else by its name.

    A body may have several values, and counts once.
    """

    places: Sequence[str] | Ints
    values: ArrayLike = 1.0  # (places,), or one for all
    scale: float = 1.0  # of what the text advises: a length or time that is as far from the limit as the value
    facts: Mapping[str, object] = {}  # named in the text; arrays have one for each place


def floored(value: float) -> str:
    """Two digits, rounded down, so that a value that follows the advice causes no warning."""
    return _two_digits(value, floor)


def ceiled(value: float) -> str:
    """Two digits, rounded up."""
    return _two_digits(value, ceil)


def _two_digits(value: float, rounded: Callable[[float], int]) -> str:
    unit = 10.0 ** (floor(log10(value)) - 1)
    return f"{rounded(value / unit) * unit:.2g}"


def idle(m: SceneMetrics) -> Reading | None:
    """The scene, if nothing moves and nothing acts."""
    moves = any(speed > 0.0 for _, speed in prescribed_speeds(m.scene))
    acted_on = moves or gravity_of(m.scene).any() or m.scene.overlap > 0.0
    return None if acted_on or not _left_alone(m) else Reading(["scene"])


def leaving_walls(m: SceneMetrics) -> Reading | None:
    """Walls that move away from bodies that nothing lets follow, if nothing else moves."""
    scene, gravity = m.scene, gravity_of(m.scene)
    v, n = scene.wall_velocities(0.0).T, scene.normals
    leaves = np.flatnonzero((v * n).sum(axis=0) < 0.0)
    moving = {name for name, speed in prescribed_speeds(scene) if speed > 0.0}
    if moving - {f"wall {i}" for i in leaves} or not _left_alone(m):
        return None
    away = leaves[(gravity @ n[:, leaves] > 0.0) | (not gravity.any())]
    return Reading([f"wall {i}" for i in away], facts={"x": v[0, away], "y": v[1, away]})


def weight(m: SceneMetrics) -> Reading | None:
    """Density times gravity times the height of what gravity moves, over Young's modulus of each deformable body."""
    scene, g = m.scene, gravity_of(m.scene)
    size, moved = float(np.hypot(*g)), scene.movable[scene.owner]
    if size == 0.0:
        return None
    height = float(np.ptp(g @ scene.initial_positions[:, moved])) / size
    pressure = float(scene.masses[moved].sum() / scene.initial_volumes[moved].sum()) * size * height
    return Reading(m.own, pressure / m.extremes(youngs_modulus)[0], facts={"weight": pressure})


def pulled_walls(m: SceneMetrics) -> Reading | None:
    """Walls that a constant force or pressure pulls away from bodies that do not cohere."""
    if m.cohesion > 0.0:
        return None
    given = {f"wall {i}": w.pressure if w.force is None else w.force for i, w in enumerate(m.scene.walls)}
    pulled = {name: by for name, by in given.items() if not callable(by) and by is not None and by < 0.0}
    return Reading([*pulled], facts={"by": np.array([*pulled.values()])})


def _left_alone(m: SceneMetrics) -> bool:
    """Whether bodies are at rest, and at most constant gravity and constant given motions act on them."""
    scene = m.scene
    forces = scene.loads or scene.springs or m.cohesion > 0.0 or any(driven_by_force(scene))
    return not (forces or varies_in_time(scene)) and m.at_rest


def inclined_parts(m: SceneMetrics) -> Reading:
    """Cells across the thinnest part that is inclined to the grid, of bodies wider than that."""
    scene, thin = m.scene, m.scene.deformable & (m.scene.thickness < 0.5 * diameters(m.scene))
    width = inclined_thickness(scene.outlines, m.boundary, thin)[m.own]
    return Reading(m.own, width / m.cell + m.chords, scale=m.cell)


def tips(m: SceneMetrics) -> Reading | None:
    """Angles of bodies that may meet others at their boundary points, over a cell to either side [degrees]."""
    if not m.touches or acts_at_grid_nodes(m.scheme.contact):
        return None
    boundary, x = m.scene.outlines, m.boundary
    at = np.flatnonzero(m.scene.deformable[boundary.body])
    angle = np.rad2deg(tip_angles(boundary, x, m.cell)[at])
    return Reading(boundary.body[at], angle, facts={"x": x[0, at], "y": x[1, at], "radius": f"{0.5 * m.cell:.3g}"})


def waves(m: SceneMetrics) -> Reading | None:
    """Cells that pressure waves travel in a given step, if it must resolve them.

    Functions of time without the end of the run do not tell whether it must.
    """
    known = m.until is not None or not varies_in_time(m.scene)
    needed = not m.chosen and m.scheme.inertia and m.loading.waves and known
    return Reading(["step"], m.courant, scale=m.dt) if needed else None


def pieces(m: SceneMetrics) -> Reading:
    """Bodies whose cells fall apart, with the number of pieces."""
    torn = torn_bodies(m.scene, m.grid)
    return Reading(torn, facts={"pieces": m.grid.pieces[torn], "better": _better_points(m)})


def stress_error(m: SceneMetrics) -> Reading:
    """Share by which a uniform stress is too small in bodies that hold together."""
    whole = ~np.isin(m.own, torn_bodies(m.scene, m.grid))
    error = stress_errors(m.scene, fitted=m.scheme.moment_fitting)[m.own]
    return Reading(m.own[whole], error[whole], facts={"better": _better_points(m)})


def _better_points(m: SceneMetrics) -> str:
    if not m.scheme.moment_fitting:
        return "use moment_fitting=True"
    edges, spacing = (f"{floored(factor * m.cell)} m" for factor in (1.2, 0.66))
    return f"use mesh edges of {edges} (from_mesh, order 2), a spacing of {spacing} or a larger cell"


def nu(m: SceneMetrics) -> Reading:
    """Poisson's ratio of each body, the largest of its materials."""
    return Reading(m.own, m.extremes(poisson_ratio)[1])


def confined(m: SceneMetrics) -> Reading | None:
    """Poisson's ratios of bodies with few points that contacts or a pressure may confine."""
    if not (m.touches or m.scene.pressures):
        return None
    few = m.points_per_cell < CONFINED_POINTS
    facts = {"points": CONFINED_POINTS, "spacing": floored(0.5 * m.cell)}
    return Reading(m.own[few], np.asarray(nu(m).values)[few], facts=facts)


def made_of(m: SceneMetrics, kind: Callable[[Material], bool], values: ArrayLike = 1.0, **facts: object) -> Reading:
    """Deformable bodies that have a material of a kind, with their values of those of all (deformable,)."""
    every = ((k, material) for k, b in enumerate(m.own.tolist()) for material in m.scene.bodies[b].materials)
    named = {k: type(material).__name__ for k, material in every if kind(material)}
    found, material = np.array([*named], dtype=np.int64), np.array([*named.values()])
    return Reading(m.own[found], np.broadcast_to(values, m.own.shape)[found], facts=facts | {"material": material})


def softening(m: SceneMetrics) -> Reading:
    """Stretches at which the stress of elastic materials is largest, of bodies whose stress has a peak."""
    peak = {material: stretch_of_peak(material) for material in m.scene.materials}
    return made_of(m, lambda material: np.isfinite(peak[material]), m.extremes(peak.__getitem__)[0])


def stretch_of_peak(material: Material) -> float:
    """Stretch l at which the stress dW/dl of diag(l, 1/l) is largest, up to `MODERATE`; inf if it grows.

    As long as it grows, incompressible materials are elliptic there: l^2 W'' + 2 (l^2 - 1) W' l / (l^4 - 1) > 0
    (Dowaikh & Ogden, IMA J. Appl. Math. 44, 1990). Stress of neo-Hookean and small-strain laws grows; of materials
    with memory, and where energies are infinite, nothing is said.
    """
    if type(material) is NeoHookean or is_linear(material) or has_memory(material):
        return np.inf
    stretch, zero = np.linspace(1.0, MODERATE, 101), np.zeros(101)
    with np.errstate(all="ignore"):
        P = np.asarray(material.stress(np.array([[stretch, zero], [zero, 1.0 / stretch]])))
        falls = np.diff(P[0, 0] - P[1, 1] / stretch**2) < 0.0
    return float(stretch[np.argmax(falls)]) if falls.any() else np.inf


def rotation(m: SceneMetrics) -> Reading:
    """Rotations of bodies at small strain that spin, in many steps or until their grids are built again [rad]."""
    _, C = initial_motion(m.scene)
    turn = np.maximum.reduceat(0.5 * m.dt * np.abs(C[1, 0] - C[0, 1]), m.scene.offsets[:-1])
    return made_of(m, is_linear, np.minimum(STEPS * turn, m.scheme.anchor)[m.own], steps=STEPS)


def possible_rotation(m: SceneMetrics) -> Reading | None:
    """Rotations of bodies at small strain by others, up to that at which their grids are built again [rad]."""
    rough = m.touches and m.scene.frictions.largest > 0.0
    if not rough and m.points.size <= 2:
        return None
    return made_of(m, is_linear, m.scheme.anchor, cause="friction" if rough else "its neighbours")


def of_pair(bodies: Ints, low: Array, high: Array) -> Reading:
    """The largest ratio between different bodies, of the largest value in one and the smallest in the other (n,)."""
    smallest, largest = np.argsort(low)[:2].tolist(), np.argsort(high)[-2:].tolist()
    ratio, a, b = max(((high[b] / low[a], a, b) for a in smallest for b in largest if a != b), default=(1.0, 0, 0))
    return Reading([f"bodies {bodies[a]} and {bodies[b]}"], ratio)


def densities(m: SceneMetrics) -> Reading:
    """The largest ratio between densities of different bodies that forces move."""
    start, movable = m.scene.offsets[:-1], np.flatnonzero(m.scene.movable)
    low, high = (f.reduceat(m.scene.densities, start)[movable] for f in (np.minimum, np.maximum))
    return of_pair(movable, low, high)


def layers(m: SceneMetrics) -> Reading:
    """Thicknesses [cells] of groups that share cells with others; interfaces on grid lines cost nothing."""
    found = dict[str, float]()
    for b in np.flatnonzero(m.scene.composite).tolist():
        points = m.scene.bodies[b].points
        group = np.asarray(points.group)
        for name in np.unique(group).tolist():
            if shares_cells(points.x / m.cell, group == name):
                found[f"group {name!r} of body {b}"] = _thickness(points, group == name) / m.cell
    return Reading([*found], [*found.values()], scale=m.cell)


def shares_cells(x: Array, own: Bools) -> bool:
    """Whether a cell holds points x (2, n) [cells] of a group and others."""
    cells = np.floor(x + ROUND_OFF).astype(np.int64)
    _, of = np.unique(cells, axis=1, return_inverse=True)
    inside, outside = (np.bincount(of.ravel(), mask) > 0 for mask in (own, ~own))
    return bool((inside & outside).any())


def _thickness(points: Points, own: Bools) -> float:
    """Largest sum of distances of a point of a group to another group on one side and to that or the boundary [m].

    Interfaces lie halfway between points of the two groups.
    """
    at, boundary = points.x[:, own].T, points.x[:, np.concatenate([[], *points.outline]).astype(int)]
    to_others = KDTree(points.x[:, ~own].T).query(at)[0] - 0.5 * np.sqrt(np.median(points.volume))
    return float(np.max(to_others + np.minimum(to_others, KDTree(boundary.T).query(at)[0])))


def peeling(m: SceneMetrics) -> Reading | None:
    """Range of cohesion over the opening c h / E at points that bear c where stress at the boundary scatters."""
    if m.cohesion == 0.0:
        return None
    reach = max(m.scene.cohesion_range / m.cell, TOUCHING)  # [cells]
    return Reading(m.own, reach * m.extremes(youngs_modulus)[0] / m.cohesion, scale=reach * m.cell)


def covered_points(m: SceneMetrics) -> Reading | None:
    """Boundary points on either side of a contact of a body without corners that the range of cohesion covers."""
    if m.cohesion == 0.0:
        return None
    boundary, bodies = m.scene.outlines, m.points.size
    smooth = np.bincount(boundary.body, outline.curve(boundary, m.boundary).corner, bodies)[m.own] == 0
    count = np.bincount(boundary.body, minlength=bodies)[m.own]
    spacing = outline.perimeter(boundary, m.boundary, bodies)[m.own] / count
    half_width = np.sqrt(2.0 * m.resolution * m.cell * m.scene.cohesion_range)
    return Reading(m.own[smooth], (half_width / spacing)[smooth])


def endless_fall(m: SceneMetrics) -> Reading | None:
    """Gravity along the directions of a periodic box in which nothing holds bodies: no walls, or smooth ones."""
    scene, (x, y) = m.scene, gravity_of(m.scene)
    if scene.periodic is None or scene.supports or scene.springs or not scene.movable.all():
        return None
    free = scene.periodic.box.T @ (x, y) if scene.walls else np.array([x, y])
    if (scene.frictions.at_walls > 0.0).any() or not free.any():
        return None
    return Reading(["periodic"], facts={"x": x, "y": y})


def tension(m: SceneMetrics) -> Reading | None:
    """Tension that moves a periodic box in which nothing coheres [Pa]."""
    periodic = m.scene.periodic
    if periodic is None or m.cohesion > 0.0:
        return None
    pull = float(periodic.stress_at(0.0)[np.equal(*periodic.components)].max(initial=0.0))
    return Reading(["periodic"], pull, facts={"pull": pull})


def lasting_contact(m: SceneMetrics) -> Reading | None:
    """The scheme, if it is not backward Euler where more than two things touch, or something presses them."""
    scene = m.scene
    pressed = has_gravity(scene) or scene.loads or scene.springs
    things = m.points.size + len(scene.walls) + len(scene.supports)
    lasts = m.touches and (pressed or things > 2)
    return choice(m) if lasts and m.scheme.theta < 1.0 else None


def choice(m: SceneMetrics) -> Reading:
    """What was chosen in the scheme."""
    return Reading(["scheme"], facts={"theta": m.scheme.theta, "anchor": m.scheme.anchor})


def approach(m: SceneMetrics) -> Reading:
    """Cells by which bodies may move past each other in a step."""
    fallen = f" after falling by {m.fall:.3g} m" if m.fall else ""
    return Reading(["bodies"], m.approach, facts={"fallen": fallen})
