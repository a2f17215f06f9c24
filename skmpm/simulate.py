"""`step`: the algorithm on one screen; `simulate`: the generator around it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from skmpm import outline
from skmpm.assembly import Assembly, prepare
from skmpm.contact import outlines as outline_contact
from skmpm.contact import shared_nodes
from skmpm.grid import lay
from skmpm.implicit import Bulk, Increment, NotConverged, Solution, Timer, Touching, advance
from skmpm.io import save
from skmpm.material import Rigid, determinant, product
from skmpm.progress import Progress
from skmpm.scene import Contacts, Derived, Energy, Report, Scene, State, StepFailed, motion
from skmpm.scheme import Scheme
from skmpm.transfer import to_nodes

Array = NDArray[np.float64]


def step(scene: Scene, state: State, dt: float, *, scheme: Scheme = Scheme()) -> State:  # noqa: B008
    """Advance `state` by `dt` [s]; pure: nothing is changed, nothing is kept.

    Raises
    ------
    StepFailed
        when the step's equations are not solved; its `state` is the one given here
    """
    if not (np.isfinite(dt) and dt > 0.0):
        raise ValueError(f"step: dt = {dt}; give a time step in seconds, greater than zero")
    timer = Timer()
    state = anchored(scene, state, scheme)
    assembly, bulk, own = _assembly(state), _bulk(scene, state), scene.deformable[state.body]
    v0 = to_nodes(assembly, state.mass[own], state.v[:, own], state.C[:, :, own])
    free = v0 + scheme.theta * dt * _gravity(scene, state, assembly, state.t + scheme.theta * dt)
    increment = Increment(bulk, state.displacement, v0, free, dt, scheme)
    timer.lap("transfer")
    try:
        touching = _touching(scene, state, increment, timer)
        solution = advance(increment, touching, _kept_solver(state, increment), timer)
    except NotConverged as error:
        raise StepFailed(f"step from t = {state.t:.6g} s with dt = {dt:.3g} s failed: {error}", state) from error
    moved = _moved(scene, state, increment, solution)
    timer.lap("transfer")
    return replace(moved, report=_report(scene, state, moved, increment, solution, timer))


def initial(scene: Scene, *, scheme: Scheme = Scheme()) -> State:  # noqa: B008
    """The state at t = 0, with the contacts found there."""
    points = [body.points for body in scene.bodies]
    x = np.concatenate([p.x for p in points], axis=1)
    volume = np.concatenate([p.volume for p in points])
    body = np.repeat(np.arange(len(points)), np.diff(scene.offsets))
    density = np.array([b.material.density for b in scene.bodies])
    v, C = _initial_motion(scene, volume)
    n = x.shape[1]
    state = State(
        t=0.0,
        x=x,
        v=v,
        F=np.repeat(np.eye(2)[:, :, None], n, axis=2),
        C=C,
        stress=np.zeros((2, 2, n)),
        mass=density[body] * volume,
        volume=volume,
        body=body,
        x_anchor=x,
        F_anchor=np.repeat(np.eye(2)[:, :, None], n, axis=2),
        stress_anchor=np.zeros((2, 2, n)),
        displacement=np.zeros(0),
        walls=np.array([wall.point for wall in scene.walls], dtype=float).reshape(-1, 2),
        wall_force=np.zeros((len(scene.walls), 2)),
        contacts=Contacts.none(),
        report=Report(),
    )
    state = anchored(scene, state, scheme)
    assembly, own = _assembly(state), scene.deformable[body]
    at_start = Report(energy=Energy(kinetic=_kinetic(assembly, to_nodes(assembly, state.mass[own], v[:, own], C[:, :, own]))))
    if not _can_touch(scene):
        return replace(state, report=at_start)
    rows = scheme.contact(scene, state, assembly.sheets, 1.0)(np.zeros(2 * assembly.sheets.nodes))
    nothing = np.zeros((2, rows.size))
    contacts = Contacts(rows.bodies, rows.x, rows.normal, nothing, rows.gap, rows.key, rows.point)
    return replace(state, contacts=contacts, report=at_start)


def simulate(
    scene: Scene,
    *,
    dt: float,
    until: float,
    scheme: Scheme = Scheme(),  # noqa: B008
    start: State | None = None,
    progress: bool = False,
    checkpoint: str | Path | None = None,
) -> Iterator[State]:
    """Yield the state after every step until `t >= until` [s]; the last step is shortened to end there.

    `start` continues from a state; `progress` shows step, time, ETA and residual on a terminal; `checkpoint` is a
    file that keeps the last state, written every half minute, at the end and before a failure is raised.
    """
    state = initial(scene, scheme=scheme) if start is None else start
    saved = perf_counter()
    with Progress(state.t, until, shown=progress) as bar:
        while state.t < until * (1.0 - 1e-12):
            try:
                state = step(scene, state, min(dt, until - state.t), scheme=scheme)
            except StepFailed as failure:
                if checkpoint is not None:
                    save(checkpoint, failure.state)
                raise
            if checkpoint is not None and perf_counter() - saved > 30.0:
                save(checkpoint, state)
                saved = perf_counter()
            bar.show(state)
            yield state
    if checkpoint is not None:
        save(checkpoint, state)


def anchored(scene: Scene, state: State, scheme: Scheme) -> State:
    """The state with sheets: laid anew through the points when they have deformed beyond `scheme.anchor`."""
    if state.displacement.size and state.derived is not None and not _worn(scene, state, scheme):
        return state
    own = scene.deformable[state.body]
    if state.displacement.size == 0 or _worn(scene, state, scheme):
        relative = product(state.F, _inverse(state.F_anchor))
        state = replace(
            state,
            C=product(state.C, _inverse(relative)),
            x_anchor=state.x,
            F_anchor=state.F,
            stress_anchor=state.stress,
            displacement=np.zeros(0),
        )
    volume = state.volume * determinant(state.F_anchor) / determinant(state.F)
    sheets = lay(
        state.x_anchor[:, own],
        state.body[own],
        scene.cell,
        len(scene.bodies),
        _inward(scene, state.x_anchor)[:, own],
    )
    modulus = np.zeros(len(scene.bodies))
    for b, body in enumerate(scene.bodies):
        if not isinstance(body.material, Rigid):
            lam, mu = body.material.lame
            modulus[b] = scheme.ghost * min(lam + 2.0 * mu, 10.0 * mu)
    assembly = prepare(sheets, volume[own], state.mass[own], modulus)
    displacement = state.displacement if state.displacement.size else np.zeros(2 * sheets.nodes)
    return replace(state, displacement=displacement, derived=Derived(assembly))


def _worn(scene: Scene, state: State, scheme: Scheme) -> bool:
    """Whether the sheets have deformed beyond the scheme's bound since they were laid."""
    if not np.isfinite(scheme.anchor) or state.t == 0.0:
        return False
    if scheme.anchor == 0.0:
        return state.x is not state.x_anchor
    relative = product(state.F, _inverse(state.F_anchor)) - np.eye(2)[:, :, None]
    return float(np.abs(relative).max(initial=0.0)) > scheme.anchor


def _inverse(F: Array) -> Array:
    return np.array([[F[1, 1], -F[0, 1]], [-F[1, 0], F[0, 0]]]) / determinant(F)


def _inward(scene: Scene, x: Array) -> Array:
    """Inward normals of the rim points, zero elsewhere, (2, n)."""
    inward = np.zeros_like(x)
    rim = scene.outlines
    if rim.point.size:
        inward[:, rim.point] = -outline.normals(rim, x[:, rim.point])
    return inward


def _initial_motion(scene: Scene, volume: Array) -> tuple[Array, Array]:
    """Velocities (2, n) [m/s] of the points at t = 0 and their gradients (2, 2, n) [1/s]."""
    v, C = [], []
    for body in scene.bodies:
        x, weight = body.points.x, body.points.volume
        if isinstance(body.material, Rigid):
            v.append(np.repeat(motion(body.velocity, 0.0)[:, None], x.shape[1], axis=1))
            C.append(np.zeros((2, 2, x.shape[1])))
            continue
        field, slope = _field(body.velocity, x, 1e-4 * scene.cell)
        arm = x - (x @ weight / weight.sum())[:, None]
        v.append(field + body.spin * np.stack([-arm[1], arm[0]]))
        C.append(slope + body.spin * np.array([[0.0, -1.0], [1.0, 0.0]])[:, :, None])
    return np.concatenate(v, axis=1), np.concatenate(C, axis=2)


def _field(velocity: object, x: Array, reach: float) -> tuple[Array, Array]:
    """A velocity field at the points and its gradient, by central differences."""
    if not callable(velocity):
        value = np.asarray(velocity, dtype=float)
        return np.repeat(value[:, None], x.shape[1], axis=1), np.zeros((2, 2, x.shape[1]))
    steps = reach * np.eye(2)
    columns = [
        (np.asarray(velocity(x + s[:, None])) - np.asarray(velocity(x - s[:, None]))) / (2.0 * reach) for s in steps
    ]
    return np.asarray(velocity(x), dtype=float), np.stack(columns, axis=1)


def _assembly(state: State) -> Assembly:
    assert state.derived is not None
    return state.derived.assembly


def _bulk(scene: Scene, state: State) -> Bulk:
    """The deformable bodies' energy, grouped by material."""
    own = scene.deformable[state.body]
    body = state.body[own]
    of_body = [b.material for b in scene.bodies]
    kinds = dict.fromkeys(m for m in of_body if not isinstance(m, Rigid))
    groups = [
        (kind, np.flatnonzero(np.array([m == kind for m in of_body])[body])) for kind in kinds
    ]
    F, stress = state.F_anchor[:, :, own], state.stress_anchor[:, :, own]
    undeformed = bool((F == np.eye(2)[:, :, None]).all())
    return Bulk(_assembly(state), groups, None if undeformed else F, stress if stress.any() else None)


def _gravity(scene: Scene, state: State, assembly: Assembly, t: float) -> Array:
    """Acceleration of the nodes by gravity, (2 nodes,) [m/s2]; not even looked at where gravity is zero."""
    if not callable(scene.gravity):
        g = np.asarray(scene.gravity, dtype=float)
        return np.tile(g, assembly.sheets.nodes) if g.any() else np.zeros(2 * assembly.sheets.nodes)
    own = scene.deformable[state.body]
    X = np.concatenate([body.points.x for body in scene.bodies], axis=1)[:, own]
    force = assembly.sheets.interpolation.T @ (state.mass[own] * np.asarray(scene.gravity(X, t))).T
    return np.asarray(force).ravel() / assembly.mass


def _can_touch(scene: Scene) -> bool:
    """Whether anything in the scene can touch anything else."""
    return bool(scene.walls) or len(scene.bodies) > 1


def _touching(scene: Scene, state: State, increment: Increment, timer: Timer) -> Touching | None:
    if not _can_touch(scene):
        return None
    linearise = increment.scheme.contact(scene, state, increment.bulk.assembly.sheets, increment.dt)
    timer.lap("detection")
    return Touching(linearise, increment, state.contacts.key, state.contacts.force, timer)


def _kept_solver(state: State, increment: Increment) -> object:
    derived = state.derived
    if derived is None or not increment.bulk.linear or derived.key != _solver_key(increment):
        return None
    return derived.solver


def _solver_key(increment: Increment) -> tuple[float, ...]:
    return (increment.dt, increment.scheme.theta, float(id(increment.scheme.linear)))


def _moved(scene: Scene, state: State, increment: Increment, solution: Solution) -> State:
    """Points, walls and contacts at the end of the step."""
    dt, w, scheme = increment.dt, solution.w, increment.scheme
    sheets, own = increment.bulk.assembly.sheets, scene.deformable[state.body]
    after = increment.v0 + (w - increment.v0) / scheme.theta
    displacement = increment.start + dt * w
    at = increment.bulk.at(displacement)

    x, v, F, C, stress = (a.copy() for a in (state.x, state.v, state.F, state.C, state.stress))
    x[:, own] = state.x_anchor[:, own] + sheets.at_points(displacement)
    v[:, own], C[:, :, own] = scheme.transfer(sheets, increment.v0, after, state.v[:, own])
    F[:, :, own] = product(at.F, state.F_anchor[:, :, own])
    stress[:, :, own] = increment.bulk.cauchy(at)
    _move_rigid(scene, state, dt, x, v)
    walls = state.walls + dt * scene.wall_velocities(state.t + 0.5 * dt)
    contacts, wall_force = _contacts(scene, solution, dt)
    keep = increment.bulk.linear
    derived = Derived(increment.bulk.assembly, _solver_key(increment) if keep else (), solution.solver if keep else None)
    return replace(
        state,
        t=state.t + dt,
        x=x,
        v=v,
        F=F,
        C=C,
        stress=stress,
        volume=state.volume * determinant(F) / determinant(state.F),
        displacement=displacement,
        walls=walls,
        wall_force=wall_force,
        contacts=contacts,
        derived=derived,
    )


def _move_rigid(scene: Scene, state: State, dt: float, x: Array, v: Array) -> None:
    for b in np.flatnonzero(~scene.deformable):
        points = slice(scene.offsets[b], scene.offsets[b + 1])
        x[:, points] += dt * motion(scene.bodies[b].velocity, state.t + 0.5 * dt)[:, None]
        v[:, points] = motion(scene.bodies[b].velocity, state.t + dt)[:, None]


def _contacts(scene: Scene, solution: Solution, dt: float) -> tuple[Contacts, Array]:
    """The contacts with their forces (2, k), and the forces on the walls, (walls, 2) [N/m]."""
    wall_force = np.zeros((len(scene.walls), 2))
    if solution.touching is None:
        return Contacts.none(), wall_force
    rows, force = solution.touching.rows, solution.touching.rows.forces(solution.touching.r, dt)
    on_wall = rows.bodies[1] < 0
    pushed = -(force[0] * rows.normal + force[1] * rows.tangent)[:, on_wall]
    np.add.at(wall_force, -1 - rows.bodies[1, on_wall], pushed.T)
    return Contacts(rows.bodies, rows.x, rows.normal, force, rows.gap, rows.key, rows.point), wall_force


def _kinetic(assembly: Assembly, v: Array) -> float:
    return 0.5 * float(v @ (assembly.mass * v))


def _report(
    scene: Scene, before: State, after: State, increment: Increment, solution: Solution, timer: Timer
) -> Report:
    assembly, old = increment.bulk.assembly, before.report.energy
    w, touching = solution.w, solution.touching
    speed = increment.v0 + (w - increment.v0) / increment.scheme.theta
    kinetic = _kinetic(assembly, speed)
    elastic = increment.bulk.energy(increment.bulk.at(after.displacement))
    pull = assembly.mass * (increment.free - increment.v0) / increment.scheme.theta
    external = old.external + float(pull @ w)
    push_out = old.push_out
    if touching is not None:
        rows, r = touching.rows, touching.r
        external -= float(r @ rows.given_components)
        u = rows.H @ w + rows.given_components
        normal = (r * u)[::2] if rows.tangential else r * u
        push_out += float(np.maximum(normal, 0.0).sum())
    total = old.kinetic + old.elastic + (external - old.external) + (push_out - old.push_out)
    energy = Energy(kinetic, elastic, external, push_out, old.dissipated + total - kinetic - elastic)
    timer.lap("report")
    shared = 0.0
    rim = scene.outlines
    if len(scene.bodies) > 1 and rim.point.size:
        x = after.x[:, rim.point]
        _, lenses = outline.overlap(rim, x, len(scene.bodies))
        shared = float(np.maximum(lenses, 0.0).sum() / outline.area(rim, x, len(scene.bodies)).sum())
    timer.lap("overlap")
    return Report(
        newton=solution.newton,
        linear=solution.factorised,
        contact=0 if touching is None else touching.iterations,
        residual=solution.residual,
        imbalance=solution.imbalance,
        overlap=shared,
        energy=energy,
        seconds=timer.seconds,
    )
