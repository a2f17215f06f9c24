"""Which limits a scene passes, in the order of docs/how_to/warnings.md."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from skmpm import outline
from skmpm.contact import acts_at_grid_nodes
from skmpm.contact.boundary import PUSH_OUT
from skmpm.contact.cohesion import CLOSED_GAP
from skmpm.material import has_memory, is_linear, poisson_ratio, youngs_modulus
from skmpm.preflight import limits
from skmpm.preflight.layers import thin_groups
from skmpm.preflight.limits import DOWN, LIMIT_TOLERANCE, PreflightWarning, two_digits
from skmpm.preflight.metrics import SceneMetrics
from skmpm.preflight.rolling import contacts_on_slopes
from skmpm.scene import Pressure, Scene, prescribed_motions
from skmpm.scheme import Scheme
from skmpm.step.driven import driven, driven_by_force
from skmpm.step.initial_state import initial_motion
from skmpm.step.loading import gravity_of
from skmpm.step.rigid_edges import MIN_EDGE_RADIUS, facing_edges

CONFINED_POINTS = 3.5  # per cell; half a cell apart they are four, less a tenth at the boundary
PASCALS = 1e4  # modulus from which on moduli are taken to be in Pa, and lengths then to be in metres
STEPS = 1000  # over which the rotation of a spinning body is extrapolated

Found = Iterator[PreflightWarning]


def warnings_of(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> tuple[PreflightWarning, ...]:
    """The warnings of everything outside of the verified range, at most one of a kind."""
    return tuple(warning for check in CHECKS for warning in check(scene, metrics, scheme))


def _acts(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Found:
    """Scenes in which nothing happens, or only walls move away from bodies that nothing lets follow."""
    given = [scene.gravity, *prescribed_motions(scene)]
    others = (
        scene.loads or scene.springs or metrics.cohesion or any(map(callable, given)) or [*driven_by_force(scene)]
    )
    if others or initial_motion(scene)[0][:, scene.movable[scene.owner]].any():
        return
    gravity, moving = gravity_of(scene), {name for name, speed in driven(scene) if speed > 0.0}
    if not moving and not gravity.any() and scene.overlap == 0.0:
        yield from limits.NOTHING.of(["scene"])
    v, n = scene.wall_velocities(0.0).T, scene.normals
    leaves = np.flatnonzero((v * n).sum(axis=0) < 0.0).tolist()
    if moving <= {f"wall {i}" for i in leaves}:
        away = [i for i in leaves if gravity @ n[:, i] > 0.0 or not gravity.any()]
        x, y = v[:, away[:1]].sum(axis=1)
        yield from limits.AWAY.of([f"wall {i}" for i in away], x=x, y=y)


def _overlap(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Found:
    if scene.overlap > 0.0 and not scheme.inertia:
        steps = metrics.steps
        yield from limits.OVERLAP.passed(["overlap"], [(1.0 - PUSH_OUT) ** steps], steps=steps)


def _sizes(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Found:
    if metrics.touches and metrics.young.min() > PASCALS:
        least = 2.0 * float(metrics.resolution.min()) * metrics.cell
        yield from limits.SIZE.passed(["bodies"], [least], 1.0)


def _resolution(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Found:
    own, h = metrics.own, metrics.cell
    limit = limits.RESOLUTION if metrics.touches else limits.SMALLEST
    yield from limit.passed(own, metrics.resolution, h)
    thin = limits.THIN.passed(own, metrics.across + metrics.chords, h)
    yield from thin or limits.INCLINED.passed(own, metrics.inclined + metrics.chords, h)
    yield from limits.SLIT.passed(own, metrics.slit + metrics.chords, h)


def _points(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Found:
    own, h, torn = metrics.own, metrics.cell, metrics.torn
    yield from limits.FEWEST.passed(own, metrics.points_per_cell, spacing=two_digits(0.74 * h, DOWN))
    better = (
        f"use mesh edges of {two_digits(1.2 * h, DOWN)} m (from_mesh, order 2), a spacing of"
        f" {two_digits(0.66 * h, DOWN)} m or a larger cell"
    )
    if not scheme.moment_fitting:
        better = "use moment_fitting=True"
    yield from limits.TORN.of(list(torn), pieces=next(iter(torn.values()), 0), better=better)
    error = np.where(np.isin(own, list(torn)), np.nan, metrics.softening)
    yield from limits.SOFTENING.passed(own, error, better=better)


def _motion(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Found:
    if metrics.waves:
        yield from limits.COURANT.passed(["step"], [metrics.courant], metrics.courant * metrics.cell / metrics.wave)
    if metrics.touches:
        yield from limits.LID.passed([metrics.lid_name], [metrics.lid])
    if scheme.inertia:
        fallen = f" after falling by {metrics.fall:.3g} m" if metrics.fall else ""
        yield from limits.APPROACH.passed(["bodies"], [metrics.approach], fallen=fallen)


def _incompressible(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Found:
    ratios = [(poisson_ratio(m), b) for b, body in enumerate(scene.bodies) for m in body.materials]
    (nu, b), (least, auxetic) = max(ratios), min(ratios)
    flowing = {b: m for b, body in enumerate(scene.bodies) for m in body.materials if has_memory(m)}
    if scheme.mean_dilatation is False:
        material = next((type(m).__name__ for m in flowing.values()), "")
        yield from limits.FLOW.of(list(flowing), material=material)
        # What locks does at the limit already.
        yield from limits.LOCKING.passed([b], [nu * (1.0 + 4.0 * LIMIT_TOLERANCE)], nu=nu)
    else:
        beyond = limits.POISSON.passed([b], [nu])
        yield from beyond
        if metrics.solver == "amg" and not beyond:
            yield from limits.MULTIGRID.passed([b], [nu])
    pressed = any(isinstance(load, Pressure) for load in scene.loads)
    if metrics.touches or pressed:
        sparse = metrics.own[metrics.points_per_cell < CONFINED_POINTS]
        each = [max(map(poisson_ratio, scene.bodies[b].materials)) for b in sparse.tolist()]
        yield from limits.CONFINED.passed(sparse, each, spacing=two_digits(0.5 * metrics.cell, DOWN))
    yield from limits.AUXETIC.passed([auxetic], [least])


def _ratios(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Found:
    soft = [(b, m) for b, body in enumerate(scene.bodies) for m in body.materials]
    moduli, densities = [(youngs_modulus(m), b) for b, m in soft], [(m.density, b) for b, m in soft]
    densities += [(scene.densities[scene.offsets[b]], b) for b in scene.free_rigid.tolist()]
    for limit, values in ((limits.STIFFNESS, moduli), (limits.DENSITY, densities)):
        low, high = ({b: value for value, b in sorted(values, reverse=most)} for most in (True, False))
        pairs = product(sorted(low, key=low.__getitem__)[:2], sorted(high, key=high.__getitem__)[-2:])
        found = {f"bodies {a} and {b}": high[b] / low[a] for a, b in pairs if a != b}
        ratio, pair = max(((ratio, pair) for pair, ratio in found.items()), default=(1.0, ""))
        yield from limit.passed([pair], [ratio])
    low, high = ({b: value for value, b in sorted(moduli, reverse=most)} for most in (True, False))
    composite = np.flatnonzero(scene.composite)
    yield from limits.BONDED.passed(composite, [high[b] / low[b] for b in composite.tolist()])
    names, cells = thin_groups(scene)
    yield from limits.LAYER.passed(names, cells, metrics.cell)


def _contacts(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Found:
    if metrics.touches and limits.FRICTION.beyond(value := scene.frictions.largest):
        yield from limits.FRICTION.passed([scene.frictions.largest_pair()], [value])
    if metrics.cohesion > 0.0:
        yield from _cohesion(scene, metrics)
    body, width, cell = contacts_on_slopes(scene, scheme)
    yield from limits.GLIDE.passed(body, width, cell=np.array([two_digits(each, DOWN) for each in cell]))


def _cohesion(scene: Scene, metrics: SceneMetrics) -> Found:
    """Cohesion that is large beside a modulus, and ranges that are short beside elastic opening or spacing.

    Where the stress at single boundary points scatters, those that bear c open by a share of c h / E.
    """
    c = metrics.cohesion
    E, b = min((youngs_modulus(m), b) for b, body in enumerate(scene.bodies) for m in body.materials)
    yield from limits.COHESION.passed([b], [c / E], c, cohesion=c)
    range_ = max(scene.cohesion_range / metrics.cell, CLOSED_GAP)  # [cells]
    yield from limits.PEELING.passed([b], [range_ * E / c], range_ * metrics.cell)
    boundary, x = scene.outlines, scene.initial_positions[:, scene.outlines.point]
    bodies = len(scene.bodies)
    corners = np.bincount(boundary.body, outline.curve(boundary, x).corner, bodies)
    count = np.maximum(np.bincount(boundary.body, minlength=bodies), 1)
    half_width = np.sqrt(2.0 * metrics.resolution * metrics.cell * scene.cohesion_range)
    points = half_width / (outline.perimeter(boundary, x, bodies) / count)[metrics.own]
    yield from limits.ZONE.passed(metrics.own, np.where(corners[metrics.own] > 0, np.inf, points))


def _small_strain(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Found:
    if scheme.anchor <= limits.ROTATION.value:
        return
    named = {b: type(m).__name__ for b in metrics.own.tolist() for m in scene.bodies[b].materials if is_linear(m)}
    material = np.array([named.get(b, "") for b in metrics.own.tolist()])
    rotation = np.where(np.isin(metrics.own, list(named)), metrics.rotation, 0.0)
    steps = limits.ROTATION.value / np.maximum(rotation, 1e-300)
    found = limits.ROTATION.passed(metrics.own, STEPS * rotation, material=material, steps=steps)
    yield from found
    if not found and (metrics.friction > 0.0 or metrics.points.size > 2):
        cause = "friction" if metrics.friction else "its neighbours"
        yield from limits.MAY_ROTATE.of(list(named), material=next(iter(named.values()), ""), cause=cause)


def _periodic(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Found:
    if scene.periodic is None:
        return
    gravity = gravity_of(scene)
    if gravity.any() and not (scene.supports or scene.springs or not scene.movable.all()):
        yield from limits.FALLS_FOR_EVER.of(["periodic"], x=gravity[0], y=gravity[1])
    pull = scene.periodic.stress_at(0.0)[np.equal(*scene.periodic.components)].max(initial=0.0)
    if pull > 0.0 and metrics.cohesion == 0.0:
        yield from limits.TENSION.of(["periodic"], pull=pull)


def _scheme(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Found:
    name, theta = ["scheme"], scheme.theta
    if theta < 1.0 and np.isfinite(scheme.anchor):
        yield from limits.REGRIDDING.of(name, theta=theta, anchor=scheme.anchor)
    if not metrics.touches:
        return
    pressed = callable(scene.gravity) or np.any(scene.gravity) or scene.loads or scene.springs
    if theta < 1.0 and (pressed or metrics.points.size + len(scene.walls) > 2):
        yield from limits.LASTING.of(name, theta=theta)
    if acts_at_grid_nodes(scheme.contact):
        yield from limits.SHARED_GRID.of(name)
    if scheme.inertia:
        return
    if initial_motion(scene)[0][:, scene.movable[scene.owner]].any():
        yield from limits.IGNORED.of(name)
    if not acts_at_grid_nodes(scheme.contact):
        radius = MIN_EDGE_RADIUS * metrics.cell
        found = facing_edges(scene, initial_motion(scene)[0], radius)
        rigid, first = np.unique(found[0], return_index=True)
        x, y = scene.initial_positions[:, found[1, first[:1]]].sum(axis=1)
        yield from limits.EDGE.of(rigid, x=x, y=y, soft=found[2, first[:1]].sum(), radius=radius)


CHECKS = (
    _acts,
    _overlap,
    _sizes,
    _resolution,
    _points,
    _motion,
    _incompressible,
    _ratios,
    _contacts,
    _small_strain,
    _periodic,
    _scheme,
)
