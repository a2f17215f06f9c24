"""The verified range, and warnings for scenes outside it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product

import numpy as np
from numpy.typing import NDArray

from skmpm.contact import acts_at_grid_nodes
from skmpm.implicit.residual import LONG
from skmpm.material import has_memory, is_linear, poisson_ratio, youngs_modulus
from skmpm.preflight.cohesion import cohesion_warnings
from skmpm.preflight.layers import layer_warnings
from skmpm.preflight.limit import Limit, above, below, rounded_down
from skmpm.preflight.metrics import SceneMetrics
from skmpm.preflight.periodic import periodic_warnings
from skmpm.preflight.rolling import rolling_warnings
from skmpm.scene import Pressure, Scene
from skmpm.scheme import NEARLY_INCOMPRESSIBLE, Scheme
from skmpm.simulate.initial_state import initial_motion
from skmpm.simulate.rigid_edges import MIN_EDGE_RADIUS, facing_edges
from skmpm.simulate.step_length import MAX_APPROACH, STROKE

# In the order of the checks; beside each limit, its test or page of docs/.
RESOLUTION = Limit(3.2, "piles and packings were verified from 3.2 on, Hertz's force from 5 on")  # test_pile
SMALLEST = Limit(1.0, "bodies were verified from R/h = 2 on")  # test_corners, unlike discs
THIN = Limit(
    4.0, "along the grid strips of 1, 2, 4, 8 cells bend by up to 36, 13.8, 2.2, 0.8 % too little"
)  # test_thin_parts
SLIT = Limit(2.0, "slits of 0.5, 1, 1.5, 2, 3 cells open by up to 91, 90, 86, 8, 8 % too little")  # test_slits
FEWEST = Limit(1.8, "verified from 1.8 on; with 1.3 a uniform stress was too small by up to 66 %")  # test_sampling
# Of 1,500 discs and boxes with points 0.74 h apart six are beyond; with 0.66 h 0.009 is the most.
SOFTENING = Limit(0.03, "a spacing of 0.66 h leaves at most 0.01")  # test_sampling
COURANT = Limit(LONG, "verified up to 15 where waves matter")  # test_dynamics, stability
EXPLICIT = Limit(0.7, "explicit steps are stable up to 0.7 for any position on the grid")  # test_explicit
LID = Limit(STROKE, "verified for lids of packings that move by 0.08 to 0.14")  # test_interpenetration, R/h = 5 and 8
APPROACH = Limit(MAX_APPROACH, "collisions were verified up to 0.2, beyond 1 a step fails")  # test_collision
LOCKING = Limit(
    NEARLY_INCOMPRESSIBLE,
    "at 0.4, 0.45, 0.49 a disc of R/h = 5 is 8, 10, 22 % too stiff, the peak pressure 1.4, 1.9, 4.2 times too high",
)  # test_mean_dilatation
FLOW = "plastic flow locks: a notched bar had no limit load, but forces 21 % above it and more"  # test_plastic_flow
POISSON = Limit(0.49999, "mean dilatation was verified up to 0.49999")  # test_locking
CONFINED = Limit(
    0.48, "squeezed into 0.98 of its area, a disc with points 0.74 h apart is 1 % too soft at 0.49, 11 % at 0.499"
)  # test_confined; a block with points 0.8 h apart is a third too soft at 0.49 where it is confined
CONFINED_POINTS = 3.5  # per cell; half a cell apart they are four, less a tenth at the boundary
EXPLICIT_DENSITIES = 3.0  # of the parts of one body; at 10 the errors below are seen
MULTIGRID = Limit(0.499, "amg takes 130 iterations at 0.499, 430 at 0.49999")  # test_locking
FRICTION = Limit(2.0, "the contact solver was verified up to 2")  # test_contact_solver
STIFFNESS = Limit(100.0, "collisions and squeezed discs were verified up to 100")  # tests/extremes/test_parameters
BONDED = Limit(1e5, "parts of one body were verified up to 1e6 in laminates")  # test_composite
DENSITY = Limit(1e4, "verified for a disc at rest on one 1e4 times lighter")  # test_pile
ROTATION = Limit(
    0.05, "a rotation by 0.05 rad causes a spurious strain of 0.00125, which grows with its square"
)  # test_dynamics
STEPS = 1000  # over which the rotation of a spinning body is extrapolated

Lines = Iterator[str]


def warnings_of(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> list[tuple[str, str]]:
    """Topic and text of everything outside the verified range: object, value, what was verified, remedy.

    Topics are the sections of docs/how_to/warnings.md.
    """
    return [(topic, line) for topic, check in CHECKS.items() for line in check(scene, metrics, scheme)]


def _text(value: float, limit: Limit) -> str:
    """A value that leaves a limit, with three digits or as many as tell the two apart."""
    texts = (f"{value:.{digits}g}" for digits in range(3, 18))
    return next(text for text in texts if float(text) != limit.value)


def _worst(metrics: SceneMetrics, values: NDArray[np.float64], beyond: NDArray[np.bool_]) -> str:
    """The deformable body with the smallest value, and the number of bodies beyond the limit."""
    count = int(beyond.sum())
    return f"body {metrics.own[np.argmin(values)]}" + (f", the worst of {count}" if count > 1 else "")


def _resolution(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Lines:
    limit = RESOLUTION if metrics.touches else SMALLEST
    R, smallest = metrics.resolution, metrics.resolution.min()
    if below(smallest, limit):
        remedy = f"use cell = {rounded_down(metrics.cell * smallest / limit.value)} m or less"
        yield f"{_worst(metrics, R, limit.value > R)}: R/h = {_text(smallest, limit)}; {limit.where}; {remedy}"


def _thin(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Lines:
    across = np.where(np.isnan(metrics.across), np.inf, metrics.across) + metrics.chords
    if below(least := float(across.min()), THIN):
        who, width = _worst(metrics, across, THIN.value > across), least * metrics.cell
        remedy = f"use cell = {rounded_down(width / THIN.value)} m or less"
        yield f"{who}: {_text(least, THIN)} cells across its thinnest part of {width:.3g} m; {THIN.where}; {remedy}"


def _slit(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Lines:
    if below(least := float((slit := metrics.slit + metrics.chords).min()), SLIT):
        who, width = _worst(metrics, slit, SLIT.value > slit), least * metrics.cell
        remedy = f"use cell = {rounded_down(width / SLIT.value)} m or less, or close it"
        yield f"{who}: {_text(least, SLIT)} cells across its narrowest slit of {width:.3g} m; {SLIT.where}; {remedy}"


def _points(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Lines:
    each, fewest = metrics.points_per_cell, metrics.points_per_cell.min()
    if below(fewest, FEWEST):
        who = _worst(metrics, each, FEWEST.value > each)
        remedy = f"use a spacing of {rounded_down(0.74 * metrics.cell)} m or less"
        yield f"{who}: {_text(fewest, FEWEST)} points per cell of material; {FEWEST.where}; {remedy}"


def _sampling(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Lines:
    h, whole = metrics.cell, ~np.isin(metrics.own, list(metrics.torn))
    error = np.where(whole, np.nan_to_num(metrics.softening), 0.0)
    edges, spacing = rounded_down(1.2 * h), rounded_down(0.66 * h)
    remedy = f"use mesh edges of {edges} m (from_mesh, order 2), a spacing of {spacing} m or a larger cell"
    if not scheme.moment_fitting:
        remedy = "use moment_fitting=True"
    for b, pieces in metrics.torn.items():
        yield f"body {b}: its cells form {pieces} pieces that share no node; simulate refuses it; {remedy}"
    if above(worst := float(error.max()), SOFTENING):
        who, excess = _worst(metrics, -error, error > SOFTENING.value), _text(worst, SOFTENING)
        problem = f"its points miss or misplace parts of cells, so a uniform stress is too small by about {excess}"
        yield f"{who}: {problem}; {SOFTENING.where}; {remedy}"


def _courant(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Lines:
    limit = EXPLICIT if scheme.explicit else COURANT
    if (scheme.explicit or metrics.waves) and above(metrics.courant, limit):
        remedy = f"use dt = {rounded_down(limit.value * metrics.cell / metrics.wave)} s or less"
        yield f"step: dt c/h = {_text(metrics.courant, limit)}; {limit.where}; {remedy}"


def _travel(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Lines:
    if metrics.touches and above(metrics.lid, LID):
        remedy = f"use dt {rounded_down(LID.value / metrics.lid)} times as long"
        yield f"{metrics.lid_name}: moves {_text(metrics.lid, LID)} h a step; {LID.where}; {remedy}"
    if scheme.inertia and above(metrics.approach, APPROACH):
        remedy = f"use dt {rounded_down(APPROACH.value / metrics.approach)} times as long"
        fallen = f" after falling by {metrics.fall:.3g} m" if metrics.fall else ""
        approach = _text(metrics.approach, APPROACH)
        yield f"bodies: up to {approach} h a step past each other{fallen}; {APPROACH.where}; {remedy}"


def _incompressible(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Lines:
    ratios = [(poisson_ratio(m), b) for b, body in enumerate(scene.bodies) for m in body.materials]
    (nu, b), (least, auxetic) = max(ratios), min(ratios)
    flowing = [(i, m) for i, body in enumerate(scene.bodies) for m in body.materials if has_memory(m)]
    remedy = "use Scheme(mean_dilatation=None), the default"
    if flowing and scheme.mean_dilatation is False:
        i, material = flowing[0]
        yield f"body {i}: {type(material).__name__} without mean dilatation; {FLOW}; {remedy}"
    if not below(nu, LOCKING) and scheme.mean_dilatation is False:
        yield f"body {b}: nu = {nu:g} without mean dilatation; {LOCKING.where}; {remedy}"
    elif above(nu, POISSON):
        yield f"body {b}: nu = {nu:.9g}; {POISSON.where}; use 0.49999 or less"
    elif above(nu, MULTIGRID) and metrics.solver == "amg":
        yield f"body {b}: nu = {nu:g}; {MULTIGRID.where}; use linear.banded"
    yield from _confined(scene, metrics)
    if least < 0.0:
        yield f"body {auxetic}: nu = {least:.3g} is negative, which is rare; check its moduli, or `bulk` of a rubber"


def _confined(scene: Scene, metrics: SceneMetrics) -> Lines:
    """The body of the largest Poisson's ratio among those with few points."""
    sparse = metrics.own[metrics.points_per_cell < CONFINED_POINTS].tolist()
    nu, b = max(((poisson_ratio(m), b) for b in sparse for m in scene.bodies[b].materials), default=(0.0, 0))
    pressed = any(isinstance(load, Pressure) for load in scene.loads)
    if (metrics.touches or pressed) and above(nu, CONFINED):
        few = f"nu = {_text(nu, CONFINED)} with fewer than {CONFINED_POINTS:g} points per cell"
        yield f"body {b}: {few}; {CONFINED.where}; use a spacing of {rounded_down(0.5 * metrics.cell)} m or less"


def _ratios(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Lines:
    soft = [(b, m) for b, body in enumerate(scene.bodies) for m in body.materials]
    moduli, densities = [(youngs_modulus(m), b) for b, m in soft], [(m.density, b) for b, m in soft]
    densities += [(scene.densities[scene.offsets[b]], b) for b in scene.free_rigid.tolist()]
    for name, limit, values in (("E", STIFFNESS, moduli), ("density", DENSITY, densities)):
        low, high = ({b: value for value, b in sorted(values, reverse=most)} for most in (True, False))
        pairs = product(sorted(low, key=low.__getitem__)[:2], sorted(high, key=high.__getitem__)[-2:])
        yield from _ratio(name, limit, [(high[b] / low[a], a, b) for a, b in pairs if a != b])
        if name == "E":
            yield from _ratio(
                "E", BONDED, [(high[b] / low[b], b, b) for b in np.flatnonzero(scene.composite).tolist()]
            )


def _ratio(name: str, limit: Limit, ratios: list[tuple[float, int, int]]) -> Lines:
    """The largest of some ratios of the value in a body b to that in a body a, if it is above the limit."""
    ratio, a, b = max(ratios, default=(1.0, 0, 0))
    if above(ratio, limit):
        who, remedy = f"bodies {a} and {b}" if a != b else f"body {a}", f"use a ratio of at most {limit.value:g}"
        yield f"{who}: ratio of {name} {_text(ratio, limit)}; {limit.where}; {remedy}"


def _friction(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Lines:
    value = scene.frictions.largest
    if metrics.touches and above(value, FRICTION):
        pair = scene.frictions.largest_pair()
        yield f"{pair}: friction = {value:g}; {FRICTION.where}; use 2 or less, at 2 there is little slip"


def _small_strain(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Lines:
    if scheme.anchor <= ROTATION.value:
        return
    linear = [_is_linear(scene, b) for b in metrics.own]
    rotation = np.where(linear, metrics.rotation, 0.0)
    fastest, b = float(rotation.max()), int(metrics.own[np.argmax(rotation)])
    if above(STEPS * fastest, ROTATION):
        turned = f"rotates by {ROTATION.value:g} rad in {ROTATION.value / fastest:.3g} steps"
        yield f"body {b}: {_name(scene, b)} {turned}; {ROTATION.where}; use NeoHookean"
    elif any(linear) and (metrics.friction > 0.0 or metrics.points.size > 2):
        b, cause = int(metrics.own[np.argmax(linear)]), "friction" if metrics.friction else "its neighbours"
        may = f"{cause} may rotate it by more than {ROTATION.value:g} rad"
        yield f"body {b}: {_name(scene, b)}, and {may}; {ROTATION.where}; use NeoHookean"


def _is_linear(scene: Scene, b: int) -> bool:
    return any(is_linear(material) for material in scene.bodies[b].materials)


def _name(scene: Scene, b: int) -> str:
    return next(type(material).__name__ for material in scene.bodies[b].materials if is_linear(material))


def _scheme(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Lines:
    if scheme.theta < 1.0 and np.isfinite(scheme.anchor):
        verified = "regridding adds energy to bodies that vibrate: 3 to 17 % in 240 steps, sixfold at nu = 0.49"
        chosen = f"theta = {scheme.theta:g} with anchor = {scheme.anchor:g}"
        yield f"scheme: {chosen}; {verified}; use anchor = inf or theta = 1"
    if scheme.explicit:
        yield from _unequal_densities(scene)
    if not metrics.touches:
        return
    pressed = callable(scene.gravity) or np.any(scene.gravity) or scene.loads or scene.springs
    if scheme.theta < 1.0 and (pressed or metrics.points.size + len(scene.walls) > 2):
        verified = (
            "collisions of two were verified, and that what rolls keeps its speed; forces may swing between steps"
        )
        yield f"scheme: theta = {scheme.theta:g} with contact that lasts; {verified}; use theta = 1"
    if acts_at_grid_nodes(scheme.contact):
        verified = "contact begins one to two and a half cells too early"
        yield f"scheme: contact = shared_grid; {verified}; use contact.point_to_curve"
    if not scheme.inertia and initial_motion(scene)[0][:, scene.movable[scene.owner]].any():
        yield "scheme: inertia = False ignores the initial velocities of bodies; remove them or use inertia"
    slides = not all(_is_linear(scene, b) for b in metrics.own) and metrics.friction == 0.0
    if slides and not scheme.inertia:
        verified = "a frictionless body at finite strain may have neutral motions, and Newton converges slowly"
        yield f"scheme: inertia = False; {verified}; use friction, a Support or inertia"


def _unequal_densities(scene: Scene) -> Lines:
    """Nodes of light parts are too light beside the heaviest one of their body (`skmpm.explicit_mass`)."""
    for b, body in enumerate(scene.bodies):
        densities = [material.density for material in body.materials]
        if densities and max(densities) > EXPLICIT_DENSITIES * min(densities):
            ratio = f"densities of its parts differ by {max(densities) / min(densities):.3g} times"
            verified = "in explicit steps periods of bars are 1.5 % off at 10, and runs end at 30, whatever dt"
            yield f"body {b}: {ratio}; {verified}; use implicit steps"
            return


def _edges(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Lines:
    if scheme.inertia or acts_at_grid_nodes(scheme.contact):
        return
    radius = MIN_EDGE_RADIUS * metrics.cell
    found = facing_edges(scene, initial_motion(scene)[0], radius)
    for rigid, soft in np.unique(found[[0, 2]], axis=1).T.tolist():
        point = found[1, (found[0] == rigid) & (found[2] == soft)][0]
        x, y = scene.initial_positions[:, point]
        verified = "a flat punch with rounder edges reached 40 % of the height, with sharper ones in cases only 25 %"
        where = f"body {rigid}: an edge at ({x:.4g}, {y:.4g}) m sharper than {MIN_EDGE_RADIUS:g} h meets body {soft}"
        yield f"{where} without inertia; {verified}; use inertia, or a radius of {radius:.4g} m"  # test_punch


CHECKS: dict[str, Callable[[Scene, SceneMetrics, Scheme], Lines]] = {
    "resolution": _resolution,
    "thin-parts": _thin,
    "slits": _slit,
    "points-per-cell": _points,
    "sampling": _sampling,
    "waves": _courant,
    "motion-per-step": _travel,
    "incompressibility": _incompressible,
    "unequal-bodies": _ratios,
    "layers": layer_warnings,
    "friction": _friction,
    "cohesion": cohesion_warnings,
    "gentle-slopes": rolling_warnings,
    "small-strain": _small_strain,
    "periodic-boxes": periodic_warnings,
    "scheme": _scheme,
    "rigid-edges": _edges,
}
