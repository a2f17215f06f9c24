"""Where a step begins: configuration, velocities of nodes, and the unknowns that are not on a grid."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from skmpm.arrays import Array
from skmpm.grid.transfer import nodal_velocity
from skmpm.scene import PrescribedVelocities, Scene, State, velocity_at
from skmpm.scheme import Scheme
from skmpm.step.derived import bulk_of
from skmpm.step.driven_walls import DrivenWalls
from skmpm.step.periodic_box import StressedBox, velocity_of_box
from skmpm.step.rigid_bodies import FreeBodies
from skmpm.step.scalar_unknowns import RESPONSE, Interval, ScalarUnknowns, Unknowns
from skmpm.step.terms import Configuration


def configuration_at_start(scene: Scene, state: State, scheme: Scheme) -> Configuration:
    """The configuration of a state: that in which the step ended that led to it, or a new one after changes."""
    known = state.grids.configuration
    same = state.grids.of_materials == (scheme.mean_dilatation, scene.materials_by_group)
    if isinstance(known, Configuration) and known.displacement is state.displacement and same:
        return known
    return bulk_of(scene, state, scheme).at(state.displacement)


def velocity_at_start(scene: Scene, state: State, motions: PrescribedVelocities, scheme: Scheme) -> Array:
    """The nodal velocities v0 (2 nodes,) [m/s] of a state, those that go on without inertia; with a periodic box."""
    if scheme.inertia:
        v0 = _velocity(scene, state, scheme)
        gradient = None if state.box_rate is None or motions.gradient is None else motions.gradient - state.box_rate
    else:
        v0, gradient = _continued(scene, state, motions, scheme), motions.gradient
    return v0 + velocity_of_box(state, gradient)


def _velocity(scene: Scene, state: State, scheme: Scheme) -> Array:
    """Nodal velocities (2 nodes,) of a state [m/s]."""
    own = scene.deformable_points
    known = state.nodal_velocity if scheme.keeps_nodal_velocities else np.zeros(0)
    return nodal_velocity(state.grids.assembly, state.mass[own], state.v[:, own], state.C[:, :, own], known=known)


def _continued(scene: Scene, state: State, motions: PrescribedVelocities, scheme: Scheme) -> Array:
    """The nodal velocities (2 nodes,) of the last step as far as they go on; zero of bodies that may move freely.

    What is prescribed may stop, reverse or change: the share that goes on is that of the prescribed velocities now
    along those before. An initial guess that goes on regardless leads friction to other equilibria, as loose bodies
    that go on lead packings.
    """
    grid, supports = state.grids.assembly.grid, state.grids.supports
    if supports is None or not supports.holds.any():
        return np.zeros(2 * grid.nodes)
    now, before = (np.concatenate(each) for each in zip(*_prescribed(scene, state, motions), strict=True))
    size = float(before @ before)
    share = min(max(float(now @ before) / size, 0.0), 1.0) if size > 0.0 else 1.0
    return share * np.repeat(supports.holds[grid.node_body], 2) * _velocity(scene, state, scheme)


def _prescribed(scene: Scene, state: State, motions: PrescribedVelocities) -> Iterator[tuple[Array, Array]]:
    """Velocities in this step and in the last one of what has a prescribed motion [m/s]."""
    yield motions.walls.ravel(), state.wall_velocity.ravel()
    each = zip(
        scene.supported,
        motions.supports[: 2 * len(scene.supports)].reshape(-1, 2),
        scene.free_components,
        strict=True,
    )
    for place, velocity, free in each:
        yield velocity[~free], state.v[:, place.points].mean(axis=1)[~free]
    held = np.flatnonzero(~scene.movable).tolist()
    centre = state.centres if held else np.zeros((2, 0))
    for b in held:
        own = slice(scene.offsets[b], scene.offsets[b + 1])
        arm = state.x[:, own] - centre[:, b : b + 1]
        points = np.sqrt(arm.shape[1])
        yield velocity_at(arm, motions.rigid[:, b : b + 1]).ravel() / points, state.v[:, own].ravel() / points
    gradient = motions.gradient
    if gradient is not None and state.box is not None and state.box_rate is not None:
        yield (gradient @ state.box).ravel(), (state.box_rate @ state.box).ravel()


def scalar_unknowns(
    scene: Scene, state: State, dt: float, scheme: Scheme, motions: PrescribedVelocities
) -> ScalarUnknowns:
    """The unknowns of a step of dt [s] that are not on a grid."""
    if not scene.has_scalar_unknowns:
        return ScalarUnknowns()
    soft, farthest = 0.0, np.inf
    if not scheme.inertia:
        shear = max(material.lame[1] for material in scene.materials)
        # A box that nothing resists yet would become so long that the search for neighbours takes all memory.
        soft, farthest = RESPONSE * (scheme.theta * dt) ** 2 * shear, scene.cell / dt
    interval = Interval(state.t + scheme.theta * dt, dt, scheme.theta, scheme.inertia, soft, farthest)
    kinds, moved, box = list[Unknowns](), motions, None
    if scene.periodic is not None and scene.periodic.components.size:
        box = StressedBox.in_step(scene, scene.periodic, state, interval)
        kinds, moved = [box], box.motions(box.inertia.v0, box.inertia.v0, motions)
    if scene.driven_walls.size:
        kinds.append(DrivenWalls.in_step(scene, state, interval, _size(kinds)))
    if scene.free_rigid.size:
        kinds.append(FreeBodies.in_step(scene, state, moved, interval, _size(kinds)))
    return ScalarUnknowns(kinds, box if scheme.inertia else None)


def _size(kinds: Sequence[Unknowns]) -> int:
    """Number of unknowns of some kinds."""
    return sum(kind.inertia.v0.size for kind in kinds)
